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

void Engine::begin_relight(Condition condition) {
  if (options_.method != Method::kClassic) throw InputError("only the classic method relights step by step");
  condition.validate(sky_index_->count() - 1);
  lighting_.condition = std::move(condition);
  lighting_.shots = 0;
  const std::size_t n = slot_of_patch_.size();
  const int per_slot = mesh_->elements_per_slot();
  {
    const TracePhase phase(trace_, "forward rays");
    ForwardLight light = forward_rays_->cast(lighting_.condition, *sky_index_, patch_of_slot_, patch_area_);
    lighting_.patch_sun = std::move(light.sun);
    lighting_.patch_sky = std::move(light.sky);
    lighting_.forward_ray_count = light.ray_count;
    // What lies outdoors is lit without an opening; point sources light everything.
    std::vector<int> outdoors;
    for (std::size_t p = 0; p < n; ++p)
      if (!is_interior_[p]) {
        outdoors.push_back(slot_of_patch_[p]);
        lighting_.patch_sky[p] = sky_light(patch_sky_, p);
      }
    const std::vector<Beam>& beams = lighting_.condition.beams;
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
      const Slot slot = mesh_->slot(e.element / per_slot);
      lighting_.patch_sun[patch] +=
          e.illuminance * (mesh_->element_area(slot.face, slot.cell, e.element % per_slot) / patch_area_[patch]);
    }
  }
  std::vector<glm::vec3> direct(n);
  for (std::size_t p = 0; p < n; ++p) direct[p] = lighting_.patch_sun[p] + lighting_.patch_sky[p];
  shooting_->replace_direct(direct);
  show_classic();
}

bool Engine::continue_relight(int shots) {
  if (options_.method != Method::kClassic) throw InputError("only the classic method relights step by step");
  const TracePhase phase(trace_, "shooting");
  const int shot = shooting_->shoot(shots, kShootingTolerance);
  lighting_.shots += shot;
  show_classic();
  return shot == shots;
}

// Hands the present state to all that shows or measures light.
void Engine::show_classic() {
  const std::size_t n = slot_of_patch_.size();
  lighting_.unshot_share = shooting_->unshot_share();
  lighting_.patch_irradiance = shooting_->irradiance();
  lighting_.patch_smooth_radiosity.resize(n);
  for (std::size_t p = 0; p < n; ++p)
    lighting_.patch_smooth_radiosity[p] = patch_emitted_[p] + patch_reflectance_[p] * lighting_.patch_irradiance[p];
}

}  // namespace transom
