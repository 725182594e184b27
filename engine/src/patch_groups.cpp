#include "transom/patch_groups.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <tuple>

namespace transom {
namespace {

constexpr int kLargestGroup = 64;  // patches
constexpr std::size_t kBits = 64;  // of a word

}  // namespace

PatchGroups::PatchGroups(const std::vector<PatchPlace>& places, const std::vector<float>& areas)
    : order_(places.size()), parent_of_patch_(places.size(), -1) {
  std::iota(order_.begin(), order_.end(), 0);
  const auto kind = [&](int p) {
    return std::tuple(places[static_cast<std::size_t>(p)].material,
                      main_direction(places[static_cast<std::size_t>(p)].normal), p);
  };
  std::sort(order_.begin(), order_.end(), [&](int a, int b) { return kind(a) < kind(b); });
  const auto is_other = [&](int a, int b) {
    return std::get<0>(kind(a)) != std::get<0>(kind(b)) || std::get<1>(kind(a)) != std::get<1>(kind(b));
  };
  for (int first = 0, last; first < patch_count(); first = last) {
    for (last = first + 1; last < patch_count() && !is_other(order_[first], order_[last]);) ++last;
    if (last - first > 1) add_group(places, areas, first, last - first, -1);
  }
}

// Halves the patches across the longer side of the box around them. Those above the largest size are not kept as
// groups, but their halves are. Returns the number of what stands for all of them; -1: nothing does.
int PatchGroups::add_group(const std::vector<PatchPlace>& places, const std::vector<float>& areas, int first, int count,
                           int parent) {
  if (count == 1) {
    parent_of_patch_[order_[first]] = parent;
    return order_[first];
  }
  const auto position = [&](int p) { return places[static_cast<std::size_t>(p)].position; };
  glm::vec3 low = position(order_[first]), high = low;
  for (int k = first; k < first + count; ++k) {
    low = glm::min(low, position(order_[k]));
    high = glm::max(high, position(order_[k]));
  }
  const glm::vec3 size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const int half = count / 2;
  std::nth_element(order_.begin() + first, order_.begin() + first + half, order_.begin() + first + count,
                   [&](int a, int b) { return std::tuple(position(a)[axis], a) < std::tuple(position(b)[axis], b); });
  const bool is_kept = count <= kLargestGroup;
  const int own = is_kept ? group_count() : -1;
  if (is_kept) groups_.push_back({parent, {-1, -1}, {0, 0}, first, count});
  const int halves[2]{add_group(places, areas, first, half, own),
                      add_group(places, areas, first + half, count - half, own)};
  if (!is_kept) return -1;
  const auto area = [&](int from, int to) {
    float sum = 0;
    for (int k = from; k < to; ++k) sum += areas[static_cast<std::size_t>(order_[k])];
    return sum;
  };
  const float first_area = area(first, first + half), second_area = area(first + half, first + count);
  const float share = first_area + second_area > 0 ? first_area / (first_area + second_area) : 0.5f;
  for (int k = 0; k < 2; ++k) groups_[own].half[k] = halves[k];
  groups_[own].share[0] = share;
  groups_[own].share[1] = 1 - share;
  return patch_count() + own;
}

PatchGroups::TypicalLight PatchGroups::typical(std::vector<float> radiosity) const {
  TypicalLight light{std::move(radiosity), std::vector<float>(groups_.size(), 0.f)};
  append_means(light.radiosity);
  for (int g = 0; g < group_count(); ++g) {
    float sum = 0;
    for (int k = groups_[g].first; k < groups_[g].first + groups_[g].count; ++k) {
      const float difference = light.radiosity[order_[k]] - light.radiosity[patch_count() + g];
      sum += difference * difference;
    }
    light.deviation[g] = std::sqrt(sum / static_cast<float>(groups_[g].count));
  }
  return light;
}

float PatchGroups::TypicalLight::received_by(const std::vector<Share>& row) const {
  float sum = 0;
  for (const Share& share : row) sum += share.weight * radiosity[share.index];
  return sum;
}

std::vector<Share> PatchGroups::grouped(const std::vector<Share>& row, const std::vector<TypicalLight>& lights,
                                        float tolerance) const {
  if (lights.empty()) return row;
  std::vector<float> received;
  received.reserve(lights.size());
  for (const TypicalLight& light : lights) received.push_back(light.received_by(row));
  std::vector<Share> result = grouped_within(row, lights, received, tolerance);
  const float sum = lights.front().received_by(result);
  if (sum > 0)
    for (Share& share : result) share.weight *= received.front() / sum;
  return result;
}

// Groups where, under each of the lights, weight times deviation is at most `tolerance` times what the row receives.
std::vector<Share> PatchGroups::grouped_within(const std::vector<Share>& row, const std::vector<TypicalLight>& lights,
                                               const std::vector<float>& received, float tolerance) const {
  struct Scratch {  // zeros between calls
    std::vector<float> weight;
    std::vector<std::uint64_t> is_met;
    std::vector<int> largest, met;
  };
  thread_local Scratch of_thread;
  Scratch& scratch = of_thread;  // asked for once
  scratch.weight.resize(std::max(scratch.weight.size(), groups_.size()), 0.f);
  scratch.is_met.resize(scratch.weight.size() / kBits + 1, 0);
  scratch.largest.resize(scratch.weight.size());
  // By group: its weight in the row, whether it has any, bit by bit, and the largest that may stand for it (-1: none).
  float* weight = scratch.weight.data();
  std::uint64_t* is_met = scratch.is_met.data();
  int* largest = scratch.largest.data();
  std::vector<int>& met = scratch.met;  // halves before what they are halves of
  met.clear();
  const auto add = [&](int g, float of_row) {
    if (g < 0) return;
    weight[g] += of_row;
    is_met[static_cast<std::size_t>(g) / kBits] |= std::uint64_t{1} << static_cast<std::size_t>(g) % kBits;
  };
  for (const Share& share : row) add(parent_of_patch_[share.index], share.weight);
  for (std::size_t word = scratch.is_met.size(); word-- > 0;)
    while (is_met[word] != 0) {  // adding a group to its parent adds to a lower bit, or to a word further on
      const std::uint64_t bit = std::bit_floor(is_met[word]);
      is_met[word] ^= bit;
      met.push_back(static_cast<int>(word * kBits) + std::countr_zero(bit));
      add(groups_[met.back()].parent, weight[met.back()]);
    }
  const auto is_fine = [&](int g) {
    for (std::size_t k = 0; k < lights.size(); ++k)
      if (weight[g] * lights[k].deviation[g] > tolerance * received[k]) return false;
    return true;
  };
  for (std::size_t k = met.size(); k-- > 0;) {
    const int g = met[k], parent = groups_[g].parent;
    largest[g] = parent >= 0 ? largest[parent] : -1;
    if (largest[g] < 0 && is_fine(g)) largest[g] = g;
  }
  std::vector<Share> result;
  result.reserve(row.size());
  for (const Share& share : row) {
    const int parent = parent_of_patch_[share.index], chosen = parent >= 0 ? largest[parent] : -1;
    if (chosen < 0) {
      result.push_back(share);
    } else if (weight[chosen] != 0) {
      result.push_back({patch_count() + chosen, weight[chosen]});
      weight[chosen] = 0;  // has been taken
    }
  }
  for (const int g : met) weight[g] = 0;
  return result;
}

}  // namespace transom
