/// @file A first look at a scene, before it is meshed: which solids are rooms, and what lies indoors.
#pragma once

#include <cstdint>
#include <vector>

#include "transom/geometry.h"
#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

/// Follows random rays from where light enters or starts: the room sides of openings, emitters, point sources.
///
/// A closed surface that light starts inside of is a room, whatever way its faces look: its component is opened in
/// `faces`. Returns for each face which of its sides such rays, reflected a few times and never passing an opening,
/// have met: 1 for its front, 2 for its back, 3 for both, 0 for a face that is not indoors. Every random number comes
/// from `seed`.
std::vector<char> survey_interior(const SceneGeometry& scene, const RayScene& rays, Faces& faces, std::uint32_t seed);

/// Adds to what `survey_interior` has found the sides of faces that see it, and those that see these: every side from
/// which no ray leaves the scene and two or more of a few meet a side indoors. What chance has missed is found so, and
/// the same however the scene is furnished.
void add_sides_that_see_indoors(const SceneGeometry& scene, const Faces& faces, const RayScene& rays,
                                std::uint32_t seed, std::vector<char>& is_indoors);

/// Longest edge of patches for each face [m]: `maximum_edge` indoors, or the one that gives about `target_patch_count`
/// patches there where it is 0; outdoors coarser, so that a large ground costs little: `outdoor_edge`, or what gives a
/// few hundred patches there where that is 0, and no less than indoors.
std::vector<float> choose_edges(const Faces& faces, const std::vector<char>& is_indoors, float maximum_edge,
                                float outdoor_edge, int target_patch_count);

/// Slots, not yet patches, whose own rays meet a patch indoors: what thousands of rays from the patches have missed,
/// such as thin blades, still exchanges light with them. is_interior: by slot.
std::vector<int> slots_that_see(const std::vector<char>& is_interior, const std::vector<int>& patch_of_slot,
                                const LightMesh& mesh, const RayScene& rays, std::uint32_t seed);

}  // namespace transom
