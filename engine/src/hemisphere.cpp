#include "hemisphere.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "index_sums.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr double kInverseSteps = 1 << 20;  // of the inverse distance, for the inverse of the scene's extent

// Shares of `unit` for each ray.
std::vector<Share> count_up(const std::vector<int>& indices, float unit) {
  thread_local IndexSums<int> counts;
  for (const int index : indices) counts.add(index, 1);
  std::vector<Share> shares;
  shares.reserve(counts.distinct());
  counts.take([&](int index, int count) { shares.push_back({index, unit * static_cast<float>(count)}); });
  return shares;
}

// Takes rays from sorted shares and adds others; `total`: rays in the end. False: more are taken than there are.
bool change_counts(const std::vector<Share>& known, float known_unit, std::vector<int>& lost, std::vector<int>& found,
                   float unit, std::vector<Share>& shares, int& total) {
  std::sort(lost.begin(), lost.end());
  std::sort(found.begin(), found.end());
  shares.reserve(known.size() + found.size());
  auto taken = lost.begin(), given = found.begin();
  for (auto own = known.begin(); own != known.end() || given != found.end();) {
    const int index = given == found.end() || (own != known.end() && own->index <= *given) ? own->index : *given;
    int count = 0;
    if (own != known.end() && own->index == index) count = static_cast<int>(std::lround((own++)->weight / known_unit));
    for (; given != found.end() && *given == index; ++given) ++count;
    for (; taken != lost.end() && *taken == index; ++taken) --count;
    if (count < 0) return false;
    if (count > 0) shares.push_back({index, unit * static_cast<float>(count)});
    total += count;
  }
  return taken == lost.end();
}

float harmonic_distance(int exposed, std::int64_t inverse_distance, float extent) {
  return inverse_distance > 0
             ? static_cast<float>(exposed * kInverseSteps * extent / static_cast<double>(inverse_distance))
             : Ray::kInfinity;
}

}  // namespace

void HemisphereTally::add_distance(float t, const Faces& faces) {
  inverse_distance += std::llround(kInverseSteps * faces.extent / std::max(t, faces.ray_offset()));
}

GatherRow HemisphereTally::row(int count, float extent) && {
  GatherRow row;
  const int exposed = count - buried;
  row.exposure = static_cast<float>(exposed) / static_cast<float>(count);
  if (exposed == 0) return row;
  const float share = 1 / static_cast<float>(exposed);
  row.escaped = static_cast<float>(bins.size()) * share;
  row.reached = count_up(slots, share);
  row.near = count_up(near, share);
  row.left = count_up(left, share);
  row.sky = count_up(bins, kPi * share);
  row.inverse_distance = inverse_distance;
  row.harmonic_distance = harmonic_distance(exposed, inverse_distance, extent);
  return row;
}

bool recount(GatherRow& known, HemisphereTally lost, HemisphereTally found, int count, float extent) {
  const auto known_exposed = static_cast<int>(std::lround(known.exposure * static_cast<float>(count)));
  const int exposed = known_exposed + lost.buried - found.buried;
  if (exposed < 0 || exposed > count) return false;
  GatherRow row;
  row.exposure = static_cast<float>(exposed) / static_cast<float>(count);
  row.inverse_distance = known.inverse_distance - lost.inverse_distance + found.inverse_distance;
  row.harmonic_distance = exposed > 0 ? harmonic_distance(exposed, row.inverse_distance, extent) : 0;
  const float known_share = 1 / static_cast<float>(std::max(1, known_exposed)),
              share = 1 / static_cast<float>(std::max(1, exposed));
  int reached = 0, near = 0, left = 0, escaped = 0;
  if (!change_counts(known.reached, known_share, lost.slots, found.slots, share, row.reached, reached) ||
      !change_counts(known.near, known_share, lost.near, found.near, share, row.near, near) ||
      !change_counts(known.left, known_share, lost.left, found.left, share, row.left, left) ||
      !change_counts(known.sky, kPi * known_share, lost.bins, found.bins, kPi * share, row.sky, escaped) ||
      reached + escaped != exposed || row.inverse_distance < 0)
    return false;
  row.escaped = static_cast<float>(escaped) * share;
  known = std::move(row);
  return true;
}

}  // namespace transom
