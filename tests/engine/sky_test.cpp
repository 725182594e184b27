#include "transom/sky.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rooms.h"
#include "transom/error.h"
#include "transom/sky_formula.h"

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

// One bin at the horizon, one at the zenith: one node in each, or two where the sky is steep.
SkyBinMeans two_bins(int horizon_count) {
  const glm::vec3 low(0.8f, 0, 0.6f), lower(0.96f, 0, 0.28f), high(0, 0, 1), beside(0.6f, 0, 0.8f);
  return {{low, high},
          horizon_count,
          0.9f,
          SkyNodes({low, high}, {1, 1}),
          SkyNodes({low, lower, high, beside}, {0.5f, 0.5f, 0.75f, 0.25f})};
}

TEST(SkyFormula, MeansTakeMoreNodesAlongTheHorizonAndAroundTheSun) {
  const SkyFormula overcast{4, -0.7f, 0, -1, 0, 100};
  const auto gradation = [](float sine) { return 100 * (1 + 4 * std::exp(-0.7f / sine)); };
  EXPECT_NEAR(two_bins(1).of(overcast)[0], (gradation(0.6f) + gradation(0.28f)) / 2, 1e-3f);
  EXPECT_NEAR(two_bins(0).of(overcast)[0], gradation(0.6f), 1e-3f);
  // A sun at the zenith: the bin there is a steep one.
  const SkyFormula clear{0, -1, 2000, -3, 50, 100, {0, 0, 1}};
  const auto around_sun = [](float cosine) {
    return 100 + 2000 * std::exp(-3 * std::acos(cosine)) + 50 * cosine * cosine;
  };
  EXPECT_NEAR(two_bins(0).of(clear)[1], 0.75f * around_sun(1) + 0.25f * around_sun(0.8f), 1e-2f);
  EXPECT_NEAR(two_bins(0).of(clear)[0], around_sun(0.6f), 1e-2f);
}

TEST(SkyFormula, LuminanceIsNeverNegative) {
  EXPECT_EQ(two_bins(1).of({0, -1, 0, -1, -200, 100, {0, 0, 1}})[1], 0);  // -100 and -28 without the bound
}

TEST(SkyFormula, BinsThatDoNotHaveAsManyNodesAreRefused) {
  const glm::vec3 up(0, 0, 1);
  const SkyNodes three({up, up, up}, {1, 1, 1}), two({up, up}, {1, 1});
  EXPECT_THROW(SkyBinMeans({up, up}, 1, 0.9f, two, three), InputError);
  EXPECT_THROW(SkyBinMeans({up, up}, 3, 0.9f, two, two), InputError);
  EXPECT_THROW(SkyBinMeans({}, 0, 0.9f, two, two), InputError);
  EXPECT_THROW(SkyNodes({up}, {1, 1}), InputError);
}

}  // namespace
}  // namespace transom
