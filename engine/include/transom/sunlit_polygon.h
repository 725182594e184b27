/// @file The part of a panel that the sun reaches, exactly: the panel's polygon less the shadows of what is outdoors.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/box_tree.h"
#include "transom/geometry.h"
#include "transom/light_shaft.h"

namespace transom {

/// What of faces the sun reaches from one direction. Keeps references to the scene.
class SunlitFaces {
 public:
  /// direction_to_sun: unit.
  SunlitFaces(const Faces& faces, const std::vector<Material>& materials, const std::vector<OpeningGroup>& openings,
              glm::dvec3 direction_to_sun);

  /// Convex pieces of a face that the sun reaches from its front, disjoint but for their edges. Opaque faces on the way
  /// take their shadow away; openings leave the share that they transmit. Empty if the light comes from behind. Any
  /// number of threads may ask at once.
  std::vector<SunlitPiece> pieces(int face) const;

 private:
  const Faces& faces_;
  const std::vector<Material>& materials_;
  const std::vector<OpeningGroup>& openings_;
  glm::dvec3 sun_;
  std::vector<Box> boxes_;  // of faces, along axes of which the third is towards the sun
};

/// Share of a face's area, 0..1, that the pieces hold, each weighted by its own share.
double sunlit_share(const Face& face, const std::vector<SunlitPiece>& pieces);

}  // namespace transom
