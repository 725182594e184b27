/// @file Sparse rows of weights, and form factors made reciprocal and closed.
#pragma once

#include <xmmintrin.h>

#include <functional>
#include <glm/glm.hpp>
#include <vector>

#include "transom/gather.h"

namespace transom {

/// Compressed sparse rows.
struct SparseRows {
  std::vector<std::size_t> begin{0};  ///< rows + 1
  std::vector<Share> entries;

  std::size_t row_count() const { return begin.size() - 1; }
  void append(const std::vector<Share>& row) {
    entries.insert(entries.end(), row.begin(), row.end());
    begin.push_back(entries.size());
  }
  /// One row of each object, as row_of(object) has it, in no more memory than they need.
  template <typename Object, typename RowOf = std::identity>
  static SparseRows of(const std::vector<Object>& objects, RowOf row_of = {}) {
    std::size_t count = 0;
    for (const Object& object : objects) count += std::invoke(row_of, object).size();
    SparseRows rows;
    rows.begin.reserve(objects.size() + 1);
    rows.entries.reserve(count);
    for (const Object& object : objects) rows.append(std::invoke(row_of, object));
    return rows;
  }
  std::vector<Share> row(std::size_t i) const {
    return {entries.begin() + static_cast<std::ptrdiff_t>(begin[i]),
            entries.begin() + static_cast<std::ptrdiff_t>(begin[i + 1])};
  }
  /// Sum over a row of weight x values[index].
  template <typename Value>
  Value dot(std::size_t row, const std::vector<Value>& values) const {
    Value sum(0);
    for (std::size_t k = begin[row]; k < begin[row + 1]; ++k) sum += entries[k].weight * values[entries[k].index];
    return sum;
  }
  /// The same for single floats and for values of four: every fourth entry goes to the same of four sums, so that none
  /// waits for the last, and these are added at the end.
  float dot(std::size_t row, const std::vector<float>& values) const {
    return dot_of(begin[row], begin[row + 1], values);
  }
  /// Sum over entries from one to before another.
  float dot_of(std::size_t first, std::size_t end, const std::vector<float>& values) const {
    float sums[4] = {0, 0, 0, 0};
    const auto term = [&](std::size_t i) { return entries[i].weight * values[entries[i].index]; };
    std::size_t k = first;
    for (; k + 4 <= end; k += 4)
      for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] += term(k + lane);
    for (std::size_t lane = 0; k < end; ++k, ++lane) sums[lane] += term(k);
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }
  glm::vec4 dot(std::size_t row, const std::vector<glm::vec4>& values) const {
    const float* value = values.empty() ? nullptr : &values[0].x;
    __m128 sums[4] = {_mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps()};
    const std::size_t end = begin[row + 1];
    const auto term = [&](std::size_t i) {
      return _mm_mul_ps(_mm_set1_ps(entries[i].weight),
                        _mm_loadu_ps(value + 4 * static_cast<std::size_t>(entries[i].index)));
    };
    std::size_t k = begin[row];
    for (; k + 4 <= end; k += 4)
      for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] = _mm_add_ps(sums[lane], term(k + lane));
    for (std::size_t lane = 0; k < end; ++k, ++lane) sums[lane] = _mm_add_ps(sums[lane], term(k));
    glm::vec4 sum;
    _mm_storeu_ps(&sum.x, _mm_add_ps(_mm_add_ps(sums[0], sums[1]), _mm_add_ps(sums[2], sums[3])));
    return sum;
  }
};

/// Columns as rows, of square rows; entries in the order of their rows.
SparseRows transposed(const SparseRows& rows);

/// How far sampled form factors were from what form factors must be, before and after mending.
struct TransferDefects {
  double raw_reciprocity = 0;  ///< sum |A_i F_ij - A_j F_ji| / sum A_i F_ij, as sampled
  double raw_row_sum = 0;      ///< largest |sum_j F_ij - target_i| after making F reciprocal
  double row_sum = 0;          ///< the same at the end
  double reciprocity = 0;      ///< largest |A_i F_ij - A_j F_ji| / max(A_i, A_j) at the end
  int iterations = 0;
};

/// Makes sampled form factors obey A_i F_ij = A_j F_ji and sum_j F_ij = target_i.
///
/// Both estimates of A_i F_ij are averaged by the inverse of their variance, then scaled symmetrically, d_i S_ij d_j,
/// until the row sums hold [matrix balancing after Sinkhorn & Knopp 1967, by Newton's method: Knight & Ruiz 2013]. Rows
/// without entries stay empty.
TransferDefects make_reciprocal(SparseRows& form_factors, const std::vector<float>& areas,
                                const std::vector<float>& row_sums);

}  // namespace transom
