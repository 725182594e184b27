#include "transom/transfer.h"

#include <algorithm>
#include <cmath>

#include "transom/parallel.h"

namespace transom {
namespace {

// A trace of exchange of each patch with itself. It makes the scaling possible for every scene (the matrix then has
// total support), and takes up what a patch in a gap cannot give to others.
constexpr float kSelfShare = 1e-5f;

constexpr int kMaximumScalings = 100;
constexpr int kPlainScalings = 12;  // before Newton's method, which is costly where it is far from the solution
constexpr std::size_t kGrain = 64;  // rows at once
constexpr double kRowSumTolerance = 1e-7;
constexpr double kLargestStep = 3.0;  // of a logarithm of a scale: those of patches in gaps are far off at first
constexpr int kMaximumGradientSteps = 300;
constexpr double kGradientTolerance = 1e-3;  // relative: Newton's method needs no more,
constexpr double kFarTolerance = 0.1;        // and this where its steps are long
constexpr double kFarRowSum = 1e-3;

constexpr std::size_t kRowsAtOnce = 64;

// Row i of the mean of both estimates; their difference and sum are added up for the defect.
void average_row(std::size_t i, const SparseRows& exchange, const SparseRows& reverse, const std::vector<float>& areas,
                 std::vector<Share>& row, double& difference, double& sum) {
  const auto own = static_cast<int>(i);
  std::size_t a = exchange.begin[i], b = reverse.begin[i];
  bool has_itself = a == exchange.begin[i + 1] && b == reverse.begin[i + 1];  // rows without entries stay empty
  while (a < exchange.begin[i + 1] || b < reverse.begin[i + 1] || !has_itself) {
    const int forth_index = a < exchange.begin[i + 1] ? exchange.entries[a].index : INT32_MAX,
              back_index = b < reverse.begin[i + 1] ? reverse.entries[b].index : INT32_MAX;
    const int index = std::min({forth_index, back_index, has_itself ? INT32_MAX : own});
    const float forth = forth_index == index ? exchange.entries[a++].weight : 0;
    const float back = back_index == index ? reverse.entries[b++].weight : 0;
    difference += std::abs(static_cast<double>(forth) - back);
    const float both = areas[i] + areas[index];
    float mean = areas[index] / both * forth + areas[i] / both * back;  // the same number from either side
    sum += mean;
    if (index == own) {
      mean += kSelfShare * areas[i];
      has_itself = true;
    }
    row.push_back({index, mean});
  }
}

// One A_i F_ij for every pair that either patch has seen. With equal numbers of rays a patch, the variance of its
// estimate is in proportion to its area: the smaller patch, whose rays are denser, has the larger say.
SparseRows average_both_ways(const SparseRows& exchange, const std::vector<float>& areas, double& defect) {
  const SparseRows reverse = transposed(exchange);
  const std::size_t n = exchange.row_count(), chunk_count = (n + kRowsAtOnce - 1) / kRowsAtOnce;
  struct Chunk {
    std::vector<Share> entries;
    std::vector<std::size_t> ends;
    double difference = 0, sum = 0;
  };
  std::vector<Chunk> chunks(chunk_count);
  parallel_indices(chunk_count, 1, [&](std::size_t c) {
    Chunk& chunk = chunks[c];
    for (std::size_t i = c * kRowsAtOnce; i < std::min(n, (c + 1) * kRowsAtOnce); ++i) {
      average_row(i, exchange, reverse, areas, chunk.entries, chunk.difference, chunk.sum);
      chunk.ends.push_back(chunk.entries.size());
    }
  });
  SparseRows result;
  double difference = 0, sum = 0;
  for (const Chunk& chunk : chunks) {
    const std::size_t base = result.begin.back();
    for (const std::size_t end : chunk.ends) result.begin.push_back(base + end);
    difference += chunk.difference;
    sum += chunk.sum;
  }
  result.entries.resize(result.begin.back());
  parallel_indices(chunk_count, 1, [&](std::size_t c) {
    std::copy(chunks[c].entries.begin(), chunks[c].entries.end(),
              result.entries.begin() + static_cast<std::ptrdiff_t>(result.begin[c * kRowsAtOnce]));
  });
  defect = sum > 0 ? difference / sum : 0;
  return result;
}

// Row i times x, in four sums that do not wait for each other.
double row_product(const SparseRows& rows, std::size_t i, const std::vector<double>& x) {
  const Share *entry = rows.entries.data() + rows.begin[i], *last = rows.entries.data() + rows.begin[i + 1];
  const auto term = [&](int k) { return static_cast<double>(entry[k].weight) * x[entry[k].index]; };
  double sum[4]{};
  for (; last - entry >= 4; entry += 4)
    for (int k = 0; k < 4; ++k) sum[k] += term(k);
  for (; entry != last; ++entry) sum[0] += term(0);
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// Conjugate gradients with the diagonal as preconditioner, for a positive (semi-)definite operator.
template <typename Operator>
void solve_positive_definite(const Operator& apply, const std::vector<double>& diagonal,
                             const std::vector<double>& right, double tolerance, std::vector<double>& x) {
  const std::size_t n = right.size();
  std::vector<double> r = right, z(n), p(n), q(n);
  std::fill(x.begin(), x.end(), 0.0);
  const auto precondition = [&] {
    double product = 0;
    for (std::size_t i = 0; i < n; ++i) {
      z[i] = diagonal[i] > 0 ? r[i] / diagonal[i] : 0;
      product += r[i] * z[i];
    }
    return product;
  };
  double rho = precondition();
  const double target = tolerance * tolerance * rho;
  p = z;
  for (int step = 0; step < kMaximumGradientSteps && rho > target; ++step) {
    apply(p, q);
    double curvature = 0;
    for (std::size_t i = 0; i < n; ++i) curvature += p[i] * q[i];
    if (!(curvature > 0)) return;
    const double alpha = rho / curvature;
    for (std::size_t i = 0; i < n; ++i) {
      x[i] += alpha * p[i];
      r[i] -= alpha * q[i];
    }
    const double next = precondition(), beta = next / rho;
    rho = next;
    for (std::size_t i = 0; i < n; ++i) p[i] = z[i] + beta * p[i];
  }
}

// F_ij = d_i S_ij d_j / A_i. Returns the largest |A_i F_ij - A_j F_ji| / max(A_i, A_j): S is symmetric and each product
// is taken in the same order both ways, so that only the rounding of F itself is left.
double scale_both_ways(SparseRows& exchange, const std::vector<double>& scale, const std::vector<float>& areas) {
  const std::size_t n = exchange.row_count();
  std::vector<double> worst(n, 0.0);
  parallel_indices(n, kGrain, [&](std::size_t i) {
    for (std::size_t k = exchange.begin[i]; k < exchange.begin[i + 1]; ++k) {
      Share& entry = exchange.entries[k];
      const double shared = entry.weight * (scale[i] * scale[entry.index]);
      const auto forth = static_cast<float>(shared / areas[i]), back = static_cast<float>(shared / areas[entry.index]);
      worst[i] = std::max(
          worst[i], std::abs(static_cast<double>(areas[i]) * forth - static_cast<double>(areas[entry.index]) * back) /
                        std::max(areas[i], areas[entry.index]));
      entry.weight = forth;
    }
  });
  return n > 0 ? *std::max_element(worst.begin(), worst.end()) : 0;
}

}  // namespace

SparseRows transposed(const SparseRows& rows) {
  SparseRows result;
  const std::size_t n = rows.row_count();
  std::vector<std::size_t> count(n + 1, 0);
  for (const Share& s : rows.entries) ++count[s.index + 1];
  for (std::size_t i = 0; i < n; ++i) count[i + 1] += count[i];
  result.begin = count;
  result.entries.resize(rows.entries.size());
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = rows.begin[i]; k < rows.begin[i + 1]; ++k)
      result.entries[count[rows.entries[k].index]++] = {static_cast<int>(i), rows.entries[k].weight};
  return result;
}

TransferDefects make_reciprocal(SparseRows& form_factors, const std::vector<float>& areas,
                                const std::vector<float>& row_sums) {
  TransferDefects defects;
  const std::size_t n = form_factors.row_count();
  parallel_indices(n, kGrain, [&](std::size_t i) {
    for (std::size_t k = form_factors.begin[i]; k < form_factors.begin[i + 1]; ++k)
      form_factors.entries[k].weight *= areas[i];
  });
  SparseRows exchange = average_both_ways(form_factors, areas, defects.raw_reciprocity);

  std::vector<double> scale(n, 1.0), sum(n, 0.0), residual(n), step(n), scaled(n);
  const auto worst_row_sum = [&] {
    double worst = 0;
    parallel_indices(n, kGrain, [&](std::size_t i) { sum[i] = scale[i] * row_product(exchange, i, scale); });
    for (std::size_t i = 0; i < n; ++i) {
      residual[i] = sum[i] > 0 ? areas[i] * static_cast<double>(row_sums[i]) - sum[i] : 0;
      if (sum[i] > 0) worst = std::max(worst, std::abs(residual[i]) / areas[i]);
    }
    return worst;
  };
  defects.raw_row_sum = defects.row_sum = worst_row_sum();
  for (int k = 0; k < kPlainScalings && defects.row_sum > kRowSumTolerance; ++k) {
    for (std::size_t i = 0; i < n; ++i)
      if (sum[i] > 0) scale[i] *= std::sqrt(areas[i] * static_cast<double>(row_sums[i]) / sum[i]);
    defects.row_sum = worst_row_sum();
  }
  for (; defects.row_sum > kRowSumTolerance && defects.iterations < kMaximumScalings; ++defects.iterations) {
    // Newton's step for the logarithms of the scales: (diag(sum) + D S D) step = residual, by conjugate gradients.
    solve_positive_definite(
        [&](const std::vector<double>& x, std::vector<double>& y) {
          for (std::size_t i = 0; i < n; ++i) scaled[i] = scale[i] * x[i];
          parallel_indices(n, kGrain, [&](std::size_t i) {
            y[i] = sum[i] > 0 ? sum[i] * x[i] + scale[i] * row_product(exchange, i, scaled) : x[i];
          });
        },
        sum, residual, defects.row_sum > kFarRowSum ? kFarTolerance : kGradientTolerance, step);
    for (std::size_t i = 0; i < n; ++i) scale[i] *= std::exp(std::clamp(step[i], -kLargestStep, kLargestStep));
    defects.row_sum = worst_row_sum();
  }

  defects.reciprocity = scale_both_ways(exchange, scale, areas);
  form_factors = std::move(exchange);
  return defects;
}

SparseRows sent_unevenly(const SparseRows& form_factors, const std::vector<std::vector<Share>>& seen) {
  SparseRows sent = form_factors;
  parallel_indices(sent.row_count(), kGrain, [&](std::size_t i) {
    double before = 0, after = 0;
    auto next = seen[i].begin();
    for (std::size_t k = sent.begin[i]; k < sent.begin[i + 1]; ++k) {
      Share& share = sent.entries[k];
      before += share.weight;
      while (next != seen[i].end() && next->index < share.index) ++next;
      if (next != seen[i].end() && next->index == share.index) share.weight *= next->weight;
      after += share.weight;
    }
    const float scale = after > 0 ? static_cast<float>(before / after) : 1.f;
    for (std::size_t k = sent.begin[i]; k < sent.begin[i + 1]; ++k) sent.entries[k].weight *= scale;
  });
  return sent;
}

}  // namespace transom
