/// @file Depth range by the nearest distance and the farthest depth of any opaque triangle.
#include "volume_projection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <limits>

namespace transom {

namespace {

/// Nearest depth drawn in proportion to the farthest, if a surface is closer than that: what 24 bits can carry.
constexpr double kNearestDepthShare = 1e-4;

/// Distance from a point to a triangle. [Ericson 2005, Real-Time Collision Detection, 5.1.5]
double triangle_distance(glm::dvec3 point, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) {
  const auto to_segment = [&](glm::dvec3 from, glm::dvec3 to) {
    const glm::dvec3 along = to - from;
    const double length_squared = glm::dot(along, along);
    const double t = length_squared > 0 ? std::clamp(glm::dot(point - from, along) / length_squared, 0.0, 1.0) : 0.0;
    return glm::distance(point, from + t * along);
  };
  const glm::dvec3 normal = glm::cross(b - a, c - a);
  const double area_squared = glm::dot(normal, normal);
  if (area_squared > 0 && glm::dot(glm::cross(b - a, point - a), normal) >= 0 &&
      glm::dot(glm::cross(c - b, point - b), normal) >= 0 && glm::dot(glm::cross(a - c, point - c), normal) >= 0) {
    return std::abs(glm::dot(point - a, normal)) / std::sqrt(area_squared);
  }
  return std::min({to_segment(a, b), to_segment(b, c), to_segment(c, a)});
}

}  // namespace

glm::dmat4 volume_clip_from_world(const VolumeCamera& camera, std::span<const glm::vec3> vertices,
                                  std::span<const glm::uvec3> opaque_triangles) {
  const glm::dmat4 view = glm::lookAt(camera.position, camera.target, camera.up);
  double distance = std::numeric_limits<double>::infinity();
  double farthest = 0;
  for (const glm::uvec3& t : opaque_triangles) {
    const std::array<glm::dvec3, 3> corner{vertices[t.x], vertices[t.y], vertices[t.z]};
    distance = std::min(distance, triangle_distance(camera.position, corner[0], corner[1], corner[2]));
    for (const glm::dvec3& point : corner) farthest = std::max(farthest, -(view * glm::dvec4(point, 1)).z);
  }
  if (!(farthest > 0)) farthest = 1;  // nothing before the camera
  farthest *= 1.001;
  const double aspect = static_cast<double>(camera.width) / camera.height;
  const double half_height = std::tan(camera.vertical_fov_rad / 2);
  const double corner_cosine = 1 / std::sqrt(1 + half_height * half_height * (1 + aspect * aspect));
  const double nearest = std::clamp(0.99 * distance * corner_cosine, kNearestDepthShare * farthest, 0.5 * farthest);
  return glm::perspective(camera.vertical_fov_rad, aspect, nearest, farthest) * view;
}

}  // namespace transom
