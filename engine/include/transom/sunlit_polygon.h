/// @file The part of a panel that the sun reaches, exactly: the panel's polygon less the shadows of what is outdoors.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/geometry.h"
#include "transom/light_shaft.h"

namespace transom {

/// Convex pieces of a face that parallel light reaches from its front, disjoint but for their edges. Opaque faces on
/// the way take their shadow away; openings leave the share that they transmit. direction_to_sun: unit. Empty if the
/// light comes from behind.
std::vector<SunlitPiece> sunlit_pieces(const Faces& faces, const std::vector<Material>& materials,
                                       const std::vector<OpeningGroup>& openings, int face,
                                       glm::dvec3 direction_to_sun);

/// Share of a face's area, 0..1, that the pieces hold, each weighted by its own share.
double sunlit_share(const Face& face, const std::vector<SunlitPiece>& pieces);

}  // namespace transom
