#include "transom/sky.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rooms.h"

namespace transom {
namespace {

using test::tregenza;
using test::uniform_sky;

TEST(Condition, SkyAndGroundDoNotBlendAtTheHorizonOfAPicture) {
  const SkyBinIndex bins(tregenza());
  for (const int height : {2, 5, 64}) {
    Condition condition = uniform_sky(500, 100);
    condition.picture_height = height;
    condition.picture_width = 4 * height;
    condition.picture.assign(4 * height * height, 1000.f);
    for (const float z : {1e-4f, 0.01f, 0.3f}) {
      EXPECT_FLOAT_EQ(condition.seen(glm::normalize(glm::vec3(1, 0.5f, z)), bins).y, 1000) << height << ' ' << z;
      EXPECT_FLOAT_EQ(condition.seen(glm::normalize(glm::vec3(1, 0.5f, -z)), bins).y, 100) << height << ' ' << z;
    }
  }
}

TEST(Condition, APictureOfTheSkyIsSeenWhereItsTexelsAre) {
  const SkyBinIndex bins(tregenza());
  constexpr int kHeight = 16, kWidth = 64;
  constexpr float kPi = std::numbers::pi_v<float>;
  Condition condition = uniform_sky(500, 100);
  condition.sky_colour = {0.5f, 1, 2};
  condition.picture_height = kHeight;
  condition.picture_width = kWidth;
  for (int texel = 0; texel < kHeight * kWidth; ++texel) condition.picture.push_back(static_cast<float>(texel));
  for (int row = 1; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column) {
      const float theta = kPi / 2 * static_cast<float>(row) / (kHeight - 1) - 1e-6f,
                  phi = 2 * kPi * (static_cast<float>(column) + 0.5f) / kWidth;
      const glm::vec3 seen =
          condition.seen({std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)}, bins);
      const auto expected = static_cast<float>(row * kWidth + column);
      EXPECT_NEAR(seen.y, expected, 0.01f);
      EXPECT_FLOAT_EQ(seen.x, seen.y / 2);
      EXPECT_FLOAT_EQ(seen.z, seen.y * 2);
    }
}

}  // namespace
}  // namespace transom
