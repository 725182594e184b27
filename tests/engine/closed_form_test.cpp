#include "transom/closed_form.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace transom {
namespace {

struct Rectangle {
  float a, b, h;
  double cosine_integral;  // of cos(theta) over the solid angle, point under a corner
};

TEST(PointToPolygon, RoofRectanglesMatchTheCornerFormula) {
  for (const Rectangle r : {Rectangle{2, 1.5, 3, 0.22957335}, Rectangle{4, 4, 3, 0.53979275}}) {
    // Front looks down: clockwise seen from above.
    const std::vector<glm::vec3> corners{{0, 0, r.h}, {0, r.b, r.h}, {r.a, r.b, r.h}, {r.a, 0, r.h}};
    EXPECT_NEAR(point_to_polygon({0, 0, 0}, {0, 0, 1}, corners) * std::numbers::pi, r.cosine_integral, 2e-6);
  }
}

TEST(PointToPolygon, FacadeRectangleIsClippedAtTheHorizon) {
  // Twice as high as the table's facade of 2 x 1.5 m at 3 m: the half below the horizon does not count.
  const std::vector<glm::vec3> corners{{0, 3, -1.5f}, {2, 3, -1.5f}, {2, 3, 1.5f}, {0, 3, 1.5f}};
  EXPECT_NEAR(point_to_polygon({0, 0, 0}, {0, 0, 1}, corners) * std::numbers::pi, 0.05354204, 2e-6);
}

TEST(PointToPolygon, IsZeroFromBehind) {
  const std::vector<glm::vec3> corners{{0, 0, 3}, {2, 0, 3}, {2, 2, 3}, {0, 2, 3}};
  EXPECT_EQ(point_to_polygon({0, 0, 0}, {0, 0, 1}, corners), 0);
}

}  // namespace
}  // namespace transom
