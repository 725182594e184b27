#include "transom/deposit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kSamplesPerElement = 4;          // of a beam, to find out which patches are lit, and wholly or partly
constexpr int kRefinedSamplesPerElement = 32;  // on patches that are partly lit
constexpr int kSourceSamplesPerElement = 16;   // of point sources
constexpr float kSameShare = 1e-3f;            // of a beam, between samples of an evenly lit element
constexpr std::size_t kGrain = 16;
constexpr std::uint32_t kRaysPerSmallOpening = 256;
constexpr float kGrazingCosine = 1e-3f;  // below it a small opening lets nothing through

}  // namespace

DirectLight::DirectLight(const LightMesh& mesh, const RayScene& rays, const std::vector<PointSource>& sources,
                         const std::vector<Material>& materials, float small_opening_m2)
    : mesh_(mesh), rays_(rays), is_small_opening_(mesh.faces().faces.size(), 0) {
  for (std::size_t f = 0; f < is_small_opening_.size(); ++f) {
    const Face& face = mesh.faces().faces[f];
    if (materials[face.material].opening < 0 || face.area >= small_opening_m2) continue;
    small_openings_.push_back(static_cast<int>(f));
    is_small_opening_[f] = 1;
  }
  for (const PointSource& source : sources)
    sources_.push_back({glm::vec3(source.position - mesh.faces().origin), source.intensity});
}

void DirectLight::beam_transmission(glm::vec3 direction, std::span<const glm::vec3> points,
                                    std::span<float> share) const {
  std::vector<Ray> rays(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) rays[i] = {points[i], direction};
  std::vector<std::uint8_t> blocked(points.size());
  rays_.occluded(RayScene::What::kOpaque, rays, blocked, RayScene::Order::kCoherent);
  std::vector<Ray> free_rays;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!blocked[i]) free_rays.push_back(rays[i]);
  std::vector<float> transmitted(free_rays.size());
  rays_.transmittance(free_rays, transmitted);
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
    beam_transmission(beam.direction_to_source, {&point, 1}, {&share, 1});
    sum += beam.normal_illuminance * (cosine * share);
  }
  return sum;
}

// Lifted points of some elements of a slot, `samples` each.
std::vector<glm::vec3> DirectLight::points_on(int slot_index, std::span<const int> elements, int samples,
                                              std::uint32_t seed) const {
  const Slot slot = mesh_.slot(slot_index);
  std::vector<glm::vec3> points;
  points.reserve(elements.size() * static_cast<std::size_t>(samples));
  const bool is_quad = mesh_.grid(slot.face).is_quad;
  const int edge = static_cast<int>(std::lround(std::sqrt(static_cast<float>(mesh_.elements_per_slot()))));
  // A cell, and a quad's element in it, is the affine or bilinear picture of its own square or triangle.
  const auto corner = [&](float u, float v) {
    return mesh_.lifted_position(slot.face, slot.side, mesh_.cell_parameters(slot.face, slot.cell, {u, v}));
  };
  const glm::vec3 a = corner(0, 0), ab = corner(1, 0) - a, ac = corner(0, 1) - a,
                  twist = is_quad ? corner(1, 1) - a - ab - ac : glm::vec3(0);
  for (const int e : elements) {
    const SobolSequence sequence(
        hash_seed(seed, static_cast<std::uint64_t>(slot_index) * mesh_.elements_per_slot() + e));
    for (int i = 0; i < samples; ++i) {
      const glm::vec2 local = mesh_.sample_local(slot.face, sequence.point2(static_cast<std::uint32_t>(i)));
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

// Mean share of a beam on each element of a slot. Few samples tell patches that are wholly lit or dark from the others,
// which are sampled densely throughout: light thinner than the distance of samples is then missed and found alike.
void DirectLight::beam_on_slot(glm::vec3 direction, int slot_index, std::uint32_t seed,
                               std::vector<float>& mean) const {
  const int element_count = mesh_.elements_per_slot();
  std::vector<int> elements(static_cast<std::size_t>(element_count));
  std::iota(elements.begin(), elements.end(), 0);
  std::vector<float> share(static_cast<std::size_t>(element_count * kSamplesPerElement));
  std::vector<glm::vec3> points = points_on(slot_index, elements, kSamplesPerElement, seed);
  beam_transmission(direction, points, share);
  ignore_small_openings(direction, points, share);
  const auto [least, most] = std::minmax_element(share.begin(), share.end());
  mean.assign(static_cast<std::size_t>(element_count), *most);
  if (*most - *least <= kSameShare) return;
  share.resize(elements.size() * kRefinedSamplesPerElement);
  points = points_on(slot_index, elements, kRefinedSamplesPerElement, seed);
  beam_transmission(direction, points, share);
  ignore_small_openings(direction, points, share);
  for (std::size_t k = 0; k < elements.size(); ++k)
    mean[elements[k]] = std::accumulate(&share[k * kRefinedSamplesPerElement],
                                        &share[k * kRefinedSamplesPerElement] + kRefinedSamplesPerElement, 0.f) /
                        kRefinedSamplesPerElement;
}

void DirectLight::deposit_on_slot(const std::vector<Beam>& beams, int slot_index, std::uint32_t seed,
                                  std::vector<LitElement>& lit) const {
  const Slot slot = mesh_.slot(slot_index);
  const Face& face = mesh_.faces().faces[slot.face];
  const glm::vec3 normal = slot.side == 0 ? face.normal : -face.normal;
  const int element_count = mesh_.elements_per_slot();
  if (mesh_.is_cluster(slot_index)) {
    for (int e = 0; e < element_count; ++e) deposit_on_cluster(beams, slot_index * element_count + e, seed, lit);
    return;
  }
  std::vector<glm::vec3> sum;
  std::vector<float> mean;
  for (const Beam& beam : beams) {
    const float cosine = glm::dot(beam.direction_to_source, normal);
    if (cosine <= 0 || beam.normal_illuminance == glm::vec3(0)) continue;
    beam_on_slot(beam.direction_to_source, slot_index, seed, mean);
    sum.resize(static_cast<std::size_t>(element_count), glm::vec3(0));
    for (int e = 0; e < element_count; ++e) sum[e] += beam.normal_illuminance * (cosine * mean[e]);
  }
  if (!sources_.empty()) {
    std::vector<int> elements(static_cast<std::size_t>(element_count));
    std::iota(elements.begin(), elements.end(), 0);
    const std::vector<glm::vec3> points = points_on(slot_index, elements, kSourceSamplesPerElement, seed);
    sum.resize(static_cast<std::size_t>(element_count), glm::vec3(0));
    for (std::size_t i = 0; i < points.size(); ++i)
      sum[i / kSourceSamplesPerElement] +=
          point_source_illuminance(points[i], normal) / static_cast<float>(kSourceSamplesPerElement);
  }
  for (std::size_t e = 0; e < sum.size(); ++e)
    if (sum[e] != glm::vec3(0)) lit.push_back({slot_index * element_count + static_cast<int>(e), sum[e]});
}

// Faces of a cluster look many ways: each sample asks for the light at its own place.
void DirectLight::deposit_on_cluster(const std::vector<Beam>& beams, int element, std::uint32_t seed,
                                     std::vector<LitElement>& lit) const {
  if (!(mesh_.element_area(element) > 0)) return;
  const SobolSequence sequence(hash_seed(seed, static_cast<std::uint64_t>(element)));
  glm::vec3 sum(0);
  for (std::uint32_t i = 0; i < kSamplesPerElement; ++i) {
    const Node place = mesh_.place_on_element(element, sequence.point2(i));
    sum += illuminance(beams, place.position, place.normal) / static_cast<float>(kSamplesPerElement);
  }
  if (sum != glm::vec3(0)) lit.push_back({element, sum});
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
      beam_transmission(beam.direction_to_source, places, share);
      rays_.intersect(RayScene::What::kAll, onwards, hits);
      const float flux_share = face.area * std::abs(cosine) / static_cast<float>(kRaysPerSmallOpening);
      for (std::size_t i = 0; i < hits.size(); ++i) {
        const Hit& hit = hits[i];
        if (share[i] <= 0 || hit.face < 0 || mesh_.faces().is_inside_solid(hit.face, hit.side)) continue;
        const int element = mesh_.element_at(hit);
        const float area = mesh_.element_area(element);
        if (area > 0) sent[element] += beam.normal_illuminance * (share[i] * flux_share / area);
      }
    }
  return sent;
}

std::vector<LitElement> DirectLight::deposit(const std::vector<Beam>& beams, const std::vector<int>& slots,
                                             std::uint32_t seed) const {
  std::vector<LitElement> lit;
  if (beams.empty() && sources_.empty()) return lit;
  std::vector<std::vector<LitElement>> by_slot(slots.size());
  parallel_indices(slots.size(), kGrain, [&](std::size_t i) { deposit_on_slot(beams, slots[i], seed, by_slot[i]); });
  const std::map<int, glm::vec3> sent = send_through_small_openings(beams, seed);
  for (std::size_t i = 0; i < slots.size() && !sent.empty(); ++i) {
    const int first = slots[i] * mesh_.elements_per_slot(), last = first + mesh_.elements_per_slot();
    for (auto entry = sent.lower_bound(first); entry != sent.end() && entry->first < last; ++entry) {
      const int element = entry->first;
      const auto known = std::find_if(by_slot[i].begin(), by_slot[i].end(),
                                      [element](const LitElement& e) { return e.element == element; });
      if (known == by_slot[i].end())
        by_slot[i].push_back({element, entry->second});
      else
        known->illuminance += entry->second;
    }
  }
  for (const std::vector<LitElement>& part : by_slot) lit.insert(lit.end(), part.begin(), part.end());
  return lit;
}

}  // namespace transom
