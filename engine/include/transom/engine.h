/// @file The engine: solve once for a geometry, relight for every condition, then look at it from anywhere.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "transom/classic.h"
#include "transom/deposit.h"
#include "transom/first_bounce.h"
#include "transom/gather.h"
#include "transom/geometry.h"
#include "transom/interreflection.h"
#include "transom/light_mesh.h"
#include "transom/node_field.h"
#include "transom/point_links.h"
#include "transom/ray_scene.h"
#include "transom/sky.h"
#include "transom/trace.h"
#include "transom/transfer.h"

namespace transom {

/// How light is found and shown. kGather: light gathered at nodes, interpolated between them. kClassic: the published
/// method, constant patches lit by forward rays and shooting (classic.h).
enum class Method { kGather, kClassic };

/// Settings of a solve. The defaults serve every scene.
struct SolveOptions {
  Method method = Method::kGather;
  float maximum_edge_m = 0;       ///< of a patch; 0: from the target number of patches
  int target_patch_count = 3000;  ///< sides of cells that take part in the exchange of light, about
  int elements_per_edge = 4;      ///< a patch has the square of it
  GatherSamples patch_samples{512, 128};
  GatherSamples node_samples{1024, 256};
  float node_tolerance = 0.06f;  ///< relative error of interpolated light from which on nodes are added; infinity: none
  double tolerance = 1e-4;       ///< flux in flight at which interreflection stops, relative
  std::uint32_t seed = 1;
  bool trace = false;
};

/// What the solve found and did, for the run bundle.
struct SolveFacts {
  int face_count = 0, patch_count = 0, interior_patch_count = 0, node_count = 0;
  float maximum_edge_m = 0;
  double leak_share = 0;  ///< of the hemisphere rays of interior patches, those that met nothing
  TransferDefects defects;
  int cluster_count = 0;       ///< of patches, for interreflection
  std::size_t link_bytes = 0;  ///< of what is kept of how nodes see patches
};

/// Flux balance of the interior [lm], linear RGB. Interior: every side that light from the rooms' side of the openings,
/// or from emitters, reaches without passing an opening.
struct EnergyAudit {
  glm::dvec3 in_sky{0};        ///< sky and ground light through the openings, sampled from the openings
  glm::dvec3 in_beams{0};      ///< the same for beams
  glm::dvec3 in_reflected{0};  ///< light that outdoor surfaces send through the openings
  glm::dvec3 in_emitted{0};    ///< emitting surfaces and point sources
  glm::dvec3 absorbed{0};      ///< by opaque surfaces
  glm::dvec3 out{0};           ///< into the room side of openings: transmitted or absorbed there
  glm::dvec3 in() const { return in_sky + in_beams + in_reflected + in_emitted; }
};

/// Irradiance split by where it comes from [lx].
struct Irradiance {
  glm::vec3 direct{0};    ///< beams and point sources
  glm::vec3 sky{0};       ///< sky and ground, directly or through openings
  glm::vec3 indirect{0};  ///< all surfaces: reflected and emitted
};

/// Light of the present condition.
struct Lighting {
  Condition condition;
  std::vector<glm::vec3> node_sky, node_indirect;  ///< irradiance of each node [lx]
  std::vector<glm::vec3> patch_irradiance;         ///< all light [lx]
  std::vector<glm::vec3> patch_smooth_radiosity;   ///< what nodes find by rays: M + rho (E - direct) [lm/m²]
  std::vector<LitElement> lit_elements;            ///< by beams and point sources
  std::vector<BrightElement> bright_elements;      ///< what points are connected to
  std::vector<glm::vec3> patch_sky;                ///< directly from sky and ground [lx]
  std::vector<glm::vec3> patch_sun;                ///< directly from beams and point sources [lx]
  int sweeps = 0;                                  ///< cycles of interreflection
  int shots = 0;                                   ///< kClassic: patches that have shot
  double unshot_share = 0;                         ///< kClassic: flux in flight, relative
  int forward_ray_count = 0;                       ///< kClassic
};

class Engine {
 public:
  /// Solves: everything that depends on geometry and reflectance alone. Throws InputError for a scene that cannot be
  /// lit rightly, such as a room whose wall is open.
  Engine(SceneGeometry scene, const SkyBins& sky_bins, SolveOptions options);
  ~Engine();

  /// Relights for a condition: everything but the image.
  void relight(Condition condition);

  /// kClassic: relights step by step. The direct light is that of the new condition at once; `continue_relight` shoots
  /// at most `shots` times, replaces the old condition's indirect light by as much, and says whether more is to come.
  /// Throws InputError for another method.
  void begin_relight(Condition condition);
  bool continue_relight(int shots);

  /// Irradiance at points (world coordinates [m]) with unit normals, under the present condition. What the last points
  /// see is kept: asked again under another condition, they cost sums and connections to sunlit patches.
  std::vector<Irradiance> illuminance(const std::vector<glm::dvec3>& points, const std::vector<glm::vec3>& normals,
                                      GatherSamples samples);

  /// Flux balance under the present condition; `rays_per_opening` samples each opening triangle independently.
  EnergyAudit audit(int rays_per_opening) const;

  const SolveFacts& facts() const { return facts_; }
  const Lighting& lighting() const { return lighting_; }
  Trace& trace() { return trace_; }

  // What rendering needs.
  const SceneGeometry& scene() const { return scene_; }
  const Faces& faces() const { return faces_; }
  const RayScene& rays() const { return *rays_; }
  const LightMesh& mesh() const { return *mesh_; }
  const SkyBinIndex& sky_index() const { return *sky_index_; }
  const DirectLight& direct_light() const { return *direct_light_; }
  glm::vec3 reflectance(int face, Side side) const;

  /// The points at which light is gathered to be shown; none with kClassic. Those at corners of cells come first.
  std::span<const Node> nodes() const {
    return nodes_ ? std::span<const Node>(nodes_->nodes()) : std::span<const Node>();
  }

  /// What speaks for the light at a point of a face: nodes around it, or else its patch. Numbers are those of
  /// `shown_radiance`. Empty where the side takes no part.
  NodeShares shown_at(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const;

  /// Radiance reflected by every node, then by every patch, of the present light of sky and of surfaces [cd/m²].
  void shown_radiance(std::vector<glm::vec4>& sky, std::vector<glm::vec4>& indirect) const;

  const SparseRows& form_factors() const { return form_factors_; }
  const std::vector<float>& patch_areas() const { return patch_area_; }
  const std::vector<int>& patch_slots() const { return slot_of_patch_; }

 private:
  std::vector<int> first_wave() const;
  void find_patches(std::vector<int> wave, std::vector<GatherRow>& rows);
  void find_unseen_patches(std::vector<GatherRow>& rows);
  std::vector<int> first_slots() const;
  void mark_interior(const std::vector<GatherRow>& rows);
  void check_closed(const std::vector<GatherRow>& rows);
  void assemble_transfer(std::vector<GatherRow>& rows);
  struct TrialLight;
  struct NodeTrial;
  std::vector<TrialLight> trial_lights() const;
  void gather_new_nodes(NodeTrial& trial, int first_part);
  std::vector<Share> near_elements(const Node& node, const std::vector<Share>& elements) const;
  void resolve_near_light(const NodeTrial& trial);
  bool is_worth_a_look(const NodeTrial& trial, int part, int level, float tolerance) const;
  bool is_to_be_divided(const NodeTrial& trial, int part, int level, float tolerance) const;
  void gather_nodes();
  void solve_classic();
  void show_classic();
  std::vector<Share> to_patches(const std::vector<Share>& elements) const;
  glm::vec3 sky_light(const SparseRows& rows, std::size_t row) const;
  void light_always();
  std::vector<int> beam_slots() const;
  std::vector<BrightElement> bright_elements(const std::vector<LitElement>& lit) const;
  std::vector<glm::vec3> element_direct() const;

  SceneGeometry scene_;
  SolveOptions options_;
  Trace trace_;
  SolveFacts facts_;
  Faces faces_;
  std::unique_ptr<RayScene> rays_;
  std::unique_ptr<LightMesh> mesh_;
  std::unique_ptr<SkyBinIndex> sky_index_;
  std::unique_ptr<Gatherer> gatherer_;
  std::unique_ptr<DirectLight> direct_light_, beam_light_;  // with point sources and without

  // Patches: the slots that take part.
  std::vector<int> patch_of_slot_;  // -1: takes no part
  std::vector<int> slot_of_patch_;
  std::vector<float> patch_area_;  // exposed part [m²]
  std::vector<glm::vec3> patch_reflectance_, patch_emitted_;
  std::vector<char> is_interior_;
  std::vector<int> unseen_slots_;   // that see patches indoors and were seen by none
  bool connects_emitters_ = false;  // small emitters: found by connection, not by rays
  SparseRows form_factors_, through_, patch_sky_;
  std::unique_ptr<Interreflection> interreflection_;

  // Where light is shown.
  std::unique_ptr<NodeField> nodes_;
  SparseRows node_sky_, node_patches_;
  SparseRows node_near_;  // what the nodes, then the patches, send close by: those with their weights, less these
  std::unique_ptr<PointLinks> links_;

  // Light that no condition changes: of point sources on elements, and its first reflection, with small emitters, at
  // nodes.
  std::vector<LitElement> lit_by_sources_;
  std::vector<BrightElement> bright_always_;
  std::vector<glm::vec3> node_always_;

  // Points at which illuminance was asked for last.
  struct Sensors {
    std::vector<glm::dvec3> points;
    std::vector<glm::vec3> normals;
    GatherSamples samples;
    std::vector<Node> nodes;
    SparseRows sky, patches;
  };
  void gather_sensors(const std::vector<glm::dvec3>& points, const std::vector<glm::vec3>& normals,
                      GatherSamples samples);
  Sensors sensors_;

  // kClassic alone.
  std::unique_ptr<ForwardRays> forward_rays_;
  std::unique_ptr<ProgressiveRadiosity> shooting_;

  Lighting lighting_;
};

}  // namespace transom
