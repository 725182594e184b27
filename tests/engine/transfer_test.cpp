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

TEST(Transfer, ReflectanceActsBeforeTheOperatorAndNotAfter) {
  // Two facing surfaces that see only each other: B1 = M1 + r1 E1, E1 = B2; B2 = r2 E2, E2 = B1.
  SparseRows f = rows_of({{{1, 1.f}}, {{0, 1.f}}}), none = rows_of({{}, {}});
  const std::vector<glm::vec3> rho{glm::vec3(0.2f), glm::vec3(0.8f)}, emitted{glm::vec3(100), glm::vec3(0)};
  const std::vector<glm::vec3> direct{glm::vec3(0), glm::vec3(0)};
  std::vector<glm::vec3> e = direct;
  solve_interreflection(f, none, rho, emitted, direct, {1, 1}, 1e-9, 1000, e);
  const double b1 = 100 / (1 - 0.2 * 0.8);
  EXPECT_NEAR(e[1].x, b1, 1e-3);
  EXPECT_NEAR(e[0].x, 0.8 * b1, 1e-3);
}

TEST(Transfer, ARoomThatLosesNothingIsRefused) {
  SparseRows f = rows_of({{{1, 1.f}}, {{0, 1.f}}}), none = rows_of({{}, {}});
  const std::vector<glm::vec3> white(2, glm::vec3(1)), light(2, glm::vec3(1)), dark(2, glm::vec3(0));
  std::vector<glm::vec3> e = dark;
  EXPECT_THROW(solve_interreflection(f, none, white, light, dark, {1, 1}, 1e-9, 50, e), std::runtime_error);
}

}  // namespace
}  // namespace transom
