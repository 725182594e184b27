/// @file The projection under which shadow volumes are drawn: a pinhole camera's, with the depth range fitted to the
/// scene.
#pragma once

#include <glm/glm.hpp>
#include <span>

#include "transom/shadow_volumes.h"

namespace transom {

/// Clip coordinates (OpenGL's: depth -1..1) of points of the scene. Near and far depth stand as close around the
/// visible surfaces as can be told, since it is their ratio that costs the depth buffer its resolution.
glm::dmat4 volume_clip_from_world(const VolumeCamera& camera, std::span<const glm::vec3> vertices,
                                  std::span<const glm::uvec3> opaque_triangles);

}  // namespace transom
