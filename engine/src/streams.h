/// @file Streams of random numbers of a solve, so that its steps do not repeat each other's.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "transom/light_mesh.h"
#include "transom/sampling.h"

namespace transom {

enum Stream : std::uint64_t {
  kPatchStream = 1,
  kNodeStream,
  kBeamStream,
  kSensorStream,
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

/// The same to 1e-4 of the scene's extent, so that they are those of the same scene at another size.
inline std::uint32_t relative_place_seed(std::uint32_t seed, Stream stream, const Node& place, float extent) {
  constexpr float kSteps = 10007.3f;  // none of them falls on what people build
  seed = hash_seed(seed, stream);
  for (const glm::vec3 v : {place.position / extent, place.normal})
    for (int axis = 0; axis < 3; ++axis)
      seed = hash_seed(seed, static_cast<std::uint32_t>(std::lround(kSteps * v[axis])));
  return seed;
}

}  // namespace transom
