#include "transom/view.h"

#include <cmath>
#include <numbers>
#include <string>

#include "transom/error.h"

namespace transom {

void View::validate() const {
  constexpr int kMaximumSize = 16384;
  if (width < 1 || height < 1 || width > kMaximumSize || height > kMaximumSize)
    throw InputError("the picture's size " + std::to_string(width) + " x " + std::to_string(height) +
                     " is outside 1.." + std::to_string(kMaximumSize));
  if (!(vertical_fov_rad > 0 && vertical_fov_rad < std::numbers::pi))
    throw InputError("the vertical field of view is outside 0..180 degrees");
  const glm::dvec3 forward = target - position;
  for (int axis = 0; axis < 3; ++axis)
    if (!std::isfinite(position[axis]) || !std::isfinite(target[axis]) || !std::isfinite(up[axis]))
      throw InputError("the camera's position, target or up direction is not finite");
  if (!(glm::length(glm::cross(forward, up)) > 1e-9 * glm::length(forward) * glm::length(up)))
    throw InputError("the camera's target is at its position, or straight along its up direction");
}

CameraRays::CameraRays(const View& view) : width_(view.width), height_(view.height) {
  view.validate();
  forward_ = glm::normalize(view.target - view.position);
  const double half_height = std::tan(view.vertical_fov_rad / 2);
  right_ = glm::normalize(glm::cross(forward_, view.up)) * (half_height * width_ / height_);
  down_ = glm::normalize(glm::cross(forward_, right_)) * half_height;
}

glm::vec3 CameraRays::direction(glm::vec2 pixel) const {
  glm::vec3 result;
  directions(glm::vec2(0), {&pixel, 1}, &result.x, &result.y, &result.z);
  return result;
}

// Channel by channel, so that the compiler takes several places at once.
void CameraRays::directions(glm::vec2 corner, std::span<const glm::vec2> places, float* x, float* y, float* z) const {
  if (places.empty()) return;
  const glm::dvec3 forward = forward_, right = right_, down = down_;
  const double width = width_, height = height_;
  const float* place = &places[0].x;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double across = 2.0 * static_cast<double>(corner.x + place[2 * i]) / width - 1.0,
                 along = 2.0 * static_cast<double>(corner.y + place[2 * i + 1]) / height - 1.0;
    const double dx = forward.x + across * right.x + along * down.x, dy = forward.y + across * right.y + along * down.y,
                 dz = forward.z + across * right.z + along * down.z;
    const double scale = 1.0 / std::sqrt(dx * dx + dy * dy + dz * dz);
    x[i] = static_cast<float>(dx * scale);
    y[i] = static_cast<float>(dy * scale);
    z[i] = static_cast<float>(dz * scale);
  }
}

}  // namespace transom
