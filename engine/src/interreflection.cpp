#include "transom/interreflection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr int kLargestClusterCount = 320;
constexpr std::size_t kGrain = 128;

SparseRows sum_of(const SparseRows& a, const SparseRows& b) {
  SparseRows result;
  std::vector<Share> row;
  for (std::size_t i = 0; i < a.row_count(); ++i) {
    row.assign(a.entries.begin() + static_cast<std::ptrdiff_t>(a.begin[i]),
               a.entries.begin() + static_cast<std::ptrdiff_t>(a.begin[i + 1]));
    if (b.begin[i] != b.begin[i + 1]) {
      row.insert(row.end(), b.entries.begin() + static_cast<std::ptrdiff_t>(b.begin[i]),
                 b.entries.begin() + static_cast<std::ptrdiff_t>(b.begin[i + 1]));
      merge_shares(row);
    }
    result.append(row);
  }
  return result;
}

// 0 to 5: the axis, and its sense, that a normal is nearest to.
int main_direction(glm::vec3 n) {
  const glm::vec3 a = glm::abs(n);
  const int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
  return 2 * axis + (n[axis] < 0);
}

}  // namespace

Interreflection::Interreflection(const SparseRows& form_factors, const SparseRows& through,
                                 std::vector<glm::vec3> reflectance, std::vector<float> areas,
                                 const std::vector<PatchPlace>& places)
    : exchange_(sum_of(form_factors, through)), reflectance_(std::move(reflectance)), areas_(std::move(areas)) {
  find_clusters(places);
  find_operators();
}

// Patches in one cube of space that face about the same way. The cubes grow until the clusters are few enough.
void Interreflection::find_clusters(const std::vector<PatchPlace>& places) {
  cluster_of_.assign(places.size(), 0);
  if (places.empty()) return;
  glm::vec3 low = places[0].position, high = low;
  for (const PatchPlace& place : places) {
    low = glm::min(low, place.position);
    high = glm::max(high, place.position);
  }
  const float extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z, 1e-6f});
  for (float cube = extent / 1024;; cube *= 1.25f) {
    std::map<std::tuple<int, int, int, int>, int> number;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const glm::ivec3 cell((places[i].position - low) / cube);
      cluster_of_[i] =
          number
              .try_emplace({main_direction(places[i].normal), cell.x, cell.y, cell.z}, static_cast<int>(number.size()))
              .first->second;
    }
    cluster_count_ = static_cast<int>(number.size());
    if (cluster_count_ <= kLargestClusterCount || cube > 2 * extent) break;
  }
}

// With F_c and rho_c averaged over clusters by area: F_c (1 - rho_c F_c)^-1. One for all colours, with the least of
// their reflectances: a larger one would carry more than there is in the others, and could diverge.
void Interreflection::find_operators() {
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Index m = cluster_count_;
  cluster_area_.assign(static_cast<std::size_t>(m), 0.f);
  std::vector<glm::vec3> reflectance(static_cast<std::size_t>(m), glm::vec3(0));
  Matrix exchange = Matrix::Zero(m, m);
  for (std::size_t i = 0; i < areas_.size(); ++i) {
    cluster_area_[cluster_of_[i]] += areas_[i];
    reflectance[cluster_of_[i]] += areas_[i] * reflectance_[i];
    for (std::size_t k = exchange_.begin[i]; k < exchange_.begin[i + 1]; ++k)
      exchange(cluster_of_[i], cluster_of_[exchange_.entries[k].index]) += areas_[i] * exchange_.entries[k].weight;
  }
  for (Eigen::Index c = 0; c < m; ++c) exchange.row(c) /= std::max(cluster_area_[c], 1e-30f);
  Matrix system = Matrix::Identity(m, m);
  for (Eigen::Index c = 0; c < m; ++c) {
    const glm::vec3 rho = reflectance[c] / std::max(cluster_area_[c], 1e-30f);
    system.row(c) -= std::min({rho.x, rho.y, rho.z}) * exchange.row(c);
  }
  const Matrix solved = exchange * system.partialPivLu().inverse();
  operator_.assign(solved.data(), solved.data() + solved.size());
  // A room that loses nothing has no such operator: then the patches go on alone.
  if (!std::all_of(operator_.begin(), operator_.end(), [](float value) { return std::isfinite(value); }))
    operator_.assign(operator_.size(), 0.f);
}

int Interreflection::solve(const std::vector<glm::vec3>& emitted, const std::vector<glm::vec3>& direct,
                           double tolerance, int maximum_cycles, std::vector<glm::vec3>& irradiance,
                           const AfterCycle& after_cycle) const {
  const std::size_t n = areas_.size(), m = static_cast<std::size_t>(cluster_count_);
  std::vector<glm::vec4> radiosity(n), next(n);
  for (std::size_t i = 0; i < n; ++i) radiosity[i] = glm::vec4(emitted[i] + reflectance_[i] * direct[i], 0);
  irradiance = direct;
  std::vector<glm::vec4> left(m), carried(m);
  for (int cycle = 1; cycle <= maximum_cycles; ++cycle) {
    parallel_indices(n, kGrain, [&](std::size_t i) {
      irradiance[i] = direct[i] + glm::vec3(exchange_.dot(i, radiosity));
      next[i] = glm::vec4(emitted[i] + reflectance_[i] * irradiance[i], 0);
    });
    double change = 0, total = 0;
    std::fill(left.begin(), left.end(), glm::vec4(0));
    for (std::size_t i = 0; i < n; ++i) {
      const glm::vec4 difference = next[i] - radiosity[i];
      left[cluster_of_[i]] += areas_[i] * difference;
      change += areas_[i] * (std::abs(difference.x) + std::abs(difference.y) + std::abs(difference.z));
      total += areas_[i] * (next[i].x + next[i].y + next[i].z);
    }
    if (!(change > tolerance * total)) return cycle;
    if (after_cycle && !after_cycle(cycle, irradiance)) return 0;
    for (std::size_t c = 0; c < m; ++c) left[c] /= std::max(cluster_area_[c], 1e-30f);
    parallel_indices(m, 32, [&](std::size_t c) {
      glm::vec4 sum(0);
      for (std::size_t k = 0; k < m; ++k) sum += operator_[c * m + k] * left[k];
      carried[c] = sum;
    });
    for (std::size_t i = 0; i < n; ++i)
      radiosity[i] = next[i] + glm::vec4(reflectance_[i], 0) * carried[cluster_of_[i]];
  }
  throw std::runtime_error("interreflection has not converged: is the room closed and almost perfectly white?");
}

}  // namespace transom
