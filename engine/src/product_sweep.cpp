#include "transom/product_sweep.h"

#include <utility>

#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {

ProductSweep sweep_directions(const TraceDirection& trace, const std::vector<glm::dvec3>& directions, int ray_count,
                              std::uint32_t seed) {
  ProductSweep sweep;
  const std::size_t count = directions.size();
  sweep.transmitted_shares.assign(count, 0);
  sweep.reflected_shares.assign(count, 0);
  std::vector<std::vector<Exit>> exits(count);
  parallel_indices(count, 1, [&](std::size_t i) {
    TraceOptions options;
    options.ray_count = ray_count;
    options.seed = hash_seed(seed, i);
    ProductLight light = trace(directions[i], options);
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
