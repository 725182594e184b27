/// @file Sparse rows in half the memory, for sums over many of them: memory is what these wait for.
#pragma once

#include <emmintrin.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <vector>

#include "transom/transfer.h"

namespace transom {

/// The upper half of a float: 8 bits of precision, the whole range.
struct Half {
  std::uint16_t bits = 0;
  Half() = default;
  /// Rounds up or down, so that many equal values have their mean: `number` tells them apart.
  Half(float value, std::size_t number) {
    constexpr std::uint32_t kGoldenRatio = 40503;  // of 2^16: consecutive numbers are spread evenly
    const std::uint32_t threshold = static_cast<std::uint32_t>(number) * kGoldenRatio & 0xffffu;
    bits = static_cast<std::uint16_t>((std::bit_cast<std::uint32_t>(value) + threshold) >> 16);
  }
  explicit operator float() const { return std::bit_cast<float>(static_cast<std::uint32_t>(bits) << 16); }
};

/// Values for the columns of compact rows. One channel for grey light, else three and a blank.
struct HalfColours {
  std::vector<Half> value;
  bool is_grey = false;

  HalfColours(const std::vector<glm::vec4>& colours, bool grey)
      : value(colours.size() * (grey ? 1 : 4)), is_grey(grey) {
    const int channels = grey ? 1 : 4;
    for (std::size_t i = 0; i < colours.size(); ++i)
      for (int channel = 0; channel < channels; ++channel)
        value[i * static_cast<std::size_t>(channels) + static_cast<std::size_t>(channel)] =
            Half(colours[i][channel], i);
  }
  explicit HalfColours(const std::vector<glm::vec4>& colours) : HalfColours(colours, false) {}
  explicit HalfColours(const std::vector<float>& greys) : value(greys.size()), is_grey(true) {
    for (std::size_t i = 0; i < greys.size(); ++i) value[i] = Half(greys[i], i);
  }
};

/// Compressed sparse rows whose weights are halves, each off by up to 1/128, and by nothing on the mean: a sum over
/// some hundred of them by a few 1e-4 of itself. Columns take two bytes each where these suffice.
class CompactRows {
 public:
  CompactRows() = default;
  explicit CompactRows(const SparseRows& rows) : begin_(rows.begin) {
    int most = 0;
    for (const Share& share : rows.entries) most = std::max(most, share.index);
    has_short_columns_ = most <= std::numeric_limits<std::uint16_t>::max();
    for (const Share& share : rows.entries) {
      if (has_short_columns_)
        short_column_.push_back(static_cast<std::uint16_t>(share.index));
      else
        column_.push_back(static_cast<std::uint32_t>(share.index));
      weight_.emplace_back(share.weight, weight_.size());
    }
  }

  std::size_t row_count() const { return begin_.size() - 1; }

  /// Sum over a row of weight x value; every fourth entry goes to the same of four sums.
  glm::vec3 dot(std::size_t row, const HalfColours& values) const {
    if (values.is_grey)
      return glm::vec3(has_short_columns_ ? dot_grey(row, short_column_, values) : dot_grey(row, column_, values));
    return has_short_columns_ ? dot_colour(row, short_column_, values) : dot_colour(row, column_, values);
  }

 private:
  // Four halves as floats.
  static __m128 widen(const Half* halves) {
    return _mm_castsi128_ps(
        _mm_unpacklo_epi16(_mm_setzero_si128(), _mm_loadl_epi64(reinterpret_cast<const __m128i*>(halves))));
  }

  template <typename Column>
  float dot_grey(std::size_t row, const std::vector<Column>& column, const HalfColours& values) const {
    float sums[4] = {0, 0, 0, 0};
    const std::size_t end = begin_[row + 1];
    const auto term = [&](std::size_t i) {
      return static_cast<float>(weight_[i]) * static_cast<float>(values.value[column[i]]);
    };
    std::size_t k = begin_[row];
    for (; k + 4 <= end; k += 4)
      for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] += term(k + lane);
    for (std::size_t lane = 0; k < end; ++k, ++lane) sums[lane] += term(k);
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }

  template <typename Column>
  glm::vec3 dot_colour(std::size_t row, const std::vector<Column>& column, const HalfColours& values) const {
    const Half* value = values.value.data();
    __m128 sums[4] = {_mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps()};
    const std::size_t end = begin_[row + 1];
    const auto term = [&](std::size_t i, __m128 weight) {
      return _mm_mul_ps(weight, widen(value + 4 * static_cast<std::size_t>(column[i])));
    };
    std::size_t k = begin_[row];
    for (; k + 4 <= end; k += 4) {
      const __m128 weight = widen(&weight_[k]);
      sums[0] = _mm_add_ps(sums[0], term(k, _mm_shuffle_ps(weight, weight, 0x00)));
      sums[1] = _mm_add_ps(sums[1], term(k + 1, _mm_shuffle_ps(weight, weight, 0x55)));
      sums[2] = _mm_add_ps(sums[2], term(k + 2, _mm_shuffle_ps(weight, weight, 0xaa)));
      sums[3] = _mm_add_ps(sums[3], term(k + 3, _mm_shuffle_ps(weight, weight, 0xff)));
    }
    for (std::size_t lane = 0; k < end; ++k, ++lane)
      sums[lane] = _mm_add_ps(sums[lane], term(k, _mm_set1_ps(static_cast<float>(weight_[k]))));
    alignas(16) float sum[4];
    _mm_store_ps(sum, _mm_add_ps(_mm_add_ps(sums[0], sums[1]), _mm_add_ps(sums[2], sums[3])));
    return {sum[0], sum[1], sum[2]};
  }

  bool has_short_columns_ = true;
  std::vector<std::size_t> begin_{0};
  std::vector<std::uint16_t> short_column_;
  std::vector<std::uint32_t> column_;
  std::vector<Half> weight_;
};

}  // namespace transom
