/// @file The outlines of openings along a beam: which polygons its light may reach through them. No rays.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/geometry.h"

namespace transom {

/// A convex polygon of up to four corners as seen along a beam: on a plane across it, and how far towards the source.
struct BeamOutline {
  std::array<glm::vec2, 4> corner{};
  int corner_count = 0;
  glm::vec2 low{0}, high{0};        ///< of the corners
  float nearest = 0, farthest = 0;  ///< along the direction to the source [m]
};

/// Outlines of faces along one direction.
class BeamOutlines {
 public:
  /// faces: numbers of those that light may pass, such as openings.
  BeamOutlines(const Faces& faces, const std::vector<int>& passages, glm::vec3 direction_to_source);

  BeamOutline outline(std::span<const glm::vec3> corners) const;

  /// The passages that cover some of a polygon and do not lie wholly behind it. Conservative: one that covers nothing
  /// may be named, none that covers something is left out.
  void covering(const BeamOutline& polygon, std::vector<int>& passages) const;

  /// Whether any of those passages covers some of a polygon.
  bool is_covered(const BeamOutline& polygon, const std::vector<int>& passages) const;

 private:
  bool covers(const BeamOutline& passage, const BeamOutline& polygon) const;

  glm::vec3 across_, along_, towards_;
  float margin_;
  std::vector<BeamOutline> passages_;
};

}  // namespace transom
