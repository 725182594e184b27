/// @file Faces that lie on each other, between which light cannot choose.
#pragma once

#include <vector>

#include "transom/geometry.h"
#include "transom/ray_scene.h"

namespace transom {

/// Marks faces of solids that lie on other faces (`Face::is_set_back`): of each such pair one, the smaller where both
/// are of solids. Rays take them to lie a little deeper in their solid (RayScene), so that a ray from within it meets
/// its own face first: of two faces in one plane either would be met by chance, and what lies within solids would see
/// the floor and the walls that they stand on.
void set_back_contacts(Faces& faces);

/// Throws InputError for two faces indoors that lie in one plane (nearer than the lift of ray origins), overlap, and
/// can be lit where they do: which of them light meets would be chance, and both would receive it. A box that stands
/// on the floor covers it and is no such pair. is_indoors: by face, see survey.h.
void check_overlaps(const Faces& faces, const std::vector<char>& is_indoors, const RayScene& rays);

}  // namespace transom
