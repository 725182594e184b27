// Races on purpose: the thread sanitizer must report each. It shows that loops on oneTBB's threads, which it does not
// see into, are watched nevertheless, and that nothing that is said about them hides a fault of the engine.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "rooms.h"
#include "transom/frame.h"
#include "transom/parallel.h"
#include "transom/relight_worker.h"

namespace transom {
namespace {

// Waits until so many have come, or for some seconds at most. Orders nothing: all is relaxed.
class Meeting {
 public:
  explicit Meeting(int count) : missing_(count) {}
  void wait() {
    missing_.fetch_sub(1, std::memory_order_relaxed);
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (missing_.load(std::memory_order_relaxed) > 0 && std::chrono::steady_clock::now() < limit)
      std::this_thread::yield();
  }

 private:
  std::atomic<int> missing_;
};

void at_once(const std::function<void(int)>& work) {
  std::thread first([&] { work(0); }), second([&] { work(1); });
  first.join();
  second.join();
}

// Two ranges of one loop write to the same place.
void race_of_ranges() {
  std::vector<int> sums(2);
  Meeting both(2);
  parallel_indices(sums.size(), 1, [&](std::size_t i) {
    both.wait();
    sums[0] += static_cast<int>(i);
  });
}

// Loops of two callers, run by the same threads, write to the same places.
void race_of_callers() {
  std::vector<int> shared(10000);
  Meeting both(2);
  at_once([&](int caller) {
    both.wait();
    for (int round = 0; round < 20; ++round)
      parallel_indices(shared.size(), 100, [&](std::size_t i) { shared[i] = caller; });
  });
}

SolveOptions small_options() {
  SolveOptions options;
  options.target_patch_count = 300;
  options.patch_samples = {64, 64};
  options.node_samples = {64, 64};
  return options;
}

// Light is changed after it was published, while another thread draws from it in the loops of the engine.
void race_for_a_state() {
  const Engine engine(test::roof_light_room(0.6f), test::tregenza(), small_options());
  RelightWorker worker(engine);
  worker.submit(test::uniform_sky(1000));
  const std::shared_ptr<const Lighting> state = worker.finished().lighting;
  Meeting both(2);
  at_once([&](int thread) {
    both.wait();
    if (thread == 0)
      FrameRenderer(engine).render(test::into_the_room(), *state, {});
    else
      for (glm::vec3& light : const_cast<Lighting&>(*state).node_indirect) light *= 2.f;
  });
}

// The same without a race: ranges write their own places, callers theirs, and the state is only read.
void no_race() {
  std::vector<int> mine(10000), yours(10000);
  at_once([&](int caller) {
    std::vector<int>& own = caller == 0 ? mine : yours;
    for (int round = 0; round < 20; ++round)
      parallel_indices(own.size(), 100, [&](std::size_t i) { own[i] += caller; });
    parallel_sort(own);
  });
  const Engine engine(test::roof_light_room(0.6f), test::tregenza(), small_options());
  RelightWorker worker(engine);
  worker.submit(test::uniform_sky(1000));
  const std::shared_ptr<const Lighting> state = worker.finished().lighting;
  at_once([&](int) { FrameRenderer(engine).render(test::into_the_room(), *state, {}); });
}

}  // namespace
}  // namespace transom

int main(int argument_count, char** arguments) {
  const std::map<std::string, void (*)()> races{{"ranges", transom::race_of_ranges},
                                                {"callers", transom::race_of_callers},
                                                {"state", transom::race_for_a_state},
                                                {"none", transom::no_race}};
  const auto race = races.find(argument_count == 2 ? arguments[1] : "");
  if (race == races.end()) {
    std::fprintf(stderr, "usage: planted_races ranges|callers|state|none\n");
    return 2;
  }
  race->second();
  return 0;
}
