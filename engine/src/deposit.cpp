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

}  // namespace

DirectLight::DirectLight(const LightMesh& mesh, const RayScene& rays, const std::vector<PointSource>& sources)
    : mesh_(mesh), rays_(rays) {
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
  beam_transmission(direction, points_on(slot_index, elements, kSamplesPerElement, seed), share);
  const auto [least, most] = std::minmax_element(share.begin(), share.end());
  mean.assign(static_cast<std::size_t>(element_count), *most);
  if (*most - *least <= kSameShare) return;
  share.resize(elements.size() * kRefinedSamplesPerElement);
  beam_transmission(direction, points_on(slot_index, elements, kRefinedSamplesPerElement, seed), share);
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

std::vector<LitElement> DirectLight::deposit(const std::vector<Beam>& beams, const std::vector<int>& slots,
                                             std::uint32_t seed) const {
  std::vector<LitElement> lit;
  if (beams.empty() && sources_.empty()) return lit;
  std::vector<std::vector<LitElement>> by_slot(slots.size());
  parallel_indices(slots.size(), kGrain, [&](std::size_t i) { deposit_on_slot(beams, slots[i], seed, by_slot[i]); });
  for (const std::vector<LitElement>& part : by_slot) lit.insert(lit.end(), part.begin(), part.end());
  return lit;
}

}  // namespace transom
