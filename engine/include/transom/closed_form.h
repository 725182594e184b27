/// @file Form factors that have a closed form.
#pragma once

#include <glm/glm.hpp>
#include <span>

namespace transom {

/// Form factor from a point to an unoccluded planar polygon: the share of the flux leaving a small surface at `point`,
/// facing `normal`, that arrives at the polygon's front, the side from which its corners run counter-clockwise. 0 where
/// the point is behind. The part below the point's horizon is clipped.
/// Unitless, in [0, 1]. At most 8 corners.  [Lambert 1760; Baum, Rushmeier & Winget 1989, eq. 8]
float point_to_polygon(glm::vec3 point, glm::vec3 normal, std::span<const glm::vec3> corners);

}  // namespace transom
