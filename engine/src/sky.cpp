#include "transom/sky.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "transom/error.h"

namespace transom {
namespace {

constexpr float kTwoPi = 2 * std::numbers::pi_v<float>;

float azimuth_of(glm::vec3 direction) {
  const float azimuth = std::atan2(direction.y, direction.x);
  return azimuth < 0 ? azimuth + kTwoPi : azimuth;
}

bool is_unit(glm::vec3 direction) {
  return std::abs(glm::length(direction) - 1) <= 1e-3f;
}

}  // namespace

SkyBinIndex::SkyBinIndex(const SkyBins& bins) : row_counts_(bins.row_counts) {
  if (bins.row_altitude_edges.size() != bins.row_counts.size() + 1 || bins.row_counts.empty())
    throw InputError("sky bins: row_altitude_edges must have one entry more than row_counts");
  int first = 0;
  for (std::size_t row = 0; row < row_counts_.size(); ++row) {
    if (row_counts_[row] < 1) throw InputError("sky bins: row " + std::to_string(row) + " has no bin");
    if (!(bins.row_altitude_edges[row] < bins.row_altitude_edges[row + 1]))
      throw InputError("sky bins: the edges of row " + std::to_string(row) + " do not rise");
    row_sines_.push_back(std::sin(bins.row_altitude_edges[row]));
    row_first_.push_back(first);
    first += row_counts_[row];
  }
  count_ = first + 1;
}

int SkyBinIndex::operator()(glm::vec3 direction) const {
  if (direction.z < 0) return count_ - 1;
  const auto above = std::upper_bound(row_sines_.begin() + 1, row_sines_.end(), direction.z);
  const auto row = static_cast<std::size_t>(above - row_sines_.begin()) - 1;
  const int bin = static_cast<int>(azimuth_of(direction) / kTwoPi * static_cast<float>(row_counts_[row]));
  return row_first_[row] + std::min(bin, row_counts_[row] - 1);
}

void Condition::validate(int sky_bin_count) const {
  if (static_cast<int>(sky_luminance.size()) != sky_bin_count)
    throw InputError("the sky vector has " + std::to_string(sky_luminance.size()) + " entries, the engine's sky has " +
                     std::to_string(sky_bin_count));
  for (const float l : sky_luminance)
    if (!(l >= 0 && std::isfinite(l))) throw InputError("the sky vector holds a value that is negative or not finite");
  for (const std::vector<Beam>* list : {&beams, &sub_suns})
    for (const Beam& beam : *list) {
      if (!is_unit(beam.direction_to_source)) throw InputError("the direction of a beam is not a unit vector");
      if (beam.opening >= 0 && !is_unit(beam.direction_to_sun))
        throw InputError("the direction from a lobe's panel to the sun is not a unit vector");
      if (beam.opening >= 0 && list == &sub_suns) throw InputError("a sub-sun is the sun itself, not a lobe of it");
      for (int c = 0; c < 3; ++c)
        if (!(beam.normal_illuminance[c] >= 0 && std::isfinite(beam.normal_illuminance[c])))
          throw InputError("the illuminance of a beam is negative or not finite");
    }
  for (const Residual& residual : residuals) {
    if (!is_unit(residual.direction_to_sun))
      throw InputError("the direction from a residual's panel to the sun is not a unit vector");
    for (const glm::vec3& radiance : residual.radiance)
      for (int c = 0; c < 3; ++c)
        if (!(radiance[c] >= 0 && std::isfinite(radiance[c])))
          throw InputError("the residual of a panel holds a value that is negative or not finite");
  }
  for (int c = 0; c < 3; ++c)
    if (!(ground_luminance[c] >= 0 && std::isfinite(ground_luminance[c])) ||
        !(sky_colour[c] >= 0 && std::isfinite(sky_colour[c])))
      throw InputError("the ground's luminance or the sky's colour is negative or not finite");
}

std::vector<Beam> Condition::beams_at_points() const {
  if (sub_suns.empty()) return beams;
  std::vector<Beam> at_points = sub_suns;
  for (const Beam& beam : beams)
    if (beam.opening >= 0) at_points.push_back(beam);
  return at_points;
}

glm::vec3 Condition::seen(glm::vec3 direction, glm::vec2 place, const SkyBinIndex& bins,
                          const SkyPicture* picture) const {
  if (direction.z < 0) return ground_luminance;
  return (picture ? picture->at(place) : sky_luminance[bins(direction)]) * sky_colour;
}

void SkyPicture::validate() const {
  if (width < 1 || height < 2 || luminance.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    throw InputError("the picture of the sky does not have width x height texels, in at least one column and two rows");
  for (const float texel : luminance)
    if (!(texel >= 0 && std::isfinite(texel)))
      throw InputError("the picture of the sky holds a value that is negative or not finite");
}

glm::vec2 SkyPicture::place_of(glm::vec3 direction) {
  return {azimuth_of(direction) / kTwoPi, std::acos(std::min(direction.z, 1.f)) / (kTwoPi / 4)};
}

float SkyPicture::at(glm::vec2 place) const {
  const float y = place.y * static_cast<float>(height - 1);
  const float x = place.x * static_cast<float>(width) - 0.5f;
  const int y0 = std::min(static_cast<int>(y), height - 2);
  const int x0 = static_cast<int>(std::floor(x));
  const float fy = y - static_cast<float>(y0), fx = x - static_cast<float>(x0);
  const auto texel = [&](int column, int row) { return luminance[row * width + (column + width) % width]; };
  return (1 - fy) * ((1 - fx) * texel(x0, y0) + fx * texel(x0 + 1, y0)) +
         fy * ((1 - fx) * texel(x0, y0 + 1) + fx * texel(x0 + 1, y0 + 1));
}

}  // namespace transom
