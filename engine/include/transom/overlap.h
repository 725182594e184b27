/// @file Faces that lie on each other, between which light cannot choose.
#pragma once

#include <vector>

#include "transom/geometry.h"

namespace transom {

/// Throws InputError for two faces indoors that lie in one plane (nearer than the lift of ray origins), overlap, and can
/// be lit from the same side: which of them light meets would be chance, and both would receive it. Faces of closed
/// solids that stand on others, or back on to them, are no such pair. is_indoors: by face, see survey.h.
void check_overlaps(const Faces& faces, const std::vector<char>& is_indoors);

}  // namespace transom
