/// @file A perspective camera.
#pragma once

#include <glm/glm.hpp>
#include <span>

namespace transom {

/// Pinhole camera in world coordinates [m]. The vertical field of view spans the height of the picture.
struct View {
  glm::dvec3 position{0};
  glm::dvec3 target{0, 1, 0};
  glm::dvec3 up{0, 0, 1};
  double vertical_fov_rad = 1;
  int width = 640;
  int height = 480;

  bool operator==(const View&) const = default;

  /// Throws InputError for a camera without direction or size.
  void validate() const;
};

/// Rays through points of the picture, (0, 0) being its upper left corner and (width, height) its lower right one.
class CameraRays {
 public:
  explicit CameraRays(const View& view);
  glm::vec3 direction(glm::vec2 pixel) const;
  /// The same for places of a pixel, from its upper left corner. x, y and z have the size of `places`.
  void directions(glm::vec2 corner, std::span<const glm::vec2> places, float* x, float* y, float* z) const;

 private:
  glm::dvec3 forward_, right_, down_;
  double width_, height_;
};

}  // namespace transom
