#include "transom/convex_room.h"

#include <algorithm>

namespace transom {

bool is_convex_room(const Faces& faces) {
  // Corners are rounded to some 1e-7 of the extent; what stands out by a part of the lift of points shades none of
  // them.
  const float rounding = 0.1f * faces.ray_offset();
  return std::all_of(faces.faces.begin(), faces.faces.end(), [&](const Face& face) {
    bool has_front = false, has_back = false;
    for (const Face& other : faces.faces)
      for (const glm::vec3& corner : other.corners()) {
        const float height = glm::dot(corner - face.corner[0], face.normal);
        has_front |= height > rounding;
        has_back |= height < -rounding;
        if (has_front && has_back) return false;
      }
    return true;
  });
}

}  // namespace transom
