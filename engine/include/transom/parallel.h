/// @file Parallel loops whose result does not depend on the number of threads: every index writes its own output.
#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <cstddef>

namespace transom {

/// Flushes denormal numbers to zero in the calling thread while it lives, as Embree asks. The thread may be the
/// caller's own: what it had is put back.
class FlushDenormals {
 public:
  FlushDenormals() : before_(_mm_getcsr()) {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned before_;
};

/// Calls body(begin, end) for consecutive ranges of [0, count), at most `grain` or so indices each.
template <typename Body>
void parallel_ranges(std::size_t count, std::size_t grain, const Body& body) {
  oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
    const FlushDenormals flush;
    body(range.begin(), range.end());
  });
}

/// Calls body(i) for every i in [0, count).
template <typename Body>
void parallel_indices(std::size_t count, std::size_t grain, const Body& body) {
  parallel_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

}  // namespace transom
