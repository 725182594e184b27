#include "transom/deposit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "transom/beam_outlines.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kSamplesPerElement = 4;          // of a beam
constexpr int kTellingSamples = 2;             // of these, the ones that say whether an element is partly lit
constexpr int kRefinedSamplesPerElement = 16;  // at the edges of light
constexpr int kSourceSamplesPerElement = 16;   // of point sources
constexpr float kSameShare = 1e-3f;            // of a beam, between samples of an evenly lit element
constexpr std::size_t kGrain = 4;
constexpr std::uint32_t kRaysPerSmallOpening = 256;
constexpr float kGrazingCosine = 1e-3f;  // below it a small opening lets nothing through
constexpr std::uint32_t kPatternCount = 64;
constexpr std::uint32_t kPatternPoints = 16;
static_assert(kPatternPoints >= kRefinedSamplesPerElement && kPatternPoints >= kSourceSamplesPerElement);

}  // namespace

// Places of samples in an element, evenly spread: a choice of patterns, so that neighbours do not repeat each other.
class DirectLight::Patterns {
 public:
  explicit Patterns(std::uint32_t seed) : seed_(seed) {
    for (std::uint32_t pattern = 0; pattern < kPatternCount; ++pattern) {
      const SobolSequence sequence(hash_seed(seed, pattern));
      for (std::uint32_t i = 0; i < kPatternPoints; ++i) points_.push_back(sequence.point2(i));
    }
  }
  std::span<const glm::vec2> of(int element) const {
    const std::uint32_t pattern = hash_seed(seed_, static_cast<std::uint64_t>(element)) % kPatternCount;
    return {&points_[static_cast<std::size_t>(pattern) * kPatternPoints], kPatternPoints};
  }

 private:
  std::uint32_t seed_;
  std::vector<glm::vec2> points_;
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
    : mesh_(mesh), rays_(rays), is_small_opening_(mesh.faces().faces.size(), 0) {
  for (std::size_t f = 0; f < is_small_opening_.size(); ++f) {
    const Face& face = mesh.faces().faces[f];
    if (materials[face.material].opening < 0) continue;
    is_small_opening_[f] = face.area < small_opening_m2;
    (is_small_opening_[f] ? small_openings_ : large_openings_).push_back(static_cast<int>(f));
  }
  for (const PointSource& source : sources)
    sources_.push_back({glm::vec3(source.position - mesh.faces().origin), source.intensity});
}

void DirectLight::beam_transmission(const Beam& beam, std::span<const glm::vec3> points,
                                    std::span<float> share) const {
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
    const std::span<const glm::vec2> pattern = patterns.of(slot_index * per_slot + e);
    for (int i = 0; i < samples; ++i) {
      const glm::vec2 local = mesh_.sample_local(slot.face, pattern[static_cast<std::size_t>(i)]);
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

// Whether the samples of an element, or of one beside it, differ. Elements of triangles ask all of their patch.
bool DirectLight::is_partly_lit(int slot_index, int element, std::span<const float> share) const {
  const int edge = static_cast<int>(std::lround(std::sqrt(static_cast<float>(mesh_.elements_per_slot())))),
            x = element % edge, y = element / edge;
  const bool is_quad = mesh_.grid(mesh_.slot(slot_index).face).is_quad;
  const float own = share[static_cast<std::size_t>(element * kSamplesPerElement)];
  for (int e = 0; e < mesh_.elements_per_slot(); ++e) {
    if (is_quad && (std::abs(e % edge - x) > 1 || std::abs(e / edge - y) > 1)) continue;
    for (int i = 0; i < kTellingSamples; ++i)
      if (std::abs(share[static_cast<std::size_t>(e * kSamplesPerElement + i)] - own) > kSameShare) return true;
  }
  return false;
}

// Mean share of a beam on each element of a slot. Few samples tell elements that are wholly lit or dark from those at
// the edges of light, which are sampled densely.
void DirectLight::sun_on_slot(const Beam& sun, int slot_index, const Corners& corners, const Patterns& patterns,
                              std::vector<float>& mean) const {
  const int element_count = mesh_.elements_per_slot();
  std::vector<int> elements(static_cast<std::size_t>(element_count));
  std::iota(elements.begin(), elements.end(), 0);
  std::vector<float> share(static_cast<std::size_t>(element_count * kSamplesPerElement));
  std::vector<glm::vec3> points = points_on(slot_index, corners, elements, kSamplesPerElement, patterns);
  beam_transmission(sun, points, share);
  ignore_small_openings(sun.direction_to_source, points, share);
  mean.resize(static_cast<std::size_t>(element_count));
  for (int e = 0; e < element_count; ++e)
    mean[e] = std::accumulate(&share[e * kSamplesPerElement + kTellingSamples],
                              &share[e * kSamplesPerElement] + kSamplesPerElement, 0.f) /
              static_cast<float>(kSamplesPerElement - kTellingSamples);
  std::erase_if(elements, [&](int e) { return !is_partly_lit(slot_index, e, share); });
  if (elements.empty()) return;
  std::vector<float> refined(elements.size() * kRefinedSamplesPerElement);
  points = points_on(slot_index, corners, elements, kRefinedSamplesPerElement, patterns);
  beam_transmission(sun, points, refined);
  ignore_small_openings(sun.direction_to_source, points, refined);
  for (std::size_t k = 0; k < elements.size(); ++k)
    mean[elements[k]] = std::accumulate(&refined[k * kRefinedSamplesPerElement],
                                        &refined[k * kRefinedSamplesPerElement] + kRefinedSamplesPerElement, 0.f) /
                        kRefinedSamplesPerElement;
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

std::vector<std::vector<char>> DirectLight::reach(const std::vector<Beam>& beams, const Receivers& receivers) const {
  std::vector<std::vector<char>> reached(beams.size(), std::vector<char>(receivers.slots.size(), 0));
  for (std::size_t b = 0; b < beams.size(); ++b) {
    if (beams[b].normal_illuminance == glm::vec3(0)) continue;
    if (beams[b].opening >= 0) {
      reached[b] = reach_of_lobe(beams[b], receivers);
      continue;
    }
    const glm::vec3 direction = beams[b].direction_to_source;
    const BeamOutlines outlines(mesh_.faces(), large_openings_, direction);
    int known_face = -1;
    std::vector<int> passages;  // over that face
    for (std::size_t i = 0; i < receivers.slots.size(); ++i) {
      if (glm::dot(direction, receivers.normals[i]) <= 0) continue;
      if (!receivers.is_behind_openings[i]) {
        reached[b][i] = 1;
        continue;
      }
      const int f = mesh_.slot(receivers.slots[i]).face;
      const Face& face = mesh_.faces().faces[f];
      if (f != known_face) outlines.covering(outlines.outline({face.corner, face.is_quad ? 4u : 3u}), passages);
      known_face = f;
      if (passages.empty()) continue;
      reached[b][i] = outlines.is_covered(outlines.outline(receivers.corners[i]), passages);
    }
  }
  return reached;
}

// Takes the light away that comes to the points through a small opening first.
void DirectLight::ignore_small_openings(glm::vec3 direction, std::span<const glm::vec3> points,
                                        std::span<float> share) const {
  if (small_openings_.empty()) return;
  std::vector<Ray> rays;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (share[i] > 0) {
      rays.push_back({points[i], direction});
      index.push_back(i);
    }
  std::vector<Hit> hits(rays.size());
  rays_.intersect(RayScene::What::kOpenings, rays, hits);
  for (std::size_t k = 0; k < hits.size(); ++k)
    if (hits[k].face >= 0 && is_small_opening_[hits[k].face]) share[index[k]] = 0;
}

// Mean illuminance of elements by the light of small openings: equal parts of it from places all over each.
std::map<int, glm::vec3> DirectLight::send_through_small_openings(const std::vector<Beam>& beams,
                                                                  std::uint32_t seed) const {
  std::map<int, glm::vec3> sent;
  std::vector<glm::vec3> places(kRaysPerSmallOpening);
  std::vector<float> share(kRaysPerSmallOpening);
  std::vector<Ray> onwards(kRaysPerSmallOpening);
  std::vector<Hit> hits(kRaysPerSmallOpening);
  for (const int f : small_openings_)
    for (const Beam& beam : beams) {
      if (beam.opening >= 0) continue;
      const Face& face = mesh_.faces().faces[f];
      const float cosine = glm::dot(face.normal, beam.direction_to_source);
      if (std::abs(cosine) < kGrazingCosine) continue;
      // Off the face along the beam, not along the normal: the way back to the sun is then through that place of it.
      const glm::vec3 beyond = -mesh_.faces().ray_offset() / std::abs(cosine) * beam.direction_to_source;
      const SobolSequence points(hash_seed(seed, static_cast<std::uint64_t>(f)));
      for (std::uint32_t i = 0; i < kRaysPerSmallOpening; ++i) {
        const glm::vec2 u = points.point2(i);
        places[i] = face.position(face.is_quad ? u : sample_triangle(u)) + beyond;
        onwards[i] = {places[i], -beam.direction_to_source};
      }
      beam_transmission(beam, places, share);
      rays_.intersect(RayScene::What::kAll, onwards, hits);
      const float flux_share = face.area * std::abs(cosine) / static_cast<float>(kRaysPerSmallOpening);
      for (std::size_t i = 0; i < hits.size(); ++i) {
        const Hit& hit = hits[i];
        if (share[i] <= 0 || hit.face < 0 || mesh_.faces().is_inside_solid(hit.face, hit.side)) continue;
        const int element = mesh_.element_at(hit), per_slot = mesh_.elements_per_slot();
        const Slot slot = mesh_.slot(element / per_slot);
        const float area = mesh_.element_area(slot.face, slot.cell, element % per_slot);
        if (area > 0) sent[element] += beam.normal_illuminance * (share[i] * flux_share / area);
      }
    }
  return sent;
}

std::vector<LitElement> DirectLight::deposit(const std::vector<Beam>& beams, const Receivers& receivers,
                                             std::uint32_t seed) const {
  std::vector<LitElement> lit;
  if (beams.empty() && sources_.empty()) return lit;
  const std::vector<std::vector<char>> reached = reach(beams, receivers);
  const std::map<int, glm::vec3> sent = send_through_small_openings(beams, seed);
  const int per_slot = mesh_.elements_per_slot();
  const auto is_sent = [&](int slot) {
    const auto entry = sent.lower_bound(slot * per_slot);
    return entry != sent.end() && entry->first < (slot + 1) * per_slot;
  };
  std::vector<std::size_t> candidates;
  for (std::size_t i = 0; i < receivers.slots.size(); ++i)
    if (!sources_.empty() || is_sent(receivers.slots[i]) ||
        std::any_of(reached.begin(), reached.end(), [i](const std::vector<char>& by_beam) { return by_beam[i] != 0; }))
      candidates.push_back(i);
  const Patterns patterns(seed);
  std::vector<std::vector<glm::vec3>> sum(candidates.size());
  parallel_indices(candidates.size(), kGrain, [&](std::size_t k) {
    const int slot_index = receivers.slots[candidates[k]];
    const Corners& corners = receivers.corners[candidates[k]];
    const glm::vec3 normal = receivers.normals[candidates[k]];
    sum[k].assign(static_cast<std::size_t>(per_slot), glm::vec3(0));
    std::vector<float> mean;
    for (std::size_t b = 0; b < beams.size(); ++b) {
      if (!reached[b][candidates[k]]) continue;
      const float cosine = glm::dot(beams[b].direction_to_source, normal);
      if (beams[b].opening < 0)
        sun_on_slot(beams[b], slot_index, corners, patterns, mean);
      else
        lobe_on_slot(beams[b], slot_index, seed, mean);
      for (int e = 0; e < per_slot; ++e) sum[k][e] += beams[b].normal_illuminance * (cosine * mean[e]);
    }
    if (!sources_.empty()) sources_on_slot(slot_index, corners, normal, patterns, sum[k]);
    for (auto entry = sent.lower_bound(slot_index * per_slot);
         entry != sent.end() && entry->first < (slot_index + 1) * per_slot; ++entry)
      sum[k][entry->first % per_slot] += entry->second;
  });
  for (std::size_t k = 0; k < candidates.size(); ++k)
    for (int e = 0; e < per_slot; ++e)
      if (sum[k][e] != glm::vec3(0)) lit.push_back({receivers.slots[candidates[k]] * per_slot + e, sum[k][e]});
  return lit;
}

}  // namespace transom
