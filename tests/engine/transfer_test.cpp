#include "transom/transfer.h"

#include <gtest/gtest.h>

namespace transom {
namespace {

SparseRows rows_of(const std::vector<std::vector<Share>>& rows) {
  SparseRows result;
  for (const std::vector<Share>& row : rows) result.append(row);
  return result;
}

TEST(Transfer, NoisyFormFactorsBecomeReciprocalAndClosed) {
  SparseRows f = rows_of({{{1, 0.6f}, {2, 0.4f}}, {{0, 0.25f}, {2, 0.75f}}, {{0, 0.3f}, {1, 0.7f}}});
  const std::vector<float> areas{1, 2, 1.5f}, sums{1, 1, 1};
  const TransferDefects defects = make_reciprocal(f, areas, sums);
  EXPECT_GT(defects.raw_reciprocity, 0.01);
  EXPECT_LT(defects.row_sum, 1e-6);
  EXPECT_LT(defects.reciprocity, 1e-6);
}

TEST(Transfer, PatchesThatSendUnevenlySendAsMuchInAll) {
  const SparseRows f = rows_of({{{1, 0.5f}, {2, 0.25f}, {3, 0.25f}}, {}, {{0, 0.6f}, {3, 0.3f}}, {{2, 1.f}}});
  // Patch 0 is seen by 1 where it is dark and by 2 where it is bright; nothing is known of what 3 sees.
  const SparseRows sent = sent_unevenly(f, {{{1, 0.5f}, {2, 1.5f}}, {}, {{0, 2.f}, {1, 9.f}, {3, 2.f}}, {{2, 0.f}}});
  const float scale = 1 / 0.875f;
  EXPECT_FLOAT_EQ(sent.row(0)[0].weight, 0.25f * scale);
  EXPECT_FLOAT_EQ(sent.row(0)[1].weight, 0.375f * scale);
  EXPECT_FLOAT_EQ(sent.row(0)[2].weight, 0.25f * scale);
  EXPECT_TRUE(sent.row(1).empty());
  EXPECT_FLOAT_EQ(sent.row(2)[0].weight, 0.6f);  // all see it alike
  EXPECT_FLOAT_EQ(sent.row(2)[1].weight, 0.3f);
  EXPECT_EQ(sent.row(3)[0].weight, 0);
}

TEST(Transfer, FourFloatsAreSummedAsOne) {
  const SparseRows rows = rows_of({{{0, 0.5f}, {1, 2.f}, {2, -1.f}}, {}, {{2, 3.f}}});
  const std::vector<glm::vec4> values{{1, 2, 3, 4}, {5, 6, 7, 8}, {9, 10, 11, 12}};
  EXPECT_EQ(rows.dot(0, values), glm::vec4(1.5f, 3, 4.5f, 6));
  EXPECT_EQ(rows.dot(1, values), glm::vec4(0));
  EXPECT_EQ(rows.dot(2, values), glm::vec4(27, 30, 33, 36));
}

}  // namespace
}  // namespace transom
