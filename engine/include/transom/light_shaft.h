/// @file Shafts of parallel light behind panels: where the sun reaches a panel, and where a lobe goes from there.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/ray_scene.h"

namespace transom {

/// A convex part of a panel that the sun reaches. share: what openings before it leave of the sun, 0..1.
struct SunlitPiece {
  std::vector<glm::dvec3> corner;  ///< in the engine's frame, in the sense of the panel's corners
  float share = 1;
};

/// A convex prism of parallel light: a sunlit piece swept along a lobe.
struct LightShaft {
  std::vector<glm::vec3> corner;  ///< of the piece
  std::vector<glm::vec4> sides;   ///< a point p is inside if dot(side, (p, 1)) >= 0 for all of them,
  glm::vec4 plane;                ///< and dot(plane, (p, 1)) > 0: the distance [m] to the panel's plane
  glm::vec3 direction_to_source;  ///< unit
  float share = 1;

  bool holds(glm::vec3 point) const {
    const glm::vec4 p(point, 1);
    if (!(glm::dot(plane, p) > 0)) return false;
    for (const glm::vec4& side : sides)
      if (glm::dot(side, p) < 0) return false;
    return true;
  }
  /// False where no point of a box can be inside.
  bool may_meet(glm::vec3 low, glm::vec3 high) const;

  /// From a point inside back to the panel, as far as `gap` [m] before its plane.
  Ray ray_to_panel(glm::vec3 point, float gap) const {
    const float cosine = -glm::dot(glm::vec3(plane), direction_to_source);
    return {point, direction_to_source, 0, (glm::dot(plane, glm::vec4(point, 1)) - gap) / cosine};
  }
};

/// Calls take(index of the point, ray to the panel, share) for every shaft that holds a point. Shafts do not end: where
/// the panels of a group stand behind one another a point is in several, and lit by the one whose ray meets nothing.
template <typename Take>
void find_rays_to_panels(std::span<const LightShaft> shafts, std::span<const glm::vec3> points, float gap,
                         const Take& take) {
  if (points.empty()) return;
  glm::vec3 low = points[0], high = low;
  for (const glm::vec3 point : points) {
    low = glm::min(low, point);
    high = glm::max(high, point);
  }
  for (const LightShaft& shaft : shafts) {
    if (!shaft.may_meet(low, high)) continue;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (shaft.holds(points[i])) take(i, shaft.ray_to_panel(points[i], gap), shaft.share);
  }
}

/// The shaft of a piece of a panel with that normal (unit, towards outdoors) along a lobe.
/// direction_to_source: unit, back through the panel along the lobe; its cosine to the normal is positive.
LightShaft light_shaft(const SunlitPiece& piece, glm::dvec3 normal, glm::dvec3 direction_to_source);

/// The part of a convex planar polygon inside a shaft; empty if there is none.
std::vector<glm::vec3> clip_to_shaft(std::span<const glm::vec3> polygon, const LightShaft& shaft);

/// Area of a planar convex polygon [m²].
double polygon_area(std::span<const glm::vec3> corner);

}  // namespace transom
