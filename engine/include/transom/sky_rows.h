/// @file What places see of the sky, the ground and panels, prepared for many conditions.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/compact_rows.h"

namespace transom {

/// Radiance of all that rows of the sky have weights of [cd/m²].
struct SkyRadiance {
  const std::vector<float>& luminance;  ///< of sky bins; kept by reference
  glm::vec3 colour;                     ///< of the sky
  std::vector<glm::vec4> beyond;        ///< of the ground, then of the exit bins of panels
};

/// Rows of weights. Sky bins have a luminance each and one colour together: a single channel is summed.
class SkyRows {
 public:
  SkyRows() = default;
  /// rows: by column, sky bins before `ground`, the ground, and exit bins of panels from there on; ascending.
  SkyRows(const SparseRows& rows, int ground);

  std::size_t row_count() const { return bins_.row_count(); }
  std::vector<Share> row(std::size_t i) const;

  /// Sum over a row of weight x radiance.
  glm::vec3 irradiance(std::size_t row, const SkyRadiance& radiance) const {
    return glm::vec3(beyond_.dot(row, radiance.beyond)) + bins_.dot(row, radiance.luminance) * radiance.colour;
  }

 private:
  int ground_ = 0;
  ExactRows bins_, beyond_;
};

}  // namespace transom
