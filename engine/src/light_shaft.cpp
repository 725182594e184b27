#include "transom/light_shaft.h"

#include <algorithm>

namespace transom {
namespace {

// The part of a polygon where dot(plane, (p, 1)) >= 0 [Sutherland & Hodgman 1974].
void clip(const std::vector<glm::vec3>& polygon, glm::vec4 plane, std::vector<glm::vec3>& inside) {
  inside.clear();
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const glm::vec3 a = polygon[k], b = polygon[(k + 1) % polygon.size()];
    const float at_a = glm::dot(plane, glm::vec4(a, 1)), at_b = glm::dot(plane, glm::vec4(b, 1));
    if (at_a >= 0) inside.push_back(a);
    if ((at_a >= 0) != (at_b >= 0)) inside.push_back(a + at_a / (at_a - at_b) * (b - a));
  }
}

}  // namespace

bool LightShaft::may_meet(glm::vec3 low, glm::vec3 high) const {
  const auto is_outside = [&](const glm::vec4& side) {
    const glm::vec3 normal(side), farthest = glm::mix(low, high, glm::greaterThanEqual(normal, glm::vec3(0)));
    return glm::dot(normal, farthest) + side.w < 0;
  };
  return !is_outside(plane) && std::none_of(sides.begin(), sides.end(), is_outside);
}

LightShaft light_shaft(const SunlitPiece& piece, glm::dvec3 normal, glm::dvec3 direction_to_source) {
  LightShaft shaft;
  shaft.direction_to_source = glm::vec3(direction_to_source);
  shaft.share = piece.share;
  glm::dvec3 middle(0);
  for (const glm::dvec3& corner : piece.corner) {
    shaft.corner.push_back(glm::vec3(corner));
    middle += corner / static_cast<double>(piece.corner.size());
  }
  shaft.plane = glm::vec4(-normal, glm::dot(normal, middle));
  for (std::size_t k = 0; k < piece.corner.size(); ++k) {
    const glm::dvec3 a = piece.corner[k], b = piece.corner[(k + 1) % piece.corner.size()];
    const glm::dvec3 across = glm::cross(b - a, direction_to_source);
    const double length = glm::length(across);
    if (!(length > 0)) continue;
    const double sense = glm::dot(across, middle - a) < 0 ? -1 : 1;
    const glm::dvec3 inward = across * (sense / length);
    shaft.sides.push_back(glm::vec4(inward, -glm::dot(inward, a)));
  }
  return shaft;
}

std::vector<glm::vec3> clip_to_shaft(std::span<const glm::vec3> polygon, const LightShaft& shaft) {
  std::vector<glm::vec3> part(polygon.begin(), polygon.end()), next;
  clip(part, shaft.plane, next);
  part.swap(next);
  for (const glm::vec4& side : shaft.sides) {
    if (part.size() < 3) break;
    clip(part, side, next);
    part.swap(next);
  }
  if (part.size() < 3) part.clear();
  return part;
}

double polygon_area(std::span<const glm::vec3> corner) {
  glm::dvec3 twice_area(0);
  for (std::size_t k = 2; k < corner.size(); ++k)
    twice_area += glm::cross(glm::dvec3(corner[k - 1] - corner[0]), glm::dvec3(corner[k] - corner[0]));
  return 0.5 * glm::length(twice_area);
}

}  // namespace transom
