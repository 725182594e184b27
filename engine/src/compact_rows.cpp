#include "transom/compact_rows.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace transom {
namespace {

constexpr int kShift = 13;                    // bits of a float's mantissa that a half has not
constexpr std::uint32_t kBias = 112u << 23;   // of the exponent of a float against that of a half
constexpr std::uint32_t kLeast = 113u << 23;  // 2^-14: below it a half is 0
constexpr int kLargest = 14;                  // exponent of the largest value
constexpr std::uint32_t kGoldenRatio = 5063;  // of 2^13: multiples of it are spread evenly

// Rounds up or down, so that many equal values have their mean: `number` tells them apart.
std::uint16_t half_of(float value, std::size_t number) {
  const auto bits = std::bit_cast<std::uint32_t>(value), size = bits & 0x7fffffffu;
  const std::uint32_t threshold = static_cast<std::uint32_t>(number) * kGoldenRatio & ((1u << kShift) - 1);
  if (size < kLeast) return 0;
  return static_cast<std::uint16_t>((bits >> 16 & 0x8000u) | (size - kBias + threshold) >> kShift);
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

// Four whole numbers as floats.
inline __m128 counted(const std::uint16_t* numbers) {
  return _mm_cvtepi32_ps(
      _mm_unpacklo_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(numbers)), _mm_setzero_si128()));
}

}  // namespace

// A power of two, so that it changes no rounding.
void HalfColours::choose_unit(float most) {
  if (most > 0) unit_ = std::ldexp(1.f, std::ilogb(most) - kLargest);
}

HalfColours::HalfColours(const std::vector<glm::vec4>& colours, bool is_grey) : is_grey_(is_grey) {
  float most = 0;
  for (const glm::vec4& colour : colours)
    most = std::max({most, std::abs(colour.x), std::abs(colour.y), std::abs(colour.z)});
  choose_unit(most);
  const float scale = 1 / unit_;
  const int channels = is_grey ? 1 : 4;
  half_.resize(colours.size() * static_cast<std::size_t>(channels));
  for (std::size_t i = 0, k = 0; i < colours.size(); ++i)
    for (int channel = 0; channel < channels; ++channel, ++k) half_[k] = half_of(scale * colours[i][channel], i);
}

HalfColours::HalfColours(const std::vector<float>& greys) : half_(greys.size()), is_grey_(true) {
  float most = 0;
  for (const float grey : greys) most = std::max(most, std::abs(grey));
  choose_unit(most);
  const float scale = 1 / unit_;
  for (std::size_t i = 0; i < greys.size(); ++i) half_[i] = half_of(scale * greys[i], i);
}

CompactRows::CompactRows(const SparseRows& rows) : begin_(rows.begin) {
  int last_column = 0;
  for (const Share& share : rows.entries) last_column = std::max(last_column, share.index);
  has_short_columns_ = last_column <= std::numeric_limits<std::uint16_t>::max();
  for (std::size_t row = 0; row < rows.row_count(); ++row) {
    float most = 0;
    for (std::size_t k = begin_[row]; k < begin_[row + 1]; ++k) most = std::max(most, rows.entries[k].weight);
    unit_.push_back(most > 0 ? most / std::numeric_limits<std::uint16_t>::max() : 1.f);
    for (std::size_t k = begin_[row]; k < begin_[row + 1]; ++k) {
      const Share& share = rows.entries[k];
      if (has_short_columns_)
        short_column_.push_back(static_cast<std::uint16_t>(share.index));
      else
        column_.push_back(static_cast<std::uint32_t>(share.index));
      weight_.push_back(static_cast<std::uint16_t>(std::lround(share.weight / unit_.back())));
    }
  }
}

template <typename Column>
float CompactRows::grey(std::size_t row, const std::vector<Column>& column, const HalfColours& values) const {
  float sums[4] = {0, 0, 0, 0};
  const std::size_t end = begin_[row + 1];
  const auto term = [&](std::size_t i) {
    return static_cast<float>(static_cast<int>(weight_[i])) * widened(values.half_[column[i]]);
  };
  std::size_t k = begin_[row];
  for (; k + 4 <= end; k += 4)
    for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] += term(k + lane);
  for (std::size_t lane = 0; k < end; ++k, ++lane) sums[lane] += term(k);
  return kWidened * ((sums[0] + sums[1]) + (sums[2] + sums[3]));
}

template <typename Column>
glm::vec3 CompactRows::colour(std::size_t row, const std::vector<Column>& column, const HalfColours& values) const {
  const std::uint16_t* half = values.half_.data();
  __m128 sums[4] = {_mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps()};
  const std::size_t end = begin_[row + 1];
  const auto term = [&](std::size_t i, __m128 weight) {
    return _mm_mul_ps(weight, widened(half + 4 * static_cast<std::size_t>(column[i])));
  };
  std::size_t k = begin_[row];
  for (; k + 4 <= end; k += 4) {
    const __m128 weight = counted(&weight_[k]);
    sums[0] = _mm_add_ps(sums[0], term(k, _mm_shuffle_ps(weight, weight, 0x00)));
    sums[1] = _mm_add_ps(sums[1], term(k + 1, _mm_shuffle_ps(weight, weight, 0x55)));
    sums[2] = _mm_add_ps(sums[2], term(k + 2, _mm_shuffle_ps(weight, weight, 0xaa)));
    sums[3] = _mm_add_ps(sums[3], term(k + 3, _mm_shuffle_ps(weight, weight, 0xff)));
  }
  for (std::size_t lane = 0; k < end; ++k, ++lane)
    sums[lane] = _mm_add_ps(sums[lane], term(k, _mm_set1_ps(static_cast<float>(static_cast<int>(weight_[k])))));
  alignas(16) float sum[4];
  _mm_store_ps(sum, _mm_add_ps(_mm_add_ps(sums[0], sums[1]), _mm_add_ps(sums[2], sums[3])));
  return kWidened * glm::vec3(sum[0], sum[1], sum[2]);
}

template float CompactRows::grey(std::size_t, const std::vector<std::uint16_t>&, const HalfColours&) const;
template float CompactRows::grey(std::size_t, const std::vector<std::uint32_t>&, const HalfColours&) const;
template glm::vec3 CompactRows::colour(std::size_t, const std::vector<std::uint16_t>&, const HalfColours&) const;
template glm::vec3 CompactRows::colour(std::size_t, const std::vector<std::uint32_t>&, const HalfColours&) const;

}  // namespace transom
