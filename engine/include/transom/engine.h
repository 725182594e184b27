/// @file The engine: solve once for a geometry, relight for every condition, then look at it from anywhere.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "transom/classic.h"
#include "transom/compact_rows.h"
#include "transom/deposit.h"
#include "transom/first_bounce.h"
#include "transom/gather.h"
#include "transom/geometry.h"
#include "transom/interreflection.h"
#include "transom/light_mesh.h"
#include "transom/lighting.h"
#include "transom/node_field.h"
#include "transom/panels.h"
#include "transom/parallel.h"
#include "transom/point_links.h"
#include "transom/ray_scene.h"
#include "transom/scene_change.h"
#include "transom/sky.h"
#include "transom/sky_rows.h"
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
  float outdoor_edge_m = 0;       ///< of a patch outdoors, if longer; 0: so that these are not too many
  int target_patch_count = 3000;  ///< sides of cells that take part in the exchange of light, about
  int elements_per_edge = 4;      ///< a patch has the square of it
  GatherSamples patch_samples{512, 128};
  GatherSamples node_samples{1024, 384};
  int panel_rays = 256;           ///< outwards from a panel, for each incident bin
  float node_tolerance = 0.054f;  ///< of light between nodes, relative; infinity: more only at ends of solids and gaps
  double tolerance = 2.5e-4;      ///< flux in flight at which interreflection stops, relative
  std::uint32_t seed = 1;
  bool trace = false;

  /// Throws InputError, naming the setting, its value and what is allowed.
  void validate() const;
};

/// What the solve found and did, for the run bundle.
struct SolveFacts {
  int face_count = 0, patch_count = 0, interior_patch_count = 0, node_count = 0;
  float maximum_edge_m = 0, outdoor_edge_m = 0;
  double leak_share = 0;  ///< of the hemisphere rays of interior patches, those that met nothing
  TransferDefects defects;
  int cluster_count = 0;  ///< of patches, for interreflection
  int panel_count = 0, panel_bin_count = 0;
  std::size_t link_bytes = 0;  ///< of what is kept of how nodes see patches
  /// Rows begun from those of another engine: but for what lies behind openings, and for single rays, they are its own.
  int kept_patch_rows = 0, kept_node_rows = 0;
};

/// Flux balance of the interior [lm], linear RGB. Interior: every side that light from the rooms' side of the openings,
/// or from emitters, reaches without passing an opening.
struct EnergyAudit {
  glm::dvec3 in_sky{0};    ///< sky and ground light through the openings, sampled from the openings
  glm::dvec3 in_beams{0};  ///< the same for beams
  glm::dvec3 in_reflected{
      0};                    ///< light that surfaces before and, into gaps between panes, behind openings send through
  glm::dvec3 in_emitted{0};  ///< emitting surfaces and point sources
  glm::dvec3 absorbed{0};    ///< by opaque surfaces
  glm::dvec3 out{0};         ///< into the room side of openings: transmitted or absorbed there
  glm::dvec3 in() const { return in_sky + in_beams + in_reflected + in_emitted; }
};

class Engine {
 public:
  /// Solves: everything that depends on geometry and reflectance alone. Throws InputError for a scene that cannot be
  /// lit rightly, such as a room whose wall is open.
  Engine(SceneGeometry scene, const SkyBins& sky_bins, SolveOptions options);

  /// Solves a scene with the options of an engine whose scene was another, and takes over what that found wherever the
  /// edit leaves it valid: equal bit by bit to a fresh solve whose patches have the same longest edges, and faster.
  /// Reflectance, luminance: no ray is cast anew. Glazing, or an opening closed: only rays through openings are. An
  /// object moved, added or removed, or a wall opened: only rays that meet the boxes around it, where it was and where
  /// it is, as long as the extent of the scene remains; where a wall is opened, those through openings too.
  /// `solved` is not changed and may go. Throws as above.
  Engine(const Engine& solved, SceneGeometry scene);
  ~Engine();

  /// The light of a condition: everything but the image. Any number of threads may ask at once. Throws InputError for
  /// light that is negative or not finite.
  /// previous: light whose indirect part the first states show; kClassic starts from it and replaces it step by step,
  /// so that its answer depends on it within the tolerance of shooting. Null: from darkness. follower: takes the states
  /// on the way; null: none. The answer is null where it has abandoned the relighting.
  std::shared_ptr<const Lighting> relight(Condition condition, const Lighting* previous = nullptr,
                                          RelightFollower* follower = nullptr) const;

  /// Throws InputError for a condition that `relight` would refuse.
  void check(const Condition& condition) const { condition.validate(sky_index_->count() - 1); }

  /// Puts a product into the panels of an opening group; until then nothing passes them. No light that was found before
  /// changes. Throws InputError for a group without panels, a matrix of the wrong size or values that cannot be. Not
  /// while others relight.
  void set_product(int opening, Product product);

  /// What points (world coordinates [m]) with normals see: found once, asked under any light.
  Sensors sensors(const std::vector<glm::dvec3>& points, const std::vector<glm::vec3>& normals,
                  GatherSamples samples) const;

  /// Irradiance at sensors: sums, and connections to sunlit patches.
  std::vector<Irradiance> illuminance(const Lighting& lighting, const Sensors& sensors) const;

  /// Flux balance; `rays_per_opening` samples each opening triangle independently.
  EnergyAudit audit(const Lighting& lighting, int rays_per_opening) const;

  const SolveFacts& facts() const { return facts_; }
  Trace& trace() const { return trace_; }

  // What rendering needs.
  const SceneGeometry& scene() const { return scene_; }
  const Faces& faces() const { return faces_; }
  const RayScene& rays() const { return *rays_; }
  const LightMesh& mesh() const { return *mesh_; }
  const SkyBinIndex& sky_index() const { return *sky_index_; }
  const DirectLight& direct_light() const { return *direct_light_; }
  const Panels& panels() const { return *panels_; }
  glm::vec3 reflectance(int face, Side side) const;

  /// The points at which light is gathered to be shown; none with kClassic. Those at corners of cells come first.
  std::span<const Node> nodes() const {
    return nodes_ ? std::span<const Node>(nodes_->nodes()) : std::span<const Node>();
  }

  /// What speaks for the light at a point of a face: nodes and midpoints around it, or else its patch. Numbers are
  /// those of `shown_radiance`. Empty where the side takes no part.
  NodeShares shown_at(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const;

  /// Radiance reflected at every node and midpoint, then by every patch, of the light of sky and of surfaces [cd/m²].
  void shown_radiance(const Lighting& lighting, std::vector<glm::vec4>& sky, std::vector<glm::vec4>& indirect) const;

  /// Whether a slot takes part, and whether beams are then known to reach it through openings alone.
  bool is_patch(int slot) const { return patch_of_slot_[slot] >= 0; }
  bool is_behind_openings(int slot) const { return receivers_.is_behind_openings[patch_of_slot_[slot]] != 0; }

  const SparseRows& form_factors() const { return *form_factors_; }
  const std::vector<float>& patch_areas() const { return patch_area_; }
  const std::vector<int>& patch_slots() const { return slot_of_patch_; }
  bool is_interior(std::size_t patch) const { return is_interior_[patch] != 0; }

 private:
  /// What an engine of an earlier state of the scene found, as far as it is valid.
  struct Known {
    const Engine* engine = nullptr;
    std::unique_ptr<SceneChange> change;  // null without an engine
    bool has_openings = false;            // all faces of openings and their glazing are the same
    bool has_same_patches = false;        // no face has changed, and patches have the same numbers
    bool has_same_nodes = false;          // and nodes have
    std::unordered_multimap<std::uint32_t, int> nodes_by_seed;
    std::vector<int> node;  // its number of each node here, or -1
    bool has_same_faces() const { return change && change->is_none(); }
    int patch(int slot) const;  // its number of the patch of a slot here, or -1
  };
  /// What a patch sees, by slot: without looking through openings; and through them, with all of the sky.
  struct PatchRow {
    std::shared_ptr<const GatherRow> around, beyond;
  };
  /// What nodes see, for edits: by slot, since an edit may make patches of slots that are none.
  struct NodeRows {
    SparseRows reached, through;  // without looking through openings, and through them
    SparseRows sky;               // seen by itself
    SparseRows near;              // elements of the nearest slots
    std::vector<float> exposure, harmonic_distance;
    std::vector<std::int64_t> inverse_distance;
  };

  void solve(const Engine* solved);
  FaceClusters clusters(const std::vector<float>& edges, const std::vector<char>& is_indoors) const;
  int opening_of(int face) const;
  std::vector<int> opening_faces() const;
  Known known_from(const Engine* solved) const;
  std::vector<int> slots_lit_by_sources() const;
  std::vector<int> first_wave() const;
  PatchRow patch_row(int slot, const Known& known) const;
  std::shared_ptr<const GatherRow> surroundings_of_patch(int slot, const std::shared_ptr<const GatherRow>& known_row,
                                                         const Known& known) const;
  void find_patches(std::vector<int> wave, const Known& known);
  void find_unseen_patches(const Known& known);
  std::vector<int> first_slots() const;
  void mark_interior();
  void check_closed();
  SparseRows assemble_transfer(const Known& known);
  void find_smooth_lights();
  struct TrialLight;
  struct NodeTrial;
  std::vector<TrialLight> trial_lights() const;
  GatherRow surroundings_of_node(const Node& node, int known_node, const Known& known) const;
  void look_through_openings(const Node& node, int known_node, const Known& known, GatherRow& row) const;
  void gather_new_nodes(NodeTrial& trial, int first_part, Known& known);
  std::vector<std::vector<Share>> with_far_patches_grouped(std::vector<std::vector<Share>> rows) const;
  void keep_node_rows(NodeTrial& trial, Known& known);
  void resolve_near_light(const NodeTrial& trial);
  std::vector<float> find_rounds(const NodeTrial& trial);
  std::vector<float> gathered_in_rounds(const TrialLight& light, const std::vector<int>& rounds,
                                        std::vector<float>& before) const;
  float sent_of_trial(const TrialLight& light, std::size_t node, float irradiance) const;
  std::vector<float> element_profiles(const std::vector<float>& node_irradiance) const;
  std::vector<Share> seen_of(std::size_t patch, const std::vector<float>& profiles) const;
  std::vector<float> send_unevenly(const std::vector<float>& node_irradiance);
  void see_from_afar(const std::vector<float>& seen_from_afar, const std::vector<Share>& near,
                     std::vector<Share>& patches) const;
  bool is_worth_a_look(const NodeTrial& trial, int part, int level, float tolerance) const;
  bool is_to_be_divided(const NodeTrial& trial, int part, int level, float tolerance) const;
  bool is_at_mouth_of_gap(const NodeTrial& trial, int part) const;
  void gather_nodes(Known& known);
  void link_nodes(const Known& known);
  std::uint32_t node_seed(const Node& node) const;
  std::uint32_t patch_seed(int slot) const;
  void gather_panels();
  void link_panels(SparseRows& patch_sky);
  void balance_panels(SparseRows& patch_sky) const;
  void solve_classic();
  std::shared_ptr<const Lighting> relight_classic(Condition condition, const Lighting* previous,
                                                  RelightFollower* follower) const;
  Lighting direct_classic(Condition condition, const Lighting* previous) const;
  void show_classic(Lighting& lighting) const;
  Lighting direct_light_of(Condition condition) const;
  bool is_grey(const Condition& condition) const;
  std::shared_ptr<const Lighting> with_indirect_of(Lighting lighting, const Lighting* previous) const;
  void find_smooth_radiosity(Lighting& lighting) const;
  glm::vec3 emitted_at_node(std::size_t node) const;
  glm::vec3 sent_by_node(const Lighting& lighting, std::size_t node) const;
  std::vector<glm::vec4> sent_by_nodes_and_patches(const Lighting& lighting) const;
  std::vector<Share> resolved_by_nodes(const std::vector<Share>& elements) const;
  void gather_indirect(Lighting& lighting, const std::vector<glm::vec3>& first_reflection) const;
  void gather_close_by(Lighting& lighting) const;
  std::vector<Share> to_patches(const std::vector<Share>& slots) const;
  SkyRadiance sky_radiance(const Lighting& lighting) const;
  int ground_bin() const { return sky_index_->count() - 1; }
  void find_shafts(Condition& condition, std::vector<glm::vec3>& residual) const;
  double find_panel_radiance(const std::vector<glm::vec3>& radiosity, Lighting& lighting) const;
  template <typename Body>
  void for_shown_nodes(const Body& body) const;
  void find_sky_light(Lighting& lighting) const;
  bool solve_with_panels(Lighting& lighting, const Interreflection::AfterCycle& after_cycle) const;
  void light_always();
  std::vector<int> beam_slots() const;
  std::vector<BrightElement> bright_elements(std::span<const LitElement> lit) const;
  std::vector<glm::vec3> element_direct(const Lighting& lighting) const;
  glm::dvec3 into_gaps(int face, std::span<const Ray> rays, const std::function<glm::vec3(int)>& radiosity) const;
  glm::dvec3 through_product(const Panel& panel, const std::vector<glm::dvec3>& arriving) const;

  SceneGeometry scene_;
  SkyBins sky_bins_;
  SolveOptions options_;
  mutable Trace trace_;
  SolveFacts facts_;
  Faces faces_;
  std::unique_ptr<RayScene> rays_;
  std::unique_ptr<LightMesh> mesh_;
  std::unique_ptr<SkyBinIndex> sky_index_;
  std::unique_ptr<Panels> panels_;
  std::unique_ptr<Gatherer> gatherer_;
  std::unique_ptr<DirectLight> direct_light_, beam_light_;  // with point sources and without

  // Patches: the slots that take part.
  std::vector<int> patch_of_slot_;  // -1: takes no part
  std::vector<int> slot_of_patch_;
  std::vector<PatchRow> patch_rows_;
  std::vector<float> patch_area_;     // exposed part [m²]
  std::vector<float> element_share_;  // of that area: patch * elements_per_slot + element
  std::vector<glm::vec3> patch_reflectance_, patch_emitted_;
  std::vector<char> is_interior_;
  DirectLight::Receivers receivers_;  // all patches
  std::vector<int> lit_slots_;        // that point sources light
  std::vector<int> unseen_slots_;     // that see patches indoors and were seen by none
  bool is_grey_scene_ = false;        // all reflectances and emitters
  bool connects_emitters_ = false;    // small emitters: found by connection, not by rays
  std::shared_ptr<const SparseRows> form_factors_;
  SparseRows through_;
  SkyRows patch_sky_;
  std::unique_ptr<Interreflection> interreflection_;
  std::vector<std::vector<float>> smooth_lights_;  // radiosity of patches: first what the sky makes, if it is seen
  bool has_sky_ = false;

  // Panels: products by opening; what arrives at each incident bin from the sky, and from elements or patches outdoors.
  std::vector<Product> products_;
  std::vector<GatherRow> panel_rows_;  // during solve
  SkyRows panel_sky_;
  SparseRows panel_patches_;

  // Where light is shown.
  std::unique_ptr<NodeField> nodes_;
  std::shared_ptr<const NodeRows> node_rows_;
  SkyRows node_sky_;                          // all of the sky
  CompactRows node_patches_;                  // all that shown nodes see of patches, far ones in groups
  std::vector<NodeShares> nodes_at_element_;  // what speaks for each element of patches, at its middle
  ExactRows node_near_;  // what the nodes, then the patches, send close by: those with their weights, less these
  std::vector<std::size_t> shown_nodes_;                  // the others get no light
  std::vector<std::vector<std::size_t>> nodes_of_round_;  // that gather what is close by before all do, and again
  std::unique_ptr<PointLinks> links_;

  // Light that no condition changes: of point sources on elements, and its first reflection, with small emitters, at
  // nodes.
  std::vector<LitElement> lit_by_sources_;
  std::vector<BrightElement> bright_always_;
  std::vector<glm::vec3> node_always_;

  // kClassic alone.
  std::unique_ptr<ForwardRays> forward_rays_;
  std::unique_ptr<ProgressiveRadiosity> shooting_;
};

// In a loop on all threads.
template <typename Body>
void Engine::for_shown_nodes(const Body& body) const {
  parallel_indices(shown_nodes_.size(), 64, [&](std::size_t k) { body(shown_nodes_[k]); });
}

}  // namespace transom
