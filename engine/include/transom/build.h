/// @file How this library was built.
#pragma once

namespace transom {

/// Version, compiler, flags and libraries, for provenance.
const char* build_description();

}  // namespace transom
