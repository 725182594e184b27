#include "transom/angle_bins.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "transom/error.h"

namespace transom {
namespace {

constexpr float kTwoPi = 2 * std::numbers::pi_v<float>;
constexpr float kEdgeTolerance = 1e-4f;  // rad

}  // namespace

AngleBins::AngleBins(const std::vector<float>& polar_edges, std::vector<int> counts) : counts_(std::move(counts)) {
  const bool is_whole = polar_edges.size() == counts_.size() + 1 && !counts_.empty() &&
                        std::abs(polar_edges.front()) < kEdgeTolerance &&
                        std::abs(polar_edges.back() - kTwoPi / 4) < kEdgeTolerance &&
                        std::is_sorted(polar_edges.begin(), polar_edges.end()) &&
                        std::all_of(counts_.begin(), counts_.end(), [](int count) { return count > 0; });
  if (!is_whole)
    throw InputError(
        "angle bins: the edges must rise from 0 to pi / 2, one more than rings, each with one bin or more");
  first_.push_back(0);
  for (const float edge : polar_edges) squares_.push_back(std::sin(edge) * std::sin(edge));
  squares_.front() = 0;
  squares_.back() = 1;
  for (std::size_t ring = 0; ring < counts_.size(); ++ring) {
    const float share = kTwoPi / 2 * (squares_[ring + 1] - squares_[ring]) / static_cast<float>(counts_[ring]);
    projected_solid_angles_.insert(projected_solid_angles_.end(), static_cast<std::size_t>(counts_[ring]), share);
    ring_of_.insert(ring_of_.end(), static_cast<std::size_t>(counts_[ring]), static_cast<int>(ring));
    first_.push_back(first_.back() + counts_[ring]);
  }
}

int AngleBins::bin_of(glm::vec3 direction) const {
  const float square = direction.x * direction.x + direction.y * direction.y;
  const auto above = std::upper_bound(squares_.begin() + 1, squares_.end() - 1, square);
  const std::size_t ring = static_cast<std::size_t>(above - squares_.begin()) - 1;
  const float turn = std::atan2(direction.y, direction.x) / kTwoPi;
  const int count = counts_[ring], place = static_cast<int>(std::floor(turn * static_cast<float>(count) + 0.5f));
  return first_[ring] + (place + count) % count;
}

glm::vec3 AngleBins::sample(int bin, glm::vec2 u) const {
  const auto ring = static_cast<std::size_t>(ring_of_[static_cast<std::size_t>(bin)]);
  const float square = glm::mix(squares_[ring], squares_[ring + 1], u.x), radius = std::sqrt(square);
  const float phi = kTwoPi * (static_cast<float>(bin - first_[ring]) + u.y - 0.5f) / static_cast<float>(counts_[ring]);
  return {radius * std::cos(phi), radius * std::sin(phi), std::sqrt(std::max(0.f, 1 - square))};
}

}  // namespace transom
