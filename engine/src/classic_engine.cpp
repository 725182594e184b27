// The engine by the published method: what classic.h offers, put together.
#include "transom/engine.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr std::uint64_t kForwardStream = 0xc1a551c;
constexpr double kShootingTolerance = 1e-3;  // flux in flight at which shooting stops, relative
constexpr int kShotsBetweenStates = 64;
constexpr int kAllShots = 1 << 20;

}  // namespace

void Engine::solve_classic() {
  forward_rays_ = std::make_unique<ForwardRays>(*mesh_, *rays_, scene_.materials, scene_.openings, *panels_,
                                                ForwardRayCounts{}, hash_seed(options_.seed, kForwardStream));
  shooting_ =
      std::make_unique<ProgressiveRadiosity>(*form_factors_, through_, patch_area_, patch_reflectance_, patch_emitted_);
  connects_emitters_ = false;
}

// The direct light of a condition, with all indirect light of another still to be replaced.
Lighting Engine::direct_classic(Condition condition, const Lighting* previous) const {
  Lighting lighting;
  lighting.condition = std::move(condition);
  const std::size_t n = slot_of_patch_.size();
  const int per_slot = mesh_->elements_per_slot();
  {
    const TracePhase phase(trace_, "forward rays");
    find_shafts(lighting.condition, lighting.panel_residual);
    lighting.patch_sun.assign(n, glm::vec3(0));
    lighting.patch_sky.assign(n, glm::vec3(0));
    lighting.panel_radiance.assign(lighting.panel_residual.size(), glm::vec3(0));
    // What lies outdoors is lit without an opening; point sources light everything.
    const SkyRadiance radiance = sky_radiance(lighting);
    std::vector<int> outdoors;
    for (std::size_t p = 0; p < n; ++p)
      if (!is_interior_[p]) {
        outdoors.push_back(slot_of_patch_[p]);
        lighting.patch_sky[p] = patch_sky_.irradiance(p, radiance);
      }
    const std::vector<Beam>& beams = lighting.condition.beams;
    std::vector<LitElement> lit = direct_light_->deposit(beams, direct_light_->receivers(outdoors, {}));
    if (!scene_.point_sources.empty()) {
      std::vector<int> indoors;
      for (std::size_t p = 0; p < n; ++p)
        if (is_interior_[p]) indoors.push_back(slot_of_patch_[p]);
      const std::vector<LitElement> more = direct_light_->deposit({}, direct_light_->receivers(indoors, {}));
      lit.insert(lit.end(), more.begin(), more.end());
    }
    for (const LitElement& e : lit) {
      const int patch = patch_of_slot_[e.element / per_slot];
      lighting.patch_sun[patch] += e.illuminance * element_share_[patch * per_slot + e.element % per_slot];
    }
    // Panels pass on what surfaces outdoors reflect of their direct light.
    std::vector<glm::vec3> radiosity(n, glm::vec3(0));
    for (const int slot : outdoors) {
      const auto p = static_cast<std::size_t>(patch_of_slot_[slot]);
      radiosity[p] = patch_emitted_[p] + patch_reflectance_[p] * (lighting.patch_sky[p] + lighting.patch_sun[p]);
    }
    find_panel_radiance(radiosity, lighting);
    const ForwardLight light =
        forward_rays_->cast(lighting.condition, lighting.panel_radiance, *sky_index_, patch_of_slot_, patch_area_);
    lighting.forward_ray_count = light.ray_count;
    for (std::size_t p = 0; p < n; ++p) {
      lighting.patch_sun[p] += light.sun[p];
      if (is_interior_[p]) lighting.patch_sky[p] += light.sky[p];
    }
  }
  std::vector<glm::vec3> direct(n);
  for (std::size_t p = 0; p < n; ++p) direct[p] = lighting.patch_sun[p] + lighting.patch_sky[p];
  const bool is_usable = previous && previous->shooting.unshot.size() == n;
  lighting.shooting = is_usable ? previous->shooting : shooting_->dark();
  shooting_->replace_direct(lighting.shooting, direct);
  show_classic(lighting);
  return lighting;
}

std::shared_ptr<const Lighting> Engine::relight_classic(Condition condition, const Lighting* previous,
                                                        RelightFollower* follower) const {
  auto lighting = std::make_shared<Lighting>(direct_classic(std::move(condition), previous));
  const TracePhase phase(trace_, "shooting");
  for (bool is_final = false; !is_final;) {
    if (follower) {
      if (!follower->is_wanted()) return nullptr;
      lighting->is_final = false;
      follower->show(std::make_shared<const Lighting>(*lighting));
    }
    const int shots = follower ? kShotsBetweenStates : kAllShots;
    const int shot = shooting_->shoot(lighting->shooting, shots, kShootingTolerance);
    lighting->shots += shot;
    is_final = shot < shots;
    if (is_final || follower) show_classic(*lighting);
  }
  lighting->is_final = true;
  return lighting;
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
