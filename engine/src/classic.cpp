#include "transom/classic.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kBlock = 512;    // rays traced together
constexpr int kMaximumCrossings = 16;  // openings passed, one behind another
constexpr std::uint64_t kSunStream = 1, kSkyStream = 2, kPointStream = 3, kPanelStream = 4;

glm::vec3 point_of_triangle(const glm::vec3 corner[3], glm::vec2 u) {
  const glm::vec2 b = sample_triangle(u);
  return corner[0] + b.x * (corner[1] - corner[0]) + b.y * (corner[2] - corner[0]);
}

float channel_sum(glm::vec3 v) {
  return std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
}

}  // namespace

ForwardRays::ForwardRays(const LightMesh& mesh, const RayScene& rays, const std::vector<Material>& materials,
                         const std::vector<OpeningGroup>& openings, const Panels& panels, ForwardRayCounts counts,
                         std::uint32_t seed)
    : mesh_(mesh),
      rays_(rays),
      materials_(materials),
      openings_(openings),
      panels_(panels),
      counts_(counts),
      seed_(seed) {
  for (std::size_t f = 0; f < mesh.faces().faces.size(); ++f) {
    const Face& face = mesh.faces().faces[f];
    const int opening = materials[static_cast<std::size_t>(face.material)].opening;
    if (opening < 0) continue;
    for (int part = 0; part < (face.is_quad ? 2 : 1); ++part) {
      const glm::vec3 a = face.corner[0], b = face.corner[1 + part], c = face.corner[2 + part];
      const float area = 0.5f * glm::length(glm::cross(b - a, c - a));
      triangles_.push_back({{a, b, c}, face.normal, area, static_cast<int>(f), opening});
      total_area_ += area;
    }
  }
}

// Parallel rays, shared among the openings that face the beam by the area that they show it. Of a lobe: from all over
// its panels, each ray if the sun reaches the point where it starts.
std::vector<ForwardRays::Arrival> ForwardRays::sun_arrivals(const Beam& beam) const {
  std::vector<Arrival> arrivals;
  float shown_area = 0;
  const auto takes_part = [&](const OpeningTriangle& t) {
    return beam.opening < 0 ? !panels_.at(t.face) : t.opening == beam.opening;
  };
  for (const OpeningTriangle& t : triangles_)
    if (takes_part(t)) shown_area += t.area * std::max(0.f, glm::dot(t.normal, beam.direction_to_source));
  if (!(shown_area > 0)) return arrivals;
  for (std::size_t k = 0; k < triangles_.size(); ++k) {
    const OpeningTriangle& t = triangles_[k];
    const float cosine = glm::dot(t.normal, beam.direction_to_source);
    if (cosine <= 0 || !takes_part(t)) continue;
    const float shown = t.area * cosine;
    const int count = std::max(1, static_cast<int>(std::lround(static_cast<double>(counts_.sun) * shown / shown_area)));
    const float passes =
        beam.opening < 0 ? openings_[static_cast<std::size_t>(t.opening)].transmittance_at(cosine) : 1.f;
    const glm::vec3 flux = beam.normal_illuminance * (shown / static_cast<float>(count) * passes);
    const glm::vec3 outwards = beam.opening < 0 ? beam.direction_to_source : beam.direction_to_sun;
    const SobolSequence points(hash_seed(seed_, hash_seed(kSunStream, k)));
    for (int i = 0; i < count; ++i)
      arrivals.push_back({point_of_triangle(t.corner, points.point2(static_cast<std::uint32_t>(i))), outwards,
                          -beam.direction_to_source, flux});
  }
  return arrivals;
}

// From every direction of sky and ground through every point.
std::vector<ForwardRays::Arrival> ForwardRays::sky_arrivals(const Condition& condition, const SkyBinIndex& sky) const {
  struct Place {
    const OpeningTriangle* triangle;
    glm::vec3 point;
  };
  std::vector<Place> places;
  const SobolSequence points(hash_seed(seed_, kPointStream));
  float passed = 0;
  std::size_t k = 0;
  for (int i = 0; i < counts_.opening_points && !triangles_.empty(); ++i) {  // equal strips of the joint area
    const float wanted = total_area_ * (static_cast<float>(i) + 0.5f) / static_cast<float>(counts_.opening_points);
    while (k + 1 < triangles_.size() && passed + triangles_[k].area < wanted) passed += triangles_[k++].area;
    places.push_back(
        {&triangles_[k], point_of_triangle(triangles_[k].corner, points.point2(static_cast<std::uint32_t>(i)))});
  }
  std::vector<Arrival> arrivals;
  const float area = total_area_ / static_cast<float>(std::max(counts_.opening_points, 1));
  const int ground = sky.count() - 1;
  for (const bool is_sky : {true, false}) {
    const int count = is_sky ? counts_.sky_directions : counts_.ground_directions;
    const float solid_angle = 2 * kPi / static_cast<float>(count);
    const SobolSequence directions(hash_seed(seed_, hash_seed(kSkyStream, is_sky)));
    for (int i = 0; i < count; ++i) {
      const glm::vec2 u = directions.point2(static_cast<std::uint32_t>(i));
      const float z = is_sky ? u.x : -u.x, r = std::sqrt(std::max(0.f, 1 - z * z));
      const glm::vec3 direction(r * std::cos(2 * kPi * u.y), r * std::sin(2 * kPi * u.y), z);
      const int bin = is_sky ? std::min(sky(direction), ground - 1) : ground;
      const glm::vec3 luminance = bin == ground
                                      ? condition.ground_luminance
                                      : condition.sky_luminance[static_cast<std::size_t>(bin)] * condition.sky_colour;
      if (luminance == glm::vec3(0)) continue;
      for (const Place& place : places) {
        const float cosine = glm::dot(place.triangle->normal, direction);
        if (cosine <= 0) continue;
        const float passes =
            openings_[static_cast<std::size_t>(place.triangle->opening)].transmittance_at(cosine) * cosine;
        if (passes > 0)
          arrivals.push_back({place.point, direction, -direction, luminance * (solid_angle * area * passes)});
      }
    }
  }
  return arrivals;
}

// From points all over each panel into every exit bin.
std::vector<ForwardRays::Arrival> ForwardRays::panel_arrivals(const std::vector<glm::vec3>& panel_radiance) const {
  std::vector<Arrival> arrivals;
  const int count = counts_.panel_bin_rays;
  for (std::size_t k = 0; k < triangles_.size(); ++k) {
    const OpeningTriangle& t = triangles_[k];
    const Panel* panel = panels_.at(t.face);
    if (!panel) continue;
    const PanelFrame& frame = panels_.frame(*panel);
    for (int bin = 0; bin < frame.bins.count(); ++bin) {
      const glm::vec3 radiance = panel_radiance[panel->first_bin + bin];
      if (radiance == glm::vec3(0)) continue;
      const glm::vec3 flux = radiance * (t.area * frame.bins.projected_solid_angle(bin) / static_cast<float>(count));
      const SobolSequence points(hash_seed(seed_, hash_seed(kPanelStream + k, static_cast<std::uint64_t>(bin))));
      for (int i = 0; i < count; ++i) {
        const glm::vec4 u = points.point4(static_cast<std::uint32_t>(i));
        arrivals.push_back({point_of_triangle(t.corner, {u.z, u.w}), glm::vec3(0),
                            frame.to_world(frame.bins.sample(bin, {u.x, u.y})), flux});
      }
    }
  }
  return arrivals;
}

// Each arrival must see where it comes from; then it goes on to the first surface indoors.
void ForwardRays::deposit(const std::vector<Arrival>& arrivals, const std::vector<int>& patch_of_slot,
                          std::vector<glm::vec3>& flux) const {
  std::vector<int> patches(arrivals.size(), -1);
  std::vector<float> shares(arrivals.size(), 0.f);
  const float offset = mesh_.faces().ray_offset();
  parallel_ranges(arrivals.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    const std::size_t size = end - begin;
    std::vector<Ray> outward(size), inward;
    std::vector<std::uint8_t> blocked(size);
    std::vector<float> outdoors(size);
    for (std::size_t i = 0; i < size; ++i) {
      const Arrival& a = arrivals[begin + i];
      const bool has_arrived = a.outwards == glm::vec3(0);
      outward[i] = {a.point, has_arrived ? a.inwards : a.outwards, offset, has_arrived ? 2 * offset : Ray::kInfinity};
    }
    rays_.occluded(RayScene::What::kOpaque, outward, blocked);
    rays_.transmittance(outward, outdoors);
    std::vector<std::size_t> active;
    for (std::size_t i = 0; i < size; ++i) {
      if (blocked[i]) continue;
      shares[begin + i] = outdoors[i];
      active.push_back(i);
    }
    std::vector<float> starts(size, offset);
    std::vector<Hit> hits;
    for (int crossing = 0; crossing <= kMaximumCrossings && !active.empty(); ++crossing) {
      inward.clear();
      for (const std::size_t i : active) {
        const Arrival& a = arrivals[begin + i];
        inward.push_back({a.point, a.inwards, starts[i]});
      }
      hits.resize(inward.size());
      rays_.intersect(RayScene::What::kAll, inward, hits);
      std::size_t kept = 0;
      for (std::size_t k = 0; k < active.size(); ++k) {
        const std::size_t i = active[k];
        const Hit& hit = hits[k];
        if (hit.face < 0 || mesh_.faces().is_inside_solid(hit.face, hit.side)) continue;
        const Face& face = mesh_.faces().faces[static_cast<std::size_t>(hit.face)];
        const int opening = materials_[static_cast<std::size_t>(face.material)].opening;
        if (opening >= 0 && hit.side == 0) {  // into the next room
          shares[begin + i] *= openings_[static_cast<std::size_t>(opening)].transmittance_at(
              std::abs(glm::dot(face.normal, inward[k].direction)));
          starts[i] = hit.t + offset;
          active[kept++] = i;
          continue;
        }
        patches[begin + i] = patch_of_slot[static_cast<std::size_t>(mesh_.element_at(hit) / mesh_.elements_per_slot())];
      }
      active.resize(kept);
    }
  });
  for (std::size_t i = 0; i < arrivals.size(); ++i)
    if (patches[i] >= 0) flux[static_cast<std::size_t>(patches[i])] += shares[i] * arrivals[i].flux;
}

ForwardLight ForwardRays::cast(const Condition& condition, const std::vector<glm::vec3>& panel_radiance,
                               const SkyBinIndex& sky, const std::vector<int>& patch_of_slot,
                               const std::vector<float>& patch_area) const {
  ForwardLight light;
  light.sun.assign(patch_area.size(), glm::vec3(0));
  light.sky.assign(patch_area.size(), glm::vec3(0));
  for (const Beam& beam : condition.beams) {
    const std::vector<Arrival> arrivals = sun_arrivals(beam);
    light.ray_count += static_cast<int>(arrivals.size());
    deposit(arrivals, patch_of_slot, light.sun);
  }
  const std::vector<Arrival> arrivals = sky_arrivals(condition, sky);
  light.ray_count += static_cast<int>(arrivals.size());
  deposit(arrivals, patch_of_slot, light.sky);
  const std::vector<Arrival> from_panels = panel_arrivals(panel_radiance);
  light.ray_count += static_cast<int>(from_panels.size());
  deposit(from_panels, patch_of_slot, light.sky);
  for (std::size_t p = 0; p < patch_area.size(); ++p) {
    light.sun[p] /= patch_area[p];
    light.sky[p] /= patch_area[p];
  }
  return light;
}

ProgressiveRadiosity::ProgressiveRadiosity(const SparseRows& form_factors, const SparseRows& through,
                                           std::vector<float> area, std::vector<glm::vec3> reflectance,
                                           std::vector<glm::vec3> emitted)
    : area_(std::move(area)), reflectance_(std::move(reflectance)), emitted_(std::move(emitted)) {
  const std::size_t n = area_.size();
  std::vector<std::vector<Share>> columns(n);
  for (const SparseRows* rows : {&form_factors, &through})
    for (std::size_t p = 0; p < n; ++p)
      for (std::size_t k = rows->begin[p]; k < rows->begin[p + 1]; ++k)
        columns[static_cast<std::size_t>(rows->entries[k].index)].push_back(
            {static_cast<int>(p), rows->entries[k].weight});
  for (std::vector<Share>& column : columns) {
    merge_shares(column);
    seen_by_.append(column);
  }
}

ShootingState ProgressiveRadiosity::dark() const {
  const std::vector<glm::vec3> nothing(area_.size(), glm::vec3(0));
  return {nothing, nothing, emitted_};
}

void ProgressiveRadiosity::replace_direct(ShootingState& state, const std::vector<glm::vec3>& direct) const {
  for (std::size_t p = 0; p < area_.size(); ++p) {
    const glm::vec3 change = direct[p] - state.direct[p];
    state.irradiance[p] += change;
    state.unshot[p] += reflectance_[p] * change;
  }
  state.direct = direct;
}

int ProgressiveRadiosity::shoot(ShootingState& state, int shots, double tolerance) const {
  if (area_.empty()) return 0;
  double in_flight = 0;
  for (std::size_t p = 0; p < area_.size(); ++p) in_flight += area_[p] * channel_sum(state.unshot[p]);
  const double enough = tolerance * flux_leaving(state);
  int shot = 0;
  for (; shot < shots && in_flight > enough; ++shot) {
    std::size_t brightest = 0;
    float most = -1;
    for (std::size_t p = 0; p < area_.size(); ++p) {
      const float flux = area_[p] * channel_sum(state.unshot[p]);
      if (flux > most) {
        most = flux;
        brightest = p;
      }
    }
    const glm::vec3 given = state.unshot[brightest];
    state.unshot[brightest] = glm::vec3(0);
    in_flight -= static_cast<double>(most);
    for (std::size_t k = seen_by_.begin[brightest]; k < seen_by_.begin[brightest + 1]; ++k) {
      const std::size_t p = static_cast<std::size_t>(seen_by_.entries[k].index);
      const glm::vec3 received = seen_by_.entries[k].weight * given;
      state.irradiance[p] += received;
      const float before = channel_sum(state.unshot[p]);
      state.unshot[p] += reflectance_[p] * received;
      in_flight += static_cast<double>(area_[p] * (channel_sum(state.unshot[p]) - before));
    }
  }
  return shot;
}

double ProgressiveRadiosity::flux_leaving(const ShootingState& state) const {
  double sum = 0;
  for (std::size_t p = 0; p < area_.size(); ++p)
    sum += area_[p] * channel_sum(emitted_[p] + reflectance_[p] * state.irradiance[p]);
  return sum;
}

double ProgressiveRadiosity::unshot_share(const ShootingState& state) const {
  double in_flight = 0;
  for (std::size_t p = 0; p < area_.size(); ++p) in_flight += area_[p] * channel_sum(state.unshot[p]);
  const double all = flux_leaving(state);
  return all > 0 ? in_flight / all : 0;
}

}  // namespace transom
