/// @file Light of many directions through one product: what matrices and tables of it are made of.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <vector>

#include "transom/product_light.h"

namespace transom {

/// Light that left a product for each of N directions of incidence, in their order. Shares of each one's flux.
struct ProductSweep {
  std::vector<Exit> transmitted;           ///< of all directions
  std::vector<std::uint32_t> incidence;    ///< of each exit in `transmitted`, the direction that it belongs to
  std::vector<double> transmitted_shares;  ///< (N)
  std::vector<double> reflected_shares;    ///< (N)
};

/// Traces parallel light of one direction; may be called by several threads at once.
using TraceDirection = std::function<ProductLight(glm::dvec3, const TraceOptions&)>;

/// Traces each direction by `ray_count` rays, with random numbers of its own from `seed` and its number. The result
/// does not depend on the number of threads.
ProductSweep sweep_directions(const TraceDirection& trace, const std::vector<glm::dvec3>& directions, int ray_count,
                              std::uint32_t seed);

}  // namespace transom
