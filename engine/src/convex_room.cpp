#include "transom/convex_room.h"

#include <algorithm>

namespace transom {
namespace {

constexpr std::size_t kMostPlanes = 128;  // a room of more is seldom convex, and then takes the longest to find out

// Of the corners of a face, how far the farthest are in front of the plane of another, and behind it [m].
struct Reach {
  float front = 0, back = 0;
};

Reach reach(const Face& face, const Face& plane) {
  Reach reach;
  for (const glm::vec3& corner : face.corners()) {
    const float height = glm::dot(corner - plane.corner[0], plane.normal);
    reach.front = std::max(reach.front, height);
    reach.back = std::max(reach.back, -height);
  }
  return reach;
}

}  // namespace

bool is_convex_room(const Faces& faces) {
  // Corners are rounded to some 1e-7 of the extent; what stands out by a part of the lift of points shades none of
  // them.
  const float rounding = 0.1f * faces.ray_offset();
  std::vector<const Face*> planes;  // one face of each
  for (const Face& face : faces.faces) {
    const auto is_within = [&](const Face* plane) {
      const auto [front, back] = reach(face, *plane);
      return front <= rounding && back <= rounding;
    };
    if (std::any_of(planes.begin(), planes.end(), is_within)) continue;
    if (planes.size() == kMostPlanes) return false;
    planes.push_back(&face);
    Reach all;
    for (const Face& other : faces.faces) {
      const auto [front, back] = reach(other, face);
      all.front = std::max(all.front, front);
      all.back = std::max(all.back, back);
      if (all.front > rounding && all.back > rounding) return false;
    }
  }
  return true;
}

}  // namespace transom
