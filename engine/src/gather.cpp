#include "transom/gather.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "transom/panels.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kBlock = 64;                  // rays traced together
constexpr double kSmallSolidAngle = 2e-3;   // below it a triangle is sampled by area [sr]
constexpr int kMinimumRaysPerTriangle = 4;  // towards an opening triangle above the horizon
constexpr float kPi = std::numbers::pi_v<float>;

}  // namespace

void merge_shares(std::vector<Share>& shares) {
  std::sort(shares.begin(), shares.end(), [](const Share& a, const Share& b) { return a.index < b.index; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    if (kept > 0 && shares[kept - 1].index == shares[i].index)
      shares[kept - 1].weight += shares[i].weight;
    else
      shares[kept++] = shares[i];
  }
  shares.resize(kept);
}

Gatherer::Gatherer(const LightMesh& mesh, const RayScene& rays, const std::vector<Material>& materials,
                   const std::vector<OpeningGroup>& openings, const SkyBinIndex& sky, const Panels& panels)
    : mesh_(mesh), rays_(rays), materials_(materials), openings_(openings), sky_(sky), panels_(panels) {
  const std::vector<Face>& faces = mesh.faces().faces;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (materials[faces[f].material].opening < 0) continue;
    for (int part = 0; part < (faces[f].is_quad ? 2 : 1); ++part) {
      const glm::vec3 a = faces[f].corner[0], b = faces[f].corner[1 + part], c = faces[f].corner[2 + part];
      opening_triangles_.push_back({{a, b, c}, static_cast<int>(f), 0.5f * glm::length(glm::cross(b - a, c - a))});
    }
  }
}

template <typename OriginOf>
void Gatherer::gather_hemisphere(const OriginOf& origin_of, int count, std::uint32_t seed, GatherRow& row) const {
  const SobolSequence points(seed);
  const std::vector<std::uint32_t>& order = coherent_order(count);
  Ray rays[kBlock];
  Hit hits[kBlock];
  int buried = 0, escaped = 0;
  double inverse_distance = 0;
  std::vector<int> slots;  // one a ray
  slots.reserve(static_cast<std::size_t>(count));
  std::vector<int> open_bins;
  auto next = order.begin();
  for (int begin = 0; begin < count; begin += kBlock) {
    const int size = std::min(kBlock, count - begin);
    for (int i = 0; i < size; ++i) {
      while (*next >= static_cast<std::uint32_t>(count)) ++next;
      const glm::vec4 u = points.point4(*next++);
      const Origin origin = origin_of(glm::vec2(u.z, u.w));
      rays[i] = {origin.position, frame_from_normal(origin.normal) * sample_cosine_hemisphere({u.x, u.y})};
    }
    rays_.intersect(RayScene::What::kAll, {rays, static_cast<std::size_t>(size)},
                    {hits, static_cast<std::size_t>(size)}, RayScene::Order::kCoherent);
    for (int i = 0; i < size; ++i) {
      if (hits[i].face < 0) {
        ++escaped;
        open_bins.push_back(sky_(rays[i].direction));
      } else if (mesh_.faces().is_inside_solid(hits[i].face, hits[i].side)) {
        ++buried;
      } else {
        slots.push_back(mesh_.slot_at(hits[i]));
        inverse_distance += 1 / std::max(hits[i].t, mesh_.faces().ray_offset());
      }
    }
  }
  const int exposed = count - buried;
  row.exposure = static_cast<float>(exposed) / static_cast<float>(count);
  if (exposed == 0) return;
  const float share = 1 / static_cast<float>(exposed);
  std::sort(slots.begin(), slots.end());
  for (auto first = slots.begin(); first != slots.end();) {
    const auto last = std::find_if(first, slots.end(), [&](int slot) { return slot != *first; });
    row.reached.push_back({*first, share * static_cast<float>(last - first)});
    first = last;
  }
  for (const int bin : open_bins) row.sky.push_back({bin, kPi * share});
  row.escaped = static_cast<float>(escaped) * share;
  row.harmonic_distance = inverse_distance > 0 ? static_cast<float>(exposed / inverse_distance) : Ray::kInfinity;
}

template <typename OriginOf>
void Gatherer::gather_openings(const Origin& middle, const OriginOf& origin_of, int count, std::uint32_t seed,
                               GatherRow& row) const {
  if (opening_triangles_.empty() || row.exposure == 0) return;
  const auto triangle_from = [](const OpeningTriangle& t, glm::vec3 p) {
    return SphericalTriangle(glm::normalize(glm::dvec3(t.corner[0] - p)), glm::normalize(glm::dvec3(t.corner[1] - p)),
                             glm::normalize(glm::dvec3(t.corner[2] - p)));
  };
  // Rays in proportion to the solid angle, with a floor, and none for what lies behind the receiver.
  std::vector<double> importance(opening_triangles_.size(), 0.0);
  double total = 0;
  for (std::size_t k = 0; k < opening_triangles_.size(); ++k) {
    const OpeningTriangle& t = opening_triangles_[k];
    float highest = -1;
    for (const glm::vec3& corner : t.corner)
      highest = std::max(highest, glm::dot(corner - middle.position, middle.normal));
    if (highest < 0) continue;
    importance[k] = triangle_from(t, middle.position).solid_angle() + 1e-9;
    total += importance[k];
  }
  if (total == 0) return;

  struct Candidate {
    float weight;  // cos(theta) x solid angle / rays [sr]
    int face;
  };
  std::vector<Ray> segments;
  std::vector<Candidate> candidates;
  for (std::size_t k = 0; k < opening_triangles_.size(); ++k) {
    if (importance[k] == 0) continue;
    const OpeningTriangle& t = opening_triangles_[k];
    const int n = std::max(kMinimumRaysPerTriangle, static_cast<int>(std::lround(importance[k] / total * count)));
    const SobolSequence points(hash_seed(seed, k + 1));
    const std::vector<std::uint32_t>& order = coherent_order(n);
    const glm::vec3 normal = mesh_.faces().faces[t.face].normal;
    glm::vec3 seen_from = middle.position;
    SphericalTriangle seen = triangle_from(t, seen_from);
    for (const std::uint32_t index : order) {
      if (index >= static_cast<std::uint32_t>(n)) continue;
      const glm::vec4 u = points.point4(index);
      const Origin origin = origin_of(glm::vec2(u.z, u.w));
      if (origin.position != seen_from) seen = triangle_from(t, seen_from = origin.position);
      glm::vec3 to_opening;
      float solid_angle;
      if (seen.solid_angle() > kSmallSolidAngle) {
        const glm::vec3 direction(seen.sample({u.x, u.y}));
        const float facing = glm::dot(direction, normal);
        if (std::abs(facing) < 1e-6f) continue;
        to_opening = direction * (glm::dot(t.corner[0] - origin.position, normal) / facing);
        solid_angle = static_cast<float>(seen.solid_angle());
      } else {
        const glm::vec2 b = sample_triangle({u.x, u.y});
        to_opening =
            t.corner[0] + b.x * (t.corner[1] - t.corner[0]) + b.y * (t.corner[2] - t.corner[0]) - origin.position;
        const float distance2 = glm::dot(to_opening, to_opening);
        if (distance2 == 0) continue;
        solid_angle = t.area * std::abs(glm::dot(to_opening, normal)) / (distance2 * std::sqrt(distance2));
      }
      const float distance = glm::length(to_opening);
      if (!(distance > 0)) continue;
      const float cosine = glm::dot(to_opening, origin.normal) / distance;
      if (cosine <= 0) continue;
      segments.push_back({origin.position, to_opening / distance, 0, distance - mesh_.faces().ray_offset()});
      candidates.push_back({cosine * solid_angle / static_cast<float>(n), t.face});
    }
  }
  if (segments.empty()) return;
  std::vector<std::uint8_t> blocked(segments.size());
  rays_.occluded(RayScene::What::kAll, segments, blocked, RayScene::Order::kCoherent);
  const float scale = 1 / row.exposure;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (blocked[i] || segments[i].t_far <= 0) continue;
    if (const Panel* panel = panels_.at(candidates[i].face)) {
      if (glm::dot(segments[i].direction, mesh_.faces().faces[panel->face].normal) > 0)
        row.sky.push_back({sky_.count() + panels_.bin(*panel, -segments[i].direction), scale * candidates[i].weight});
      continue;
    }
    segments[kept] = segments[i];
    candidates[kept++] = candidates[i];
  }
  segments.resize(kept);
  candidates.resize(kept);

  // Beyond the opening: an obstruction, the sky or the ground. Further openings on the way take their share.
  const float offset = mesh_.faces().ray_offset();
  for (Ray& ray : segments) {
    ray.t_near = ray.t_far;
    ray.t_far = Ray::kInfinity;
  }
  std::vector<Hit> hits(kept);
  rays_.intersect(RayScene::What::kOpaque, segments, hits, RayScene::Order::kCoherent);
  for (std::size_t i = 0; i < kept; ++i)
    if (hits[i].face >= 0) segments[i].t_far = hits[i].t - offset;
  std::vector<float> transmitted(kept);
  rays_.transmittance(segments, transmitted);
  for (std::size_t i = 0; i < kept; ++i) {
    const float weight = scale * candidates[i].weight * transmitted[i];
    if (weight <= 0) continue;
    if (hits[i].face < 0)
      row.sky.push_back({sky_(segments[i].direction), weight});
    else if (!mesh_.faces().is_inside_solid(hits[i].face, hits[i].side))
      row.through.push_back({mesh_.slot_at(hits[i]), weight / kPi});
  }
}

GatherRow Gatherer::surroundings_of_point(const Node& point, GatherSamples samples, std::uint32_t seed) const {
  GatherRow row;
  gather_hemisphere([&](glm::vec2) { return Origin{point.position, point.normal}; }, samples.hemisphere, seed, row);
  return row;
}

void Gatherer::look_through_openings(const Node& point, GatherSamples samples, std::uint32_t seed,
                                     GatherRow& row) const {
  const Origin origin{point.position, point.normal};
  gather_openings(
      origin, [&](glm::vec2) { return origin; }, samples.openings, seed, row);
  merge_shares(row.through);
  merge_shares(row.sky);
}

auto Gatherer::places_on(int slot) const {
  return [this, slot](glm::vec2 u) {
    const Node place = mesh_.place_on(slot, u);
    return Origin{place.position, place.normal};
  };
}

GatherRow Gatherer::surroundings_of_patch(int slot, GatherSamples samples, std::uint32_t seed) const {
  GatherRow row;
  gather_hemisphere(places_on(slot), samples.hemisphere, seed, row);
  return row;
}

void Gatherer::look_through_openings(int slot, GatherSamples samples, std::uint32_t seed, GatherRow& row) const {
  const Node middle = mesh_.middle_of(slot);
  gather_openings({middle.position, middle.normal}, places_on(slot), samples.openings, seed, row);
  merge_shares(row.through);
  merge_shares(row.sky);
}

GatherRow Gatherer::gather_at_point(const Node& point, GatherSamples samples, std::uint32_t seed) const {
  GatherRow row = surroundings_of_point(point, samples, seed);
  look_through_openings(point, samples, seed, row);
  return row;
}

}  // namespace transom
