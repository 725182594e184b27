/// @file Faces cut where openings and walls meet them, so that no piece lies on both sides of one.
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

/// Pieces of all faces, in the order of the faces. A window reveal that passes the plane of its pane is cut there, and
/// a floor where a wall stands on it: an opaque face is cut by the plane of every opening that it meets, and of large
/// faces in one plane that together cover at least half of the cut, as those around the windows of a wall do. extent:
/// size of the scene [m].
std::vector<FacePiece> cut_faces(const SceneGeometry& scene, glm::dvec3 origin, double extent);

}  // namespace transom
