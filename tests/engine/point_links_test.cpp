#include "transom/point_links.h"

#include <gtest/gtest.h>

#include "rooms.h"

namespace transom {
namespace {

using test::add_quad;
using test::diffuse;

// A floor of 4 x 4 m whose patches are bright, and points that look down on it or along it.
struct LitFloor {
  SceneGeometry scene;
  Faces faces;
  std::unique_ptr<RayScene> rays;
  std::unique_ptr<LightMesh> mesh;
  std::vector<BrightElement> bright;
  std::vector<Node> points;

  explicit LitFloor(bool with_table = false, float glass = -1) {
    scene.materials = {diffuse(0.5f), {glm::vec3(0), glm::vec3(0), false, 0}};
    scene.openings = {{std::vector<float>(2, std::max(glass, 0.f)), 0.f}};
    add_quad(scene, {0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, 0);
    if (with_table) add_quad(scene, {1, 1, 1}, {3, 1, 1}, {3, 3, 1}, {1, 3, 1}, 0);
    if (glass >= 0) add_quad(scene, {-9, -9, 1.5}, {9, -9, 1.5}, {9, 9, 1.5}, {-9, 9, 1.5}, 1);
    faces = make_faces(scene);
    rays = std::make_unique<RayScene>(faces, scene.materials, scene.openings);
    mesh = std::make_unique<LightMesh>(faces, std::vector<float>(faces.faces.size(), 0.5f), 4);
    for (int cell = 0; cell < mesh->grid(0).cell_count(); ++cell)
      for (int e = 0; e < mesh->elements_per_slot(); ++e)
        bright.push_back({mesh->slot_index(0, 0, cell) * mesh->elements_per_slot() + e,
                          glm::vec3(100 + 10 * static_cast<float>(cell % 7), 100, 50)});
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j < 9; ++j)
        for (const float z : {0.1f, 0.7f, 2.f, 8.f}) {
          const glm::vec3 place = glm::vec3(0.5 * i - 0.1, 0.5 * j + 0.07, z) - glm::vec3(faces.origin);
          points.push_back({place, {0, 0, -1}});
          points.push_back({place, glm::normalize(glm::vec3(1, 0.2f, 0.1f))});
        }
  }

  std::vector<glm::vec3> by_links(PointLinks& links) const {
    std::vector<glm::vec3> irradiance(points.size(), glm::vec3(0));
    links.add_irradiance(bright, irradiance);
    return irradiance;
  }

  std::vector<glm::vec3> by_connections(FirstBounce::Rays precision = FirstBounce::Rays::kOne) const {
    const FirstBounce connections(*mesh, *rays, bright);
    std::vector<glm::vec3> irradiance;
    for (const Node& point : points)
      irradiance.push_back(connections.irradiance(point.position, point.normal, precision));
    return irradiance;
  }
};

TEST(PointLinks, APointWithinTheLightOfAPatchStaysFinite) {
  LitFloor floor;
  // The very centroid of the light of the first patch, beside points that see it from afar.
  glm::vec3 centroid(0);
  const int count = floor.mesh->elements_per_slot();
  for (int e = 0; e < count; ++e) centroid += element_shape(*floor.mesh, floor.bright[e].element).middle;
  floor.points[0] = {centroid / static_cast<float>(count), {0, 0, 1}};
  PointLinks links(*floor.mesh, *floor.rays, floor.points);
  for (const glm::vec3& e : floor.by_links(links)) EXPECT_TRUE(std::isfinite(e.x + e.y + e.z));
}

TEST(PointLinks, AgreeWithConnectionsWhereNothingStandsBetween) {
  LitFloor floor;
  PointLinks links(*floor.mesh, *floor.rays, floor.points);
  const std::vector<glm::vec3> linked = floor.by_links(links), connected = floor.by_connections();
  for (std::size_t i = 0; i < floor.points.size(); ++i) {
    const glm::vec3 expected = connected[i];
    EXPECT_NEAR(linked[i].x, expected.x, 2e-3f * expected.x + 1e-3f) << i;
    EXPECT_NEAR(linked[i].z, expected.z, 2e-3f * expected.z + 1e-3f) << i;
  }
}

TEST(PointLinks, FarAboveAFloorIlluminanceFollowsTheInverseSquare) {
  LitFloor floor;
  for (BrightElement& b : floor.bright) b.radiosity = glm::vec3(100);
  floor.points = {{glm::vec3(2, 2, 100) - glm::vec3(floor.faces.origin), {0, 0, -1}}};
  PointLinks links(*floor.mesh, *floor.rays, floor.points);
  const double expected = 100 * 16 / (std::numbers::pi * 100 * 100);  // flux / (pi d²), the floor being small
  EXPECT_NEAR(floor.by_links(links)[0].y / expected, 1, 1e-3);
}

TEST(PointLinks, PreparedBeforehandOrWhenNeededIsTheSame) {
  LitFloor floor(true);
  PointLinks early(*floor.mesh, *floor.rays, floor.points), late(*floor.mesh, *floor.rays, floor.points);
  std::vector<int> slots;
  for (int cell = 0; cell < floor.mesh->grid(0).cell_count(); ++cell)
    slots.push_back(floor.mesh->slot_index(0, 0, cell));
  early.prepare(slots, {});
  EXPECT_GT(early.byte_count(), 0u);
  EXPECT_EQ(floor.by_links(early), floor.by_links(late));
}

TEST(PointLinks, LessMemoryCostsTimeAlone) {
  LitFloor floor(true);
  std::vector<int> slots;
  for (int cell = 0; cell < floor.mesh->grid(0).cell_count(); ++cell)
    slots.push_back(floor.mesh->slot_index(0, 0, cell));
  PointLinks all(*floor.mesh, *floor.rays, floor.points);
  all.prepare(slots, {});
  const std::vector<glm::vec3> expected = floor.by_links(all);
  for (const double share : {0.9, 0.3, 0.0}) {  // of what all links take: without weights, some of them, none
    const auto memory = static_cast<std::size_t>(share * static_cast<double>(all.byte_count()));
    PointLinks links(*floor.mesh, *floor.rays, floor.points, {}, memory);
    links.prepare(slots, {});
    const std::vector<glm::vec3> found = floor.by_links(links);
    EXPECT_LE(links.byte_count(), memory) << share;
    EXPECT_EQ(links.byte_count() > 0, share > 0) << share;
    for (std::size_t i = 0; i < found.size(); ++i)
      EXPECT_NEAR(found[i].x, expected[i].x, 1e-4f * expected[i].x + 1e-3f) << share << " " << i;
  }
}

TEST(PointLinks, AnEvenlyLitPatchIsTheLimitOfAnAlmostEvenOne) {
  // The one is known beforehand, the other is found element by element and at the centroid of its light.
  LitFloor even(true), uneven(true);
  for (BrightElement& bright : even.bright) bright.radiosity = {120, 100, 50};
  uneven.bright = even.bright;
  for (std::size_t k = 0; k < uneven.bright.size(); k += 2) uneven.bright[k].radiosity *= 1.004f;
  PointLinks links(*even.mesh, *even.rays, even.points);
  const std::vector<glm::vec3> a = even.by_links(links), b = uneven.by_links(links);
  float most = 0;
  for (const glm::vec3& e : a) most = std::max(most, e.y);
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(b[i][channel], 1.002f * a[i][channel], 3e-3f * a[i][channel] + 1e-4f * most) << i;
}

TEST(PointLinks, ElementsOfOnePatchMayHaveTheirOwnHues) {
  LitFloor floor;
  for (std::size_t k = 0; k < floor.bright.size(); ++k)
    floor.bright[k].radiosity *= k % 2 ? glm::vec3(1, 0.2f, 0) : glm::vec3(0, 0.5f, 1);
  PointLinks links(*floor.mesh, *floor.rays, floor.points);
  const std::vector<glm::vec3> linked = floor.by_links(links), connected = floor.by_connections();
  for (std::size_t i = 0; i < floor.points.size(); ++i) {
    const glm::vec3 expected = connected[i];
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(linked[i][channel], expected[channel], 0.01f * (expected.x + expected.y + expected.z) + 1e-3f) << i;
  }
}

TEST(PointLinks, ATableHidesTheFloorBelowIt) {
  LitFloor open, covered(true);
  open.points = covered.points = {{glm::vec3(2, 2, 1.01) - glm::vec3(open.faces.origin), {0, 0, -1}}};
  covered.points[0].position = glm::vec3(2, 2, 1.01) - glm::vec3(covered.faces.origin);
  PointLinks seen(*open.mesh, *open.rays, open.points), hidden(*covered.mesh, *covered.rays, covered.points);
  EXPECT_GT(open.by_links(seen)[0].y, 1);
  EXPECT_LT(covered.by_links(hidden)[0].y, 1e-3f);
}

// Points in a row high above the floor and a screen between, so that some see a part of the patches below its edge.
struct ScreenedFloor : LitFloor {
  NodeNeighbours neighbours;

  explicit ScreenedFloor(bool knows_neighbours) : LitFloor(true) {
    points.clear();
    neighbours.begin = {0};
    for (int i = 0; i < 60; ++i) {
      points.push_back({glm::vec3(-2 + 0.13 * i, 2.03, 4) - glm::vec3(faces.origin), {0, 0, -1}});
      for (const int other : {i - 1, i, i + 1})
        if (other >= 0 && other < 60) neighbours.node.push_back(other);
      neighbours.begin.push_back(neighbours.node.size());
    }
    if (!knows_neighbours) neighbours = {};
  }

  // Of what connections with many rays find, by the mean over the points.
  double mean_error() const {
    PointLinks links(*mesh, *rays, points, neighbours);
    const std::vector<glm::vec3> linked = by_links(links), connected = by_connections(FirstBounce::Rays::kMany);
    double error = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const float expected = connected[i].y;
      error += std::abs(linked[i].y - expected) / expected / static_cast<double>(points.size());
    }
    return error;
  }
};

TEST(PointLinks, APatchThatIsPartlyHiddenIsPartlySeen) {
  // Lit evenly, and lit in every third element alone: the part that is seen counts, not the share.
  for (const std::size_t step : {1, 3}) {
    ScreenedFloor all_or_nothing(false), parts(true);
    for (ScreenedFloor* floor : {&all_or_nothing, &parts}) {
      std::vector<BrightElement> kept;
      for (std::size_t k = 0; k < floor->bright.size(); k += step) kept.push_back(floor->bright[k]);
      floor->bright = kept;
      floor->bright.resize(40 / step * 16);  // the first rows of patches, of which the screen hides some
    }
    EXPECT_GT(all_or_nothing.mean_error(), 0.02) << step;
    EXPECT_LT(parts.mean_error(), 0.3 * all_or_nothing.mean_error()) << step;
  }
}

TEST(PointLinks, GlassTakesItsShare) {
  // What a link keeps of a transmittance is rounded to 1/255 of its root.
  LitFloor clear(false, 1.f), dark(false, 0.3f);
  clear.points = {{glm::vec3(2, 2, 8) - glm::vec3(clear.faces.origin), {0, 0, -1}}};
  dark.points = {{glm::vec3(2, 2, 8) - glm::vec3(dark.faces.origin), {0, 0, -1}}};
  PointLinks a(*clear.mesh, *clear.rays, clear.points), b(*dark.mesh, *dark.rays, dark.points);
  EXPECT_NEAR(dark.by_links(b)[0].y / clear.by_links(a)[0].y, 0.3, 0.3 * 0.008);
}

}  // namespace
}  // namespace transom
