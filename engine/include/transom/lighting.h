/// @file The light of one condition, and what sensors receive of it.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "transom/classic.h"
#include "transom/deposit.h"
#include "transom/first_bounce.h"
#include "transom/gather.h"
#include "transom/light_mesh.h"
#include "transom/sky.h"
#include "transom/sky_rows.h"
#include "transom/transfer.h"

namespace transom {

/// Irradiance split by where it comes from [lx].
struct Irradiance {
  glm::vec3 direct{0};    ///< beams and point sources
  glm::vec3 sky{0};       ///< sky and ground, directly or through openings
  glm::vec3 indirect{0};  ///< all surfaces: reflected and emitted
};

/// How much of a relighting a condition needed.
struct RelightPlan {
  bool is_grey = false;  ///< reflectances and light are grey: one channel was computed, the others repeat it
  BeamPlan beams;        ///< none for an overcast sky
};

/// Light of a condition, as Engine::relight found it. Shown, measured and kept as it is; never changed.
struct Lighting {
  Condition condition;
  std::vector<glm::vec3> panel_residual;           ///< sunlight of panels into their exit bins, without lobes [cd/m²]
  std::vector<glm::vec3> panel_radiance;           ///< the same, and what they pass of sky, ground and outdoors
  std::vector<glm::vec3> node_sky, node_indirect;  ///< irradiance of each node [lx]
  std::vector<glm::vec3> patch_irradiance;         ///< all light [lx]
  std::vector<glm::vec3> patch_smooth_radiosity;   ///< what nodes find by rays: M + rho (E - direct) [lm/m²]
  std::vector<LitElement> lit_elements;            ///< by beams and point sources
  std::vector<BrightElement> bright_elements;      ///< what points are connected to
  std::size_t beam_lit_count = 0;                  ///< of the lit elements, the first: by beams
  std::size_t beam_bright_count = 0;               ///< the same of the bright ones
  std::vector<glm::vec3> patch_sky;                ///< directly from sky and ground [lx]
  std::vector<glm::vec3> patch_sun;                ///< directly from beams and point sources [lx]
  bool is_final = true;                            ///< false: a state on the way, with indirect light to come
  int sweeps = 0;                                  ///< cycles of interreflection
  RelightPlan plan;
  int shots = 0;              ///< kClassic: patches that have shot
  double unshot_share = 0;    ///< kClassic: flux in flight, relative
  ShootingState shooting;     ///< kClassic: where the next relighting may begin
  int forward_ray_count = 0;  ///< kClassic
};

/// Follows a relighting on its way.
class RelightFollower {
 public:
  virtual ~RelightFollower() = default;
  /// Takes a usable state before the last one: first the new light of beams and sky with the old indirect light, then
  /// what interreflection or shooting has found so far.
  virtual void show(std::shared_ptr<const Lighting> state) = 0;
  /// Asked between steps; false abandons the relighting.
  virtual bool is_wanted() const = 0;
};

/// Points at which illuminance is asked for, and what they see.
struct Sensors {
  std::vector<glm::dvec3> points;  ///< world [m]
  std::vector<glm::vec3> normals;
  GatherSamples samples;
  std::vector<Node> nodes;
  SkyRows sky;
  SparseRows patches;
  SparseRows resolved;  ///< what nodes say of the patches, less the patches: of nodes, then of patches

  /// Whether these are the sensors that were asked for.
  bool are(const std::vector<glm::dvec3>& p, const std::vector<glm::vec3>& n, GatherSamples s) const {
    return points == p && normals == n && samples == s;
  }
};

}  // namespace transom
