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

TEST(Grid, InterpolationReproducesLinearFunctions) {
  const SobolSequence points(2);
  for (const Grid& grid : kGrids)
    for (std::uint32_t i = 0; i < 200; ++i) {
      const glm::vec2 st = point_on(grid, points.point2(i));
      const NodeWeights w = grid.interpolate(grid.locate(st));
      float sum = 0;
      glm::vec2 mean(0);
      for (int k = 0; k < w.count; ++k) {
        ASSERT_LT(w.node[k], grid.node_count());
        sum += w.weight[k];
        mean += w.weight[k] * grid.node_parameters(w.node[k]);
      }
      EXPECT_NEAR(sum, 1, 1e-5);
      EXPECT_NEAR(glm::length(mean - st), 0, 1e-5);
    }
}

}  // namespace
}  // namespace transom
