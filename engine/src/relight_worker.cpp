#include "transom/relight_worker.h"

#include <utility>

namespace transom {

// Publishes the states of one condition for as long as no newer one is wanted.
class RelightWorker::Follower : public RelightFollower {
 public:
  Follower(RelightWorker& worker, std::uint64_t number) : worker_(worker), number_(number) {}
  void show(std::shared_ptr<const Lighting> state) override { worker_.publish(number_, std::move(state)); }
  bool is_wanted() const override {
    const std::lock_guard lock(worker_.mutex_);
    return !worker_.is_stopping_ && worker_.newest_ == number_;
  }

 private:
  RelightWorker& worker_;
  std::uint64_t number_;
};

RelightWorker::RelightWorker(const Engine& engine, std::shared_ptr<const Lighting> first)
    : engine_(engine), state_{0, std::move(first)}, thread_([this] { work(); }) {}

RelightWorker::~RelightWorker() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

std::uint64_t RelightWorker::submit(Condition condition) {
  engine_.check(condition);
  std::uint64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    wanted_ = std::move(condition);
    number = ++newest_;
  }
  changed_.notify_all();
  return number;
}

RelightWorker::State RelightWorker::taken(const std::unique_lock<std::mutex>&) const {
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  return state_;
}

RelightWorker::State RelightWorker::latest() const {
  const std::unique_lock lock(mutex_);
  return taken(lock);
}

RelightWorker::State RelightWorker::finished() const {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return done_ == newest_; });
  return taken(lock);
}

void RelightWorker::publish(std::uint64_t number, std::shared_ptr<const Lighting> lighting) {
  const std::lock_guard lock(mutex_);
  state_ = {number, std::move(lighting)};
}

void RelightWorker::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_stopping_ || wanted_; });
    if (is_stopping_) return;
    Condition condition = std::move(*wanted_);
    wanted_.reset();
    const std::uint64_t number = newest_;
    const std::shared_ptr<const Lighting> previous = state_.lighting;
    lock.unlock();
    std::shared_ptr<const Lighting> lighting;
    std::exception_ptr error;
    try {
      Follower follower(*this, number);
      lighting = engine_.relight(std::move(condition), previous.get(), &follower);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    if (lighting) state_ = {number, std::move(lighting)};
    if (error) error_ = error;
    done_ = number;
    changed_.notify_all();
  }
}

}  // namespace transom
