/// @file Which faces may stand between places and blocks of points: told from planes and boxes, without a ray.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/geometry.h"
#include "transom/light_mesh.h"

namespace transom {

/// A few faces, such as those of openings, and blocks of points. A face stands between places and points only if they
/// do not all lie on one side of its plane (one bit for each block and face), and if it meets the box around them.
class Screens {
 public:
  /// screens: those of the faces that count. points: those of block k begin at k * block_size.
  Screens(const Faces& faces, const std::vector<int>& screens, std::span<const Node> points, std::size_t block_size);

  /// Places from which points are seen.
  struct Places {
    std::vector<std::uint64_t> is_front, is_back;  // of the plane of each screen, bit by bit: all of the places
    glm::vec3 low, high;                           // their box
  };
  Places places(std::span<const glm::vec3> positions) const;

  /// Whether some screen may stand on a segment between one of the places and a point of the block, be it moved aside
  /// by a part of Faces::ray_offset. False is certain.
  bool may_hide(const Places& places, std::size_t block) const;

 private:
  struct Box {
    glm::vec3 low, high;
  };
  struct Screen {
    glm::vec3 corner, normal;  // of its plane
    float clearance;           // from it, of what lies on one side [m]
    Box box;                   // with that around it
  };
  static Box box_of(std::span<const glm::vec3> positions);
  void mark_sides(std::span<const glm::vec3> positions, std::uint64_t* is_front, std::uint64_t* is_back) const;

  std::vector<Screen> screens_;
  std::size_t word_count_;  // for the bits of all screens
  std::vector<Box> blocks_;
  std::vector<std::uint64_t> is_front_, is_back_;  // by block
};

}  // namespace transom
