#include "transom/grid.h"

#include <gtest/gtest.h>

#include "transom/sampling.h"

namespace transom {
namespace {

const Grid kGrids[]{{true, 1, 1}, {true, 3, 5}, {false, 1, 1}, {false, 4, 4}};

glm::vec2 point_on(const Grid& grid, glm::vec2 u) {
  return grid.is_quad ? u : sample_triangle(u);
}

TEST(Grid, LocateAndParametersAreInverse) {
  const SobolSequence points(1);
  for (const Grid& grid : kGrids)
    for (std::uint32_t i = 0; i < 200; ++i) {
      const glm::vec2 st = point_on(grid, points.point2(i));
      const CellPoint p = grid.locate(st);
      ASSERT_GE(p.cell, 0);
      ASSERT_LT(p.cell, grid.cell_count());
      EXPECT_NEAR(glm::length(grid.parameters(p) - st), 0, 1e-5);
    }
}

TEST(Grid, TheMiddleOfACellLiesInIt) {
  for (const Grid& grid : kGrids)
    for (int cell = 0; cell < grid.cell_count(); ++cell) {
      const CellPoint found = grid.locate(grid.parameters({cell, grid.middle()}));
      EXPECT_EQ(found.cell, cell);
      EXPECT_NEAR(glm::length(found.local - grid.middle()), 0, 1e-5);
    }
}

}  // namespace
}  // namespace transom
