#include <numbers>

#include "transom/engine.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::uint32_t kAuditSeed = 0x5eed0a0d;

}  // namespace

// Flux [lm] that a product sends into the room of the flux that arrives by incident bin.
glm::dvec3 Engine::through_product(const Panel& panel, const std::vector<glm::dvec3>& arriving) const {
  const std::vector<float>& transmission = products_[static_cast<std::size_t>(panel.opening)].transmission;
  glm::dvec3 sum(0);
  for (std::size_t out = 0; out < arriving.size() && !transmission.empty(); ++out)
    for (std::size_t in = 0; in < arriving.size(); ++in)
      sum += static_cast<double>(panels_->frame(panel).bins.projected_solid_angle(static_cast<int>(out)) *
                                 transmission[out * arriving.size() + in]) *
             arriving[in];
  return sum;
}

// What lies before an opening may be indoors itself, such as the gap between two panes: then light of the rooms enters
// there. rays: outwards from an opening that is no panel. Sum of the radiances that come along those that end indoors.
glm::dvec3 Engine::into_gaps(int face_index, std::span<const Ray> rays,
                             const std::function<glm::vec3(int element)>& radiosity) const {
  const Face& face = faces_.faces[static_cast<std::size_t>(face_index)];
  const float lift = 2 * faces_.ray_offset();  // from one side of the opening to the other
  std::vector<Hit> ends(rays.size()), begins(rays.size());
  rays_->intersect(RayScene::What::kAll, rays, ends);
  std::vector<Ray> back(rays.begin(), rays.end());
  for (Ray& ray : back) ray = {ray.origin - lift * face.normal, -ray.direction};
  rays_->intersect(RayScene::What::kOpaque, back, begins);
  glm::dvec3 sum(0);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (ends[i].face < 0 || begins[i].face < 0) continue;
    const int patch = patch_of_slot_[mesh_->element_at(ends[i]) / mesh_->elements_per_slot()];
    if (patch < 0 || !is_interior_[patch] || faces_.is_inside_solid(begins[i].face, begins[i].side)) continue;
    back[i].t_far = begins[i].t;
    const float passed =
        rays_->opening_transmittance(face_index, back[i].direction) * rays_->transmittance(back[i]) / kPi;
    sum += glm::dvec3(passed * radiosity(mesh_->element_at(begins[i])));
  }
  return sum;
}

// Flux in is sampled here from the openings outwards, with rays of its own: nothing of the solve is used but the
// radiosity of outdoor surfaces.
EnergyAudit Engine::audit(const Lighting& lighting, int rays_per_opening) const {
  EnergyAudit audit;
  const Condition& condition = lighting.condition;
  const int ground = sky_index_->count() - 1, per_slot = mesh_->elements_per_slot();
  const std::vector<glm::vec3> element_light = element_direct(lighting);
  const auto element_radiosity = [&](int element) {
    const int patch = patch_of_slot_[element / per_slot];
    if (patch < 0) return glm::vec3(0);
    return lighting.patch_smooth_radiosity[patch] + (connects_emitters_ ? patch_emitted_[patch] : glm::vec3(0)) +
           patch_reflectance_[patch] * element_light[patch * per_slot + element % per_slot];
  };
  std::vector<Ray> rays(static_cast<std::size_t>(rays_per_opening));
  std::vector<Hit> hits(rays.size());
  std::vector<std::uint8_t> blocked(rays.size());
  for (std::size_t f = 0; f < faces_.faces.size(); ++f) {
    const Face& face = faces_.faces[f];
    const int opening = scene_.materials[face.material].opening;
    if (opening < 0) continue;
    const OpeningGroup& group = scene_.openings[opening];
    const SobolSequence points(hash_seed(options_.seed ^ kAuditSeed, f));
    const float flux_share = face.area / static_cast<float>(rays_per_opening);
    std::vector<glm::vec3> places(rays.size());
    for (int i = 0; i < rays_per_opening; ++i) {
      const glm::vec4 u = points.point4(static_cast<std::uint32_t>(i));
      const glm::vec2 st = face.is_quad ? glm::vec2(u.z, u.w) : sample_triangle({u.z, u.w});
      places[i] = mesh_->lifted_position(static_cast<int>(f), 0, st);
      rays[i] = {places[i], frame_from_normal(face.normal) * sample_cosine_hemisphere({u.x, u.y})};
    }
    rays_->intersect(RayScene::What::kOpaque, rays, hits);
    const Panel* panel = panels_->at(static_cast<int>(f));
    std::vector<glm::dvec3> arriving(panel ? group.panel->bins.count() : 0, glm::dvec3(0));  // flux by incident bin
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (hits[i].face >= 0 && faces_.is_inside_solid(hits[i].face, hits[i].side)) continue;
      Ray beyond = rays[i];
      if (hits[i].face >= 0) beyond.t_far = hits[i].t;
      const float share = kPi * flux_share * rays_->transmittance(beyond) *
                          (panel ? 1.f : group.transmittance_at(glm::dot(rays[i].direction, face.normal)));
      if (panel) {
        const int bin = (*sky_index_)(rays[i].direction);
        const glm::vec3 radiance = hits[i].face >= 0 ? element_radiosity(mesh_->element_at(hits[i])) / kPi
                                   : bin == ground   ? condition.ground_luminance
                                                     : condition.sky_luminance[bin] * condition.sky_colour;
        arriving[panels_->bin(*panel, -rays[i].direction) - panel->first_bin] += glm::dvec3(share * radiance);
        continue;
      }
      if (hits[i].face >= 0) {
        audit.in_reflected += glm::dvec3(share / kPi * element_radiosity(mesh_->element_at(hits[i])));
      } else {
        const int bin = (*sky_index_)(rays[i].direction);
        audit.in_sky += glm::dvec3(
            share * (bin == ground ? condition.ground_luminance : condition.sky_luminance[bin] * condition.sky_colour));
      }
    }
    if (panel)
      audit.in_sky += through_product(*panel, arriving);
    else
      audit.in_reflected +=
          static_cast<double>(kPi * flux_share) * into_gaps(static_cast<int>(f), rays, element_radiosity);
    for (const Beam& beam : condition.beams) {
      const float cosine = glm::dot(face.normal, beam.direction_to_source);
      if (cosine <= 0 || beam.opening != (panel ? opening : -1)) continue;
      const float passes = panel ? 1.f : group.transmittance_at(cosine);
      const glm::vec3 sun = panel ? beam.direction_to_sun : beam.direction_to_source;
      for (std::size_t i = 0; i < rays.size(); ++i) rays[i] = {places[i], sun};
      rays_->occluded(RayScene::What::kOpaque, rays, blocked);
      for (std::size_t i = 0; i < rays.size(); ++i)
        if (!blocked[i])
          audit.in_beams += glm::dvec3(beam.normal_illuminance) *
                            static_cast<double>(flux_share * cosine * passes * rays_->transmittance(rays[i]));
    }
    for (const Residual& residual : condition.residuals) {
      if (!panel || residual.opening != opening) continue;
      for (std::size_t i = 0; i < rays.size(); ++i) rays[i] = {places[i], residual.direction_to_sun};
      rays_->occluded(RayScene::What::kOpaque, rays, blocked);
      double sunlit = 0;
      for (std::size_t i = 0; i < rays.size(); ++i)
        if (!blocked[i]) sunlit += static_cast<double>(flux_share * rays_->transmittance(rays[i]));
      for (int bin = 0; bin < group.panel->bins.count(); ++bin)
        audit.in_beams += sunlit * static_cast<double>(group.panel->bins.projected_solid_angle(bin)) *
                          glm::dvec3(residual.radiance[bin]);
    }
  }
  for (const PointSource& source : scene_.point_sources) audit.in_emitted += glm::dvec3(4 * kPi * source.intensity);
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p) {
    if (!is_interior_[p]) continue;
    const glm::dvec3 lost(patch_area_[p] * (1.f - patch_reflectance_[p]) * lighting.patch_irradiance[p]);
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    (scene_.materials[faces_.faces[slot.face].material].opening >= 0 ? audit.out : audit.absorbed) += lost;
    audit.in_emitted += glm::dvec3(patch_area_[p] * patch_emitted_[p]);
  }
  return audit;
}

}  // namespace transom
