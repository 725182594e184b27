/// @file Light through the section of a glazing product that is extruded along one axis and repeats along another: a
/// goniophotometer that needs no laboratory. Frame: x along the extrusion, y up, z into the room; metres.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/optical_surface.h"
#include "transom/product_light.h"

namespace transom {

/// A line of the section from a to b, as (y, z). The front of its surface is to the left of a -> b, seen with y to the
/// right and z up. bow [m]: 0 for a straight line; else an arc of a circle whose middle lies so far to the left of the
/// straight line (negative: to the right), less than half of the distance from a to b.
struct Line {
  glm::dvec2 a{0}, b{0};
  Surface surface;
  double bow = 0;
};

/// What repeats along y with `period`, between the planes z = low_z (outdoors) and z = high_z (room). Lines may leave
/// 0 <= y < period; no two lines, nor a line and another's repetition, may cross. Medium 0 is the air around.
struct Section {
  double period = 1;
  double low_z = 0, high_z = 0;
  std::vector<Medium> media;
  std::vector<Line> lines;

  /// Throws InputError for lines outside the planes, media out of range, or impossible coefficients.
  void validate() const;
};

/// Sends parallel unpolarised light of one direction through a section. The x component of the optical direction is
/// constant, so that light moves in the plane, and between straight lines parallel light stays parallel: beams are cut
/// where lines end, so that their shares are exact. A beam that meets an arc or a diffuse surface becomes rays, in
/// number as its flux. All branches of reflection and refraction are followed until they are weaker than split_share
/// of a ray; then they go one way by chance.
ProductLight trace_section(const Section& section, glm::dvec3 direction, TraceOptions options);

}  // namespace transom
