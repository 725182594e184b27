#include "transom/patch_groups.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace transom {
namespace {

constexpr int kLargestGroup = 64;  // patches

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
  constexpr int kUnknown = -2, kNone = -1;
  thread_local std::vector<float> weight;  // by group; 0 between calls
  thread_local std::vector<int> largest;   // by group: the largest that may stand for it; kUnknown between calls
  thread_local std::vector<int> touched;
  weight.resize(std::max(weight.size(), groups_.size()), 0.f);
  largest.resize(weight.size(), kUnknown);
  touched.clear();
  for (const Share& share : row)
    for (int g = parent_of_patch_[share.index]; g >= 0; g = groups_[g].parent) {
      if (weight[g] == 0) touched.push_back(g);
      weight[g] += share.weight;
    }
  const auto is_fine = [&](int g) {
    for (std::size_t k = 0; k < lights.size(); ++k)
      if (weight[g] * lights[k].deviation[g] > tolerance * received[k]) return false;
    return true;
  };
  // Asked once for each group, from the largest around it down.
  const auto largest_of = [&](int g, const auto& self) -> int {
    if (g < 0) return kNone;
    if (largest[g] == kUnknown) {
      largest[g] = self(groups_[g].parent, self);
      if (largest[g] == kNone && is_fine(g)) largest[g] = g;
    }
    return largest[g];
  };
  std::vector<Share> result;
  result.reserve(row.size());
  for (const Share& share : row) {
    const int chosen = largest_of(parent_of_patch_[share.index], largest_of);
    if (chosen < 0) {
      result.push_back(share);
    } else if (weight[chosen] != 0) {
      result.push_back({patch_count() + chosen, weight[chosen]});
      weight[chosen] = 0;  // has been taken
    }
  }
  for (const int g : touched) {
    weight[g] = 0;
    largest[g] = kUnknown;
  }
  return result;
}

}  // namespace transom
