/// @file Light of many directions through one section: what matrices and tables of a product are made of.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "transom/section.h"

namespace transom {

/// Light that left a section for each of N directions of incidence, in their order. Shares of each one's flux.
struct SectionSweep {
  std::vector<Exit> transmitted;           ///< of all directions
  std::vector<std::uint32_t> incidence;    ///< of each exit in `transmitted`, the direction that it belongs to
  std::vector<double> transmitted_shares;  ///< (N)
  std::vector<double> reflected_shares;    ///< (N)
};

/// Traces each direction by `ray_count` rays, with random numbers of its own from `seed` and its number. Throws
/// InputError as trace_section does. The result does not depend on the number of threads.
SectionSweep trace_section_sweep(const Section& section, const std::vector<glm::dvec3>& directions, int ray_count,
                                 std::uint32_t seed);

}  // namespace transom
