#include "transom/engine.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "streams.h"
#include "transom/convex_room.h"
#include "transom/error.h"
#include "transom/overlap.h"
#include "transom/parallel.h"
#include "transom/sampling.h"
#include "transom/survey.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kGrain = 8;
constexpr double kSmoothTolerance = 1e-3;  // of interreflection, for lights that only have to look like others
constexpr int kMostCycles = 1000;
constexpr int kMostElementsPerEdge = 16;  // a byte tells those of a patch apart
constexpr double kConnectedShare = 0.05;  // emitters up to this share of the interior's area are connected, not hit

}  // namespace

void SolveOptions::validate() const {
  const auto check = [](bool is_allowed, const char* name, double value, const char* allowed) {
    if (is_allowed) return;
    std::ostringstream text;
    text << name << " is " << value << "; allowed: " << allowed;
    throw InputError(text.str());
  };
  const auto check_count = [&](const char* name, int value, int most) {
    check(value >= 1 && value <= most, name, value, ("1 to " + std::to_string(most)).c_str());
  };
  constexpr int kMost = 1 << 24;
  check(maximum_edge_m >= 0 && std::isfinite(maximum_edge_m), "maximum_edge_m", static_cast<double>(maximum_edge_m),
        "0, or a length");
  check(outdoor_edge_m >= 0 && std::isfinite(outdoor_edge_m), "outdoor_edge_m", static_cast<double>(outdoor_edge_m),
        "0, or a length");
  check_count("target_patch_count", target_patch_count, kMost);
  check_count("elements_per_edge", elements_per_edge, kMostElementsPerEdge);
  for (const GatherSamples& samples : {patch_samples, node_samples}) {
    check_count("rays over the hemisphere", samples.hemisphere, kMost);
    check_count("rays towards openings", samples.openings, kMost);
  }
  check_count("panel_rays", panel_rays, kMost);
  check(node_tolerance > 0, "node_tolerance", static_cast<double>(node_tolerance), "above 0");
  check(tolerance > 0, "tolerance", tolerance, "above 0");
}

Engine::Engine(SceneGeometry scene, const SkyBins& sky_bins, SolveOptions options)
    : scene_(std::move(scene)), sky_bins_(sky_bins), options_(options) {
  solve(nullptr);
}

Engine::Engine(const Engine& solved, SceneGeometry scene)
    : scene_(std::move(scene)), sky_bins_(solved.sky_bins_), options_(solved.options_) {
  options_.maximum_edge_m = solved.facts_.maximum_edge_m;
  options_.outdoor_edge_m = solved.facts_.outdoor_edge_m;
  solve(&solved);
}

void Engine::solve(const Engine* solved) {
  options_.validate();
  for (OpeningGroup& group : scene_.openings)
    if (group.panel) group.diffuse_reflectance = 0;  // comes with a product, and no solve depends on that
  trace_.enable(options_.trace);
  {
    const TracePhase phase(trace_, "geometry");
    faces_ = make_faces(scene_);
    rays_ = std::make_unique<RayScene>(faces_, scene_.materials, scene_.openings);
    sky_index_ = std::make_unique<SkyBinIndex>(sky_bins_);
    std::vector<char> is_indoors = survey_interior(scene_, *rays_, faces_, hash_seed(options_.seed, kSurveyStream));
    check_overlaps(faces_, is_indoors, *rays_);
    add_sides_that_see_indoors(scene_, faces_, *rays_, options_.seed, is_indoors);
    const std::vector<float> edges =
        choose_edges(faces_, is_indoors, options_.maximum_edge_m, options_.outdoor_edge_m, options_.target_patch_count);
    facts_.maximum_edge_m = *std::min_element(edges.begin(), edges.end());
    facts_.outdoor_edge_m = *std::max_element(edges.begin(), edges.end());
    mesh_ = std::make_unique<LightMesh>(faces_, edges, options_.elements_per_edge, clusters(edges, is_indoors));
    panels_ = std::make_unique<Panels>(faces_, scene_.materials, scene_.openings);
    gatherer_ = std::make_unique<Gatherer>(*mesh_, *rays_, scene_.materials, scene_.openings, *sky_index_, *panels_);
    const float element_edge = facts_.maximum_edge_m / static_cast<float>(options_.elements_per_edge);
    const std::uint32_t beam_seed = hash_seed(options_.seed, kBeamStream);
    const bool is_convex = is_convex_room(faces_);
    direct_light_ = std::make_unique<DirectLight>(*mesh_, *rays_, scene_.point_sources, scene_.materials,
                                                  element_edge * element_edge, is_convex, beam_seed);
    beam_light_ = std::make_unique<DirectLight>(*mesh_, *rays_, std::vector<PointSource>{}, scene_.materials,
                                                element_edge * element_edge, is_convex, beam_seed);
  }
  Known known = known_from(solved);
  {
    const TracePhase phase(trace_, "patches");
    patch_of_slot_.assign(static_cast<std::size_t>(mesh_->slot_count()), -1);
    gather_panels();
    lit_slots_ = slots_lit_by_sources();
    find_patches(first_wave(), known);
    mark_interior();
    find_unseen_patches(known);
    check_closed();
    known.has_same_patches = known.has_same_faces() && slot_of_patch_ == solved->slot_of_patch_;
  }
  {
    const TracePhase phase(trace_, "transfer");
    SparseRows patch_sky = assemble_transfer(known);
    link_panels(patch_sky);
    patch_sky_ = SkyRows(patch_sky, ground_bin());
  }
  if (options_.method == Method::kClassic) {
    const TracePhase phase(trace_, "forward rays");
    solve_classic();
  } else {
    {
      const TracePhase phase(trace_, "likeness");
      lit_by_sources_ = direct_light_->deposit({}, receivers_);
      find_smooth_lights();
    }
    {
      const TracePhase phase(trace_, "nodes");
      gather_nodes(known);
    }
    const TracePhase phase(trace_, "links");
    light_always();
    link_nodes(known);
  }
  facts_.face_count = static_cast<int>(faces_.faces.size());
  facts_.patch_count = static_cast<int>(slot_of_patch_.size());
}

// Small faces taken together, where each for itself would be too many.
FaceClusters Engine::clusters(const std::vector<float>& edges, const std::vector<char>& is_indoors) const {
  const std::vector<char> is_small = find_small_faces(faces_, scene_.materials, edges, options_.target_patch_count);
  return {faces_,
          is_small,
          is_indoors,
          facts_.maximum_edge_m,
          options_.target_patch_count / 2,
          options_.elements_per_edge * options_.elements_per_edge};
}

Engine::Known Engine::known_from(const Engine* solved) const {
  Known known;
  known.engine = solved;
  if (!solved) return known;
  known.change = std::make_unique<SceneChange>(*solved->mesh_, *mesh_);
  const std::vector<int> own = opening_faces(), others = solved->opening_faces();
  known.has_openings = std::equal(own.begin(), own.end(), others.begin(), others.end(), [&](int face, int other) {
    const OpeningGroup &a = scene_.openings[opening_of(face)], &b = solved->scene_.openings[solved->opening_of(other)];
    return known.change->face_before(face) == other && a.transmittance == b.transmittance && a.panel == b.panel;
  });
  return known;
}

int Engine::opening_of(int face) const {
  return scene_.materials[faces_.faces[face].material].opening;
}

std::vector<int> Engine::opening_faces() const {
  std::vector<int> faces;
  for (int face = 0; face < static_cast<int>(faces_.faces.size()); ++face)
    if (opening_of(face) >= 0) faces.push_back(face);
  return faces;
}

Engine::~Engine() = default;

glm::vec3 Engine::reflectance(int face, Side side) const {
  const Material& material = scene_.materials[faces_.faces[face].material];
  if (material.opening < 0) return material.reflectance;
  return side == 1 ? glm::vec3(scene_.openings[material.opening].diffuse_reflectance) : glm::vec3(0);
}

std::vector<Share> Engine::to_patches(const std::vector<Share>& slots) const {
  std::vector<Share> patches;
  patches.reserve(slots.size());
  for (const Share& share : slots)
    if (patch_of_slot_[share.index] >= 0) patches.push_back({patch_of_slot_[share.index], share.weight});
  merge_shares(patches);
  return patches;
}

// Returns what patches see of the sky, with panels as they were sampled.
SparseRows Engine::assemble_transfer(const Known& known) {
  SparseRows patch_sky;
  const std::size_t n = patch_rows_.size();
  patch_area_.resize(n);
  patch_reflectance_.resize(n);
  patch_emitted_.resize(n);
  std::vector<float> row_sums(n);
  std::vector<char> is_behind_openings(n);
  for (std::size_t p = 0; p < n; ++p) {
    const PatchRow& row = patch_rows_[p];
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    patch_area_[p] = std::max(1e-6f, row.around->exposure) * mesh_->slot_area(slot_of_patch_[p]);
    for (int e = 0; e < mesh_->elements_per_slot(); ++e)
      element_share_.push_back(mesh_->element_area(slot_of_patch_[p] * mesh_->elements_per_slot() + e) /
                               patch_area_[p]);
    patch_reflectance_[p] = reflectance(slot.face, slot.side);
    patch_emitted_[p] = kPi * scene_.materials[faces_.faces[slot.face].material].luminance;
    row_sums[p] = is_interior_[p] ? 1.f : 1.f - row.around->escaped;
    is_behind_openings[p] = is_interior_[p] && row.around->escaped == 0;
    through_.append(to_patches(row.beyond->through));
    facts_.kept_patch_rows += known.patch(slot_of_patch_[p]) >= 0;
    patch_sky.append(row.beyond->sky);
  }
  receivers_ = beam_light_->receivers(slot_of_patch_, std::move(is_behind_openings));
  double emitting = 0, interior = 0;
  for (std::size_t p = 0; p < n; ++p) {
    if (is_interior_[p]) interior += patch_area_[p];
    if (is_interior_[p] && patch_emitted_[p] != glm::vec3(0)) emitting += patch_area_[p];
  }
  const auto is_grey = [](glm::vec3 colour) { return colour.x == colour.y && colour.y == colour.z; };
  is_grey_scene_ = std::all_of(patch_reflectance_.begin(), patch_reflectance_.end(), is_grey) &&
                   std::all_of(patch_emitted_.begin(), patch_emitted_.end(), is_grey) &&
                   std::all_of(scene_.point_sources.begin(), scene_.point_sources.end(),
                               [&](const PointSource& source) { return is_grey(source.intensity); });
  connects_emitters_ = emitting < kConnectedShare * interior;
  if (known.has_same_patches && is_interior_ == known.engine->is_interior_) {
    form_factors_ = known.engine->form_factors_;
    facts_.defects = known.engine->facts_.defects;
  } else {
    SparseRows sampled;
    for (const PatchRow& row : patch_rows_) sampled.append(to_patches(row.around->reached));
    facts_.defects = make_reciprocal(sampled, patch_area_, row_sums);
    form_factors_ = std::make_shared<const SparseRows>(std::move(sampled));
  }
  std::vector<PatchPlace> places(n);
  for (std::size_t p = 0; p < n; ++p) {
    places[p] = {mesh_->middle_of(slot_of_patch_[p]).position, mesh_->normal_of(slot_of_patch_[p]),
                 faces_.faces[mesh_->slot(slot_of_patch_[p]).face].material};
  }
  interreflection_ =
      std::make_unique<Interreflection>(*form_factors_, through_, patch_reflectance_, patch_area_, places);
  facts_.cluster_count = interreflection_->cluster_count();
  return patch_sky;
}

// What patches send when an even sky is all there is, and when lamps are: light that has the shape of the light of many
// conditions once it has been reflected.
void Engine::find_smooth_lights() {
  const std::size_t n = slot_of_patch_.size();
  const std::vector<glm::vec3> nothing(n, glm::vec3(0));
  std::vector<glm::vec3> from_sky = nothing, from_lamps = nothing;
  for (std::size_t p = 0; p < n; ++p)
    for (const Share& share : patch_sky_.row(p)) from_sky[p] += glm::vec3(share.weight);
  for (const LitElement& e : lit_by_sources_) {
    const int per_slot = mesh_->elements_per_slot(), patch = patch_of_slot_[e.element / per_slot];
    from_lamps[patch] += e.illuminance * element_share_[patch * per_slot + e.element % per_slot];
  }
  has_sky_ = from_sky != nothing;
  smooth_lights_.clear();
  const auto add = [&](const std::vector<glm::vec3>& emitted, const std::vector<glm::vec3>& direct) {
    std::vector<glm::vec3> irradiance;
    interreflection_->solve({emitted, direct}, kSmoothTolerance, kMostCycles, irradiance);
    std::vector<float> radiosity(n);
    for (std::size_t p = 0; p < n; ++p) {
      const glm::vec3 sent = emitted[p] + patch_reflectance_[p] * irradiance[p];
      radiosity[p] = (sent.x + sent.y + sent.z) / 3;
    }
    smooth_lights_.push_back(std::move(radiosity));
  };
  if (has_sky_) add(nothing, from_sky);
  if (from_lamps != nothing || patch_emitted_ != nothing) add(patch_emitted_, from_lamps);
}

// Patches that a beam may light: they see some of the sky.
std::vector<int> Engine::beam_slots() const {
  std::vector<int> slots;
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p) {
    if (patch_reflectance_[p] == glm::vec3(0)) continue;
    const std::vector<Share> sky = patch_sky_.row(p);
    if (std::any_of(sky.begin(), sky.end(), [&](const Share& share) { return share.index != ground_bin(); }))
      slots.push_back(slot_of_patch_[p]);
  }
  return slots;
}

void Engine::light_always() {
  const int per_slot = mesh_->elements_per_slot();
  bright_always_ = bright_elements(lit_by_sources_);
  if (connects_emitters_)
    for (std::size_t p = 0; p < slot_of_patch_.size(); ++p)
      if (patch_emitted_[p] != glm::vec3(0))
        for (int e = 0; e < per_slot; ++e)
          bright_always_.push_back({slot_of_patch_[p] * per_slot + e, patch_emitted_[p]});
  const std::vector<Node>& nodes = nodes_->nodes();
  node_always_.assign(nodes.size(), glm::vec3(0));
  if (bright_always_.empty()) return;
  const FirstBounce first_bounce(*mesh_, *rays_, bright_always_);
  parallel_indices(nodes.size(), kGrain, [&](std::size_t i) {
    if (nodes_->is_exposed(i))
      node_always_[i] = first_bounce.irradiance(nodes[i].position, nodes[i].normal, FirstBounce::Rays::kOne);
  });
}

}  // namespace transom
