/// @file Sparse rows of weights, and form factors made reciprocal and closed.
#pragma once

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

/// Shares of what patches send that reach each other, by sender, where patches do not send evenly: form factors times
/// what is seen of the sender's radiosity, relative to its mean. seen: by sender, sorted by the patch that sees it; 1
/// for others. Rows add up to what they do in `form_factors`: nothing is lost.
SparseRows sent_unevenly(const SparseRows& form_factors, const std::vector<std::vector<Share>>& seen);

}  // namespace transom
