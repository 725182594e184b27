/// @file Parallel loops whose result does not depend on the number of threads: every index writes its own output.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace transom {

/// Calls call(body, begin, end) for consecutive ranges of [0, count), at most `grain` or so indices each, with denormal
/// numbers flushed to zero, as Embree asks. What the caller did comes before every range, and every range before the
/// return; ranges come in any order, on any thread. Throws what a range throws.
void run_ranges(std::size_t count, std::size_t grain, const void* body,
                void (*call)(const void* body, std::size_t begin, std::size_t end));

/// Calls body(begin, end) for consecutive ranges of [0, count), at most `grain` or so indices each.
template <typename Body>
void parallel_ranges(std::size_t count, std::size_t grain, const Body& body) {
  run_ranges(count, grain, &body, [](const void* erased, std::size_t begin, std::size_t end) {
    (*static_cast<const Body*>(erased))(begin, end);
  });
}

/// Calls body(i) for every i in [0, count).
template <typename Body>
void parallel_indices(std::size_t count, std::size_t grain, const Body& body) {
  parallel_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

/// Calls both, at the same time where a thread is free: either fills the gaps that the other leaves.
template <typename First, typename Second>
void parallel_pair(const First& first, const Second& second) {
  parallel_indices(2, 1, [&](std::size_t i) { i == 0 ? first() : second(); });
}

/// Sorts in ascending order. Values that compare equal must be equal: which of them comes first is not said.
template <typename Value>
void parallel_sort(std::vector<Value>& values) {
  constexpr std::size_t kRunCount = 16;  // sorted each, then merged in pairs, in pairs of pairs and so on
  const auto at = [&](std::size_t run) {
    return values.begin() + values.size() * std::min(run, kRunCount) / kRunCount;
  };
  parallel_indices(kRunCount, 1, [&](std::size_t run) { std::sort(at(run), at(run + 1)); });
  for (std::size_t merged = 1; merged < kRunCount; merged *= 2)
    parallel_indices(kRunCount / (2 * merged), 1, [&](std::size_t pair) {
      const std::size_t run = 2 * merged * pair;
      std::inplace_merge(at(run), at(run + merged), at(run + 2 * merged));
    });
}

}  // namespace transom
