/// @file Faces cut where an opening meets them, so that no piece lies partly indoors and partly outdoors.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/geometry.h"

namespace transom {

/// A face of the scene, or a part of one. Positions relative to the origin asked for.
struct FacePiece {
  int source = 0;  ///< face of the scene
  bool is_quad = false;
  glm::dvec3 corner[4];
  glm::vec3 corner_normal[4];
};

/// Pieces of all faces, in the order of the faces. A window reveal that passes the plane of its pane is cut there: each
/// opaque face is cut by the plane of every opening face whose polygon it meets, within `tolerance` [m].
std::vector<FacePiece> cut_at_openings(const SceneGeometry& scene, glm::dvec3 origin, double tolerance);

}  // namespace transom
