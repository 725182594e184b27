// Between nodes light follows the bend that the nodes along a line show, and nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "rooms.h"
#include "transom/node_field.h"

namespace transom {
namespace {

/// Nodes of a floor of 4 x 4 m, in cells of 0.5 m, or of one with a screen that stands on a part of it.
struct Floor {
  explicit Floor(bool has_screen = false, float thin = 0) {
    scene.materials = {test::diffuse(0.5f)};
    test::add_quad(scene, {0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, 0);
    if (has_screen) test::add_quad(scene, {2.25, 1.2, 0}, {2.25, 2.8, 0}, {2.25, 2.8, 2}, {2.25, 1.2, 2}, 0);
    faces = make_faces(scene);
    rays = std::make_unique<RayScene>(faces, scene.materials, scene.openings);
    mesh = std::make_unique<LightMesh>(faces, std::vector<float>(faces.faces.size(), 0.5f), 4);
    std::vector<int> slots;
    for (int cell = 0; cell < mesh->grid(0).cell_count(); ++cell) slots.push_back(mesh->slot_index(0, 0, cell));
    field = std::make_unique<NodeField>(*mesh, *rays, slots, thin);
    expose(0);
  }

  void expose(int first_part) {
    const std::size_t known = exposed;
    exposed = field->nodes().size();
    field->expose(std::vector<char>(exposed - known, 1), first_part);
  }

  void find_midpoints(const std::vector<std::vector<float>>& lights, float dark = 0) const {
    std::vector<LightAtNodes> at_nodes;
    for (const std::vector<float>& light : lights) at_nodes.push_back({light, dark});
    field->find_midpoints(field->shown_nodes(), at_nodes);
  }

  /// What is shown of a light at a place of the floor.
  double shown(const std::vector<float>& light, double x, double y) const {
    const glm::vec2 st(x / 4, y / 4);
    const NodeShares shares = field->interpolate(0, 0, st, mesh->lifted_position(0, 0, st));
    double sum = 0;
    for (int k = 0; k < shares.count; ++k) {
      const auto number = static_cast<std::size_t>(shares.node[k]);
      const bool is_node = number < light.size();
      sum += static_cast<double>(shares.weight[k] *
                                 (is_node ? light[number] : field->midpoints().dot(number - light.size(), light)));
    }
    return sum;
  }

  glm::dvec3 place(int node) const {
    return glm::dvec3(field->nodes()[static_cast<std::size_t>(node)].position) + faces.origin;
  }
  std::vector<float> light(const std::function<double(double, double)>& of) const {
    std::vector<float> values;
    for (int node = 0; node < static_cast<int>(field->nodes().size()); ++node)
      values.push_back(static_cast<float>(of(place(node).x, place(node).y)));
    return values;
  }
  glm::dvec3 place_of_midpoint(std::size_t i) const {
    glm::dvec3 sum(0);
    for (const Share& share : field->midpoints().row(i)) sum += static_cast<double>(share.weight) * place(share.index);
    return sum;
  }

  SceneGeometry scene;
  Faces faces;
  std::unique_ptr<RayScene> rays;
  std::unique_ptr<LightMesh> mesh;
  std::unique_ptr<NodeField> field;
  std::size_t exposed = 0;
};

TEST(Midpoints, FollowABendThatGoesOn) {
  Floor floor;
  const auto bend = [](double x, double y) { return 5 + x + 0.2 * x * x + 0.5 * y + 0.1 * y * y + 0.05 * x * y; };
  const std::vector<float> light = floor.light(bend);
  floor.find_midpoints({light});
  ASSERT_GT(floor.field->midpoints().row_count(), 100u);
  double of_midpoints = 0, of_straight_lines = 0;
  for (std::size_t i = 0; i < floor.field->midpoints().row_count(); ++i) {
    const glm::dvec3 place = floor.place_of_midpoint(i);
    of_midpoints = std::max(of_midpoints, std::abs(floor.field->midpoints().dot(i, light) - bend(place.x, place.y)));
  }
  for (int part = 0; part < floor.field->part_count(); ++part) {
    const auto& corner = floor.field->corners(part);
    const glm::dvec3 middle = 0.5 * (floor.place(corner[0]) + floor.place(corner[2]));
    double straight = 0;
    for (int k = 0; k < 4; ++k) straight += 0.25 * static_cast<double>(light[static_cast<std::size_t>(corner[k])]);
    of_straight_lines = std::max(of_straight_lines, std::abs(straight - bend(middle.x, middle.y)));
  }
  EXPECT_GT(of_straight_lines, 0.015);
  EXPECT_LT(of_midpoints, 1e-4);
}

TEST(Midpoints, KeepWhatIsEvenOrSlopesAsItIs) {
  // Cells of 0.5 m, or so narrow that light is taken not to change across them, with some of them divided or with a
  // middle; up to the borders of the floor, beyond the last nodes.
  for (const bool has_thin_cells : {false, true}) {
    Floor floor(false, has_thin_cells ? 0.6f : 0.f);
    const int part_count = floor.field->part_count();
    for (const int part : {3, 12, 30}) floor.field->add_middle(part);
    floor.expose(0);
    floor.field->divide(12);
    floor.expose(part_count);
    const auto slope = [&](double x, double y) { return has_thin_cells ? 7.0 : 2 + 3 * x + 0.7 * y; };
    const std::vector<float> light = floor.light(slope);
    floor.find_midpoints({light});
    for (double x = 0.01; x < 4; x += 0.0531)
      for (double y = 0.01; y < 4; y += 0.0531)
        EXPECT_NEAR(floor.shown(light, x, y), slope(x, y), 1e-4) << x << " " << y;
  }
}

TEST(Midpoints, BendThoughAnotherLightDoesNotGetThere) {
  Floor floor;
  const std::vector<float> bend = floor.light([](double x, double) { return 5 + x + 0.2 * x * x; }),
                           none(bend.size(), 0.f),
                           noise = floor.light([](double x, double y) { return 1e-4 * std::sin(100 * x + 37 * y); });
  floor.find_midpoints({bend, none, noise}, 0.05f);
  // On a straight line between the nodes beside it, it would be 0.0125 more.
  EXPECT_NEAR(floor.shown(bend, 1.75, 2), 5 + 1.75 + 0.2 * 1.75 * 1.75, 1e-3);
}

TEST(Midpoints, AreStraightWhereOneOfTheLightsBreaksOff) {
  Floor floor;
  const std::vector<float> smooth = floor.light([](double x, double) { return 5 + x + 0.2 * x * x; }),
                           step = floor.light([](double x, double) { return x < 2.1 ? 1 : 0.2; });
  floor.find_midpoints({smooth, step});
  ASSERT_GT(floor.field->midpoints().row_count(), 100u);
  for (std::size_t i = 0; i < floor.field->midpoints().row_count(); ++i) {
    const float value = floor.field->midpoints().dot(i, step);
    EXPECT_GT(value, 0.2f - 1e-5f);
    EXPECT_LT(value, 1 + 1e-5f);
  }
}

TEST(Midpoints, DoNotReachThroughWhatStandsBetween) {
  Floor floor(true);
  floor.find_midpoints({floor.light([](double x, double) { return 5 + x + 0.2 * x * x; })});
  ASSERT_GT(floor.field->midpoints().row_count(), 100u);
  int before = 0, behind = 0;
  for (std::size_t i = 0; i < floor.field->midpoints().row_count(); ++i) {
    const double along = floor.place_of_midpoint(i).y;
    if (along < 1.3 || along > 2.7) continue;  // beside the screen
    bool is_before = false, is_behind = false;
    for (const Share& share : floor.field->midpoints().row(i))
      (floor.place(share.index).x < 2.25 ? is_before : is_behind) = true;
    EXPECT_FALSE(is_before && is_behind);
    (is_before ? before : behind)++;
  }
  EXPECT_GT(before, 20);
  EXPECT_GT(behind, 20);
}

TEST(Midpoints, OfADividedNeighbourAreItsNodes) {
  Floor floor;
  const int divided = 9, beside = 10, part_count = floor.field->part_count();
  floor.field->add_middle(divided);
  floor.field->divide(divided);
  floor.expose(part_count);
  const glm::dvec3 border =
      0.5 * (floor.place(floor.field->corners(divided)[1]) + floor.place(floor.field->corners(divided)[2]));
  ASSERT_LT(glm::distance(floor.place(floor.field->corners(beside)[0]), floor.place(floor.field->corners(divided)[1])),
            1e-6);
  std::vector<float> light = floor.light([](double, double) { return 1; });
  int node = -1;
  for (int i = 0; i < static_cast<int>(light.size()); ++i)
    if (glm::distance(floor.place(i), border) < 1e-5) node = i;
  ASSERT_GE(node, 0);
  light[static_cast<std::size_t>(node)] = 3;
  floor.find_midpoints({light});
  EXPECT_NEAR(floor.shown(light, border.x + 4e-4, border.y), 3, 0.01);
}

}  // namespace
}  // namespace transom
