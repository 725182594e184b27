/// @file Scenes in which nothing opaque can stand between a surface and the openings.
#pragma once

#include "transom/geometry.h"

namespace transom {

/// Whether all faces lie on the boundary of their convex hull: an empty room without reveals, and nothing outdoors.
/// Then light that comes to a place indoors through an opening has met nothing opaque, since no straight line meets the
/// boundary of a convex body twice on its way out. Looks at few faces where it is not so; else time grows with the
/// product of faces and the planes that they are in. Where these are more than some hundred the answer is no.
bool is_convex_room(const Faces& faces);

}  // namespace transom
