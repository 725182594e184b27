#include "transom/sampling.h"

#include <gtest/gtest.h>

#include <set>

#include <numbers>
#include <set>

namespace transom {
namespace {

TEST(Sobol, EveryElementaryIntervalOfANetHoldsOnePoint) {
  const SobolSequence points(7);
  for (int log_x = 0; log_x <= 6; ++log_x) {
    const int nx = 1 << log_x, ny = 64 / nx;
    std::set<std::pair<int, int>> cells;
    for (std::uint32_t i = 0; i < 64; ++i) {
      const glm::vec2 u = points.point2(i);
      cells.insert({static_cast<int>(u.x * static_cast<float>(nx)), static_cast<int>(u.y * static_cast<float>(ny))});
    }
    EXPECT_EQ(cells.size(), 64u) << nx << " x " << ny;
  }
}

TEST(Sobol, FourDimensionsAreEachStratified) {
  const SobolSequence points(3);
  for (int d = 0; d < 4; ++d) {
    std::set<int> strata;
    for (std::uint32_t i = 0; i < 256; ++i) strata.insert(static_cast<int>(points.point4(i)[d] * 256));
    EXPECT_EQ(strata.size(), 256u) << "dimension " << d;
  }
}

TEST(Hemisphere, CosineSamplesHaveMeanCosineTwoThirds) {
  const SobolSequence points(1);
  double sum = 0;
  constexpr int kCount = 4096;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const glm::vec3 d = sample_cosine_hemisphere(points.point2(i));
    EXPECT_NEAR(glm::length(d), 1, 1e-5);
    sum += d.z;
  }
  EXPECT_NEAR(sum / kCount, 2.0 / 3, 1e-3);
}

TEST(Hemisphere, SixteenDirectionsAtOnceAreThoseOfTheirPointsWhateverTheirNumber) {
  const SobolSequence points(9);
  const glm::mat3 frame = frame_from_normal(glm::normalize(glm::vec3(0.3f, -0.8f, 0.5f)));
  // Within the tabulated points and beyond.
  std::uint32_t indices[kPointsAtOnce];
  for (std::uint32_t k = 0; k < kPointsAtOnce; ++k) indices[k] = 500 * k + k % 3;
  Directions all, some;
  sample_hemisphere(points, indices, frame, all);
  sample_hemisphere(points, {indices + 5, 3}, frame, some);
  for (std::size_t k = 0; k < kPointsAtOnce; ++k) {
    const glm::vec3 expected = frame * sample_cosine_hemisphere(points.point2(indices[k]));
    EXPECT_LT(glm::length(glm::vec3(all.x[k], all.y[k], all.z[k]) - expected), 1e-6f) << k;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(some.x[k], all.x[5 + k]);
    EXPECT_EQ(some.y[k], all.y[5 + k]);
    EXPECT_EQ(some.z[k], all.z[5 + k]);
  }
}

TEST(Frame, IsRightHandedForEveryNormal) {
  for (const glm::vec3 n : {glm::vec3(0, 0, 1), glm::vec3(0, 0, -1), glm::normalize(glm::vec3(1, -2, 0.5f))}) {
    const glm::mat3 frame = frame_from_normal(n);
    EXPECT_NEAR(glm::determinant(frame), 1, 1e-5);
    EXPECT_NEAR(glm::length(frame[2] - n), 0, 1e-6);
  }
}

TEST(SphericalTriangle, OctantHasAnEighthOfTheSphere) {
  EXPECT_NEAR(SphericalTriangle({1, 0, 0}, {0, 1, 0}, {0, 0, 1}).solid_angle(), std::numbers::pi / 2, 1e-12);
}

TEST(SphericalTriangle, SamplesLieInsideAndHaveTheOctantsMean) {
  const SphericalTriangle octant({1, 0, 0}, {0, 1, 0}, {0, 0, 1});
  const SobolSequence points(5);
  glm::dvec3 sum(0);
  constexpr int kCount = 4096;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const glm::dvec3 d = octant.sample(points.point2(i));
    EXPECT_NEAR(glm::length(d), 1, 1e-9);
    EXPECT_GE(std::min({d.x, d.y, d.z}), -1e-9);
    sum += d;
  }
  // The mean of x over the octant is 1/2.
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(sum[axis] / kCount, 0.5, 1e-3);
}

TEST(SphericalTriangle, DegenerateOneHasNoSolidAngle) {
  EXPECT_EQ(SphericalTriangle({1, 0, 0}, {1, 0, 0}, {0, 0, 1}).solid_angle(), 0);
}

TEST(Sampling, PacketsOfTheCoherentOrderStayTogetherUnderEverySeed) {
  const std::vector<std::uint32_t>& order = coherent_order(1000);
  ASSERT_EQ(order.size(), 1024u);
  EXPECT_EQ(std::set<std::uint32_t>(order.begin(), order.end()).size(), 1024u);
  for (const std::uint32_t seed : {1u, 77u, 123456u}) {
    const SobolSequence points(seed);
    for (std::size_t begin = 0; begin < order.size(); begin += 16) {
      glm::vec2 low(1), high(0);
      for (std::size_t i = begin; i < begin + 16; ++i) {
        low = glm::min(low, points.point2(order[i]));
        high = glm::max(high, points.point2(order[i]));
      }
      EXPECT_LT(high.x - low.x, 0.125f);
      EXPECT_LT(high.y - low.y, 0.125f);
    }
  }
}

}  // namespace
}  // namespace transom
