#include "transom/gather.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "hemisphere.h"
#include "index_sums.h"
#include "transom/panels.h"
#include "transom/sampling.h"
#include "transom/scene_change.h"

namespace transom {
namespace {

constexpr int kBlock = 64;                  // rays traced together
constexpr double kSmallSolidAngle = 2e-3;   // below it a triangle is sampled by area [sr]
constexpr int kMinimumRaysPerTriangle = 4;  // towards an opening triangle above the horizon
constexpr float kNearPatch = 2;             // diameters of a patch up to which its elements are told apart
constexpr float kPi = std::numbers::pi_v<float>;

// Directions around a point's normal by those samples of `indices` that are below `count`, in order; sixteen at once:
// visit(directions, how many).
template <typename Visit>
void for_directions(const Node& point, const SobolSequence& points, std::span<const std::uint32_t> indices, int count,
                    const Visit& visit) {
  const glm::mat3 frame = frame_from_normal(point.normal);
  Directions directions;
  std::uint32_t block[kPointsAtOnce];
  std::size_t size = 0;
  const auto take = [&] {
    sample_hemisphere(points, {block, size}, frame, directions);
    visit(directions, size);
    size = 0;
  };
  for (const std::uint32_t index : indices) {
    if (index >= static_cast<std::uint32_t>(count)) continue;
    block[size++] = index;
    if (size == kPointsAtOnce) take();
  }
  if (size > 0) take();
}

}  // namespace

void merge_shares(std::vector<Share>& shares) {
  const auto is_before = [](const Share& a, const Share& b) { return a.index < b.index; };
  if (std::adjacent_find(shares.begin(), shares.end(), std::not_fn(is_before)) == shares.end()) return;
  thread_local IndexSums<float> sums;
  for (const Share& share : shares) sums.add(share.index, share.weight);
  shares.clear();
  sums.take([&](int index, float weight) { shares.push_back({index, weight}); });
}

Gatherer::Gatherer(const LightMesh& mesh, const RayScene& rays, const std::vector<Material>& materials,
                   const std::vector<OpeningGroup>& openings, const SkyBinIndex& sky, const Panels& panels)
    : mesh_(mesh), rays_(rays), materials_(materials), openings_(openings), sky_(sky), panels_(panels) {
  // Clusters have no nodes that could tell their elements apart.
  near_distance_.assign(static_cast<std::size_t>(mesh.slot_count()), 0.f);
  for (int slot = 0; slot < mesh.slot_count() && !mesh.is_cluster(slot); ++slot)
    near_distance_[static_cast<std::size_t>(slot)] = kNearPatch * std::sqrt(2 * mesh.slot_area(slot));
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
GatherRow Gatherer::gather_hemisphere(const OriginOf& origin_of, int count, std::uint32_t seed, Elements told) const {
  thread_local Cast cast;
  cast.clear();
  add_rays(origin_of, SobolSequence(seed), coherent_order(count), count, cast);
  HemisphereTally tally;
  tally.slots.reserve(static_cast<std::size_t>(count));
  add_hits(cast, told, tally);
  return std::move(tally).row(count, mesh_.faces().extent);
}

// The same from one point: directions are made and rays cast sixteen at once.
GatherRow Gatherer::gather_from_point(const Node& point, int count, std::uint32_t seed, Elements told) const {
  HemisphereTally tally;
  tally.slots.reserve(static_cast<std::size_t>(count));
  for_directions(point, SobolSequence(seed), coherent_order(count), count, [&](const Directions& to, std::size_t size) {
    Hit hits[kPointsAtOnce];
    rays_.intersect_from(point.position, to.x, to.y, to.z, RayScene::What::kAll, {hits, size});
    for (std::size_t i = 0; i < size; ++i) add_hit(hits[i], {to.x[i], to.y[i], to.z[i]}, -1, told, tally);
  });
  return std::move(tally).row(count, mesh_.faces().extent);
}

// Casts rays and counts what they meet.
void Gatherer::add_hits(const Cast& cast, Elements told, HemisphereTally& tally) const {
  Hit hits[kBlock];
  for (std::size_t begin = 0; begin < cast.rays.size(); begin += kBlock) {
    const std::span block(&cast.rays[begin], std::min<std::size_t>(kBlock, cast.rays.size() - begin));
    rays_.intersect(RayScene::What::kAll, block, {hits, block.size()}, RayScene::Order::kCoherent);
    for (std::size_t i = 0; i < block.size(); ++i)
      add_hit(hits[i], block[i].direction, cast.elements.empty() ? -1 : cast.elements[begin + i], told, tally);
  }
}

// element: that the ray has left, of a patch; else -1.
void Gatherer::add_hit(const Hit& hit, glm::vec3 direction, int element, Elements told, HemisphereTally& tally) const {
  if (hit.face < 0) {
    tally.bins.push_back(sky_(direction));
  } else if (mesh_.faces().is_inside_solid(hit.face, hit.side)) {
    ++tally.buried;
  } else {
    const int slot = mesh_.slot_at(hit);
    tally.slots.push_back(slot);
    const float near = told == Elements::kNone ? 0 : near_distance(slot);
    if (hit.t < near || (told == Elements::kAll && near > 0)) tally.near.push_back(mesh_.element_at(hit));
    if (element >= 0) tally.left.push_back(slot * mesh_.elements_per_slot() + element);
    tally.add_distance(hit.t, mesh_.faces());
  }
}

// Rays towards the openings, in proportion to the solid angle, with a floor, and none for what lies behind the
// receiver. visit(ray up to the opening, cos(theta) x solid angle / rays [sr], face): false to stop. Returns whether it
// went on.
template <typename OriginOf, typename Visit>
bool Gatherer::visit_opening_rays(const Origin& middle, const OriginOf& origin_of, int count, std::uint32_t seed,
                                  const Visit& visit) const {
  const auto triangle_from = [](const OpeningTriangle& t, glm::vec3 p) {
    return SphericalTriangle(glm::normalize(glm::dvec3(t.corner[0] - p)), glm::normalize(glm::dvec3(t.corner[1] - p)),
                             glm::normalize(glm::dvec3(t.corner[2] - p)));
  };
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
      const Ray ray{origin.position, to_opening / distance, 0, distance - mesh_.faces().ray_offset()};
      if (!visit(ray, cosine * solid_angle / static_cast<float>(n), t.face)) return false;
    }
  }
  return true;
}

template <typename OriginOf>
void Gatherer::gather_openings(const Origin& middle, const OriginOf& origin_of, int count, std::uint32_t seed,
                               GatherRow& row) const {
  if (row.exposure == 0) return;
  struct Candidate {
    float weight;  // cos(theta) x solid angle / rays [sr]
    int face;
  };
  std::vector<Ray> segments;
  std::vector<Candidate> candidates;
  visit_opening_rays(middle, origin_of, count, seed, [&](const Ray& ray, float weight, int face) {
    segments.push_back(ray);
    candidates.push_back({weight, face});
    return true;
  });
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
    ray.t_near = ray.t_far + 2 * offset;
    ray.t_far = Ray::kInfinity;
  }
  std::vector<Hit> hits(kept);
  rays_.intersect(RayScene::What::kAll, segments, hits, RayScene::Order::kCoherent);
  const std::vector<float> transmitted = past_further_openings(segments, hits);
  for (std::size_t i = 0; i < kept; ++i) {
    const float weight = scale * candidates[i].weight * transmitted[i] *
                         rays_.opening_transmittance(candidates[i].face, segments[i].direction);
    if (weight <= 0) continue;
    if (hits[i].face < 0)
      row.sky.push_back({sky_(segments[i].direction), weight});
    else if (!mesh_.faces().is_inside_solid(hits[i].face, hits[i].side))
      row.through.push_back({mesh_.slot_at(hits[i]), weight / kPi});
  }
}

// Where rays have met an opening they go on to what is opaque: their hits are then that. Returns the share that the
// openings between pass.
std::vector<float> Gatherer::past_further_openings(std::span<const Ray> rays, std::vector<Hit>& hits) const {
  std::vector<float> shares(rays.size(), 1.f);
  std::vector<Ray> onward;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].face < 0 ||
        materials_[mesh_.faces().faces[static_cast<std::size_t>(hits[i].face)].material].opening < 0)
      continue;
    onward.push_back(rays[i]);
    index.push_back(i);
  }
  if (onward.empty()) return shares;
  std::vector<Hit> met(onward.size());
  rays_.intersect(RayScene::What::kOpaque, onward, met, RayScene::Order::kCoherent);
  for (std::size_t k = 0; k < onward.size(); ++k)
    if (met[k].face >= 0) onward[k].t_far = met[k].t - mesh_.faces().ray_offset();
  std::vector<float> passed(onward.size());
  rays_.transmittance(onward, passed);
  for (std::size_t k = 0; k < onward.size(); ++k) {
    hits[index[k]] = met[k];
    shares[index[k]] = passed[k];
  }
  return shares;
}

GatherRow Gatherer::surroundings_of_point(const Node& point, GatherSamples samples, std::uint32_t seed) const {
  return gather_from_point(point, samples.hemisphere, seed, Elements::kNear);
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
    return Origin{place.position, place.normal, mesh_.element_of_place(slot, u)};
  };
}

GatherRow Gatherer::surroundings_of_patch(int slot, GatherSamples samples, std::uint32_t seed) const {
  return gather_hemisphere(places_on(slot), samples.hemisphere, seed, Elements::kNone);
}

void Gatherer::look_through_openings(int slot, GatherSamples samples, std::uint32_t seed, GatherRow& row) const {
  const Node middle = mesh_.middle_of(slot);
  gather_openings({middle.position, middle.normal}, places_on(slot), samples.openings, seed, row);
  merge_shares(row.through);
  merge_shares(row.sky);
}

// The rays of those points of a sequence that are below `count`.
template <typename OriginOf>
void Gatherer::add_rays(const OriginOf& origin_of, const SobolSequence& points, std::span<const std::uint32_t> indices,
                        int count, Cast& cast) {
  for (const std::uint32_t index : indices) {
    if (index >= static_cast<std::uint32_t>(count)) continue;
    const glm::vec4 u = points.point4(index);
    const Origin origin = origin_of(glm::vec2(u.z, u.w));
    cast.rays.push_back({origin.position, frame_from_normal(origin.normal) * sample_cosine_hemisphere({u.x, u.y})});
    cast.elements.push_back(origin.element);
  }
}

// The same from a point, as gather_from_point casts them.
void Gatherer::add_rays_from_point(const Node& point, const SobolSequence& points,
                                   std::span<const std::uint32_t> indices, int count, std::vector<Ray>& rays) {
  for_directions(point, points, indices, count, [&](const Directions& to, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) rays.push_back({point.position, {to.x[i], to.y[i], to.z[i]}});
  });
}

// Casts those rays again that may meet what has changed, in both states. False: their answers do not go together.
// radius: around `middle`, of where rays begin; 0: all begin there, and origin_of is not asked.
template <typename OriginOf>
bool Gatherer::gather_again(const OriginOf& origin_of, const Node& middle, float radius, int count, std::uint32_t seed,
                            Elements told, const Gatherer& before, const SceneChange& change, GatherRow& row) const {
  const HemisphereCells& cells = HemisphereCells::of(coherent_bits(count));
  thread_local std::vector<char> is_met;
  thread_local Cast cast;
  cast.clear();
  if (radius < Ray::kInfinity) {
    if (!change.may_meet(middle, radius, cells, is_met)) return true;
  } else {
    is_met.assign(static_cast<std::size_t>(cells.count()), 1);
  }
  const SobolSequence points(seed);
  const std::vector<std::uint32_t>& order = coherent_order(count);
  const std::size_t per_cell = order.size() / is_met.size();
  for (std::size_t begin = 0; begin < order.size(); begin += per_cell) {
    const glm::ivec2 cell = points.cell2(order[begin], cells.bits());
    if (!is_met[cell.y * cells.per_axis() + cell.x]) continue;
    const std::span<const std::uint32_t> cell_order{&order[begin], per_cell};
    if (radius > 0)
      add_rays(origin_of, points, cell_order, count, cast);
    else
      add_rays_from_point(middle, points, cell_order, count, cast.rays);
  }
  cast.keep_if([&](const Ray& ray) { return change.may_meet(ray); });
  if (cast.rays.empty()) return true;
  HemisphereTally lost, found;
  before.add_hits(cast, told, lost);
  add_hits(cast, told, found);
  std::erase_if(lost.slots, [&](int& slot) { return (slot = change.slot_after(slot)) < 0; });
  const int per_slot = mesh_.elements_per_slot();
  for (std::vector<int>* elements : {&lost.near, &lost.left})
    std::erase_if(*elements, [&](int& element) {
      const int slot = change.slot_after(element / per_slot);
      element = slot * per_slot + element % per_slot;
      return slot < 0;
    });
  return recount(row, std::move(lost), std::move(found), count, mesh_.faces().extent);
}

GatherRow Gatherer::surroundings_of_point(const Node& point, GatherSamples samples, std::uint32_t seed, GatherRow known,
                                          const Gatherer& before, const SceneChange& change) const {
  const auto origin_of = [&](glm::vec2) { return Origin{point.position, point.normal}; };
  if (gather_again(origin_of, point, 0, samples.hemisphere, seed, Elements::kNear, before, change, known)) return known;
  return surroundings_of_point(point, samples, seed);
}

GatherRow Gatherer::surroundings_of_patch(int slot, GatherSamples samples, std::uint32_t seed, GatherRow known,
                                          const Gatherer& before, const SceneChange& change) const {
  if (gather_again(places_on(slot), mesh_.middle_of(slot), radius_of(slot), samples.hemisphere, seed, Elements::kNone,
                   before, change, known))
    return known;
  return surroundings_of_patch(slot, samples, seed);
}

// Of a circle around the middle of a cell; of a cluster, which has no plane, infinity.
float Gatherer::radius_of(int index) const {
  if (mesh_.is_cluster(index)) return Ray::kInfinity;
  const Slot slot = mesh_.slot(index);
  const glm::vec3 middle = mesh_.middle_of(index).position;
  float radius = 0;
  for (const glm::vec2 corner : {glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(0, 1), glm::vec2(1, 1)}) {
    if (corner == glm::vec2(1, 1) && !mesh_.grid(slot.face).is_quad) continue;
    const glm::vec2 st = mesh_.cell_parameters(slot.face, slot.cell, corner);
    radius = std::max(radius, glm::length(mesh_.lifted_position(slot.face, slot.side, st) - middle));
  }
  return radius;
}

// Looked at as shafts first, which is cheap, then ray by ray.
template <typename OriginOf>
bool Gatherer::may_meet_through_openings(const Node& middle, float radius, const OriginOf& origin_of, int count,
                                         std::uint32_t seed, const SceneChange& change) const {
  const bool any_shaft =
      std::any_of(opening_triangles_.begin(), opening_triangles_.end(), [&](const OpeningTriangle& t) {
        const bool is_ahead = std::any_of(t.corner, t.corner + 3, [&](const glm::vec3& corner) {
          return glm::dot(corner - middle.position, middle.normal) >= 0;
        });
        return is_ahead && change.may_meet(middle.position, radius, t.corner);
      });
  return any_shaft &&
         !visit_opening_rays({middle.position, middle.normal}, origin_of, count, seed, [&](const Ray& ray, float, int) {
           return !change.may_meet(Ray{ray.origin, ray.direction});
         });
}

bool Gatherer::may_meet_through_openings(const Node& point, GatherSamples samples, std::uint32_t seed,
                                         const SceneChange& change) const {
  const auto origin_of = [&](glm::vec2) { return Origin{point.position, point.normal}; };
  return may_meet_through_openings(point, 0, origin_of, samples.openings, seed, change);
}

bool Gatherer::may_meet_through_openings(int slot, GatherSamples samples, std::uint32_t seed,
                                         const SceneChange& change) const {
  return may_meet_through_openings(mesh_.middle_of(slot), radius_of(slot), places_on(slot), samples.openings, seed,
                                   change);
}

GatherRow Gatherer::gather_at_point(const Node& point, GatherSamples samples, std::uint32_t seed) const {
  GatherRow row = gather_from_point(point, samples.hemisphere, seed, Elements::kAll);
  look_through_openings(point, samples, seed, row);
  return row;
}

}  // namespace transom
