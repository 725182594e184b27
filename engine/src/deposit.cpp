#include "transom/deposit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "transom/beam_outlines.h"
#include "transom/convex_room.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kSamplesPerElement = 4;          // of a beam
constexpr int kTellingSamples = 2;             // of these, the ones that say whether an element is partly lit
constexpr int kRefinedSamplesPerElement = 32;  // at the edges of light
constexpr int kSourceSamplesPerElement = 16;   // of point sources
constexpr float kSameShare = 1e-3f;            // of a beam, between samples of an evenly lit element
constexpr std::size_t kGrain = 4;
constexpr std::uint32_t kPatternCount = 64;
constexpr std::uint32_t kPatternPoints = 32;
static_assert(kPatternPoints >= kRefinedSamplesPerElement && kPatternPoints >= kSourceSamplesPerElement);

}  // namespace

// Places of samples in an element, evenly spread: one of some patterns, moved by an offset of the element's own
// [Cranley & Patterson 1976], so that no two elements repeat each other. Neighbours that did would err alike about
// stripes of light.
class DirectLight::Patterns {
 public:
  explicit Patterns(std::uint32_t seed) : seed_(seed) {
    for (std::uint32_t pattern = 0; pattern < kPatternCount; ++pattern) {
      const SobolSequence sequence(hash_seed(seed, pattern));
      for (std::uint32_t i = 0; i < kPatternPoints; ++i) points_.push_back(sequence.point2(i));
    }
  }

  class Pattern {
   public:
    Pattern(const glm::vec2* points, glm::vec2 offset) : points_(points), offset_(offset) {}
    glm::vec2 operator[](int i) const {
      const glm::vec2 moved = points_[i] + offset_;
      return {moved.x < 1 ? moved.x : moved.x - 1, moved.y < 1 ? moved.y : moved.y - 1};
    }

   private:
    const glm::vec2* points_;
    glm::vec2 offset_;
  };
  Pattern of(int element) const {
    const std::uint32_t hash = hash_seed(seed_, static_cast<std::uint64_t>(element));
    const auto part = [hash](int shift) { return static_cast<float>(hash >> shift & 0xfffu) / 4096; };
    return {&points_[static_cast<std::size_t>(hash % kPatternCount) * kPatternPoints], {part(8), part(20)}};
  }

 private:
  std::uint32_t seed_;
  std::vector<glm::vec2> points_;
};

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

DirectLight::Receivers DirectLight::receivers(const std::vector<int>& slots,
                                              std::vector<char> is_behind_openings) const {
  Receivers receivers{slots, std::move(is_behind_openings), {}, {}};
  receivers.is_behind_openings.resize(slots.size(), 0);
  for (const int slot_index : slots) {
    const Slot slot = mesh_.slot(slot_index);
    const Face& face = mesh_.faces().faces[slot.face];
    const auto corner = [&](float u, float v) {
      return mesh_.lifted_position(slot.face, slot.side, mesh_.cell_parameters(slot.face, slot.cell, {u, v}));
    };
    receivers.corners.push_back({corner(0, 0), corner(1, 0), face.is_quad ? corner(1, 1) : corner(0, 1), corner(0, 1)});
    receivers.normals.push_back(slot.side == 0 ? face.normal : -face.normal);
  }
  return receivers;
}

DirectLight::DirectLight(const LightMesh& mesh, const RayScene& rays, const std::vector<PointSource>& sources,
                         const std::vector<Material>& materials, float small_opening_m2)
    : mesh_(mesh),
      rays_(rays),
      is_convex_(is_convex_room(mesh.faces())),
      is_small_opening_(mesh.faces().faces.size(), 0) {
  for (std::size_t f = 0; f < is_small_opening_.size(); ++f) {
    const Face& face = mesh.faces().faces[f];
    if (materials[face.material].opening < 0) continue;
    is_small_opening_[f] = face.area < small_opening_m2;
    openings_.push_back(static_cast<int>(f));
    if (is_small_opening_[f]) small_openings_.push_back(static_cast<int>(f));
  }
  for (const PointSource& source : sources)
    sources_.push_back({glm::vec3(source.position - mesh.faces().origin), source.intensity});
}

void DirectLight::beam_transmission(const Beam& beam, std::span<const glm::vec3> points, std::span<float> share) const {
  if (beam.opening >= 0) {
    shaft_transmission(beam, points, share);
    return;
  }
  std::vector<Ray> rays(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) rays[i] = {points[i], beam.direction_to_source};
  std::vector<std::uint8_t> blocked(points.size());
  rays_.occluded(RayScene::What::kOpaque, rays, blocked, RayScene::Order::kCoherent);
  std::vector<Ray> free_rays;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!blocked[i]) free_rays.push_back(rays[i]);
  std::vector<float> transmitted(free_rays.size());
  rays_.transmittance(free_rays, transmitted, RayScene::Order::kCoherent);
  for (std::size_t i = 0, next = 0; i < points.size(); ++i) share[i] = blocked[i] ? 0 : transmitted[next++];
}

glm::vec3 DirectLight::point_source_illuminance(glm::vec3 point, glm::vec3 normal) const {
  glm::vec3 sum(0);
  for (const LocalSource& source : sources_) {
    const glm::vec3 to_source = source.position - point;
    const float distance2 = glm::dot(to_source, to_source), cosine = glm::dot(to_source, normal) / std::sqrt(distance2);
    if (!(distance2 > 0) || cosine <= 0) continue;
    const Ray ray{point, to_source, 0, 1};
    std::uint8_t blocked = 0;
    rays_.occluded(RayScene::What::kOpaque, {&ray, 1}, {&blocked, 1});
    if (!blocked) sum += source.intensity * (cosine / distance2 * rays_.transmittance(ray));
  }
  return sum;
}

glm::vec3 DirectLight::illuminance(const std::vector<Beam>& beams, glm::vec3 point, glm::vec3 normal) const {
  glm::vec3 sum = point_source_illuminance(point, normal);
  for (const Beam& beam : beams) {
    const float cosine = glm::dot(beam.direction_to_source, normal);
    if (cosine <= 0) continue;
    float share = 0;
    beam_transmission(beam, {&point, 1}, {&share, 1});
    sum += beam.normal_illuminance * (cosine * share);
  }
  return sum;
}

// Lifted points of some elements of a slot, `samples` each.
std::vector<glm::vec3> DirectLight::points_on(int slot_index, const Corners& corners, std::span<const int> elements,
                                              int samples, const Patterns& patterns) const {
  const Slot slot = mesh_.slot(slot_index);
  std::vector<glm::vec3> points;
  points.reserve(elements.size() * static_cast<std::size_t>(samples));
  const bool is_quad = mesh_.grid(slot.face).is_quad;
  const int per_slot = mesh_.elements_per_slot(),
            edge = static_cast<int>(std::lround(std::sqrt(static_cast<float>(per_slot))));
  // A cell, and a quad's element in it, is the affine or bilinear picture of its own square or triangle.
  const glm::vec3 a = corners[0], ab = corners[1] - a, ac = corners[3] - a, twist = corners[2] - a - ab - ac;
  for (const int e : elements) {
    const Patterns::Pattern pattern = patterns.of(slot_index * per_slot + e);
    for (int i = 0; i < samples; ++i) {
      const glm::vec2 local = mesh_.sample_local(slot.face, pattern[i]);
      if (is_quad) {
        const glm::vec2 u = (glm::vec2(e % edge, e / edge) + local) / static_cast<float>(edge);
        points.push_back(a + u.x * ab + u.y * ac + u.x * u.y * twist);
      } else {
        points.push_back(
            mesh_.lifted_position(slot.face, slot.side, mesh_.element_parameters(slot.face, slot.cell, e, local)));
      }
    }
  }
  return points;
}

// The few samples that every element of the candidates has: share of a beam, kSamplesPerElement an element.
std::vector<float> DirectLight::sample_sun(const Sun& sun, const Receivers& receivers,
                                           const std::vector<SunlitSlot>& candidates, const Patterns& patterns) const {
  std::vector<int> elements(static_cast<std::size_t>(mesh_.elements_per_slot()));
  std::iota(elements.begin(), elements.end(), 0);
  const std::size_t samples_per_slot = elements.size() * kSamplesPerElement;
  std::vector<float> share(candidates.size() * samples_per_slot);
  parallel_indices(candidates.size(), kGrain, [&](std::size_t k) {
    const std::size_t i = candidates[k].receiver;
    const std::vector<glm::vec3> points =
        points_on(receivers.slots[i], receivers.corners[i], elements, kSamplesPerElement, patterns);
    sun_transmission(sun, candidates[k], points, {&share[k * samples_per_slot], samples_per_slot});
  });
  return share;
}

// The elements of a slot whose telling samples differ from each other or from those of an element beside them, in the
// same face. Patches without samples are dark. In triangles, the elements of a patch are all beside each other.
std::vector<int> DirectLight::partly_lit(int slot_index, const std::vector<int>& place_of_slot,
                                         const std::vector<float>& share) const {
  const Slot slot = mesh_.slot(slot_index);
  const Grid& grid = mesh_.grid(slot.face);
  const int per_slot = mesh_.elements_per_slot(),
            edge = static_cast<int>(std::lround(std::sqrt(static_cast<float>(per_slot))));
  const auto sample = [&](int of_slot, int element, int i) {
    const int place = place_of_slot[of_slot];
    return place < 0 ? 0.f : share[(static_cast<std::size_t>(place) * per_slot + element) * kSamplesPerElement + i];
  };
  std::vector<int> found;
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
void DirectLight::add_sun(const Beam& sun, const Receivers& receivers, const Patterns& patterns,
                          std::vector<std::vector<glm::vec3>>& sum, BeamPlan& plan) const {
  const Sun seen(*this, sun);
  const std::vector<SunlitSlot> candidates = reached(seen, receivers);
  plan.facing_openings += static_cast<int>(std::count(seen.lets_in.begin(), seen.lets_in.end(), 1));
  plan.patches += static_cast<int>(candidates.size());
  if (candidates.empty()) return;
  ++plan.beams;
  plan.is_unshaded |= is_convex_;
  const std::vector<float> share = sample_sun(seen, receivers, candidates, patterns);
  std::vector<int> place_of_slot(static_cast<std::size_t>(mesh_.slot_count()), -1);
  for (std::size_t k = 0; k < candidates.size(); ++k)
    place_of_slot[receivers.slots[candidates[k].receiver]] = static_cast<int>(k);
  const int per_slot = mesh_.elements_per_slot();
  parallel_indices(candidates.size(), kGrain, [&](std::size_t k) {
    const std::size_t i = candidates[k].receiver;
    const glm::vec3 full = sun.normal_illuminance * glm::dot(sun.direction_to_source, receivers.normals[i]);
    const float* own = &share[k * static_cast<std::size_t>(per_slot * kSamplesPerElement)];
    std::vector<float> mean(static_cast<std::size_t>(per_slot));
    for (int e = 0; e < per_slot; ++e)
      mean[e] =
          std::accumulate(own + e * kSamplesPerElement + kTellingSamples, own + (e + 1) * kSamplesPerElement, 0.f) /
          static_cast<float>(kSamplesPerElement - kTellingSamples);
    const std::vector<int> elements = partly_lit(receivers.slots[i], place_of_slot, share);
    std::vector<float> refined(elements.size() * kRefinedSamplesPerElement);
    const std::vector<glm::vec3> points =
        points_on(receivers.slots[i], receivers.corners[i], elements, kRefinedSamplesPerElement, patterns);
    sun_transmission(seen, candidates[k], points, refined);
    for (std::size_t n = 0; n < elements.size(); ++n)
      mean[elements[n]] = std::accumulate(&refined[n * kRefinedSamplesPerElement],
                                          &refined[n * kRefinedSamplesPerElement] + kRefinedSamplesPerElement, 0.f) /
                          kRefinedSamplesPerElement;
    sum[i].resize(static_cast<std::size_t>(per_slot), glm::vec3(0));
    for (int e = 0; e < per_slot; ++e) sum[i][e] += mean[e] * full;
  });
}

void DirectLight::sources_on_slot(int slot_index, const Corners& corners, glm::vec3 normal, const Patterns& patterns,
                                  std::vector<glm::vec3>& sum) const {
  std::vector<int> elements(static_cast<std::size_t>(mesh_.elements_per_slot()));
  std::iota(elements.begin(), elements.end(), 0);
  const std::vector<glm::vec3> points = points_on(slot_index, corners, elements, kSourceSamplesPerElement, patterns);
  for (std::size_t i = 0; i < points.size(); ++i)
    sum[i / kSourceSamplesPerElement] +=
        point_source_illuminance(points[i], normal) / static_cast<float>(kSourceSamplesPerElement);
}

// The receivers that the sun may reach.
std::vector<DirectLight::SunlitSlot> DirectLight::reached(const Sun& sun, const Receivers& receivers) const {
  std::vector<SunlitSlot> found;
  int known_face = -1;
  std::vector<int> over_face, over_slot;
  for (std::size_t i = 0; i < receivers.slots.size(); ++i) {
    if (mesh_.is_cluster(receivers.slots[i]) || glm::dot(sun.beam.direction_to_source, receivers.normals[i]) <= 0)
      continue;
    const int f = mesh_.slot(receivers.slots[i]).face;
    const Face& face = mesh_.faces().faces[f];
    if (f != known_face) sun.outlines.covering(sun.outlines.outline({face.corner, face.is_quad ? 4u : 3u}), over_face);
    known_face = f;
    const BeamOutline outline = sun.outlines.outline(receivers.corners[i]);
    over_slot.clear();
    for (const int k : over_face)
      if (sun.outlines.covers(k, outline)) over_slot.push_back(k);
    const bool is_behind = receivers.is_behind_openings[i] != 0;
    if (is_behind && std::none_of(over_slot.begin(), over_slot.end(), [&](int k) { return sun.lets_in[k] != 0; }))
      continue;
    found.push_back({i, is_behind, over_slot});
  }
  return found;
}

// Share of the sun's light that arrives at lifted points of a slot, but for what comes through a small opening first.
// Where openings stand in the way is known in closed form: rays look for what is opaque, and only from points that
// openings let light to.
void DirectLight::sun_transmission(const Sun& sun, const SunlitSlot& slot, std::span<const glm::vec3> points,
                                   std::span<float> share) const {
  struct Scratch {
    std::vector<Ray> rays;
    std::vector<std::uint8_t> blocked;
    std::vector<float> x, y, z;
    std::vector<int> is_behind, is_crossed;
  };
  thread_local Scratch of_thread;
  Scratch& scratch = of_thread;  // asked for once
  const std::size_t count = points.size();
  for (std::vector<float>* list : {&scratch.x, &scratch.y, &scratch.z}) list->resize(count);
  scratch.is_behind.resize(count);
  scratch.is_crossed.assign(count, slot.is_behind_openings ? 0 : 1);
  scratch.rays.resize(count);
  scratch.blocked.resize(count);
  float *x = scratch.x.data(), *y = scratch.y.data(), *z = scratch.z.data();
  int *is_behind = scratch.is_behind.data(), *is_crossed = scratch.is_crossed.data();
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 place = sun.outlines.along_beam(points[i]);
    x[i] = place.x;
    y[i] = place.y;
    z[i] = place.z;
    share[i] = 1;
  }
  for (const int k : slot.passages) {
    sun.outlines.mark_behind(k, scratch.x, scratch.y, scratch.z, scratch.is_behind);
    const float transmittance = sun.transmittance[k];
    for (std::size_t i = 0; i < count; ++i) {
      share[i] *= is_behind[i] ? transmittance : 1.f;
      is_crossed[i] |= is_behind[i];
    }
  }
  std::size_t ray_count = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_crossed[i]) share[i] = 0;
    if (share[i] > 0) scratch.rays[ray_count++] = {points[i], sun.beam.direction_to_source};
  }
  if (is_convex_ && slot.is_behind_openings)
    std::fill_n(scratch.blocked.begin(), ray_count, std::uint8_t{0});
  else
    rays_.occluded(RayScene::What::kOpaque, {scratch.rays.data(), ray_count}, {scratch.blocked.data(), ray_count},
                   RayScene::Order::kCoherent);
  for (std::size_t i = 0, next = 0; i < count; ++i)
    if (share[i] > 0 && scratch.blocked[next++]) share[i] = 0;
  ignore_small_openings(sun.beam.direction_to_source, points, share);
}

// Faces of a cluster look many ways: each sample asks for the light at its own place.
void DirectLight::sources_and_beams_on_cluster(const std::vector<Beam>& beams, int slot, std::uint32_t seed,
                                               std::vector<glm::vec3>& sum) const {
  const int per_slot = mesh_.elements_per_slot();
  sum.resize(static_cast<std::size_t>(per_slot), glm::vec3(0));
  for (int e = 0; e < per_slot; ++e) {
    const int element = slot * per_slot + e;
    if (!(mesh_.element_area(element) > 0)) continue;
    const SobolSequence sequence(hash_seed(seed, static_cast<std::uint64_t>(element)));
    for (std::uint32_t i = 0; i < kSamplesPerElement; ++i) {
      const Node place = mesh_.place_on_element(element, sequence.point2(i));
      sum[e] += illuminance(beams, place.position, place.normal) / static_cast<float>(kSamplesPerElement);
    }
  }
}

std::vector<LitElement> DirectLight::deposit(const std::vector<Beam>& beams, const Receivers& receivers,
                                             std::uint32_t seed, BeamPlan* plan) const {
  BeamPlan unasked;
  std::vector<LitElement> lit;
  if (beams.empty() && sources_.empty()) return lit;
  const Patterns patterns(seed);
  const int per_slot = mesh_.elements_per_slot();
  std::vector<std::vector<glm::vec3>> sum(receivers.slots.size());  // by element, or empty
  for (const Beam& beam : beams) {
    if (beam.normal_illuminance == glm::vec3(0)) continue;
    if (beam.opening < 0)
      add_sun(beam, receivers, patterns, sum, plan ? *plan : unasked);
    else
      add_lobe(beam, receivers, seed, sum, plan ? *plan : unasked);
  }
  parallel_indices(receivers.slots.size(), kGrain, [&](std::size_t i) {
    if (mesh_.is_cluster(receivers.slots[i])) sources_and_beams_on_cluster(beams, receivers.slots[i], seed, sum[i]);
  });
  const std::map<int, glm::vec3> sent = send_through_small_openings(beams, seed);
  if (!sources_.empty() || !sent.empty())
    parallel_indices(receivers.slots.size(), kGrain, [&](std::size_t i) {
      sum[i].resize(static_cast<std::size_t>(per_slot), glm::vec3(0));
      if (!sources_.empty() && !mesh_.is_cluster(receivers.slots[i]))
        sources_on_slot(receivers.slots[i], receivers.corners[i], receivers.normals[i], patterns, sum[i]);
      const int first = receivers.slots[i] * per_slot;
      for (auto entry = sent.lower_bound(first); entry != sent.end() && entry->first < first + per_slot; ++entry)
        sum[i][entry->first - first] += entry->second;
    });
  for (std::size_t i = 0; i < receivers.slots.size(); ++i)
    for (std::size_t e = 0; e < sum[i].size(); ++e)
      if (sum[i][e] != glm::vec3(0)) lit.push_back({receivers.slots[i] * per_slot + static_cast<int>(e), sum[i][e]});
  return lit;
}

}  // namespace transom
