// The engine by the published method: what classic.h offers, put together.
#include "transom/engine.h"
#include "transom/error.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr std::uint64_t kForwardStream = 0xc1a551c;
constexpr double kShootingTolerance = 1e-3;  // flux in flight at which shooting stops, relative

}  // namespace

void Engine::solve_classic() {
  forward_rays_ = std::make_unique<ForwardRays>(*mesh_, *rays_, scene_.materials, scene_.openings, ForwardRayCounts{},
                                                hash_seed(options_.seed, kForwardStream));
  shooting_ =
      std::make_unique<ProgressiveRadiosity>(*form_factors_, through_, patch_area_, patch_reflectance_, patch_emitted_);
  connects_emitters_ = false;
}

Lighting Engine::begin_relight(Condition condition, const Lighting* previous) const {
  if (options_.method != Method::kClassic) throw InputError("only the classic method relights step by step");
  condition.validate(sky_index_->count() - 1);
  Lighting lighting;
  lighting.condition = std::move(condition);
  const std::size_t n = slot_of_patch_.size();
  const int per_slot = mesh_->elements_per_slot();
  {
    const TracePhase phase(trace_, "forward rays");
    ForwardLight light = forward_rays_->cast(lighting.condition, *sky_index_, patch_of_slot_, patch_area_);
    lighting.patch_sun = std::move(light.sun);
    lighting.patch_sky = std::move(light.sky);
    lighting.forward_ray_count = light.ray_count;
    // What lies outdoors is lit without an opening; point sources light everything.
    std::vector<int> outdoors;
    for (std::size_t p = 0; p < n; ++p)
      if (!is_interior_[p]) {
        outdoors.push_back(slot_of_patch_[p]);
        lighting.patch_sky[p] = sky_light(lighting.condition, patch_sky_, p);
      }
    const std::vector<Beam>& beams = lighting.condition.beams;
    std::vector<LitElement> lit = direct_light_->deposit(beams, outdoors, hash_seed(options_.seed, kForwardStream));
    if (!scene_.point_sources.empty()) {
      std::vector<int> indoors;
      for (std::size_t p = 0; p < n; ++p)
        if (is_interior_[p]) indoors.push_back(slot_of_patch_[p]);
      const std::vector<LitElement> more =
          direct_light_->deposit({}, indoors, hash_seed(options_.seed, kForwardStream));
      lit.insert(lit.end(), more.begin(), more.end());
    }
    for (const LitElement& e : lit) {
      const int patch = patch_of_slot_[e.element / per_slot];
      lighting.patch_sun[patch] +=
          e.illuminance * (mesh_->element_area(e.element) / patch_area_[patch]);
    }
  }
  std::vector<glm::vec3> direct(n);
  for (std::size_t p = 0; p < n; ++p) direct[p] = lighting.patch_sun[p] + lighting.patch_sky[p];
  lighting.shooting = previous ? previous->shooting : shooting_->dark();
  shooting_->replace_direct(lighting.shooting, direct);
  show_classic(lighting);
  return lighting;
}

bool Engine::continue_relight(Lighting& lighting, int shots) const {
  if (options_.method != Method::kClassic) throw InputError("only the classic method relights step by step");
  const TracePhase phase(trace_, "shooting");
  const int shot = shooting_->shoot(lighting.shooting, shots, kShootingTolerance);
  lighting.shots += shot;
  show_classic(lighting);
  return shot == shots;
}

// Hands the present state to all that shows or measures light.
void Engine::show_classic(Lighting& lighting) const {
  const std::size_t n = slot_of_patch_.size();
  lighting.unshot_share = shooting_->unshot_share(lighting.shooting);
  lighting.patch_irradiance = lighting.shooting.irradiance;
  lighting.patch_smooth_radiosity.resize(n);
  for (std::size_t p = 0; p < n; ++p)
    lighting.patch_smooth_radiosity[p] = patch_emitted_[p] + patch_reflectance_[p] * lighting.patch_irradiance[p];
}

}  // namespace transom
