#include "transom/closed_form.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace transom {

float point_to_polygon(glm::vec3 point, glm::vec3 normal, std::span<const glm::vec3> corners) {
  constexpr std::size_t kMaximumCorners = 8;
  const glm::dvec3 n(normal);
  glm::dvec3 clipped[2 * kMaximumCorners];
  std::size_t count = 0;
  for (std::size_t k = 0; k < std::min(corners.size(), kMaximumCorners); ++k) {
    const glm::dvec3 a(corners[k] - point), b(corners[(k + 1) % corners.size()] - point);
    const double da = glm::dot(a, n), db = glm::dot(b, n);
    if (da >= 0) clipped[count++] = a;
    if ((da > 0 && db < 0) || (da < 0 && db > 0)) clipped[count++] = a + (da / (da - db)) * (b - a);
  }
  if (count < 3) return 0;
  double sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const glm::dvec3 a = clipped[k], b = clipped[(k + 1) % count], across = glm::cross(a, b);
    const double length = glm::length(across);
    if (length == 0) continue;
    sum += std::atan2(length, glm::dot(a, b)) * glm::dot(across, n) / length;
  }
  // Seen from in front of it, the polygon's corners run clockwise around the viewing direction.
  return static_cast<float>(std::clamp(-sum / (2 * std::numbers::pi), 0.0, 1.0));
}

}  // namespace transom
