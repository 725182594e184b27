#include "transom/interreflection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr int kLargestClusterCount = 320;
constexpr std::size_t kGrain = 128;
constexpr std::size_t kBrightParts = 4;  // of bright patches, whose light is found at the same time
constexpr float kLikeness = 4.5e-4f;     // of what a patch receives: what a group may err by
constexpr std::size_t kProbeStep = 37;   // patches, between those that are lit to measure how fast light converges
constexpr double kSafety = 2;            // on what has been measured
constexpr int kLeastInnerCycles = 2, kMostInnerCycles = 5;  // with the likeness
constexpr double kWantedShrinking = 0.04;  // by a cycle: more inner ones are taken where these do not do

// Light of one channel, and of three.
float to(float, glm::vec3 colour) {
  return colour.x;
}
glm::vec4 to(glm::vec4, glm::vec3 colour) {
  return {colour, 0};
}
glm::vec3 colour_of(float value) {
  return glm::vec3(value);
}
glm::vec3 colour_of(glm::vec4 value) {
  return value;
}
float size_of(float value) {
  return std::abs(value);
}
float size_of(glm::vec4 value) {
  return std::abs(value.x) + std::abs(value.y) + std::abs(value.z);
}

}  // namespace

Interreflection::Interreflection(const SparseRows& form_factors, const SparseRows& through,
                                 std::vector<glm::vec3> reflectance, std::vector<float> areas,
                                 const std::vector<PatchPlace>& places)
    : sent_(form_factors),
      through_(through),
      sent_through_(transposed(through)),
      reflectance_(std::move(reflectance)),
      areas_(std::move(areas)),
      groups_(places, areas_),
      foretold_reflectance_(reflectance_.size(), glm::vec3(0)) {
  find_clusters(places);
  receive(form_factors);
}

void Interreflection::send(SparseRows sent) {
  SparseRows received = transposed(sent);
  parallel_indices(received.row_count(), kGrain, [&](std::size_t i) {
    for (std::size_t k = received.begin[i]; k < received.begin[i + 1]; ++k)
      received.entries[k].weight *= areas_[received.entries[k].index] / areas_[i];
  });
  sent_ = std::move(sent);
  receive(received);
}

// Makes the exchange of what patches receive of each other and through openings.
void Interreflection::receive(const SparseRows& received) {
  const SparseRows* const parts[]{&received, &through_};
  SparseRows all;
  all.entries.reserve(received.entries.size() + through_.entries.size());
  for (std::size_t i = 0; i < areas_.size(); ++i) {
    for (const SparseRows* rows : parts)
      all.entries.insert(all.entries.end(), rows->entries.begin() + static_cast<std::ptrdiff_t>(rows->begin[i]),
                         rows->entries.begin() + static_cast<std::ptrdiff_t>(rows->begin[i + 1]));
    all.begin.push_back(all.entries.size());
  }
  exchange_ = ExactRows(all);
  likeness_ = {};
  find_operators(all);
  is_foretold_ = false;
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
void Interreflection::find_operators(const SparseRows& received) {
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Index m = cluster_count_;
  cluster_area_.assign(static_cast<std::size_t>(m), 0.f);
  cluster_reflectance_.assign(static_cast<std::size_t>(m), glm::vec3(0));
  Matrix exchange = Matrix::Zero(m, m);
  for (std::size_t i = 0; i < areas_.size(); ++i) {
    cluster_area_[cluster_of_[i]] += areas_[i];
    cluster_reflectance_[cluster_of_[i]] += areas_[i] * reflectance_[i];
    for (std::size_t k = received.begin[i]; k < received.begin[i + 1]; ++k)
      exchange(cluster_of_[i], cluster_of_[received.entries[k].index]) += areas_[i] * received.entries[k].weight;
  }
  for (Eigen::Index c = 0; c < m; ++c) exchange.row(c) /= std::max(cluster_area_[c], 1e-30f);
  Matrix system = Matrix::Identity(m, m);
  for (Eigen::Index c = 0; c < m; ++c) {
    cluster_reflectance_[c] /= std::max(cluster_area_[c], 1e-30f);
    const glm::vec3 rho = cluster_reflectance_[c];
    system.row(c) -= std::min({rho.x, rho.y, rho.z}) * exchange.row(c);
  }
  const Matrix solved = exchange * system.partialPivLu().inverse();
  // A room that loses nothing has no such operator: then the patches go on alone.
  SparseRows rows;
  for (Eigen::Index c = 0; c < m; ++c) {
    if (solved.allFinite())
      for (Eigen::Index k = 0; k < m; ++k) rows.entries.push_back({static_cast<int>(k), solved(c, k)});
    rows.begin.push_back(rows.entries.size());
  }
  operator_ = ExactRows(rows);
}

void Interreflection::prepare(std::span<const std::vector<float>> smooth_lights) {
  if (smooth_lights.empty()) return;
  std::vector<PatchGroups::TypicalLight> lights;
  for (const std::vector<float>& light : smooth_lights) lights.push_back(groups_.typical(light));
  std::vector<std::vector<Share>> rows(areas_.size());
  parallel_indices(rows.size(), kGrain,
                   [&](std::size_t i) { rows[i] = groups_.grouped(exchange_.row(i), lights, kLikeness); });
  likeness_ = CompactRows(SparseRows::of(rows));
  for (inner_cycles_ = kLeastInnerCycles;; ++inner_cycles_) {
    is_foretold_ = false;
    foretell();
    if (foretold_shrinking_ <= kSafety * kWantedShrinking || inner_cycles_ == kMostInnerCycles) break;
  }
}

void Interreflection::foretell() {
  if (is_foretold_) return;
  foretold_shrinking_ = std::min(1., kSafety * measured_shrinking());
  foretold_reflectance_ = reflectance_;
  is_foretold_ = true;
}

// How much less is left over after a second cycle than after a first, of light on patches here and there.
double Interreflection::measured_shrinking() const {
  const std::vector<glm::vec3> emitted(areas_.size(), glm::vec3(0));
  std::vector<glm::vec3> direct = emitted, irradiance;
  std::vector<int> bright;
  for (std::size_t i = 0; i < areas_.size(); i += kProbeStep) {
    direct[i] = glm::vec3(1);
    bright.push_back(static_cast<int>(i));
  }
  std::vector<glm::vec4> radiosity, left;
  begin({emitted, direct, false, bright}, left, radiosity);
  const double first = cycle({emitted, direct}, left, radiosity, irradiance),
               second = cycle({emitted, direct}, left, radiosity, irradiance);
  return first > 0 ? second / first : 0;
}

template <typename Value>
void Interreflection::cluster_means(const std::vector<Value>& values, std::vector<Value>& means) const {
  means.assign(static_cast<std::size_t>(cluster_count_), Value(0));
  for (std::size_t i = 0; i < areas_.size(); ++i) means[cluster_of_[i]] += areas_[i] * values[i];
  for (std::size_t c = 0; c < means.size(); ++c) means[c] /= std::max(cluster_area_[c], 1e-30f);
}

// What clusters receive of what they have not yet reflected.
template <typename Value>
void Interreflection::apply_operator(const std::vector<Value>& mean, std::vector<Value>& received) const {
  parallel_indices(mean.size(), 32, [&](std::size_t c) { received[c] = operator_.dot(c, mean); });
}

// What is left over before anything has been reflected. Of bright patches it is the first reflection of what they send,
// which itself is taken for done.
template <typename Value>
void Interreflection::begin(const PatchLight& light, std::vector<Value>& left, std::vector<Value>& radiosity) const {
  const std::size_t n = areas_.size();
  left.resize(n);
  radiosity.assign(n, Value(0));
  for (std::size_t i = 0; i < n; ++i) left[i] = to(Value(), light.emitted[i] + reflectance_[i] * light.direct[i]);
  if (light.bright.empty()) return;
  for (const int bright : light.bright) std::swap(radiosity[bright], left[bright]);
  // Bright patches in parts, always the same ones: what these send is added up in one order.
  std::vector<std::vector<Value>> received(kBrightParts);
  parallel_indices(kBrightParts, 1, [&](std::size_t part) {
    const auto begin_of = [&](std::size_t number) { return number * light.bright.size() / kBrightParts; };
    received[part] =
        received_from(light.bright.subspan(begin_of(part), begin_of(part + 1) - begin_of(part)), radiosity);
  });
  parallel_indices(n, kGrain, [&](std::size_t i) {
    Value all(0);
    for (const std::vector<Value>& part : received) all += part[i];
    left[i] += to(Value(), reflectance_[i]) * all;
  });
}

// Irradiance of all patches by what some of them send.
template <typename Value>
std::vector<Value> Interreflection::received_from(std::span<const int> senders,
                                                  const std::vector<Value>& radiosity) const {
  std::vector<Value> received(areas_.size(), Value(0));
  for (const int sender : senders) {
    const Value flux = areas_[sender] * radiosity[sender];
    const auto row = static_cast<std::size_t>(sender);
    for (std::size_t k = sent_.begin[row]; k < sent_.begin[row + 1]; ++k)
      received[sent_.entries[k].index] += sent_.entries[k].weight * flux;
  }
  for (std::size_t i = 0; i < received.size(); ++i) received[i] /= std::max(areas_[i], 1e-30f);
  for (const int sender : senders) {
    const auto row = static_cast<std::size_t>(sender);
    for (std::size_t k = sent_through_.begin[row]; k < sent_through_.begin[row + 1]; ++k)
      received[sent_through_.entries[k].index] += sent_through_.entries[k].weight * radiosity[sender];
  }
  return received;
}

// Adds to a radiosity what is left over, and all that its further reflections bring, by the likeness. The clusters
// carry it first, then after each cycle what that has changed.
template <typename Value>
void Interreflection::carry_on(const std::vector<Value>& left, std::vector<Value>& radiosity) const {
  const std::size_t n = areas_.size(), m = static_cast<std::size_t>(cluster_count_);
  std::vector<Value> sum = left, received(n), before(m, Value(0)), mean, carried(m);
  for (int cycle = 0;; ++cycle) {
    cluster_means(sum, mean);
    for (std::size_t c = 0; c < m; ++c) before[c] = mean[c] - before[c];
    apply_operator(before, carried);
    for (std::size_t i = 0; i < n; ++i) sum[i] += to(Value(), reflectance_[i]) * carried[cluster_of_[i]];
    if (cycle == inner_cycles_) break;
    for (std::size_t c = 0; c < m; ++c) before[c] = mean[c] + to(Value(), cluster_reflectance_[c]) * carried[c];
    groups_.append_means(sum);
    parallel_indices(n, kGrain, [&](std::size_t i) {
      received[i] = likeness_.row_count() > 0 ? likeness_.dot(i, sum) : exchange_.dot(i, sum);
    });
    for (std::size_t i = 0; i < n; ++i) sum[i] = left[i] + to(Value(), reflectance_[i]) * received[i];
  }
  for (std::size_t i = 0; i < n; ++i) radiosity[i] += sum[i];
}

// What is still left over reaches the irradiance as clusters see it, with all its further reflections.
template <typename Value>
void Interreflection::add_rest(const std::vector<Value>& left, std::vector<glm::vec3>& irradiance) const {
  const auto m = static_cast<std::size_t>(cluster_count_);
  std::vector<Value> mean, carried(m);
  cluster_means(left, mean);
  apply_operator(mean, carried);
  for (std::size_t i = 0; i < irradiance.size(); ++i) irradiance[i] += colour_of(carried[cluster_of_[i]]);
}

// One cycle: returns what is then left over, relative to all flux.
template <typename Value>
double Interreflection::cycle(const PatchLight& light, std::vector<Value>& left, std::vector<Value>& radiosity,
                              std::vector<glm::vec3>& irradiance) const {
  const std::size_t n = areas_.size();
  irradiance.resize(n);
  carry_on(left, radiosity);
  parallel_indices(n, kGrain, [&](std::size_t i) {
    irradiance[i] = light.direct[i] + colour_of(exchange_.dot(i, radiosity));
    left[i] = to(Value(), light.emitted[i] + reflectance_[i] * irradiance[i]) - radiosity[i];
  });
  double rest = 0, total = 0;
  for (std::size_t i = 0; i < n; ++i) {
    rest += areas_[i] * size_of(left[i]);
    total += areas_[i] * size_of(radiosity[i]);
  }
  return total > 0 ? rest / total : 0;
}

template <typename Value>
int Interreflection::solve_as(const PatchLight& light, double tolerance, int maximum_cycles,
                              std::vector<glm::vec3>& irradiance, const AfterCycle& after_cycle) const {
  std::vector<Value> left, radiosity;
  begin(light, left, radiosity);
  double before = 0;
  for (int number = 1; number <= maximum_cycles; ++number) {
    const double rest = cycle(light, left, radiosity, irradiance);
    const double shrinks_by = number > 1 ? rest / before : foretold_shrinking_;
    if (!(rest > 0) || rest <= tolerance || (shrinks_by < 1 && rest * shrinks_by / (1 - shrinks_by) <= tolerance)) {
      add_rest(left, irradiance);
      return number;
    }
    before = rest;
    if (after_cycle && !after_cycle(number, irradiance)) return 0;
  }
  throw std::runtime_error("interreflection has not converged: is the room closed and almost perfectly white?");
}

int Interreflection::solve(const PatchLight& light, double tolerance, int maximum_cycles,
                           std::vector<glm::vec3>& irradiance, const AfterCycle& after_cycle) const {
  return light.is_grey ? solve_as<float>(light, tolerance, maximum_cycles, irradiance, after_cycle)
                       : solve_as<glm::vec4>(light, tolerance, maximum_cycles, irradiance, after_cycle);
}

}  // namespace transom
