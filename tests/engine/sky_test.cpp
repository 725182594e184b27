#include "transom/sky.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rooms.h"

namespace transom {
namespace {

using test::tregenza;
using test::uniform_sky;

glm::vec3 seen(const Condition& condition, const SkyPicture& picture, glm::vec3 direction) {
  return condition.seen(direction, SkyPicture::place_of(direction), SkyBinIndex(tregenza()), &picture);
}

TEST(SkyPicture, SkyAndGroundDoNotBlendAtTheHorizon) {
  const Condition condition = uniform_sky(500, 100);
  for (const int height : {2, 5, 64}) {
    const SkyPicture picture{std::vector<float>(4 * height * height, 1000.f), 4 * height, height};
    for (const float z : {1e-4f, 0.01f, 0.3f}) {
      EXPECT_FLOAT_EQ(seen(condition, picture, glm::normalize(glm::vec3(1, 0.5f, z))).y, 1000) << height << ' ' << z;
      EXPECT_FLOAT_EQ(seen(condition, picture, glm::normalize(glm::vec3(1, 0.5f, -z))).y, 100) << height << ' ' << z;
    }
  }
}

TEST(SkyPicture, IsSeenWhereItsTexelsAre) {
  constexpr float kPi = std::numbers::pi_v<float>;
  Condition condition = uniform_sky(500, 100);
  condition.sky_colour = {0.5f, 1, 2};
  SkyPicture picture{{}, 64, 16};
  for (int texel = 0; texel < picture.height * picture.width; ++texel)
    picture.luminance.push_back(static_cast<float>(texel));
  for (int row = 1; row < picture.height; ++row)
    for (int column = 0; column < picture.width; ++column) {
      const float theta = kPi / 2 * static_cast<float>(row) / static_cast<float>(picture.height - 1) - 1e-6f,
                  phi = 2 * kPi * (static_cast<float>(column) + 0.5f) / static_cast<float>(picture.width);
      const glm::vec3 found =
          seen(condition, picture, {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)});
      EXPECT_NEAR(found.y, static_cast<float>(row * picture.width + column), 0.01f);
      EXPECT_FLOAT_EQ(found.x, found.y / 2);
      EXPECT_FLOAT_EQ(found.z, found.y * 2);
    }
}

}  // namespace
}  // namespace transom
