/// @file Streams of random numbers: each use of them has its own.
#pragma once

#include <cstdint>

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

}  // namespace transom
