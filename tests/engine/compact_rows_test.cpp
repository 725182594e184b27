#include "transom/compact_rows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "transom/sampling.h"
#include "transom/sky_rows.h"

namespace transom {
namespace {

// Rows of random length over many columns, and values for these.
struct RandomRows {
  SparseRows rows;
  std::vector<glm::vec4> values;

  explicit RandomRows(int column_count) {
    const SobolSequence sequence(5);
    std::uint32_t next = 0;
    for (int r = 0; r < 50; ++r) {
      std::vector<Share> row;
      for (int k = 0; k < 3 * r; ++k) {
        const glm::vec2 u = sequence.point2(next++);
        row.push_back({static_cast<int>(u.x * static_cast<float>(column_count)), 1e-6f + u.y});
      }
      rows.append(row);
    }
    for (int c = 0; c < column_count; ++c)
      values.push_back(glm::vec4(0.01f * static_cast<float>(c + 1), 1e4f, -2.f - static_cast<float>(c % 5), 0));
  }
};

std::vector<float> channel_of(const std::vector<glm::vec4>& values, int channel) {
  std::vector<float> of_channel;
  for (const glm::vec4& value : values) of_channel.push_back(value[channel]);
  return of_channel;
}

// Sum over a row in double precision, and of the sizes of its terms, by which rounding is measured.
struct RowSum {
  double sum = 0, size = 0;
  RowSum(const std::vector<Share>& row, const std::vector<float>& values) {
    for (const Share& share : row) {
      const double term = static_cast<double>(share.weight) * static_cast<double>(values[share.index]);
      sum += term;
      size += std::abs(term);
    }
  }
};

TEST(CompactRows, AreOffByTheRoundingOfTheirWeights) {
  for (const int columns : {7, 3000, 70000}) {
    const RandomRows random(columns);
    const CompactRows compact(random.rows);
    ASSERT_EQ(compact.row_count(), random.rows.row_count());
    for (std::size_t r = 0; r < compact.row_count(); ++r) {
      const glm::vec4 found = compact.dot(r, random.values);
      for (int channel = 0; channel < 3; ++channel) {
        const std::vector<float> values = channel_of(random.values, channel);
        double most = 0;  // each weight is off by half a step at most, and by what keeps the sum as much again
        for (const Share& share : random.rows.row(r)) most += std::abs(static_cast<double>(values[share.index]));
        const RowSum expected(random.rows.row(r), values);
        EXPECT_NEAR(found[channel], expected.sum, 2 * most / 131070 + 1e-6 * expected.size) << columns << " " << r;
      }
    }
  }
}

TEST(ExactRows, FindWhatSparseRowsFindToRounding) {
  for (const int columns : {7, 3000, 70000}) {
    const RandomRows random(columns);
    const ExactRows exact(random.rows);
    for (std::size_t r = 0; r < random.rows.row_count(); ++r)
      for (int channel = 0; channel < 3; ++channel) {
        const std::vector<float> values = channel_of(random.values, channel);
        const RowSum expected(random.rows.row(r), values);
        EXPECT_NEAR(exact.dot(r, random.values)[channel], expected.sum, 1e-6 * expected.size) << columns << " " << r;
        EXPECT_NEAR(exact.dot(r, values), expected.sum, 1e-6 * expected.size) << columns << " " << r;
      }
  }
}

TEST(ExactRows, GiveBackTheirRows) {
  for (const int columns : {7, 70000}) {
    const RandomRows random(columns);
    const ExactRows exact(random.rows);
    for (std::size_t r = 0; r < random.rows.row_count(); ++r) EXPECT_EQ(exact.row(r), random.rows.row(r));
  }
}

TEST(ExactRows, ARowEndsWhereTheNextBegins) {
  SparseRows rows;
  for (int count = 0; count < 20; ++count) {
    rows.append(std::vector<Share>(static_cast<std::size_t>(count), {0, 1.f}));
    rows.append({{1, 1.f}});  // of a value that would be noticed
  }
  const ExactRows exact(rows);
  const CompactRows compact(rows);
  const std::vector<glm::vec4> colours{glm::vec4(1, 2, 3, 0), glm::vec4(1e6f)};
  for (int count = 0; count < 20; ++count) {
    const auto row = static_cast<std::size_t>(2 * count);
    const glm::vec4 expected = static_cast<float>(count) * colours[0];
    EXPECT_EQ(exact.dot(row, colours), expected);
    EXPECT_EQ(exact.dot(row, channel_of(colours, 1)), expected.y);
    EXPECT_EQ(compact.dot(row, channel_of(colours, 1)), compact.dot(row, colours).y);
    EXPECT_NEAR(compact.dot(row, colours).z, expected.z, 1e-6f * expected.z);
  }
}

TEST(CompactRows, KeepTheSumOfARow) {
  for (const int columns : {7, 3000}) {
    const RandomRows random(columns);
    const CompactRows compact(random.rows);
    const std::vector<float> ones(random.values.size(), 1.f);
    for (std::size_t r = 0; r < compact.row_count(); ++r) {
      const RowSum expected(random.rows.row(r), ones);
      EXPECT_NEAR(compact.dot(r, ones), expected.sum, 1e-6 * expected.sum) << columns << " " << r;
    }
  }
}

TEST(CompactRows, GreyIsEachOfThreeEqualChannels) {
  RandomRows random(500);
  for (glm::vec4& value : random.values) value = glm::vec4(glm::vec3(value.z), 0);
  const std::vector<float> greys = channel_of(random.values, 0);
  const CompactRows compact(random.rows);
  const ExactRows exact(random.rows);
  for (std::size_t r = 0; r < compact.row_count(); ++r)
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_EQ(compact.dot(r, greys), compact.dot(r, random.values)[channel]);
      EXPECT_EQ(exact.dot(r, greys), exact.dot(r, random.values)[channel]);
    }
}

TEST(SkyRows, AddBinsGroundAndPanelsInTheirColours) {
  SparseRows rows;
  rows.append({{0, 0.5f}, {2, 0.25f}, {3, 0.125f}, {5, 2.f}});  // bins 0 to 2, the ground, panels' bins 4 and 5
  rows.append({{4, 1.f}});
  rows.append({});
  const SkyRows sky(rows, 3);
  const std::vector<float> luminance{8, 100, 4};
  const SkyRadiance radiance{
      luminance, {1, 2, 4}, {glm::vec4(16, 8, 0, 0), glm::vec4(1, 2, 3, 0), glm::vec4(0, 0, 1, 0)}};
  EXPECT_EQ(sky.irradiance(0, radiance), glm::vec3(5 + 2, 10 + 1, 20 + 0 + 2));
  EXPECT_EQ(sky.irradiance(1, radiance), glm::vec3(1, 2, 3));
  EXPECT_EQ(sky.irradiance(2, radiance), glm::vec3(0));
  for (std::size_t r = 0; r < sky.row_count(); ++r) EXPECT_EQ(sky.row(r), rows.row(r));
}

}  // namespace
}  // namespace transom
