#include "transom/interreflection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <stdexcept>
#include <tuple>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr int kLargestClusterCount = 320;
constexpr std::size_t kGrain = 128;
constexpr float kNearShare = 4e-3f;  // form factors from here on stay for themselves in the likeness
constexpr int kInnerCycles = 2;      // with the likeness: they leave about as much as it is wrong by
constexpr std::size_t kLanes = 8;    // sums side by side, of the products of a dense row

// Sums side by side: vectors as GCC and Clang have them, whatever the instruction set.
using Lanes = float __attribute__((vector_size(sizeof(float) * kLanes)));
using Integers = int __attribute__((vector_size(sizeof(int) * kLanes)));
using Counts = std::uint16_t __attribute__((vector_size(sizeof(std::uint16_t) * kLanes)));

template <typename Vector, typename Scalar>
__attribute__((always_inline)) inline Vector load(const Scalar* from) {
  Vector vector;
  std::memcpy(&vector, from, sizeof(vector));
  return vector;
}

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
  find_likeness();
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
  cluster_reflectance_.assign(static_cast<std::size_t>(m), glm::vec3(0));
  Matrix exchange = Matrix::Zero(m, m);
  for (std::size_t i = 0; i < areas_.size(); ++i) {
    cluster_area_[cluster_of_[i]] += areas_[i];
    cluster_reflectance_[cluster_of_[i]] += areas_[i] * reflectance_[i];
    for (std::size_t k = exchange_.begin[i]; k < exchange_.begin[i + 1]; ++k)
      exchange(cluster_of_[i], cluster_of_[exchange_.entries[k].index]) += areas_[i] * exchange_.entries[k].weight;
  }
  for (Eigen::Index c = 0; c < m; ++c) exchange.row(c) /= std::max(cluster_area_[c], 1e-30f);
  Matrix system = Matrix::Identity(m, m);
  for (Eigen::Index c = 0; c < m; ++c) {
    cluster_reflectance_[c] /= std::max(cluster_area_[c], 1e-30f);
    const glm::vec3 rho = cluster_reflectance_[c];
    system.row(c) -= std::min({rho.x, rho.y, rho.z}) * exchange.row(c);
  }
  const Matrix solved = exchange * system.partialPivLu().inverse();
  operator_.assign(solved.data(), solved.data() + solved.size());
  // A room that loses nothing has no such operator: then the patches go on alone.
  if (!std::all_of(operator_.begin(), operator_.end(), [](float value) { return std::isfinite(value); }))
    operator_.assign(operator_.size(), 0.f);
}

void Interreflection::find_likeness() {
  const std::size_t n = areas_.size();
  far_stride_ = (static_cast<std::size_t>(cluster_count_) + kLanes - 1) / kLanes * kLanes;
  far_.assign(n * far_stride_, 0);
  far_scale_.assign(n, 0);
  std::vector<std::vector<Share>> near(n);
  parallel_indices(n, kGrain, [&](std::size_t i) {
    std::vector<float> far(far_stride_, 0.f);
    for (std::size_t k = exchange_.begin[i]; k < exchange_.begin[i + 1]; ++k) {
      const Share& share = exchange_.entries[k];
      if (share.weight >= kNearShare)
        near[i].push_back(share);
      else
        far[static_cast<std::size_t>(cluster_of_[share.index])] += share.weight;
    }
    const float most = *std::max_element(far.begin(), far.end());
    if (!(most > 0)) return;
    far_scale_[i] = most / 65535;
    for (std::size_t c = 0; c < far_stride_; ++c)
      far_[i * far_stride_ + c] = static_cast<std::uint16_t>(std::lround(far[c] / far_scale_[i]));
  });
  for (const std::vector<Share>& row : near) near_.append(row);
}

void Interreflection::cluster_means(const std::vector<glm::vec4>& values, std::vector<glm::vec4>& means) const {
  means.assign(static_cast<std::size_t>(cluster_count_), glm::vec4(0));
  for (std::size_t i = 0; i < values.size(); ++i) means[cluster_of_[i]] += areas_[i] * values[i];
  for (std::size_t c = 0; c < means.size(); ++c) means[c] /= std::max(cluster_area_[c], 1e-30f);
}

// What the likeness of the exchange makes of a radiosity and of its means over clusters.
template <bool kIsGrey>
void Interreflection::reflect_likeness(const std::vector<glm::vec4>& radiosity, const std::vector<glm::vec4>& mean,
                                       std::vector<glm::vec4>& irradiance) const {
  std::vector<float> channel[3];
  for (int c = 0; c < 3; ++c) {
    channel[c].assign(far_stride_, 0.f);
    for (std::size_t k = 0; k < mean.size(); ++k) channel[c][k] = mean[k][c];
  }
  const float *red = channel[0].data(), *green = channel[1].data(), *blue = channel[2].data();
  parallel_indices(areas_.size(), kGrain, [&](std::size_t i) {
    const std::uint16_t* row = &far_[i * far_stride_];
    Lanes r = {}, g = {}, b = {};
    for (std::size_t k = 0; k < far_stride_; k += kLanes) {
      const Lanes weight = __builtin_convertvector(__builtin_convertvector(load<Counts>(row + k), Integers), Lanes);
      r += weight * load<Lanes>(red + k);
      if constexpr (!kIsGrey) {
        g += weight * load<Lanes>(green + k);
        b += weight * load<Lanes>(blue + k);
      }
    }
    glm::vec4 sum(0);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      sum += kIsGrey ? glm::vec4(glm::vec3(r[lane]), 0) : glm::vec4(r[lane], g[lane], b[lane], 0);
    irradiance[i] = far_scale_[i] * sum + near_.dot(i, radiosity);
  });
}

// Adds to a radiosity what is left over, and all that its further reflections bring, by the likeness.
void Interreflection::carry_on(const std::vector<glm::vec4>& left, bool is_grey,
                               std::vector<glm::vec4>& radiosity) const {
  const std::size_t n = areas_.size(), m = static_cast<std::size_t>(cluster_count_);
  std::vector<glm::vec4> sum = left, received(n), mean, mean_after, carried(m);
  cluster_means(sum, mean);
  for (int cycle = 0; cycle < kInnerCycles; ++cycle) {
    if (is_grey)
      reflect_likeness<true>(sum, mean, received);
    else
      reflect_likeness<false>(sum, mean, received);
    for (std::size_t i = 0; i < n; ++i) sum[i] = left[i] + glm::vec4(reflectance_[i], 0) * received[i];
    cluster_means(sum, mean_after);
    for (std::size_t c = 0; c < m; ++c) mean[c] = mean_after[c] - mean[c];
    parallel_indices(m, 32, [&](std::size_t c) {
      glm::vec4 all(0);
      for (std::size_t k = 0; k < m; ++k) all += operator_[c * m + k] * mean[k];
      carried[c] = all;
    });
    for (std::size_t i = 0; i < n; ++i) sum[i] += glm::vec4(reflectance_[i], 0) * carried[cluster_of_[i]];
    for (std::size_t c = 0; c < m; ++c) mean[c] = mean_after[c] + glm::vec4(cluster_reflectance_[c], 0) * carried[c];
  }
  for (std::size_t i = 0; i < n; ++i) radiosity[i] += sum[i];
}

int Interreflection::solve(const PatchLight& light, double tolerance, int maximum_cycles,
                           std::vector<glm::vec3>& irradiance, const AfterCycle& after_cycle) const {
  const std::size_t n = areas_.size();
  std::vector<glm::vec4> radiosity(n, glm::vec4(0)), left(n);
  for (std::size_t i = 0; i < n; ++i) left[i] = glm::vec4(light.emitted[i] + reflectance_[i] * light.direct[i], 0);
  irradiance = light.direct;
  double before = 0;
  for (int cycle = 1; cycle <= maximum_cycles; ++cycle) {
    carry_on(left, light.is_grey, radiosity);
    parallel_indices(n, kGrain, [&](std::size_t i) {
      irradiance[i] = light.direct[i] + glm::vec3(exchange_.dot(i, radiosity));
      left[i] = glm::vec4(light.emitted[i] + reflectance_[i] * irradiance[i], 0) - radiosity[i];
    });
    double change = 0, total = 0;
    for (std::size_t i = 0; i < n; ++i) {
      change += areas_[i] * (std::abs(left[i].x) + std::abs(left[i].y) + std::abs(left[i].z));
      total += areas_[i] * (std::abs(radiosity[i].x) + std::abs(radiosity[i].y) + std::abs(radiosity[i].z));
    }
    const double shrinks_by = cycle > 1 ? change / before : 1;
    if (!(change > 0) || change <= tolerance * total ||
        (shrinks_by < 1 && change * shrinks_by / (1 - shrinks_by) <= tolerance * total))
      return cycle;
    before = change;
    if (after_cycle && !after_cycle(cycle, irradiance)) return 0;
  }
  throw std::runtime_error("interreflection has not converged: is the room closed and almost perfectly white?");
}

}  // namespace transom
