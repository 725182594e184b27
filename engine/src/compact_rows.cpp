#include "transom/compact_rows.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace transom {
namespace {

constexpr std::size_t kLanes = 8;

// Eight sums, one of each lane, added up in pairs.
float sum_of(const float (&lane)[kLanes]) {
  return ((lane[0] + lane[1]) + (lane[2] + lane[3])) + ((lane[4] + lane[5]) + (lane[6] + lane[7]));
}

// Eight weights, the running sums that they go to, and eight products at once. With registers of eight floats or of
// four the sums are the same, bit by bit.
#ifdef __AVX2__
using Eight = __m256;

inline Eight eight(const std::uint16_t* weight) {
  return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(weight))));
}
inline Eight eight(const float* weight) {
  return _mm256_loadu_ps(weight);
}
inline Eight first_of(Eight weights, std::size_t count) {
  const __m256i is_kept =
      _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(count)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
  return _mm256_and_ps(weights, _mm256_castsi256_ps(is_kept));
}

class GreySums {
 public:
  using Value = float;
  explicit GreySums(const std::vector<float>& values) : value_(values.data()) {}
  template <typename Column>
  void add(Eight weights, const Column* column) {
    sums_ = _mm256_add_ps(sums_, _mm256_mul_ps(weights, _mm256_i32gather_ps(value_, indices(column), sizeof(float))));
  }
  float total() const {
    alignas(32) float lane[kLanes];
    _mm256_store_ps(lane, sums_);
    return sum_of(lane);
  }

 private:
  static __m256i indices(const std::uint16_t* column) {
    return _mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(column)));
  }
  static __m256i indices(const std::uint32_t* column) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(column));
  }
  const float* value_;
  __m256 sums_ = _mm256_setzero_ps();
};

// Of each register, the lower half holds the sum of lane k and the upper half that of lane k + 4.
class ColourSums {
 public:
  using Value = glm::vec4;
  explicit ColourSums(const std::vector<glm::vec4>& values) : value_(values.data()) {}
  template <typename Column>
  void add(Eight weights, const Column* column) {
    const auto add_to = [](__m256& sum, __m256 weight, __m256 value) {
      sum = _mm256_add_ps(sum, _mm256_mul_ps(weight, value));
    };
    add_to(sums_[0], _mm256_permute_ps(weights, 0x00), two(column));
    add_to(sums_[1], _mm256_permute_ps(weights, 0x55), two(column + 1));
    add_to(sums_[2], _mm256_permute_ps(weights, 0xaa), two(column + 2));
    add_to(sums_[3], _mm256_permute_ps(weights, 0xff), two(column + 3));
  }
  glm::vec4 total() const {
    const __m256 halves = _mm256_add_ps(_mm256_add_ps(sums_[0], sums_[1]), _mm256_add_ps(sums_[2], sums_[3]));
    glm::vec4 sum;
    _mm_storeu_ps(&sum.x, _mm_add_ps(_mm256_castps256_ps128(halves), _mm256_extractf128_ps(halves, 1)));
    return sum;
  }

 private:
  template <typename Column>
  __m256 two(const Column* column) const {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(&value_[column[0]].x)),
                                _mm_loadu_ps(&value_[column[4]].x), 1);
  }
  const glm::vec4* value_;
  __m256 sums_[4] = {_mm256_setzero_ps(), _mm256_setzero_ps(), _mm256_setzero_ps(), _mm256_setzero_ps()};
};
#else
struct Eight {
  float lane[kLanes];
};

template <typename Weight>
Eight eight(const Weight* weight) {
  Eight weights;
  std::copy_n(weight, kLanes, weights.lane);
  return weights;
}
inline Eight first_of(Eight weights, std::size_t count) {
  std::fill(weights.lane + count, weights.lane + kLanes, 0.f);
  return weights;
}

class GreySums {
 public:
  using Value = float;
  explicit GreySums(const std::vector<float>& values) : value_(values.data()) {}
  template <typename Column>
  void add(const Eight& weights, const Column* column) {
    for (std::size_t k = 0; k < kLanes; ++k) sums_[k] += weights.lane[k] * value_[column[k]];
  }
  float total() const { return sum_of(sums_); }

 private:
  const float* value_;
  float sums_[kLanes] = {};
};

class ColourSums {
 public:
  using Value = glm::vec4;
  explicit ColourSums(const std::vector<glm::vec4>& values) : value_(values.data()) {}
  template <typename Column>
  void add(const Eight& weights, const Column* column) {
    for (std::size_t k = 0; k < kLanes; ++k)
      sums_[k] = _mm_add_ps(sums_[k], _mm_mul_ps(_mm_set1_ps(weights.lane[k]), _mm_loadu_ps(&value_[column[k]].x)));
  }
  glm::vec4 total() const {
    const auto four = [&](int k) {
      return _mm_add_ps(_mm_add_ps(sums_[k], sums_[k + 1]), _mm_add_ps(sums_[k + 2], sums_[k + 3]));
    };
    glm::vec4 sum;
    _mm_storeu_ps(&sum.x, _mm_add_ps(four(0), four(4)));
    return sum;
  }

 private:
  const glm::vec4* value_;
  __m128 sums_[kLanes] = {_mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(),
                          _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps()};
};
#endif

// Eight entries are read at the end of a row too: those that are not of it count 0.
template <typename Sums, typename Weight, typename Column>
typename Sums::Value weighted_sum(Sums sums, const Weight* weight, const Column* column, std::size_t count) {
  for (; count >= kLanes; count -= kLanes, weight += kLanes, column += kLanes) sums.add(eight(weight), column);
  if (count > 0) sums.add(first_of(eight(weight), count), column);
  return sums.total();
}

// The same for a row, whichever its columns are.
template <typename Sums, typename Weight>
typename Sums::Value row_sum(const CompactColumns& columns, const std::vector<Weight>& weights, std::size_t row,
                             const Sums& sums) {
  const std::size_t begin = columns.begin[row], count = columns.begin[row + 1] - begin;
  if (columns.are_short) return weighted_sum(sums, &weights[begin], &columns.short_column[begin], count);
  return weighted_sum(sums, &weights[begin], &columns.column[begin], count);
}

}  // namespace

// Entries of no row follow the last one.
CompactColumns::CompactColumns(const SparseRows& rows) : begin(rows.begin) {
  const auto is_before = [](const Share& a, const Share& b) { return a.index < b.index; };
  const auto last = std::max_element(rows.entries.begin(), rows.entries.end(), is_before);
  are_short = last == rows.entries.end() || last->index <= std::numeric_limits<std::uint16_t>::max();
  const auto store = [&](auto& columns) {
    columns.reserve(rows.entries.size() + kLanes);
    for (const Share& share : rows.entries)
      columns.push_back(static_cast<typename std::decay_t<decltype(columns)>::value_type>(share.index));
    columns.resize(columns.size() + kLanes, 0);
  };
  if (are_short)
    store(short_column);
  else
    store(column);
}

ExactRows::ExactRows(const SparseRows& rows) : columns_(rows) {
  weight_.reserve(rows.entries.size() + kLanes);
  for (const Share& share : rows.entries) weight_.push_back(share.weight);
  weight_.resize(weight_.size() + kLanes, 0.f);
}

std::vector<Share> ExactRows::row(std::size_t i) const {
  std::vector<Share> shares;
  for (std::size_t k = columns_.begin[i]; k < columns_.begin[i + 1]; ++k)
    shares.push_back(
        {static_cast<int>(columns_.are_short ? columns_.short_column[k] : columns_.column[k]), weight_[k]});
  return shares;
}

glm::vec4 ExactRows::dot(std::size_t row, const std::vector<glm::vec4>& values) const {
  return row_sum(columns_, weight_, row, ColourSums(values));
}

float ExactRows::dot(std::size_t row, const std::vector<float>& values) const {
  return row_sum(columns_, weight_, row, GreySums(values));
}

CompactRows::CompactRows(const SparseRows& rows) : columns_(rows) {
  weight_.reserve(rows.entries.size() + kLanes);
  for (std::size_t row = 0; row < rows.row_count(); ++row) {
    float most = 0;
    for (std::size_t k = rows.begin[row]; k < rows.begin[row + 1]; ++k) most = std::max(most, rows.entries[k].weight);
    const float step = most > 0 ? most / std::numeric_limits<std::uint16_t>::max() : 1.f;
    double sum = 0, count = 0;
    for (std::size_t k = rows.begin[row]; k < rows.begin[row + 1]; ++k) {
      const float weight = rows.entries[k].weight;
      weight_.push_back(static_cast<std::uint16_t>(std::lround(weight / step)));
      sum += static_cast<double>(weight);
      count += weight_.back();
    }
    unit_.push_back(count > 0 ? static_cast<float>(sum / count) : step);
  }
  weight_.resize(weight_.size() + kLanes, 0);
}

glm::vec4 CompactRows::dot(std::size_t row, const std::vector<glm::vec4>& values) const {
  return unit_[row] * row_sum(columns_, weight_, row, ColourSums(values));
}

float CompactRows::dot(std::size_t row, const std::vector<float>& values) const {
  return unit_[row] * row_sum(columns_, weight_, row, GreySums(values));
}

}  // namespace transom
