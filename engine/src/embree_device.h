/// @file The one Embree device of the process, of version 3 or 4.
#pragma once

#if TRANSOM_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace transom {

/// Throws std::runtime_error when Embree cannot start; its later errors are thrown as well.
RTCDevice shared_device();

}  // namespace transom
