/// @file The sky dome in bins of Reinhart's subdivision, and the condition that a relighting is given.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "transom/light_shaft.h"

namespace transom {

/// Rows of equal altitude steps, each with equally wide bins; bin 0 of a row begins at the azimuth of +x and goes
/// towards +y. The last row is the zenith cap. One more bin, the last, is the ground: everything below the horizon.
struct SkyBins {
  std::vector<float> row_altitude_edges;  ///< rows + 1, radians, from 0 to pi / 2
  std::vector<int> row_counts;
};

/// Finds the bin of a direction. Built once from SkyBins.
class SkyBinIndex {
 public:
  explicit SkyBinIndex(const SkyBins& bins);
  int count() const { return count_; }
  /// Unit direction, z up.
  int operator()(glm::vec3 direction) const;

 private:
  std::vector<float> row_sines_;  // sine of the lower edge of each row
  std::vector<int> row_first_, row_counts_;
  int count_ = 0;
};

/// Parallel light: unit direction towards its source, and normal illuminance as linear RGB [lx]. Either the sun itself,
/// outdoors and through clear openings; or a lobe of it behind the panels of an opening group, with the illuminance
/// that a panel in full sun gives it.
struct Beam {
  glm::vec3 direction_to_source{0, 0, 1};
  glm::vec3 normal_illuminance{0};
  int opening = -1;                     ///< whose panels send the lobe; -1: the sun itself
  glm::vec3 direction_to_sun{0, 0, 1};  ///< of a lobe: unit, outdoors
  /// Of a lobe: where it is, as Engine::relight has found.
  std::shared_ptr<const std::vector<LightShaft>> shafts = nullptr;
};

/// The rest of the sun behind the panels of an opening group: radiance of a panel in full sun by exit bin [cd/m²].
struct Residual {
  int opening = -1;
  glm::vec3 direction_to_sun{0, 0, 1};
  std::vector<glm::vec3> radiance;
};

/// What is seen of the sky: luminance [cd/m²], row 0 at the zenith, row j at pi/2 j / (height - 1) from it, column i at
/// azimuth 2 pi (i + 1/2) / width from +x towards +y.
struct SkyPicture {
  std::vector<float> luminance;
  int width = 0, height = 0;

  void validate() const;
  /// Where pictures show a direction above the horizon: azimuth in turns, angle from the zenith in right angles.
  static glm::vec2 place_of(glm::vec3 direction);
  /// Luminance at a place, between texels.
  float at(glm::vec2 place) const;
};

/// Everything outdoors that can change from hour to hour.
struct Condition {
  std::vector<Beam> beams;
  /// Parts of the sun's disc. They stand for the sun where its light is shown, or measured at points; elements of
  /// patches, which are wider than penumbras, receive that of the point in the middle. Empty: the sun is a point
  /// everywhere.
  std::vector<Beam> sub_suns;
  std::vector<Residual> residuals;
  std::vector<float> sky_luminance;  ///< one a sky bin [cd/m²]
  glm::vec3 sky_colour{1};           ///< RGB with Y = 1
  glm::vec3 ground_luminance{0};     ///< [cd/m²]

  void validate(int sky_bin_count) const;
  /// Beams at points: sub-suns, where there are any, in place of the sun; lobes.
  std::vector<Beam> beams_at_points() const;
  /// Radiance of sky or ground in a direction, whose place in pictures of the sky is known. picture: of this sky; null:
  /// its bins are seen.
  glm::vec3 seen(glm::vec3 direction, glm::vec2 place, const SkyBinIndex& bins, const SkyPicture* picture) const;
};

}  // namespace transom
