#include "transom/engine.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "streams.h"
#include "transom/overlap.h"
#include "transom/parallel.h"
#include "transom/sampling.h"
#include "transom/survey.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kGrain = 8;
constexpr double kConnectedShare = 0.05;   // emitters up to this share of the interior's area are connected, not hit

}  // namespace

Engine::Engine(SceneGeometry scene, const SkyBins& sky_bins, SolveOptions options)
    : scene_(std::move(scene)), options_(options) {
  trace_.enable(options_.trace);
  {
    const TracePhase phase(trace_, "geometry");
    faces_ = make_faces(scene_);
    rays_ = std::make_unique<RayScene>(faces_, scene_.materials, scene_.openings);
    sky_index_ = std::make_unique<SkyBinIndex>(sky_bins);
    const std::vector<char> is_indoors =
        survey_interior(scene_, *rays_, faces_, hash_seed(options_.seed, kSurveyStream));
    check_overlaps(faces_, is_indoors, *rays_);
    const std::vector<float> edges =
        choose_edges(faces_, is_indoors, options_.maximum_edge_m, options_.target_patch_count);
    facts_.maximum_edge_m = *std::min_element(edges.begin(), edges.end());
    mesh_ = std::make_unique<LightMesh>(faces_, edges, options_.elements_per_edge);
    gatherer_ = std::make_unique<Gatherer>(*mesh_, *rays_, scene_.materials, scene_.openings, *sky_index_);
    const float element_edge = facts_.maximum_edge_m / static_cast<float>(options_.elements_per_edge);
    direct_light_ = std::make_unique<DirectLight>(*mesh_, *rays_, scene_.point_sources, scene_.materials,
                                                  element_edge * element_edge);
    beam_light_ = std::make_unique<DirectLight>(*mesh_, *rays_, std::vector<PointSource>{}, scene_.materials,
                                                element_edge * element_edge);
  }
  std::vector<GatherRow> rows;
  {
    const TracePhase phase(trace_, "patches");
    patch_of_slot_.assign(static_cast<std::size_t>(mesh_->slot_count()), -1);
    find_patches(first_wave(), rows);
    mark_interior(rows);
    find_unseen_patches(rows);
    check_closed(rows);
  }
  {
    const TracePhase phase(trace_, "transfer");
    assemble_transfer(rows);
    rows.clear();
  }
  if (options_.method == Method::kClassic) {
    const TracePhase phase(trace_, "forward rays");
    solve_classic();
  } else {
    lit_by_sources_ = direct_light_->deposit({}, slot_of_patch_, hash_seed(options_.seed, kBeamStream));
    {
      const TracePhase phase(trace_, "nodes");
      gather_nodes();
    }
    const TracePhase phase(trace_, "links");
    light_always();
    links_ = std::make_unique<PointLinks>(*mesh_, *rays_, nodes_->nodes());
    links_->prepare(beam_slots());
    facts_.link_bytes = links_->byte_count();
  }
  facts_.face_count = static_cast<int>(faces_.faces.size());
  facts_.patch_count = static_cast<int>(slot_of_patch_.size());
}

Engine::~Engine() = default;

glm::vec3 Engine::reflectance(int face, Side side) const {
  const Material& material = scene_.materials[faces_.faces[face].material];
  if (material.opening < 0) return material.reflectance;
  return side == 1 ? glm::vec3(scene_.openings[material.opening].diffuse_reflectance) : glm::vec3(0);
}

std::vector<Share> Engine::to_patches(const std::vector<Share>& elements) const {
  std::vector<Share> patches;
  patches.reserve(elements.size());
  for (const Share& share : elements) {
    const int patch = patch_of_slot_[share.index / mesh_->elements_per_slot()];
    if (patch >= 0) patches.push_back({patch, share.weight});
  }
  merge_shares(patches);
  return patches;
}

void Engine::assemble_transfer(std::vector<GatherRow>& rows) {
  const std::size_t n = rows.size();
  patch_area_.resize(n);
  patch_reflectance_.resize(n);
  patch_emitted_.resize(n);
  std::vector<float> row_sums(n);
  for (std::size_t p = 0; p < n; ++p) {
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    patch_area_[p] = std::max(1e-6f, rows[p].exposure) * mesh_->cell_area(slot.face, slot.cell);
    patch_reflectance_[p] = reflectance(slot.face, slot.side);
    patch_emitted_[p] = kPi * scene_.materials[faces_.faces[slot.face].material].luminance;
    row_sums[p] = is_interior_[p] ? 1.f : 1.f - rows[p].escaped;
    form_factors_.append(to_patches(rows[p].reached));
    through_.append(to_patches(rows[p].through));
    patch_sky_.append(rows[p].sky);
  }
  double emitting = 0, interior = 0;
  for (std::size_t p = 0; p < n; ++p) {
    if (is_interior_[p]) interior += patch_area_[p];
    if (is_interior_[p] && patch_emitted_[p] != glm::vec3(0)) emitting += patch_area_[p];
  }
  connects_emitters_ = emitting < kConnectedShare * interior;
  facts_.defects = make_reciprocal(form_factors_, patch_area_, row_sums);
  std::vector<PatchPlace> places(n);
  for (std::size_t p = 0; p < n; ++p) {
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    const Face& face = faces_.faces[slot.face];
    places[p] = {face.position(mesh_->cell_parameters(slot.face, slot.cell, glm::vec2(1.f / 3))),
                 slot.side == 0 ? face.normal : -face.normal};
  }
  interreflection_ =
      std::make_unique<Interreflection>(form_factors_, through_, patch_reflectance_, patch_area_, places);
  facts_.cluster_count = interreflection_->cluster_count();
}

// Patches that a beam may light: they see some of the sky.
std::vector<int> Engine::beam_slots() const {
  const int ground = sky_index_->count() - 1;
  std::vector<int> slots;
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p) {
    if (patch_reflectance_[p] == glm::vec3(0)) continue;
    bool sees_sky = false;
    for (std::size_t k = patch_sky_.begin[p]; k < patch_sky_.begin[p + 1] && !sees_sky; ++k)
      sees_sky = patch_sky_.entries[k].index != ground;
    if (sees_sky) slots.push_back(slot_of_patch_[p]);
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
