/// @file Sparse rows in less memory, for sums over many of them: memory is what these wait for.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "transom/transfer.h"

namespace transom {

/// Values for the columns of compact rows: 11 bits of precision from the largest down to 2^-28 of it; smaller ones are
/// 0. One channel for grey light, else three and a blank, which is 0.
class HalfColours {
 public:
  explicit HalfColours(const std::vector<glm::vec4>& colours);
  explicit HalfColours(const std::vector<float>& greys);

 private:
  friend class CompactRows;
  void choose_unit(float most);

  std::vector<std::uint16_t> half_;  // sign, 5 bits of exponent, 10 of mantissa
  bool is_grey_ = false;
  float unit_ = 1;  // a power of two: what 1 of a half stands for
};

/// Where the entries of sparse rows are: columns take two bytes each where these suffice.
struct CompactColumns {
  CompactColumns() = default;
  explicit CompactColumns(const SparseRows& rows);

  std::vector<std::size_t> begin{0};  ///< rows + 1
  bool are_short = true;
  std::vector<std::uint16_t> short_column;  ///< else `column`
  std::vector<std::uint32_t> column;
};

/// Compressed sparse rows of weights in full.
class ExactRows {
 public:
  ExactRows() = default;
  explicit ExactRows(const SparseRows& rows);

  /// Sum over a row of weight x value; every fourth entry goes to the same of four sums.
  glm::vec4 dot(std::size_t row, const std::vector<glm::vec4>& values) const;
  float dot(std::size_t row, const std::vector<float>& values) const;

 private:
  CompactColumns columns_;
  std::vector<float> weight_;
};

/// Compressed sparse rows of weights that are not negative, each off by up to 1/131070 of the largest of its row; the
/// sum of a row is kept. With values of halves a sum of some hundred is off by a few 1e-5 of itself.
class CompactRows {
 public:
  CompactRows() = default;
  explicit CompactRows(const SparseRows& rows);

  std::size_t row_count() const { return columns_.begin.size() - 1; }

  /// Sum over a row of weight x value; every fourth entry goes to the same of four sums.
  glm::vec3 dot(std::size_t row, const HalfColours& values) const;

 private:
  CompactColumns columns_;
  std::vector<std::uint16_t> weight_;
  std::vector<float> unit_;  // by row: what 1 of a weight stands for
};

}  // namespace transom
