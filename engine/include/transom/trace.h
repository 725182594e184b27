/// @file Times the phases of a solve, a relighting or a frame. Costs nothing but a branch when off.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <vector>

namespace transom {

/// One timed phase; seconds since the trace began.
struct TraceEvent {
  std::string name;
  double begin_s = 0;
  double end_s = 0;
};

/// A list of phases. Threads may record at once; phases are the sequential steps of each.
class Trace {
 public:
  void enable(bool on) { enabled_ = on; }
  bool enabled() const { return enabled_; }
  void clear() {
    const std::lock_guard lock(mutex_);
    events_.clear();
  }
  std::vector<TraceEvent> events() const {
    const std::lock_guard lock(mutex_);
    return events_;
  }

  double now_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  void record(const char* name, double begin_s) {
    const double end_s = now_s();
    const std::lock_guard lock(mutex_);
    events_.push_back({name, begin_s, end_s});
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  mutable std::mutex mutex_;
  std::vector<TraceEvent> events_;
  bool enabled_ = false;
};

/// Records the phase `name` from its construction to its destruction.
class TracePhase {
 public:
  TracePhase(Trace& trace, const char* name) : trace_(trace), name_(name), on_(trace.enabled()) {
    if (on_) begin_s_ = trace_.now_s();
  }
  ~TracePhase() {
    if (on_) trace_.record(name_, begin_s_);
  }
  TracePhase(const TracePhase&) = delete;
  TracePhase& operator=(const TracePhase&) = delete;

 private:
  Trace& trace_;
  const char* name_;
  bool on_;
  double begin_s_ = 0;
};

}  // namespace transom
