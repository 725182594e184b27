/// @file Sparse rows for sums over many of them: in less memory, eight entries at once.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "transom/transfer.h"

namespace transom {

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

  std::size_t row_count() const { return columns_.begin.size() - 1; }
  std::vector<Share> row(std::size_t i) const;

  /// Sum over a row of weight x value; every eighth entry goes to the same of eight sums. Values are finite.
  glm::vec4 dot(std::size_t row, const std::vector<glm::vec4>& values) const;
  float dot(std::size_t row, const std::vector<float>& values) const;

 private:
  CompactColumns columns_;
  std::vector<float> weight_;
};

/// Compressed sparse rows of weights that are not negative, each rounded by up to 1/131070 of the largest of its row;
/// then the row is scaled to the sum that it had. A sum of some hundred is off by a few 1e-5 of itself.
class CompactRows {
 public:
  CompactRows() = default;
  explicit CompactRows(const SparseRows& rows);

  std::size_t row_count() const { return columns_.begin.size() - 1; }

  /// Sum over a row of weight x value; every eighth entry goes to the same of eight sums. Values are finite.
  glm::vec4 dot(std::size_t row, const std::vector<glm::vec4>& values) const;
  float dot(std::size_t row, const std::vector<float>& values) const;

 private:
  CompactColumns columns_;
  std::vector<std::uint16_t> weight_;
  std::vector<float> unit_;  // by row: what 1 of a weight stands for
};

}  // namespace transom
