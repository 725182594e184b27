/// @file Streams of random numbers: each use of them has its own.
#pragma once

#include <bit>
#include <cstdint>

#include "transom/light_mesh.h"
#include "transom/sampling.h"

namespace transom {

enum Stream : std::uint64_t {
  kPatchStream = 1,
  kNodeStream,
  kBeamStream,
  kSensorStream,
  kAuditStream,
  kSurveyStream,
  kSourceStream,
  kPanelStream,
  kUnseenStream = 1u << 20
};

/// Of samples that depend on where a receiver is alone, so that they stay when others come or go.
inline std::uint32_t place_seed(std::uint32_t seed, Stream stream, const Node& place) {
  seed = hash_seed(seed, stream);
  for (const glm::vec3 v : {place.position, place.normal})
    for (int axis = 0; axis < 3; ++axis) seed = hash_seed(seed, std::bit_cast<std::uint32_t>(v[axis]));
  return seed;
}

}  // namespace transom
