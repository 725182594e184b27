#include "transom/patch_groups.h"

#include <gtest/gtest.h>

#include <numeric>

#include "transom/compact_rows.h"
#include "transom/sampling.h"

namespace transom {
namespace {

// 20 x 20 patches of a floor, of growing size, and as many of a ceiling.
struct Floors {
  std::vector<PatchPlace> places;
  std::vector<float> areas;
  PatchGroups groups;

  Floors() {
    for (int side = 0; side < 2; ++side)
      for (int j = 0; j < 20; ++j)
        for (int i = 0; i < 20; ++i) {
          places.push_back({glm::vec3(i, j, 5 * side), glm::vec3(0, 0, side ? -1 : 1), side});
          areas.push_back(1 + 0.1f * static_cast<float>(i));
        }
    groups = PatchGroups(places, areas);
  }
  // A radiosity that falls along the floor and is the same all over the ceiling.
  std::vector<float> sloping() const {
    std::vector<float> radiosity;
    for (const PatchPlace& place : places) radiosity.push_back(place.material ? 50.f : 100 - 2 * place.position.x);
    return radiosity;
  }
  std::vector<Share> even_row() const {
    std::vector<Share> row;
    for (int p = 0; p < groups.patch_count(); ++p) row.push_back({p, 1.f / 800});
    return row;
  }
};

TEST(PatchGroups, MeansAreByAreaAndOfOneMaterial) {
  const Floors floors;
  // Whatever the groups are: those of an even light have its value, and the extremes of a sloping one are not reached.
  std::vector<glm::vec4> even(floors.places.size(), glm::vec4(3)), sloping;
  floors.groups.append_means(even);
  ASSERT_EQ(even.size(), static_cast<std::size_t>(floors.groups.patch_count() + floors.groups.group_count()));
  for (const glm::vec4& value : even) EXPECT_FLOAT_EQ(value.x, 3);
  for (const float value : floors.sloping()) sloping.push_back(glm::vec4(value));
  floors.groups.append_means(sloping);
  for (std::size_t g = floors.places.size(); g < sloping.size(); ++g)
    EXPECT_TRUE(std::abs(sloping[g].x - 50) < 1e-4f || (sloping[g].x >= 62 && sloping[g].x <= 100)) << sloping[g].x;
  EXPECT_GT(floors.groups.group_count(), 700);
}

TEST(PatchGroups, AGroupedRowKeepsItsSumAndIsAsGoodAsAsked) {
  const Floors floors;
  const std::vector<Share> row = floors.even_row();
  std::vector<float> light = floors.sloping();
  float received = 0;
  for (const Share& share : row) received += share.weight * light[share.index];
  const auto typical = floors.groups.typical(light);
  std::vector<float> extended = light;
  floors.groups.append_means(extended);
  std::size_t before = row.size() + 1;
  for (const float tolerance : {0.f, 1e-4f, 1e-3f, 1e-2f}) {
    const std::vector<Share> grouped = floors.groups.grouped(row, {typical}, {received}, tolerance);
    float sum = 0, found = 0;
    for (const Share& share : grouped) {
      sum += share.weight;
      found += share.weight * extended[share.index];
    }
    EXPECT_NEAR(sum, 1, 1e-5f);
    EXPECT_NEAR(found / received, 1, tolerance * static_cast<float>(grouped.size()) + 1e-5f);
    EXPECT_LT(grouped.size(), before);
    before = grouped.size();
  }
  EXPECT_LT(before, 60u);  // the ceiling is even: it is a few groups whatever the tolerance
}

TEST(PatchGroups, WithoutPatchesThereAreNoGroups) {
  const PatchGroups none({}, {});
  EXPECT_EQ(none.group_count(), 0);
  EXPECT_TRUE(none.grouped({}, {}, {}, 1).empty());
}

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

TEST(CompactRows, FindWhatSparseRowsFindToTheirPrecision) {
  for (const int columns : {7, 3000, 70000}) {
    const RandomRows random(columns);
    const CompactRows compact(random.rows);
    const HalfColours halves(random.values);
    ASSERT_EQ(compact.row_count(), random.rows.row_count());
    for (std::size_t r = 0; r < compact.row_count(); ++r) {
      const glm::vec4 expected = random.rows.dot(r, random.values);
      const glm::vec3 found = compact.dot(r, halves);
      for (int channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(found[channel], expected[channel], 2e-3f * std::abs(expected[channel])) << columns << " " << r;
    }
    EXPECT_NEAR(compact.dot(49, halves).y / random.rows.dot(49, random.values).y, 1, columns > 7 ? 5e-5 : 5e-4);
  }
}

TEST(ExactRows, FindWhatSparseRowsFindBitByBit) {
  for (const int columns : {7, 3000, 70000}) {
    const RandomRows random(columns);
    const ExactRows exact(random.rows);
    std::vector<float> greys;
    for (const glm::vec4& value : random.values) greys.push_back(value.y);
    for (std::size_t r = 0; r < random.rows.row_count(); ++r) {
      EXPECT_EQ(exact.dot(r, random.values), random.rows.dot(r, random.values)) << columns << " " << r;
      EXPECT_EQ(exact.dot(r, greys), random.rows.dot(r, greys)) << columns << " " << r;
    }
  }
}

TEST(CompactRows, KeepTheSumOfARow) {
  for (const int columns : {7, 3000}) {
    const RandomRows random(columns);
    const CompactRows compact(random.rows);
    const HalfColours ones(std::vector<float>(random.values.size(), 1.f));
    for (std::size_t r = 0; r < compact.row_count(); ++r) {
      double sum = 0;
      for (const Share& share : random.rows.row(r)) sum += static_cast<double>(share.weight);
      EXPECT_NEAR(compact.dot(r, ones).x, sum, 1e-6 * sum) << columns << " " << r;
    }
  }
}

TEST(CompactRows, GreyIsEachOfThreeEqualChannels) {
  RandomRows random(500);
  std::vector<float> greys;
  for (glm::vec4& value : random.values) {
    value = glm::vec4(glm::vec3(value.z), 0);
    greys.push_back(value.x);
  }
  const CompactRows compact(random.rows);
  for (std::size_t r = 0; r < compact.row_count(); ++r) {
    const glm::vec3 colour = compact.dot(r, HalfColours(random.values));
    EXPECT_FLOAT_EQ(compact.dot(r, HalfColours(greys)).x, colour.x);
    EXPECT_EQ(colour.x, colour.z);
  }
}

TEST(CompactRows, AValueThatAllColumnsHaveIsKept) {
  // Rounded to nearest, all of 1.00024 would be off alike.
  RandomRows random(3000);
  float sum = 0;
  for (const Share& share : random.rows.row(49)) sum += share.weight;
  for (const float value : {1.00024f, 3e-7f, 2.9e8f}) {
    const std::vector<float> greys(random.values.size(), value);
    EXPECT_NEAR(CompactRows(random.rows).dot(49, HalfColours(greys)).x / (sum * value), 1, 5e-5);
  }
}

TEST(CompactRows, SmallValuesBesideALargeOneKeepTheirPrecision) {
  SparseRows rows;
  rows.append({{0, 0.5f}, {2, 0.25f}});
  const std::vector<glm::vec4> values{glm::vec4(2e-3f, 0, -7e-4f, 0), glm::vec4(1e4f), glm::vec4(0)};
  const glm::vec3 found = CompactRows(rows).dot(0, HalfColours(values));
  EXPECT_NEAR(found.x, 1e-3f, 1e-6f);
  EXPECT_EQ(found.y, 0);
  EXPECT_NEAR(found.z, -3.5e-4f, 4e-7f);
}

}  // namespace
}  // namespace transom
