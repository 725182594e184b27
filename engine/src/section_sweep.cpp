#include "transom/section_sweep.h"

#include <utility>

#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kMaximumEvents = 4000;  // on one path
constexpr double kSplitShare = 0.3;   // a matrix adds up many directions: few branches of each suffice

}  // namespace

SectionSweep trace_section_sweep(const Section& section, const std::vector<glm::dvec3>& directions, int ray_count,
                                 std::uint32_t seed) {
  SectionSweep sweep;
  const std::size_t count = directions.size();
  sweep.transmitted_shares.assign(count, 0);
  sweep.reflected_shares.assign(count, 0);
  std::vector<std::vector<Exit>> exits(count);
  parallel_indices(count, 1, [&](std::size_t i) {
    auto light = trace_section(section, directions[i], {ray_count, kMaximumEvents, kSplitShare, hash_seed(seed, i)});
    for (const Exit& exit : light.transmitted) sweep.transmitted_shares[i] += exit.flux;
    for (const Exit& exit : light.reflected) sweep.reflected_shares[i] += exit.flux;
    exits[i] = std::move(light.transmitted);
  });
  for (std::size_t i = 0; i < count; ++i) {
    sweep.transmitted.insert(sweep.transmitted.end(), exits[i].begin(), exits[i].end());
    sweep.incidence.insert(sweep.incidence.end(), exits[i].size(), static_cast<std::uint32_t>(i));
  }
  return sweep;
}

}  // namespace transom
