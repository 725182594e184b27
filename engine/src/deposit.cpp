#include "transom/deposit.h"

#include <cmath>
#include <numeric>

#include "deposit_samples.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kSamplesPerElement = 4;         // of a cluster's element
constexpr int kSourceSamplesPerElement = 16;  // of point sources
constexpr std::size_t kGrain = 4;
static_assert(kPatternPoints >= kSourceSamplesPerElement);

}  // namespace

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
                         const std::vector<Material>& materials, float small_opening_m2, bool is_convex,
                         std::uint32_t seed)
    : mesh_(mesh),
      rays_(rays),
      seed_(seed),
      patterns_(std::make_unique<const Patterns>(seed)),
      is_convex_(is_convex),
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

DirectLight::~DirectLight() = default;

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
DirectLight::Points DirectLight::points_on(int slot_index, const Corners& corners, std::span<const int> elements,
                                           std::size_t samples) const {
  const Slot slot = mesh_.slot(slot_index);
  Points points;
  points.resize(elements.size() * samples);
  const bool is_quad = mesh_.grid(slot.face).is_quad;
  const int per_slot = mesh_.elements_per_slot(), edge = mesh_.elements_per_edge();
  const float part = 1 / static_cast<float>(edge);
  // A cell, and a quad's element in it, is the affine or bilinear picture of its own square or triangle.
  const glm::vec3 a = corners[0], ab = corners[1] - a, ac = corners[3] - a, twist = corners[2] - a - ab - ac;
  for (std::size_t n = 0; n < elements.size(); ++n) {
    const int e = elements[n];
    const Patterns::Pattern pattern = patterns_->of(slot_index * per_slot + e);
    const glm::vec2 first(e % edge, e / edge);
    if (is_quad) {
      for (std::size_t i = 0; i < samples; ++i) {
        const glm::vec2 u = part * (first + pattern[i]);
        points.set(n * samples + i, a + u.x * ab + u.y * ac + u.x * u.y * twist);
      }
    } else {
      for (std::size_t i = 0; i < samples; ++i)
        points.set(n * samples + i, mesh_.lifted_position(slot.face, slot.side,
                                                          mesh_.element_parameters(slot.face, slot.cell, e,
                                                                                   sample_triangle(pattern[i]))));
    }
  }
  return points;
}

void DirectLight::sources_on_slot(int slot_index, const Corners& corners, glm::vec3 normal,
                                  std::vector<glm::vec3>& sum) const {
  std::vector<int> elements(static_cast<std::size_t>(mesh_.elements_per_slot()));
  std::iota(elements.begin(), elements.end(), 0);
  const Points points = points_on(slot_index, corners, elements, kSourceSamplesPerElement);
  for (std::size_t i = 0; i < points.size(); ++i)
    sum[i / kSourceSamplesPerElement] +=
        point_source_illuminance(points[i], normal) / static_cast<float>(kSourceSamplesPerElement);
}

// Faces of a cluster look many ways: each sample asks for the light at its own place, but for what comes through a
// small opening first.
void DirectLight::sources_and_beams_on_cluster(const std::vector<Beam>& beams, int slot,
                                               std::vector<glm::vec3>& sum) const {
  const int per_slot = mesh_.elements_per_slot();
  sum.resize(static_cast<std::size_t>(per_slot), glm::vec3(0));
  struct Place {
    int element;
    glm::vec3 position, normal, illuminance;
  };
  std::vector<Place> places;
  for (int e = 0; e < per_slot; ++e) {
    const int element = slot * per_slot + e;
    if (!(mesh_.element_area(element) > 0)) continue;
    const SobolSequence sequence(hash_seed(seed_, static_cast<std::uint64_t>(element)));
    for (std::uint32_t i = 0; i < kSamplesPerElement; ++i) {
      const auto [position, normal] = mesh_.place_on_element(element, sequence.point2(i));
      places.push_back({e, position, normal, point_source_illuminance(position, normal)});
    }
  }
  std::vector<std::size_t> facing;
  std::vector<glm::vec3> points;
  std::vector<float> share;
  for (const Beam& beam : beams) {
    facing.clear();
    points.clear();
    for (std::size_t i = 0; i < places.size(); ++i)
      if (glm::dot(beam.direction_to_source, places[i].normal) > 0) {
        facing.push_back(i);
        points.push_back(places[i].position);
      }
    share.resize(points.size());
    beam_transmission(beam, points, share);
    if (beam.opening < 0) ignore_small_openings(beam.direction_to_source, Points::of(points), share);
    for (std::size_t k = 0; k < facing.size(); ++k) {
      Place& place = places[facing[k]];
      place.illuminance += beam.normal_illuminance * (glm::dot(beam.direction_to_source, place.normal) * share[k]);
    }
  }
  for (const Place& place : places) sum[place.element] += place.illuminance / static_cast<float>(kSamplesPerElement);
}

std::vector<LitElement> DirectLight::deposit(const std::vector<Beam>& beams, const Receivers& receivers,
                                             BeamPlan* plan) const {
  BeamPlan unasked;
  std::vector<LitElement> lit;
  if (beams.empty() && sources_.empty()) return lit;
  const int per_slot = mesh_.elements_per_slot();
  std::vector<std::vector<glm::vec3>> sum(receivers.slots.size());  // by element, or empty
  for (const Beam& beam : beams) {
    if (beam.normal_illuminance == glm::vec3(0)) continue;
    if (beam.opening < 0)
      add_sun(beam, receivers, sum, plan ? *plan : unasked);
    else
      add_lobe(beam, receivers, sum, plan ? *plan : unasked);
  }
  parallel_indices(receivers.slots.size(), kGrain, [&](std::size_t i) {
    if (mesh_.is_cluster(receivers.slots[i])) sources_and_beams_on_cluster(beams, receivers.slots[i], sum[i]);
  });
  const std::map<int, glm::vec3> sent = send_through_small_openings(beams);
  if (!sources_.empty() || !sent.empty())
    parallel_indices(receivers.slots.size(), kGrain, [&](std::size_t i) {
      sum[i].resize(static_cast<std::size_t>(per_slot), glm::vec3(0));
      if (!sources_.empty() && !mesh_.is_cluster(receivers.slots[i]))
        sources_on_slot(receivers.slots[i], receivers.corners[i], receivers.normals[i], sum[i]);
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
