// Where light is gathered to be shown, and what is shown between.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>

#include "rooms.h"
#include "transom/frame.h"
#include "transom/view_samples.h"

namespace transom {
namespace {

using test::add_box;
using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

constexpr float kPi = 3.14159265f;

/// A desk's slab, 0.04 m thick, 0.3 m above the floor under the roof light, against no wall.
SceneGeometry room_with_slab() {
  SceneGeometry scene = roof_light_room(0.5f);
  add_box(scene, {1.2, 1.5, 0.3}, {2.4, 2.3, 0.34}, 0);
  return scene;
}

SolveOptions options(float node_tolerance) {
  SolveOptions options;
  options.target_patch_count = 800;
  options.patch_samples = {256, 64};
  options.node_samples = {512, 256};
  options.node_tolerance = node_tolerance;
  return options;
}

/// Points of the floor on a line that passes under the slab.
std::vector<glm::dvec3> below_and_beside_the_slab() {
  std::vector<glm::dvec3> points;
  for (double x = 0.65; x < 3; x += 0.07) points.push_back({x, 1.83, 0});
  return points;
}

/// Relative differences of the luminance shown at points of a surface that looks along `normal` from what is gathered
/// there, without any node between.
std::vector<double> errors_at(const std::vector<glm::dvec3>& points, glm::vec3 normal, const SceneGeometry& scene,
                              float node_tolerance) {
  const Engine engine(scene, tregenza(), options(node_tolerance));
  const auto light = engine.relight(uniform_sky(1000));
  Sensors sensors = engine.sensors(points, std::vector<glm::vec3>(points.size(), normal), {4096, 2048});
  for (Share& share : sensors.resolved.entries) share.weight = 0;
  const std::vector<Irradiance> gathered = engine.illuminance(*light, sensors);
  std::vector<glm::vec4> sky, indirect;
  engine.shown_radiance(*light, sky, indirect);
  std::vector<double> errors;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::vec3 above = glm::vec3(points[i] - engine.faces().origin) + 0.05f * normal;
    const Ray back{above, -normal};
    Hit hit;
    engine.rays().intersect(RayScene::What::kOpaque, {&back, 1}, {&hit, 1});
    const NodeShares shares =
        engine.shown_at(hit.face, hit.side, hit.st, engine.mesh().lifted_position(hit.face, hit.side, hit.st));
    double shown = 0;
    for (int k = 0; k < shares.count; ++k)
      shown += shares.weight[k] * (sky[shares.node[k]].y + indirect[shares.node[k]].y);
    const double truth = 0.5 / kPi * (gathered[i].sky.y + gathered[i].indirect.y);
    errors.push_back(shown / truth - 1);
  }
  return errors;
}

std::vector<double> errors_on_floor(const SceneGeometry& scene, float node_tolerance) {
  return errors_at(below_and_beside_the_slab(), {0, 0, 1}, scene, node_tolerance);
}

double mean_size(const std::vector<double>& errors) {
  double sum = 0;
  for (const double error : errors) sum += std::abs(error);
  return sum / static_cast<double>(errors.size());
}

double largest(const std::vector<double>& errors) {
  double found = 0;
  for (const double error : errors) found = std::max(found, std::abs(error));
  return found;
}

TEST(Nodes, ThatAreAddedShowAContactShadowAsItIsGathered) {
  const float tolerance = SolveOptions{}.node_tolerance;
  const std::vector<double> added = errors_on_floor(room_with_slab(), tolerance),
                            none = errors_on_floor(room_with_slab(), std::numeric_limits<float>::infinity());
  // Light falls by 60 % within 10 cm, across a third of a cell: without added nodes that is not shown.
  EXPECT_GT(mean_size(none), 0.04);
  EXPECT_LT(mean_size(added), 0.5 * tolerance);
  EXPECT_LT(largest(added), 0.5 * largest(none));
}

/// Two books 2 mm apart; the second is as large as the first up to a place.
SceneGeometry room_with_books(double y, double z) {
  SceneGeometry scene = roof_light_room(0.5f);
  add_box(scene, {1, 1.5, 0.2}, {1.14, 1.7, 0.54}, 0);
  add_box(scene, {1.142, 1.5, 0.2}, {1.3, y, z}, 0);
  return scene;
}

TEST(Nodes, InAGapDoNotDarkenWhatStandsOutOfIt) {
  // By 20 mm above a lower book, where the nodes of the larger one's cells are all behind that, well inside borders.
  std::vector<glm::dvec3> above, beside;
  for (double y = 1.52; y < 1.68; y += 0.015)
    for (const double z : {0.528, 0.536}) above.push_back({1.14, y, z});
  const float tolerance = SolveOptions{}.node_tolerance;
  EXPECT_LT(mean_size(errors_at(above, {1, 0, 0}, room_with_books(1.7, 0.52), tolerance)), 0.06);
  // By 80 mm beside a narrower one.
  for (double z = 0.22; z < 0.5; z += 0.03)
    for (const double y : {1.64, 1.66}) beside.push_back({1.14, y, z});
  EXPECT_LT(mean_size(errors_at(beside, {1, 0, 0}, room_with_books(1.62, 0.54), tolerance)), 0.06);
}

TEST(Nodes, LightDecaysUnderALowSlabAsItDoesBetweenFinerPatches) {
  // Far below its edge light comes by many reflections between floor and slab, over less than a patch each.
  SceneGeometry scene = roof_light_room(0.7f);
  add_box(scene, {1, 1, 0.12}, {3, 3, 0.16}, 0);
  std::vector<glm::dvec3> points;
  for (double depth = 0.1; depth < 1; depth += 0.1) points.push_back({1 + depth, 2.03, 0});
  const auto illuminances = [&](int patches, double tolerance) {
    SolveOptions finer = options(0.06f);
    finer.target_patch_count = patches;
    finer.tolerance = tolerance;
    const Engine engine(scene, tregenza(), finer);
    const auto light = engine.relight(uniform_sky(1000));
    return engine.illuminance(*light,
                              engine.sensors(points, std::vector<glm::vec3>(points.size(), {0, 0, 1}), {8192, 2048}));
  };
  // Of all flux, what is still under way is little; of the light down there it would be a sixth.
  const std::vector<Irradiance> coarse = illuminances(1500, SolveOptions{}.tolerance), fine = illuminances(12000, 1e-6);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::vec3 found = coarse[i].sky + coarse[i].indirect, expected = fine[i].sky + fine[i].indirect;
    EXPECT_NEAR(found.y / expected.y, 1, 0.08) << points[i].x;
  }
}

TEST(Nodes, BelowASlabTakeWhatItSendsAndNotWhatItsPatchesDo) {
  // Gathered from patches alone, the middle of the slab's lower side has 15 % too much, which the floor would take on.
  SolveOptions precise = options(0.06f);
  precise.node_samples = {4096, 256};
  const Engine engine(room_with_slab(), tregenza(), precise);
  const auto light = engine.relight(uniform_sky(1000));
  std::vector<glm::dvec3> points;
  std::vector<std::size_t> shown;
  for (std::size_t i = 0; i < engine.nodes().size(); ++i) {
    const glm::dvec3 place = glm::dvec3(engine.nodes()[i].position) + engine.faces().origin;
    if (light->node_indirect[i] == glm::vec3(0) || engine.nodes()[i].normal.z < 0.9f) continue;
    if (place.x < 1.3 || place.x > 2.3 || place.y < 1.6 || place.y > 2.2 || place.z > 0.01) continue;
    points.push_back(place);
    shown.push_back(i);
  }
  ASSERT_GT(points.size(), 10);
  const std::vector<Irradiance> found = engine.illuminance(
      *light, engine.sensors(points, std::vector<glm::vec3>(points.size(), {0, 0, 1}), {8192, 2048}));
  for (std::size_t k = 0; k < points.size(); ++k)
    EXPECT_NEAR(light->node_indirect[shown[k]].y / found[k].indirect.y, 1, 0.04) << points[k].x << " " << points[k].y;
}

TEST(Nodes, AreAddedAroundASlabAndNotInTheRestOfTheRoom) {
  Engine empty(roof_light_room(0.5f), tregenza(), options(0.06f));
  Engine furnished(room_with_slab(), tregenza(), options(0.06f));
  int added_far = 0, added_near = 0;
  const auto is_near = [](glm::vec3 place) {
    return place.x > 0.5f && place.x < 3.1f && place.y > 0.8f && place.y < 3;
  };
  for (const auto& [engine, sign] : {std::pair<Engine*, int>{&furnished, 1}, {&empty, -1}})
    for (const Node& node : engine->nodes()) {
      const glm::vec3 place = node.position + glm::vec3(engine->faces().origin);
      if (place.z < 0.4f) (is_near(place) ? added_near : added_far) += sign;
    }
  EXPECT_GT(added_near, 4 * std::abs(added_far));
}

TEST(Nodes, AreOneWherePartsMeet) {
  // Walls of a length that no number of cells divides without rounding.
  SceneGeometry scene = roof_light_room(0.5f);
  for (glm::dvec3& vertex : scene.vertices) vertex *= glm::dvec3(1.07, 1.13, 0.97);
  const Engine engine(scene, tregenza(), options(0.06f));
  const std::span<const Node> nodes = engine.nodes();
  std::vector<glm::vec3> places;
  for (const Node& node : nodes) places.push_back(node.position);
  std::sort(places.begin(), places.end(), [](glm::vec3 a, glm::vec3 b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
  });
  int twice = 0;
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t k = i + 1; k < places.size() && places[k].x - places[i].x < 1e-5f; ++k)
      twice += glm::length(places[k] - places[i]) < 1e-5f;
  EXPECT_EQ(twice, 0);
}

TEST(Nodes, HaveNeighboursOnTheirFaceAndAcrossItsEdges) {
  const SceneGeometry scene = roof_light_room(0.5f);
  const Faces faces = make_faces(scene);
  const RayScene rays(faces, scene.materials, scene.openings);
  const LightMesh mesh(faces, std::vector<float>(faces.faces.size(), 0.5f), 4);
  std::vector<int> slots;
  for (int slot = 0; slot < mesh.slot_count(); slot += 2) slots.push_back(slot);  // inner sides
  NodeField field(mesh, rays, slots, 0);
  std::vector<char> is_exposed(field.nodes().size(), 1);
  is_exposed[0] = 0;
  field.expose(is_exposed, 0);
  const std::vector<std::size_t> shown = field.shown_nodes();
  ASSERT_EQ(shown.size(), field.nodes().size() - 1);  // all but the first: places are not numbers of nodes
  const NodeNeighbours neighbours = field.neighbours(shown);
  ASSERT_EQ(neighbours.begin.size(), shown.size() + 1);
  int alone = 0, across = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    bool is_itself = false, is_across = false;
    for (const int other : neighbours.of(i)) {
      const auto k = static_cast<std::size_t>(other);
      is_itself |= k == i;
      is_across |= field.surface(shown[k]) != field.surface(shown[i]);
      const auto back = neighbours.of(k);
      EXPECT_NE(std::find(back.begin(), back.end(), static_cast<int>(i)), back.end());
      EXPECT_LT(glm::length(field.nodes()[shown[k]].position - field.nodes()[shown[i]].position), 1.5f);
    }
    alone += !is_itself || neighbours.of(i).size() < 3;
    across += is_across;
  }
  EXPECT_EQ(alone, 0);
  EXPECT_GT(across, 50);
}

TEST(Nodes, OfAPlaceAreTheSameWhateverElseIsDivided) {
  Engine coarse(roof_light_room(0.5f), tregenza(), options(0.1f)),
      fine(roof_light_room(0.5f), tregenza(), options(0.02f));
  const auto coarse_light = coarse.relight(uniform_sky(1000)), fine_light = fine.relight(uniform_sky(1000));
  ASSERT_LT(coarse.nodes().size(), fine.nodes().size());
  // The corners of cells come first, and have the same samples. Where a cell at an edge is divided, nodes nearer to the
  // edge are shown instead, and the corner gets no light.
  int shown_by_both = 0;
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_EQ(coarse.nodes()[i].position, fine.nodes()[i].position);
    if (fine_light->node_sky[i] == glm::vec3(0)) continue;
    EXPECT_EQ(coarse_light->node_sky[i], fine_light->node_sky[i]);
    ++shown_by_both;
  }
  EXPECT_GT(shown_by_both, 100);
}

TEST(Frame, SamplesOfAPixelFindAnEdgeAlongAnAxisToOneOfTheirNumber) {
  for (const int n : {1, 2, 3, 4, 8}) {
    std::set<int> columns, rows, squares;
    for (int k = 0; k < n * n; ++k) {
      const glm::vec2 place = sample_place(k, n);
      columns.insert(static_cast<int>(place.x * static_cast<float>(n * n)));
      rows.insert(static_cast<int>(place.y * static_cast<float>(n * n)));
      squares.insert(static_cast<int>(place.y * static_cast<float>(n)) * n +
                     static_cast<int>(place.x * static_cast<float>(n)));
    }
    EXPECT_EQ(columns.size(), static_cast<std::size_t>(n * n));
    EXPECT_EQ(rows.size(), static_cast<std::size_t>(n * n));
    EXPECT_EQ(squares.size(), static_cast<std::size_t>(n * n));
  }
}

}  // namespace
}  // namespace transom
