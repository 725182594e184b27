#include "shadow_casters.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "shadow_scene.h"

namespace transom {
namespace {

using test::TestScene;

TEST(ShadowCastersTest, SilhouetteOfACubeIsAHexagon) {
  TestScene scene;
  scene.add_box({0, 0, 0}, {1, 1, 1});
  const auto welded = weld_vertices(scene.vertices);
  const glm::dvec3 sun = glm::normalize(glm::dvec3(1, 2, 3));
  const ShadedPoints everywhere(sun, {});
  const ShadowCasters solid(scene.vertices, welded, scene.opaque, CasterCount::kSolidsOnce);
  EXPECT_EQ(solid.volume(sun, 99, scene.vertices, everywhere).indices.size(),
            3U * (6 + 6));  // three lit faces and six silhouette edges
  const ShadowCasters sheets(scene.vertices, welded, scene.opaque, CasterCount::kEveryTriangle);
  EXPECT_EQ(sheets.volume(sun, 99, scene.vertices, everywhere).indices.size(), 3U * (12 + 2 * 6));  // both shells
  EXPECT_EQ(sheets.volume(sun, 99, scene.vertices, everywhere).clockwise_count, 3U * 6);
}

TEST(ShadowCastersTest, CastersWhoseShadeFallsElsewhereAreLeftOut) {
  TestScene scene;
  scene.add_box({0, 0, 1}, {1, 1, 2});
  scene.add_box({4, 0, 1}, {5, 1, 2});
  const ShadowCasters casters(scene.vertices, weld_vertices(scene.vertices), scene.opaque, CasterCount::kSolidsOnce);
  const glm::dvec3 sun(0, 0, 1);
  const ShadedPoints everywhere(sun, {});
  const auto corners_for = [&](glm::vec3 low, glm::vec3 high) {
    const std::vector<std::pair<glm::vec3, glm::vec3>> boxes{{low, high}};
    return casters.volume(sun, 99, scene.vertices, ShadedPoints(sun, boxes)).indices.size();
  };
  EXPECT_EQ(corners_for({-1, -1, 0}, {6, 2, 0}), casters.volume(sun, 99, scene.vertices, everywhere).indices.size());
  EXPECT_EQ(corners_for({0, 0, 0}, {1, 1, 0}), casters.volume(sun, 99, scene.vertices, everywhere).indices.size() / 2);
  EXPECT_EQ(corners_for({2, 0, 0}, {3, 1, 0}), 0U);  // between them
  const std::vector<std::pair<glm::vec3, glm::vec3>> apart{{{-1, 0, 0}, {-0.5F, 1, 0}}, {{5.5F, 0, 0}, {6, 1, 0}}};
  EXPECT_EQ(casters.volume(sun, 99, scene.vertices, ShadedPoints(sun, apart)).indices.size(), 0U);  // beside both
  EXPECT_EQ(corners_for({0, 0, 3}, {5, 1, 4}), 0U);                                                 // above both
}

TEST(ShadowCastersTest, WeldsEqualPositionsOnly) {
  const std::vector<glm::vec3> vertices{{1, 2, 3}, {0, 0, 0}, {1, 2, 3}, {-0.0F, 0, 0}, {1, 2, 3.0001F}};
  EXPECT_EQ(weld_vertices(vertices), (std::vector<std::uint32_t>{0, 1, 0, 1, 4}));
}

}  // namespace
}  // namespace transom
