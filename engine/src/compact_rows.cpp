#include "transom/compact_rows.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

namespace transom {
namespace {

constexpr int kShift = 13;                    // bits of a float's mantissa that a half has not
constexpr std::uint32_t kBias = 112u << 23;   // of the exponent of a float against that of a half
constexpr std::uint32_t kLeast = 113u << 23;  // 2^-14: below it a half is 0
constexpr int kLargest = 14;                  // exponent of the largest value
constexpr std::uint32_t kGoldenRatio = 5063;  // of 2^13: multiples of it are spread evenly

// Rounds up or down, so that many equal values have their mean: `number` tells them apart.
std::uint16_t half_of(float value, std::uint32_t number) {
  const auto bits = std::bit_cast<std::uint32_t>(value), size = bits & 0x7fffffffu;
  const std::uint32_t threshold = number * kGoldenRatio & ((1u << kShift) - 1);
  const std::uint32_t half = (bits >> 16 & 0x8000u) | (size - kBias + threshold) >> kShift;
  return static_cast<std::uint16_t>(size < kLeast ? 0u : half);
}

// Values, of which kChannels make a colour, times `scale` as halves. The loop is one for the compiler to take several
// values at once; so is the next.
template <std::uint32_t kChannels>
void put_halves(const float* values, float scale, std::vector<std::uint16_t>& halves) {
  const auto count = static_cast<std::uint32_t>(halves.size());
  std::uint16_t* const to = halves.data();
  for (std::uint32_t k = 0; k < count; ++k) to[k] = half_of(scale * values[k], k / kChannels);
}

// The largest size of values that are finite: sizes of floats are ordered as their bits are.
float largest_size(const float* values, std::size_t count) {
  std::uint32_t most = 0;
  for (std::size_t k = 0; k < count; ++k) most = std::max(most, std::bit_cast<std::uint32_t>(values[k]) & 0x7fffffffu);
  return std::bit_cast<float>(most);
}

// A half, or four, as floats.
#ifdef __F16C__
inline float widened(std::uint16_t half) {
  return _cvtsh_ss(half);
}
inline __m128 widened(const std::uint16_t* halves) {
  return _mm_cvtph_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(halves)));
}
constexpr float kWidened = 1;  // what a widened half lacks
#else
// Moved to where a float has its exponent and mantissa; the shift repeats the sign, which is masked.
inline float widened(std::uint16_t half) {
  const auto moved = static_cast<std::int32_t>(static_cast<std::uint32_t>(half) << 16) >> 3;
  return std::bit_cast<float>(static_cast<std::uint32_t>(moved) & 0x8fffffffu);
}
inline __m128 widened(const std::uint16_t* halves) {
  const __m128i moved = _mm_srai_epi32(
      _mm_unpacklo_epi16(_mm_setzero_si128(), _mm_loadl_epi64(reinterpret_cast<const __m128i*>(halves))), 3);
  return _mm_castsi128_ps(_mm_and_si128(moved, _mm_set1_epi32(static_cast<int>(0x8fffffffu))));
}
constexpr float kWidened = 5.192296858534828e33f;  // 2^112: what a widened half lacks
#endif

// Weights as floats, one or four.
inline float in_full(std::uint16_t weight) {
  return static_cast<float>(static_cast<int>(weight));
}
inline float in_full(float weight) {
  return weight;
}
inline __m128 four(const std::uint16_t* weights) {
  return _mm_cvtepi32_ps(
      _mm_unpacklo_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(weights)), _mm_setzero_si128()));
}
inline __m128 four(const float* weights) {
  return _mm_loadu_ps(weights);
}

// Four running sums of four channels each: entries k to k + 3 of a row go to one each. With registers of eight floats
// two sums share one, and are the same. ValueOf: two values for such a register, or one
// for half of it.
class FourSums {
 public:
#ifdef __AVX2__
  template <typename ValueOf>
  void add(__m128 weight, std::size_t k, const ValueOf& value_of) {
    const __m256 weights = _mm256_castps128_ps256(weight);
    const auto weighted = [&](__m256i lanes, __m256 values) {
      return _mm256_mul_ps(_mm256_permutevar8x32_ps(weights, lanes), values);
    };
    first_ = _mm256_add_ps(first_, weighted(_mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1), value_of.two(k)));
    second_ = _mm256_add_ps(second_, weighted(_mm256_setr_epi32(2, 2, 2, 2, 3, 3, 3, 3), value_of.two(k + 2)));
  }
  __m128 operator[](int i) const {
    const __m256 pair = i < 2 ? first_ : second_;
    return i % 2 == 0 ? _mm256_castps256_ps128(pair) : _mm256_extractf128_ps(pair, 1);
  }

 private:
  __m256 first_ = _mm256_setzero_ps(), second_ = _mm256_setzero_ps();
#else
  template <typename ValueOf>
  void add(__m128 weight, std::size_t k, const ValueOf& value_of) {
    sums_[0] = _mm_add_ps(sums_[0], _mm_mul_ps(_mm_shuffle_ps(weight, weight, 0x00), value_of.one(k)));
    sums_[1] = _mm_add_ps(sums_[1], _mm_mul_ps(_mm_shuffle_ps(weight, weight, 0x55), value_of.one(k + 1)));
    sums_[2] = _mm_add_ps(sums_[2], _mm_mul_ps(_mm_shuffle_ps(weight, weight, 0xaa), value_of.one(k + 2)));
    sums_[3] = _mm_add_ps(sums_[3], _mm_mul_ps(_mm_shuffle_ps(weight, weight, 0xff), value_of.one(k + 3)));
  }
  __m128 operator[](int i) const {
    return sums_[i];
  }

 private:
  __m128 sums_[4] = {_mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps()};
#endif
};

// The values of the entries of rows: halves, or single floats.
template <typename Column>
struct HalvesOf {
  const Column* column;
  const std::uint16_t* half;
  const std::uint16_t* at(std::size_t k) const { return half + 4 * static_cast<std::size_t>(column[k]); }
  __m128 one(std::size_t k) const { return widened(at(k)); }
#ifdef __AVX2__
  __m256 two(std::size_t k) const {
    return _mm256_cvtph_ps(_mm_unpacklo_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at(k))),
                                              _mm_loadl_epi64(reinterpret_cast<const __m128i*>(at(k + 1)))));
  }
#endif
};
template <typename Column>
struct FloatsOf {
  const Column* column;
  const glm::vec4* value;
  __m128 one(std::size_t k) const { return _mm_loadu_ps(&value[column[k]].x); }
#ifdef __AVX2__
  __m256 two(std::size_t k) const {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(one(k)), one(k + 1), 1);
  }
#endif
};

template <typename Weight, typename ValueOf>
glm::vec4 weighted_sum(const Weight* weights, std::size_t k, std::size_t end, const ValueOf& value_of) {
  FourSums sums;
  for (; k + 4 <= end; k += 4) sums.add(four(&weights[k]), k, value_of);
  __m128 rest[4] = {sums[0], sums[1], sums[2], sums[3]};
  for (std::size_t lane = 0; k < end; ++k, ++lane)
    rest[lane] = _mm_add_ps(rest[lane], _mm_mul_ps(_mm_set1_ps(in_full(weights[k])), value_of.one(k)));
  glm::vec4 sum;
  _mm_storeu_ps(&sum.x, _mm_add_ps(_mm_add_ps(rest[0], rest[1]), _mm_add_ps(rest[2], rest[3])));
  return sum;
}

// The same for one channel.
template <typename Weight, typename ValueOf>
float weighted_sum_grey(const Weight* weights, std::size_t k, std::size_t end, const ValueOf& value_of) {
  float sums[4] = {0, 0, 0, 0};
  for (; k + 4 <= end; k += 4)
    for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] += in_full(weights[k + lane]) * value_of(k + lane);
  for (std::size_t lane = 0; k < end; ++k, ++lane) sums[lane] += in_full(weights[k]) * value_of(k);
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

// Calls body(columns) with the columns as they are stored.
template <typename Body>
auto with_columns(const CompactColumns& columns, const Body& body) {
  return columns.are_short ? body(columns.short_column.data()) : body(columns.column.data());
}

}  // namespace

// A power of two, so that it changes no rounding.
void HalfColours::choose_unit(float most) {
  if (most > 0) unit_ = std::ldexp(1.f, std::ilogb(most) - kLargest);
}

HalfColours::HalfColours(const std::vector<glm::vec4>& colours) : half_(4 * colours.size()) {
  const float* const values = reinterpret_cast<const float*>(colours.data());
  choose_unit(largest_size(values, half_.size()));
  put_halves<4>(values, 1 / unit_, half_);
}

HalfColours::HalfColours(const std::vector<float>& greys) : half_(greys.size()), is_grey_(true) {
  choose_unit(largest_size(greys.data(), greys.size()));
  put_halves<1>(greys.data(), 1 / unit_, half_);
}

CompactColumns::CompactColumns(const SparseRows& rows) : begin(rows.begin) {
  int last = 0;
  for (const Share& share : rows.entries) last = std::max(last, share.index);
  are_short = last <= std::numeric_limits<std::uint16_t>::max();
  for (const Share& share : rows.entries)
    if (are_short)
      short_column.push_back(static_cast<std::uint16_t>(share.index));
    else
      column.push_back(static_cast<std::uint32_t>(share.index));
}

ExactRows::ExactRows(const SparseRows& rows) : columns_(rows) {
  for (const Share& share : rows.entries) weight_.push_back(share.weight);
}

glm::vec4 ExactRows::dot(std::size_t row, const std::vector<glm::vec4>& values) const {
  return with_columns(columns_, [&](const auto* column) {
    return weighted_sum(weight_.data(), columns_.begin[row], columns_.begin[row + 1],
                        FloatsOf<std::decay_t<decltype(*column)>>{column, values.data()});
  });
}

float ExactRows::dot(std::size_t row, const std::vector<float>& values) const {
  return with_columns(columns_, [&](const auto* column) {
    return weighted_sum_grey(weight_.data(), columns_.begin[row], columns_.begin[row + 1],
                             [&](std::size_t k) { return values[column[k]]; });
  });
}

CompactRows::CompactRows(const SparseRows& rows) : columns_(rows) {
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
}

glm::vec3 CompactRows::dot(std::size_t row, const HalfColours& values) const {
  const std::size_t begin = columns_.begin[row], end = columns_.begin[row + 1];
  const std::uint16_t* half = values.half_.data();
  const glm::vec3 sum = with_columns(columns_, [&](const auto* column) {
    if (values.is_grey_)
      return glm::vec3(
          weighted_sum_grey(weight_.data(), begin, end, [&](std::size_t k) { return widened(half[column[k]]); }));
    return glm::vec3(weighted_sum(weight_.data(), begin, end, HalvesOf<std::decay_t<decltype(*column)>>{column, half}));
  });
  return unit_[row] * values.unit_ * kWidened * sum;
}

}  // namespace transom
