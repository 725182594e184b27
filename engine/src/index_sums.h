// Sums by index, given back in ascending order without sorting.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace transom {

// A bit for each index that has come, and a bit for each word of those, are passed through faster than indices are
// sorted. Room for the largest index is kept, so that one object serves many lists.
template <typename Value>
class IndexSums {
 public:
  void add(int index, Value value) {
    const auto i = static_cast<std::size_t>(index);
    if (i >= sums_.size()) grow(i);
    std::uint64_t& word = has_come_[i / kBits];
    const std::uint64_t bit = std::uint64_t{1} << i % kBits;
    distinct_ += (word & bit) == 0;
    word |= bit;
    is_used_[i / (kBits * kBits)] |= std::uint64_t{1} << i / kBits % kBits;
    sums_[i] += value;
  }

  std::size_t distinct() const { return distinct_; }

  // Calls body(index, sum) for each, and forgets them.
  template <typename Body>
  void take(const Body& body) {
    for (std::size_t group = 0; group < is_used_.size(); ++group)
      for (std::uint64_t& words = is_used_[group]; words != 0; words &= words - 1) {
        const std::size_t word = group * kBits + static_cast<std::size_t>(std::countr_zero(words));
        for (std::uint64_t& bits = has_come_[word]; bits != 0; bits &= bits - 1) {
          const std::size_t i = word * kBits + static_cast<std::size_t>(std::countr_zero(bits));
          body(static_cast<int>(i), std::exchange(sums_[i], Value{0}));
        }
      }
    distinct_ = 0;
  }

 private:
  static constexpr std::size_t kBits = 64;
  void grow(std::size_t index) {
    const std::size_t groups = std::bit_ceil(index / (kBits * kBits) + 1);
    is_used_.resize(groups, 0);
    has_come_.resize(groups * kBits, 0);
    sums_.resize(groups * kBits * kBits, Value{0});
  }

  std::vector<Value> sums_;  // by index
  std::vector<std::uint64_t> has_come_, is_used_;
  std::size_t distinct_ = 0;
};

}  // namespace transom
