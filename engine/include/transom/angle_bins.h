/// @file Bins of directions at a glazing product, and the frame in which it sees light.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace transom {

/// Bins of the hemisphere in rings around the normal. Bin 0 of a ring is centred at azimuth 0, the others follow
/// counter-clockwise: the Klems bases are such. A direction's polar angle is that to the axis, whatever its sense.
class AngleBins {
 public:
  /// polar_edges: rings + 1, radians, from 0 to pi / 2. counts: bins of each ring. Throws InputError for edges that do
  /// not rise from 0 to pi / 2, or a ring without bins.
  AngleBins(const std::vector<float>& polar_edges, std::vector<int> counts);

  int count() const { return first_.back(); }

  /// Bin of a unit direction in the product's frame.
  int bin_of(glm::vec3 direction) const;

  /// Integral of cos(theta) over a bin [sr]; their sum is pi.
  float projected_solid_angle(int bin) const { return projected_solid_angles_[static_cast<std::size_t>(bin)]; }

  bool operator==(const AngleBins&) const = default;

  /// Direction of a bin, z > 0, with density cos(theta) / projected solid angle.
  glm::vec3 sample(int bin, glm::vec2 u) const;

 private:
  std::vector<int> counts_, first_;
  std::vector<float> squares_;  // of the sines of the edges
  std::vector<float> projected_solid_angles_;
  std::vector<int> ring_of_;
};

/// The frame of a product in a scene: axes x to the right and y up as seen from the room, z into it, and its bins.
struct PanelFrame {
  glm::vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  AngleBins bins;

  bool operator==(const PanelFrame&) const = default;

  glm::vec3 to_panel(glm::vec3 direction) const {
    return {glm::dot(direction, x), glm::dot(direction, y), glm::dot(direction, z)};
  }
  glm::vec3 to_world(glm::vec3 direction) const { return direction.x * x + direction.y * y + direction.z * z; }
};

}  // namespace transom
