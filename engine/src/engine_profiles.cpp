// How the light of patches is spread over their elements, and what patches and nodes see of each other for that.
#include <algorithm>

#include "transom/engine.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr std::size_t kGrain = 16;

}  // namespace

// Radiosity of elements relative to that of their patch, by patch * elements per slot + element, as the nodes around
// them have it. What no node speaks for, clusters and emitters, whose own light is even, count as even.
std::vector<float> Engine::element_profiles(const std::vector<float>& node_irradiance) const {
  const auto per_slot = static_cast<std::size_t>(mesh_->elements_per_slot());
  std::vector<float> profiles(nodes_at_element_.size(), 1.f);
  parallel_indices(slot_of_patch_.size(), kGrain, [&](std::size_t p) {
    if (patch_emitted_[p] != glm::vec3(0)) return;
    std::vector<float> rays(per_slot, 0.f);  // that leave each element
    for (const Share& share : patch_rows_[p].around->left)
      rays[static_cast<std::size_t>(share.index) % per_slot] += share.weight;
    float* const profile = &profiles[p * per_slot];
    float sum = 0, count = 0;
    for (std::size_t e = 0; e < per_slot; ++e) {
      const NodeShares& nodes = nodes_at_element_[p * per_slot + e];
      if (nodes.count == 0) continue;
      float irradiance = 0;
      for (int k = 0; k < nodes.count; ++k) irradiance += nodes.weight[k] * node_irradiance[nodes.node[k]];
      profile[e] = std::max(0.f, irradiance);
      sum += rays[e] * profile[e];
      count += rays[e];
    }
    for (std::size_t e = 0; e < per_slot; ++e)
      if (nodes_at_element_[p * per_slot + e].count > 0) profile[e] = sum > 0 ? profile[e] * count / sum : 1.f;
  });
  return profiles;
}

// What others see of a patch: mean profile of the elements that its rays to each of them have left. Sorted; nothing of
// a cluster, which sends evenly.
std::vector<Share> Engine::seen_of(std::size_t patch, const std::vector<float>& profiles) const {
  const int per_slot = mesh_->elements_per_slot(), own = static_cast<int>(patch) * per_slot;
  const std::vector<Share>& left = patch_rows_[patch].around->left;
  std::vector<Share> seen;
  for (std::size_t k = 0; k < left.size();) {
    const int slot = left[k].index / per_slot;
    float rays = 0, sent = 0;
    for (; k < left.size() && left[k].index / per_slot == slot; ++k) {
      rays += left[k].weight;
      sent += left[k].weight * profiles[own + left[k].index % per_slot];
    }
    if (patch_of_slot_[slot] >= 0) seen.push_back({patch_of_slot_[slot], sent / rays});
  }
  std::sort(seen.begin(), seen.end(), [](const Share& a, const Share& b) { return a.index < b.index; });
  return seen;
}

// Lets patches send as the shape of light under an even sky has it, or of lamps. A patch of which a part is hidden, as
// behind books on a shelf, sends less than its mean from there, and more from what the room sees of it. Returns what is
// seen of each patch from afar, relative to its mean: there all see about the same.
std::vector<float> Engine::send_unevenly(const std::vector<float>& node_irradiance) {
  const std::size_t n = slot_of_patch_.size();
  const std::vector<float> profiles = element_profiles(node_irradiance);
  std::vector<std::vector<Share>> seen(n);
  parallel_indices(n, kGrain, [&](std::size_t p) { seen[p] = seen_of(p, profiles); });
  SparseRows sent = sent_unevenly(*form_factors_, seen);
  std::vector<float> seen_from_afar(n, 1.f);
  parallel_indices(n, kGrain, [&](std::size_t p) {
    const glm::vec3 middle = mesh_->middle_of(slot_of_patch_[p]).position;
    const float near = gatherer_->near_distance(slot_of_patch_[p]);
    float even = 0, uneven = 0;
    for (std::size_t k = sent.begin[p]; k < sent.begin[p + 1]; ++k) {
      const int other = slot_of_patch_[sent.entries[k].index];
      if (glm::distance(mesh_->middle_of(other).position, middle) <= near) continue;
      even += form_factors_->entries[k].weight;
      uneven += sent.entries[k].weight;
    }
    if (even > 0) seen_from_afar[p] = uneven / even;
  });
  interreflection_->send(std::move(sent));
  find_smooth_lights();
  return seen_from_afar;
}

// What a node sees of patches beyond the near elements, whose own light it will take, as these are seen from afar.
void Engine::see_from_afar(const std::vector<float>& seen_from_afar, const std::vector<Share>& near,
                           std::vector<Share>& patches) const {
  std::vector<Share> near_slots = near;
  for (Share& share : near_slots) share.index /= mesh_->elements_per_slot();
  const std::vector<Share> near_patches = to_patches(near_slots);
  auto close_by = near_patches.begin();
  for (Share& share : patches) {
    float near_weight = 0;
    while (close_by != near_patches.end() && close_by->index < share.index) ++close_by;
    if (close_by != near_patches.end() && close_by->index == share.index) near_weight = close_by->weight;
    share.weight = near_weight + std::max(0.f, share.weight - near_weight) * seen_from_afar[share.index];
  }
}

}  // namespace transom
