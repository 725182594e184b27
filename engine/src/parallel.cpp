// Loops on oneTBB's threads. Nothing else of the engine runs code of oneTBB, so that what the thread sanitizer must be
// told about that library stands here.
#include "transom/parallel.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <pmmintrin.h>
#include <xmmintrin.h>
#ifdef TRANSOM_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif

namespace transom {
namespace {

// Flushes denormal numbers to zero in the calling thread while it lives. The thread may be the caller's own: what it
// had is put back.
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

// The two orders that oneTBB keeps: a loop's caller before each range, and each range before the caller goes on. The
// thread sanitizer does not see them in a library that is built without it, so it is told these two and no more: ranges
// stay unordered among themselves, and so do the loops of different callers.
class Order {
 public:
#ifdef TRANSOM_THREAD_SANITIZER
  Order() {
    __tsan_release(&begun_);
  }
  ~Order() {
    __tsan_acquire(&ended_);
  }
  void begin_range() {
    __tsan_acquire(&begun_);
  }
  void end_range() {
    __tsan_release(&ended_);
  }

 private:
  char begun_ = 0, ended_ = 0;
#else
  void begin_range() {}
  void end_range() {}
#endif
};

class RangeOrder {
 public:
  explicit RangeOrder(Order& order) : order_(order) { order_.begin_range(); }
  ~RangeOrder() { order_.end_range(); }
  RangeOrder(const RangeOrder&) = delete;
  RangeOrder& operator=(const RangeOrder&) = delete;

 private:
  Order& order_;
};

}  // namespace

void run_ranges(std::size_t count, std::size_t grain, const void* body,
                void (*call)(const void* body, std::size_t begin, std::size_t end)) {
  Order order;
  oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
    const RangeOrder range_order(order);
    const FlushDenormals flush;
    call(body, range.begin(), range.end());
  });
}

}  // namespace transom
