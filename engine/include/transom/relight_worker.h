/// @file Relighting beside everything else: a thread that always works on the newest condition and publishes states.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "transom/engine.h"

namespace transom {

/// Relights on a thread of its own. A condition that is submitted while an older one is in work replaces it: the older
/// one is abandoned between two of its steps. What is published is never changed afterwards, so that any thread may
/// draw and measure from it for as long as it keeps it.
class RelightWorker {
 public:
  /// What has been published last.
  struct State {
    std::uint64_t number = 0;                  ///< of the condition, counted from 1 as submitted; 0: none of them
    std::shared_ptr<const Lighting> lighting;  ///< of number 0: what the worker began with, or null
  };

  /// first: light whose indirect part the first states show; may be null.
  explicit RelightWorker(const Engine& engine, std::shared_ptr<const Lighting> first = nullptr);
  /// Abandons what is in work.
  ~RelightWorker();
  RelightWorker(const RelightWorker&) = delete;
  RelightWorker& operator=(const RelightWorker&) = delete;

  /// Takes a condition and returns its number at once. Throws InputError for one that cannot be; nothing changes then.
  std::uint64_t submit(Condition condition);

  /// The newest state, complete or on the way. Throws what a relighting has thrown since.
  State latest() const;

  /// Waits for the complete light of the newest condition. Throws what its relighting throws. Without one: at once.
  State finished() const;

 private:
  class Follower;
  void work();
  void publish(std::uint64_t number, std::shared_ptr<const Lighting> lighting);
  State taken(const std::unique_lock<std::mutex>& lock) const;

  const Engine& engine_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::optional<Condition> wanted_;  // not begun yet
  std::uint64_t newest_ = 0;         // number submitted last
  std::uint64_t done_ = 0;           // number that ended last, in light or in error
  State state_;
  mutable std::exception_ptr error_;
  bool is_stopping_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace transom
