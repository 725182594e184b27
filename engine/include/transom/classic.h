/// @file The published method that this engine began with: forward rays, constant patches, progressive shooting
/// [Cutler, Sheng, Martin, Glaser & Andersen 2008, sections 3.1, 3.2 and 3.6]. Kept to be measured against.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "transom/geometry.h"
#include "transom/light_mesh.h"
#include "transom/panels.h"
#include "transom/ray_scene.h"
#include "transom/sky.h"
#include "transom/transfer.h"

namespace transom {

/// How many rays a relighting casts.
struct ForwardRayCounts {
  int sun = 70000;               ///< of each beam, through all openings that face it
  int sky_directions = 5000;     ///< over the sky
  int ground_directions = 1000;  ///< below the horizon (the published method has no ground)
  int opening_points = 50;       ///< on all openings together; every direction passes every point
  int panel_bin_rays = 64;       ///< of each panel into each exit bin
};

/// Illuminance of patches by forward rays [lx], what came as parallel sunlight apart from what came from sky and
/// ground.
struct ForwardLight {
  std::vector<glm::vec3> sun, sky;
  int ray_count = 0;
};

/// Light carried from outdoors through the openings to the patches that it meets, normalised by area.
class ForwardRays {
 public:
  ForwardRays(const LightMesh& mesh, const RayScene& rays, const std::vector<Material>& materials,
              const std::vector<OpeningGroup>& openings, const Panels& panels, ForwardRayCounts counts,
              std::uint32_t seed);

  /// panel_radiance: of panels into their exit bins [cd/m²]. patch_of_slot: -1 where a slot takes no part. patch_area:
  /// exposed area [m²].
  ForwardLight cast(const Condition& condition, const std::vector<glm::vec3>& panel_radiance, const SkyBinIndex& sky,
                    const std::vector<int>& patch_of_slot, const std::vector<float>& patch_area) const;

 private:
  struct OpeningTriangle {
    glm::vec3 corner[3], normal;  // the normal looks outdoors
    float area;
    int face, opening;
  };
  /// Light that passes a point of an opening on its way in. outwards: towards where it comes from; 0 if it is known to
  /// arrive. inwards: where it goes.
  struct Arrival {
    glm::vec3 point, outwards, inwards, flux;
  };
  std::vector<Arrival> sun_arrivals(const Beam& beam) const;
  std::vector<Arrival> sky_arrivals(const Condition& condition, const SkyBinIndex& sky) const;
  std::vector<Arrival> panel_arrivals(const std::vector<glm::vec3>& panel_radiance) const;
  void deposit(const std::vector<Arrival>& arrivals, const std::vector<int>& patch_of_slot,
               std::vector<glm::vec3>& flux) const;

  const LightMesh& mesh_;
  const RayScene& rays_;
  const std::vector<Material>& materials_;
  const std::vector<OpeningGroup>& openings_;
  const Panels& panels_;
  ForwardRayCounts counts_;
  std::uint32_t seed_;
  std::vector<OpeningTriangle> triangles_;
  float total_area_ = 0;
};

/// Where shooting is: light that patches have received, and light that they have yet to pass on [lx, lm/m²].
struct ShootingState {
  std::vector<glm::vec3> direct, irradiance, unshot;  ///< irradiance: all of it, direct light included
};

/// Radiosity by shooting [Cohen, Chen, Wallace & Greenberg 1988]: the patch with most unshot flux gives it to all that
/// see it, again and again; every state in between is a usable picture. New direct light replaces the old by shooting
/// the difference, which may be negative [Chen 1990].
class ProgressiveRadiosity {
 public:
  /// form_factors, through: what each patch sees of the others, directly and through openings.
  ProgressiveRadiosity(const SparseRows& form_factors, const SparseRows& through, std::vector<float> area,
                       std::vector<glm::vec3> reflectance, std::vector<glm::vec3> emitted);

  void set_reflectance(std::size_t patch, glm::vec3 reflectance) { reflectance_[patch] = reflectance; }

  /// Darkness in which nothing has been emitted yet.
  ShootingState dark() const;

  /// Replaces the direct illuminance [lx].
  void replace_direct(ShootingState& state, const std::vector<glm::vec3>& direct) const;

  /// Shoots at most `shots` times; stops where the flux in flight is below `tolerance` of all that was ever reflected
  /// or emitted. Returns the number of shots.
  int shoot(ShootingState& state, int shots, double tolerance) const;

  /// Flux in flight as a share of the flux that leaves all patches.
  double unshot_share(const ShootingState& state) const;

 private:
  double flux_leaving(const ShootingState& state) const;

  SparseRows seen_by_;  // row i: the patches that see patch i, and how much of them it fills
  std::vector<float> area_;
  std::vector<glm::vec3> reflectance_, emitted_;
};

}  // namespace transom
