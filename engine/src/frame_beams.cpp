// Beams at the points of a picture: polygons along the beam first, rays for what they leave open.
#include "frame_beams.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <utility>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kChunk = 64;  // points at once

}  // namespace

void ShadowRays::trace(const RayScene& scene, RayScene::What what) {
  blocked_.resize(rays_.size());
  scene.occluded(what, rays_, blocked_, RayScene::Order::kCoherent);
  for (std::size_t i = 0; i < rays_.size(); ++i)
    if (!blocked_[i] && *shares_[i] == 0) *shares_[i] = arriving_[i];
  rays_.clear();
  arriving_.clear();
  shares_.clear();
}

SeenBeam::SeenBeam(const Engine& engine, const Beam& beam, const ViewSamples& samples,
                   const std::vector<char>& is_enclosed)
    : engine_(&engine),
      beam_(&beam),
      samples_(&samples),
      is_enclosed_(&is_enclosed),
      may_light_(samples.surfaces.size(), 0) {
  const std::vector<Face>& faces = engine.faces().faces;
  const bool is_sun = beam.opening < 0;
  if (is_sun) {
    std::vector<int> openings;
    for (std::size_t f = 0; f < faces.size(); ++f)
      if (engine.scene().materials[faces[f].material].opening >= 0) openings.push_back(static_cast<int>(f));
    outlines_.emplace(engine.faces(), openings, beam.direction_to_source);
    for (const int f : openings)
      transmittance_.push_back(engine.rays().opening_transmittance(f, beam.direction_to_source));
    over_.resize(samples.surfaces.size());
  }
  parallel_indices(samples.surfaces.size(), 64, [&](std::size_t i) {
    const auto surface = static_cast<std::size_t>(samples.surfaces[i]);
    const Face& face = faces[surface / 2];
    if ((glm::dot(face.normal, beam.direction_to_source) > 0) != (surface % 2 == 0)) return;
    if (is_sun) outlines_->covering(outlines_->outline(face.corners()), over_[i]);
    may_light_[i] = !is_sun || !is_enclosed[surface] || !over_[i].empty();
  });
}

bool SeenBeam::may_light(const BeamGroup& group) const {
  if (!may_light(group.surface)) return false;
  if (beam_->opening >= 0)
    return std::any_of(beam_->shafts->begin(), beam_->shafts->end(),
                       [&](const LightShaft& shaft) { return shaft.may_meet(group.low, group.high); });
  if (!(*is_enclosed_)[static_cast<std::size_t>(group.surface)]) return true;
  const glm::vec3 middle = outlines_->along_beam(0.5f * (group.low + group.high)),
                  half = outlines_->half_along_beam(0.5f * (group.high - group.low));
  const std::vector<int>& passages = over_[place(group.surface)];
  return std::any_of(passages.begin(), passages.end(),
                     [&](int k) { return outlines_->may_cover(k, middle - half, middle + half); });
}

void SeenBeam::find_shares(int surface, std::span<const BeamPoint> points, std::span<float> shares,
                           ShadowRays& rays) const {
  if (!may_light(surface)) {
    std::fill(shares.begin(), shares.end(), 0.f);
    return;
  }
  for (std::size_t begin = 0; begin < points.size(); begin += kChunk) {
    const std::size_t size = std::min(kChunk, points.size() - begin);
    if (beam_->opening < 0)
      find_shares_of_sun(surface, points.subspan(begin, size), shares.subspan(begin, size), rays);
    else
      find_shares_of_lobe(points.subspan(begin, size), shares.subspan(begin, size), rays);
  }
}

void SeenBeam::trace(ShadowRays& rays) const {
  rays.trace(engine_->rays(), beam_->opening < 0 ? RayScene::What::kOpaque : RayScene::What::kAll);
}

glm::vec3 SeenBeam::reflected(const BeamPoint& point, float share) const {
  return share * point.weight * glm::dot(point.normal, beam_->direction_to_source) / kPi *
         engine_->reflectance(point.surface / 2, point.surface % 2) * beam_->normal_illuminance;
}

void SeenBeam::find_shares_of_sun(int surface, std::span<const BeamPoint> points, std::span<float> shares,
                                  ShadowRays& rays) const {
  std::array<float, kChunk> x, y, z;
  std::array<int, kChunk> is_behind, is_reached;
  const std::size_t count = points.size();
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 place = outlines_->along_beam(points[i].position);
    x[i] = place.x;
    y[i] = place.y;
    z[i] = place.z;
  }
  glm::vec3 low(Ray::kInfinity), high(-Ray::kInfinity);
  for (std::size_t i = 0; i < count; ++i) {
    low = {std::min(low.x, x[i]), std::min(low.y, y[i]), std::min(low.z, z[i])};
    high = {std::max(high.x, x[i]), std::max(high.y, y[i]), std::max(high.z, z[i])};
  }
  const int is_open = (*is_enclosed_)[static_cast<std::size_t>(surface)] ? 0 : 1;
  for (std::size_t i = 0; i < count; ++i) {
    shares[i] = faces(points[i]) ? 1.f : 0.f;
    is_reached[i] = is_open;
  }
  for (const int k : over_[place(surface)]) {
    if (!outlines_->may_cover(k, low, high)) continue;
    outlines_->mark_behind(k, {x.data(), count}, {y.data(), count}, {z.data(), count}, {is_behind.data(), count});
    const float transmittance = transmittance_[static_cast<std::size_t>(k)];
    for (std::size_t i = 0; i < count; ++i) {
      shares[i] *= is_behind[i] ? transmittance : 1.f;
      is_reached[i] |= is_behind[i];
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_reached[i]) shares[i] = 0;
    const float arriving = std::exchange(shares[i], 0.f);
    if (arriving > 0) rays.add({points[i].position, beam_->direction_to_source}, arriving, &shares[i]);
  }
}

void SeenBeam::find_shares_of_lobe(std::span<const BeamPoint> points, std::span<float> shares, ShadowRays& rays) const {
  std::array<glm::vec3, kChunk> positions;
  for (std::size_t i = 0; i < points.size(); ++i) {
    shares[i] = 0;
    positions[i] = points[i].position;
  }
  find_rays_to_panels(*beam_->shafts, {positions.data(), points.size()}, engine_->faces().ray_offset(),
                      [&](std::size_t i, const Ray& ray, float arriving) {
                        if (faces(points[i])) rays.add(ray, arriving, &shares[i]);
                      });
}

}  // namespace transom
