#include "index_sums.h"

#include <gtest/gtest.h>

#include "transom/gather.h"

namespace transom {
namespace {

std::vector<std::pair<int, int>> taken(IndexSums<int>& sums) {
  std::vector<std::pair<int, int>> list;
  sums.take([&](int index, int sum) { list.emplace_back(index, sum); });
  return list;
}

TEST(IndexSums, ComeInAscendingOrderAndAreForgotten) {
  IndexSums<int> sums;
  // Within one word, in others, in other groups of words, and the first and the last of them.
  for (const int index : {70000, 3, 64, 3, 63, 4096, 0, 70000, 4095}) sums.add(index, 2);
  EXPECT_EQ(sums.distinct(), 7u);
  const std::vector<std::pair<int, int>> expected{{0, 2}, {3, 4}, {63, 2}, {64, 2}, {4095, 2}, {4096, 2}, {70000, 4}};
  EXPECT_EQ(taken(sums), expected);
  EXPECT_EQ(sums.distinct(), 0u);
  EXPECT_TRUE(taken(sums).empty());
}

TEST(IndexSums, ASumOfZeroHasComeOnce) {
  IndexSums<int> sums;
  for (const int value : {1, -1, 5}) sums.add(9, value);
  EXPECT_EQ(sums.distinct(), 1u);
  EXPECT_EQ(taken(sums), (std::vector<std::pair<int, int>>{{9, 5}}));
}

TEST(MergeShares, AddsUpEqualIndicesAndSorts) {
  std::vector<Share> shares{{5, 0.25f}, {2, 1}, {5, 0.5f}, {0, 2}};
  merge_shares(shares);
  EXPECT_EQ(shares, (std::vector<Share>{{0, 2}, {2, 1}, {5, 0.75f}}));
  const std::vector<Share> in_order = shares;
  merge_shares(shares);
  EXPECT_EQ(shares, in_order);
}

}  // namespace
}  // namespace transom
