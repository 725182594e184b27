// The sun on elements: few samples everywhere it may reach, many at the edges of its light.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "deposit_samples.h"
#include "transom/deposit.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr int kSamplesPerElement = 4;
constexpr int kTellingSamples = 2;             // of these, the ones that say whether an element is partly lit
constexpr int kRefinedSamplesPerElement = 32;  // at the edges of light
constexpr float kSameShare = 1e-3f;            // of the sun, between samples of an evenly lit element
constexpr std::size_t kGrain = 4;
constexpr std::size_t kReceivers = 128;  // looked at together: they share what covers their face
static_assert(kPatternPoints >= kRefinedSamplesPerElement);

}  // namespace

// A slot that the sun may reach, and the openings that its light may pass on the way to it.
struct DirectLight::SunlitSlot {
  std::size_t receiver;
  bool is_behind_openings;
  std::vector<int> passages;  // places in openings_
};

// The openings as the sun sees them.
class DirectLight::Sun {
 public:
  Sun(const DirectLight& light, const Beam& sun)
      : beam(sun), outlines(light.mesh_.faces(), light.openings_, sun.direction_to_source) {
    for (const int f : light.openings_) {
      // From indoors, light comes only through openings whose outer side faces it. Small ones send their light
      // themselves.
      const float facing = glm::dot(light.mesh_.faces().faces[f].normal, sun.direction_to_source);
      lets_in.push_back(facing > 0 && !light.is_small_opening_[f]);
      transmittance.push_back(light.rays_.opening_transmittance(f, sun.direction_to_source));
    }
  }
  const Beam& beam;
  BeamOutlines outlines;
  // By opening:
  std::vector<char> lets_in;
  std::vector<float> transmittance;
};

// Of the receivers from `begin` to `end`, those that the sun may reach.
std::vector<DirectLight::SunlitSlot> DirectLight::reached(const Sun& sun, const Receivers& receivers, std::size_t begin,
                                                          std::size_t end) const {
  std::vector<SunlitSlot> found;
  int known_face = -1;
  std::vector<int> over_face, over_slot;
  for (std::size_t i = begin; i < end; ++i) {
    if (mesh_.is_cluster(receivers.slots[i]) || glm::dot(sun.beam.direction_to_source, receivers.normals[i]) <= 0)
      continue;
    const int f = mesh_.slot(receivers.slots[i]).face;
    const Face& face = mesh_.faces().faces[f];
    if (f != known_face) sun.outlines.covering(sun.outlines.outline(face.corners()), over_face);
    known_face = f;
    over_slot.clear();
    if (!over_face.empty()) {
      const BeamOutline outline = sun.outlines.outline(receivers.corners[i]);
      std::copy_if(over_face.begin(), over_face.end(), std::back_inserter(over_slot),
                   [&](int k) { return sun.outlines.covers(k, outline); });
    }
    const bool is_behind = receivers.is_behind_openings[i] != 0;
    if (is_behind && std::none_of(over_slot.begin(), over_slot.end(), [&](int k) { return sun.lets_in[k] != 0; }))
      continue;
    found.push_back({i, is_behind, over_slot});
  }
  return found;
}

// The receivers that the sun may reach.
std::vector<DirectLight::SunlitSlot> DirectLight::reached(const Sun& sun, const Receivers& receivers) const {
  const std::size_t count = receivers.slots.size();
  std::vector<std::vector<SunlitSlot>> found((count + kReceivers - 1) / kReceivers);
  parallel_indices(found.size(), 1, [&](std::size_t k) {
    found[k] = reached(sun, receivers, k * kReceivers, std::min(count, (k + 1) * kReceivers));
  });
  std::vector<SunlitSlot> all;
  for (std::vector<SunlitSlot>& part : found) std::move(part.begin(), part.end(), std::back_inserter(all));
  return all;
}

// Share of the sun's light that arrives at lifted points of a slot, but for what comes through a small opening first.
// Where openings stand in the way is known in closed form: rays look for what is opaque, and only from points that
// openings let light to.
void DirectLight::sun_transmission(const Sun& sun, const SunlitSlot& slot, const Points& points,
                                   std::span<float> share) const {
  struct Scratch {
    Points open, along_beam;  // open: from which rays start
    std::vector<std::uint8_t> blocked;
    std::vector<int> is_behind, is_crossed;
  };
  thread_local Scratch of_thread;
  Scratch& scratch = of_thread;  // asked for once
  const std::size_t count = points.size();
  scratch.is_behind.resize(count);
  scratch.is_crossed.assign(count, slot.is_behind_openings ? 0 : 1);
  scratch.open.resize(count);
  scratch.blocked.resize(count);
  int *is_behind = scratch.is_behind.data(), *is_crossed = scratch.is_crossed.data();
  sun.outlines.along_beam(points, scratch.along_beam);
  std::fill(share.begin(), share.end(), 1.f);
  for (const int k : slot.passages) {
    sun.outlines.mark_behind(k, scratch.along_beam.x, scratch.along_beam.y, scratch.along_beam.z, scratch.is_behind);
    const float transmittance = sun.transmittance[k];
    for (std::size_t i = 0; i < count; ++i) {
      share[i] *= is_behind[i] ? transmittance : 1.f;
      is_crossed[i] |= is_behind[i];
    }
  }
  std::size_t ray_count = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_crossed[i]) share[i] = 0;
    if (share[i] > 0) scratch.open.set(ray_count++, points[i]);
  }
  if (is_convex_ && slot.is_behind_openings)
    std::fill_n(scratch.blocked.begin(), ray_count, std::uint8_t{0});
  else
    rays_.occluded_along(sun.beam.direction_to_source, scratch.open.x.data(), scratch.open.y.data(),
                         scratch.open.z.data(), RayScene::What::kOpaque, {scratch.blocked.data(), ray_count});
  for (std::size_t i = 0, next = 0; i < count; ++i)
    if (share[i] > 0 && scratch.blocked[next++]) share[i] = 0;
  ignore_small_openings(sun.beam.direction_to_source, points, share);
}

// The few samples that every element of the candidates has: share of a beam, kSamplesPerElement an element.
std::vector<float> DirectLight::sample_sun(const Sun& sun, const Receivers& receivers,
                                           const std::vector<SunlitSlot>& candidates) const {
  std::vector<int> elements(static_cast<std::size_t>(mesh_.elements_per_slot()));
  std::iota(elements.begin(), elements.end(), 0);
  const std::size_t samples_per_slot = elements.size() * kSamplesPerElement;
  std::vector<float> share(candidates.size() * samples_per_slot);
  parallel_indices(candidates.size(), kGrain, [&](std::size_t k) {
    const std::size_t i = candidates[k].receiver;
    const Points points = points_on(receivers.slots[i], receivers.corners[i], elements, kSamplesPerElement);
    sun_transmission(sun, candidates[k], points, {&share[k * samples_per_slot], samples_per_slot});
  });
  return share;
}

// Whether all samples of a slot say the same, and so do those of all cells around it. Places without samples are dark.
bool DirectLight::is_lit_as_all_around(int slot_index, const std::vector<int>& place_of_slot,
                                       const std::vector<float>& evenly_lit) const {
  const Slot slot = mesh_.slot(slot_index);
  const Grid& grid = mesh_.grid(slot.face);
  const float own = evenly_lit[place_of_slot[slot_index]];
  if (!grid.is_quad) return own >= 0;
  const int x = slot.cell % grid.u_count, y = slot.cell / grid.u_count;
  for (int v = std::max(0, y - 1); v <= std::min(grid.v_count - 1, y + 1); ++v)
    for (int u = std::max(0, x - 1); u <= std::min(grid.u_count - 1, x + 1); ++u) {
      const int place = place_of_slot[mesh_.slot_index(slot.face, slot.side, v * grid.u_count + u)];
      if (own < 0 || own != (place < 0 ? 0.f : evenly_lit[place])) return false;
    }
  return true;
}

// The elements of a slot whose telling samples differ from each other or from those of an element beside them, in the
// same face. Patches without samples are dark. In triangles, the elements of a patch are all beside each other.
std::vector<int> DirectLight::partly_lit(int slot_index, const std::vector<int>& place_of_slot,
                                         const std::vector<float>& share, const std::vector<float>& evenly_lit) const {
  const Slot slot = mesh_.slot(slot_index);
  const Grid& grid = mesh_.grid(slot.face);
  const int per_slot = mesh_.elements_per_slot(), edge = mesh_.elements_per_edge();
  const auto sample = [&](int of_slot, int element, int i) {
    const int place = place_of_slot[of_slot];
    return place < 0 ? 0.f : share[(static_cast<std::size_t>(place) * per_slot + element) * kSamplesPerElement + i];
  };
  std::vector<int> found;
  if (is_lit_as_all_around(slot_index, place_of_slot, evenly_lit)) return found;
  for (int e = 0; e < per_slot; ++e) {
    const float own = sample(slot_index, e, 0);
    bool differs = false;
    const auto compare = [&](int of_slot, int element) {
      for (int i = 0; i < kTellingSamples; ++i) differs |= std::abs(sample(of_slot, element, i) - own) > kSameShare;
    };
    if (!grid.is_quad) {
      for (int other = 0; other < per_slot; ++other) compare(slot_index, other);
    } else {
      const int x = slot.cell % grid.u_count * edge + e % edge, y = slot.cell / grid.u_count * edge + e / edge;
      for (int v = std::max(0, y - 1); v <= std::min(grid.v_count * edge - 1, y + 1); ++v)
        for (int u = std::max(0, x - 1); u <= std::min(grid.u_count * edge - 1, x + 1); ++u)
          compare(mesh_.slot_index(slot.face, slot.side, v / edge * grid.u_count + u / edge),
                  v % edge * edge + u % edge);
    }
    if (differs) found.push_back(e);
  }
  return found;
}

// Adds the sun to the light of elements, by receiver. Elements at the edges of light, as two samples of each tell, are
// sampled densely; the others keep two samples that did not tell: then the thin shadows that none of them found are, in
// the mean, made up for.
void DirectLight::add_sun(const Beam& sun, const Receivers& receivers, std::vector<std::vector<glm::vec3>>& sum,
                          BeamPlan& plan) const {
  const Sun seen(*this, sun);
  const std::vector<SunlitSlot> candidates = reached(seen, receivers);
  plan.facing_openings += static_cast<int>(std::count(seen.lets_in.begin(), seen.lets_in.end(), 1));
  plan.patches += static_cast<int>(candidates.size());
  if (candidates.empty()) return;
  ++plan.beams;
  plan.is_unshaded |= is_convex_;
  const std::vector<float> share = sample_sun(seen, receivers, candidates);
  std::vector<int> place_of_slot(static_cast<std::size_t>(mesh_.slot_count()), -1);
  for (std::size_t k = 0; k < candidates.size(); ++k)
    place_of_slot[receivers.slots[candidates[k].receiver]] = static_cast<int>(k);
  const int per_slot = mesh_.elements_per_slot();
  std::vector<float> evenly_lit(candidates.size());  // what all samples of a slot say, or -1
  parallel_indices(candidates.size(), kReceivers, [&](std::size_t k) {
    const auto first = share.begin() + static_cast<std::ptrdiff_t>(k) * per_slot * kSamplesPerElement;
    const bool is_even =
        std::all_of(first, first + per_slot * kSamplesPerElement, [&](float s) { return s == *first; });
    evenly_lit[k] = is_even ? *first : -1;
  });
  parallel_indices(candidates.size(), kGrain, [&](std::size_t k) {
    const std::size_t i = candidates[k].receiver;
    const glm::vec3 full = sun.normal_illuminance * glm::dot(sun.direction_to_source, receivers.normals[i]);
    const float* own = &share[k * static_cast<std::size_t>(per_slot * kSamplesPerElement)];
    std::vector<float> mean(static_cast<std::size_t>(per_slot));
    for (int e = 0; e < per_slot; ++e)
      mean[e] =
          std::accumulate(own + e * kSamplesPerElement + kTellingSamples, own + (e + 1) * kSamplesPerElement, 0.f) /
          static_cast<float>(kSamplesPerElement - kTellingSamples);
    const std::vector<int> elements = partly_lit(receivers.slots[i], place_of_slot, share, evenly_lit);
    std::vector<float> refined(elements.size() * kRefinedSamplesPerElement);
    const Points points = points_on(receivers.slots[i], receivers.corners[i], elements, kRefinedSamplesPerElement);
    sun_transmission(seen, candidates[k], points, refined);
    for (std::size_t n = 0; n < elements.size(); ++n)
      mean[elements[n]] = std::accumulate(&refined[n * kRefinedSamplesPerElement],
                                          &refined[n * kRefinedSamplesPerElement] + kRefinedSamplesPerElement, 0.f) /
                          kRefinedSamplesPerElement;
    sum[i].resize(static_cast<std::size_t>(per_slot), glm::vec3(0));
    for (int e = 0; e < per_slot; ++e) sum[i][e] += mean[e] * full;
  });
}

}  // namespace transom
