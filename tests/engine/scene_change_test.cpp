// What stays of a scene, and which rays may tell the difference.
#include <gtest/gtest.h>

#include <random>

#include "rooms.h"
#include "transom/gather.h"
#include "transom/panels.h"
#include "transom/sampling.h"
#include "transom/scene_change.h"

namespace transom {
namespace {

using test::add_box;
using test::roof_light_room;

constexpr float kEdge = 0.5f;

struct State {
  explicit State(const SceneGeometry& geometry)
      : scene(geometry),
        faces(make_faces(scene)),
        mesh(faces, std::vector<float>(faces.faces.size(), kEdge), 2),
        rays(faces, scene.materials, scene.openings) {}
  SceneGeometry scene;
  Faces faces;
  LightMesh mesh;
  RayScene rays;
};

SceneGeometry with_box(glm::dvec3 low, glm::dvec3 high) {
  SceneGeometry scene = roof_light_room(0.6f);
  add_box(scene, low, high, 0);
  return scene;
}

class AMovedBox : public testing::Test {
 protected:
  State before{with_box({1, 1, 0.5}, {2, 1.4, 0.9})}, after{with_box({2.2, 1, 0.8}, {3.2, 1.4, 1.2})};
  SceneChange change{before.mesh, after.mesh};

  bool meets_box(const Ray& ray) const {
    Hit hits[2];
    before.rays.intersect(RayScene::What::kAll, {&ray, 1}, {hits, 1});
    after.rays.intersect(RayScene::What::kAll, {&ray, 1}, {hits + 1, 1});
    return (hits[0].face >= 0 && before.faces.faces[hits[0].face].source >= 10) ||
           (hits[1].face >= 0 && after.faces.faces[hits[1].face].source >= 10);
  }
};

TEST(SceneChange, NothingHasChangedBetweenAStateAndItself) {
  const State state(with_box({1, 1, 0.5}, {2, 1.4, 0.9}));
  const SceneChange change(state.mesh, state.mesh);
  EXPECT_TRUE(change.is_none());
  EXPECT_FALSE(change.may_meet(Ray{{0, 0, 0}, {0, 0, -1}}));
}

TEST_F(AMovedBox, SlotsOfTheRoomStayAndThoseOfTheBoxDoNot) {
  EXPECT_FALSE(change.is_none());
  for (int slot = 0; slot < after.mesh.slot_count(); ++slot) {
    const bool is_of_box = after.faces.faces[after.mesh.slot(slot).face].source >= 10;
    EXPECT_EQ(change.slot_before(slot) < 0, is_of_box);
    if (is_of_box) continue;
    EXPECT_EQ(change.slot_after(change.slot_before(slot)), slot);
  }
}

TEST_F(AMovedBox, RaysThatMeetItAreSuspected) {
  const SobolSequence points(7);
  const glm::vec3 normal = glm::normalize(glm::vec3(0.1f, 0.2f, 1));
  int met = 0, suspected = 0;
  const std::uint32_t count = 4096;
  for (std::uint32_t k = 0; k < count; ++k) {
    const glm::vec4 u = points.point4(k);
    const Ray ray{{3.8f * u.z - 1.9f, 3.8f * u.w - 1.9f, -1.4f},
                  frame_from_normal(normal) * sample_cosine_hemisphere({u.x, u.y})};
    const bool is_met = meets_box(ray), is_suspected = change.may_meet(ray);
    EXPECT_TRUE(!is_met || is_suspected);
    met += is_met;
    suspected += is_suspected;
  }
  EXPECT_GT(met, 100);
  EXPECT_LT(suspected, 2 * met);
}

TEST_F(AMovedBox, CellsOfTheHemisphereHoldTheRaysThatMeetIt) {
  const float radius = 0.1f;
  const HemisphereCells& cells = HemisphereCells::of(3);
  const SobolSequence places(3);
  std::size_t asked = 0, suspected = 0;
  for (std::uint32_t place = 0; place < 64; ++place) {
    const glm::vec4 v = places.point4(place);
    const Node node{{3.4f * v.x - 1.7f, 3.4f * v.y - 1.7f, -1.49f},
                    glm::normalize(glm::vec3(v.z - 0.5f, v.w - 0.5f, 1))};
    std::vector<char> is_met;
    change.may_meet(node, radius, cells, is_met);
    const SobolSequence points(place);
    for (std::uint32_t k = 0; k < 1024; ++k) {
      const glm::vec4 u = points.point4(k);
      const glm::vec2 disc = radius * sample_disc({u.z, u.w});
      const glm::mat3 frame = frame_from_normal(node.normal);
      const Ray ray{node.position + frame * glm::vec3(disc, 0), frame * sample_cosine_hemisphere({u.x, u.y})};
      const glm::ivec2 cell = points.cell2(k, 3);
      const bool is_suspected = is_met[static_cast<std::size_t>(cell.y * cells.per_axis() + cell.x)] != 0;
      EXPECT_TRUE(is_suspected || !change.may_meet(ray));
      suspected += is_suspected;
      ++asked;
    }
  }
  EXPECT_LT(suspected, asked / 2);
}

TEST_F(AMovedBox, TheConeThroughATriangleHoldsTheRaysThroughIt) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1.9f, 1.9f), unit(0, 1);
  const auto place = [&] { return glm::vec3(uniform(random), uniform(random), 0.75f * uniform(random)); };
  int suspected = 0, met = 0;
  for (int k = 0; k < 4000; ++k) {
    const glm::vec3 triangle[3]{place(), place(), place()};
    const glm::vec3 middle = place();
    const float radius = k % 2 == 0 ? 0 : 0.1f;
    const bool is_suspected = change.may_meet(middle, radius, triangle);
    bool is_met = false;
    for (int ray = 0; ray < 64; ++ray) {
      const glm::vec2 b = sample_triangle({unit(random), unit(random)});
      const glm::vec3 target = triangle[0] + b.x * (triangle[1] - triangle[0]) + b.y * (triangle[2] - triangle[0]);
      const glm::vec3 offset = radius * glm::normalize(place());
      is_met |= change.may_meet(Ray{middle + offset, target - middle - offset});
    }
    EXPECT_TRUE(is_suspected || !is_met);
    suspected += is_suspected;
    met += is_met;
  }
  EXPECT_GT(met, 100);
  EXPECT_LT(suspected, 4000);
}

// A point beside the shadow that the box throws on it from the opening keeps what it sees outdoors.
TEST_F(AMovedBox, PointsThatSeeAnOpeningPastItLookAgainAndFewOthers) {
  const SkyBinIndex sky(test::tregenza());
  const Panels panels_there(before.faces, before.scene.materials, before.scene.openings),
      panels_here(after.faces, after.scene.materials, after.scene.openings);
  const Gatherer there(before.mesh, before.rays, before.scene.materials, before.scene.openings, sky, panels_there),
      here(after.mesh, after.rays, after.scene.materials, after.scene.openings, sky, panels_here);
  const GatherSamples samples{0, 64};
  const SobolSequence places(11);
  const std::uint32_t count = 1024;
  int looking_again = 0, changed = 0;
  for (std::uint32_t k = 0; k < count; ++k) {
    const glm::vec2 u = places.point2(k);
    const Node point{{3.8f * u.x - 1.9f, 3.8f * u.y - 1.9f, -1.49f}, {0, 0, 1}};
    GatherRow row_before, row_after;
    there.look_through_openings(point, samples, k, row_before);
    here.look_through_openings(point, samples, k, row_after);
    const bool is_changed = row_before.sky != row_after.sky,
               looks_again = here.may_meet_through_openings(point, samples, k, change);
    EXPECT_TRUE(looks_again || !is_changed);
    changed += is_changed;
    looking_again += looks_again;
  }
  EXPECT_GT(changed, 100);
  EXPECT_LT(looking_again, 1.2 * changed);
}

TEST_F(AMovedBox, SegmentsToASphereHoldThoseThatMeetIt) {
  std::mt19937 random(9);
  std::uniform_real_distribution<float> uniform(-1.9f, 1.9f);
  const auto place = [&] { return glm::vec3(uniform(random), uniform(random), 0.75f * uniform(random)); };
  int suspected = 0;
  for (int k = 0; k < 4000; ++k) {
    const glm::vec3 from = place(), to = place(), end = to + 0.2f * glm::normalize(place());
    const bool is_suspected = change.may_meet(from, to, 0.2f);
    EXPECT_TRUE(is_suspected || !change.may_meet(Ray{from, end - from, 0, 1}));
    suspected += is_suspected;
  }
  EXPECT_LT(suspected, 3000);
}

TEST(SceneChange, NothingStaysWhereTheMiddleOfTheSceneMoves) {
  const State before(with_box({1, 1, 0.5}, {2, 1.4, 0.9})), after(with_box({1, 1, 0.5}, {5, 1.4, 0.9}));
  const SceneChange change(before.mesh, after.mesh);
  for (int slot = 0; slot < after.mesh.slot_count(); ++slot) EXPECT_EQ(change.slot_before(slot), -1);
}

}  // namespace
}  // namespace transom
