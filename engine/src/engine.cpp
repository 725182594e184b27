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
constexpr int kMaximumSweeps = 20000;
constexpr int kShotsAtOnce = 1 << 20;
constexpr double kConnectedShare = 0.05;   // emitters up to this share of the interior's area are connected, not hit
constexpr float kLeastDividedSize = 0.5f;  // of the longest edge of patches: smaller cells are fine enough as they are
constexpr float kExposedNode = 0.5f;       // a node counts when at least this share of its rays is outside solids

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
  }
  std::vector<GatherRow> rows;
  std::vector<int> divisions;
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
    divisions = cell_divisions(rows);
    assemble_transfer(rows);
    rows.clear();
  }
  {
    const TracePhase phase(trace_, "nodes");
    if (options_.method == Method::kClassic)
      solve_classic();
    else
      gather_nodes(divisions);
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
}

// Cells are divided where the harmonic mean distance of what they see is short against their size: there irradiance
// changes within the cell [after Ward & Heckbert 1992].
std::vector<int> Engine::cell_divisions(const std::vector<GatherRow>& rows) const {
  std::vector<int> divisions;
  for (std::size_t p = 0; p < rows.size(); ++p) {
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    const float size = std::sqrt(mesh_->cell_area(slot.face, slot.cell));
    const float wanted = size / (options_.node_spacing * std::max(rows[p].harmonic_distance, 1e-6f * faces_.extent));
    const bool is_small = size < kLeastDividedSize * facts_.maximum_edge_m;
    divisions.push_back(is_small ? 1 : wanted > 2 ? 4 : wanted > 1 ? 2 : 1);
  }
  return divisions;
}

void Engine::gather_nodes(const std::vector<int>& divisions) {
  std::vector<int> slots, slot_divisions;
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p)
    if (patch_reflectance_[p] != glm::vec3(0)) {
      slots.push_back(slot_of_patch_[p]);
      slot_divisions.push_back(divisions[p]);
    }
  nodes_ = std::make_unique<NodeField>(*mesh_, *rays_, slots, slot_divisions);
  const std::vector<Node>& nodes = nodes_->nodes();
  facts_.node_count = static_cast<int>(nodes.size());
  std::vector<GatherRow> rows(nodes.size());
  parallel_indices(nodes.size(), kGrain, [&](std::size_t i) {
    rows[i] = gatherer_->gather_at_point(nodes[i], options_.node_samples,
                                         hash_seed(options_.seed, hash_seed(kNodeStream, i)));
    rows[i].reached.insert(rows[i].reached.end(), rows[i].through.begin(), rows[i].through.end());
    rows[i].reached = to_patches(rows[i].reached);
  });
  std::vector<char> is_exposed(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    is_exposed[i] = rows[i].exposure >= kExposedNode;
    node_sky_.append(rows[i].sky);
    node_patches_.append(rows[i].reached);
  }
  nodes_->finish(std::move(is_exposed));
}

glm::vec3 Engine::sky_light(const SparseRows& rows, std::size_t row) const {
  const int ground = sky_index_->count() - 1;
  float sky = 0;
  glm::vec3 sum(0);
  for (std::size_t k = rows.begin[row]; k < rows.begin[row + 1]; ++k) {
    const Share& share = rows.entries[k];
    if (share.index == ground)
      sum += share.weight * lighting_.condition.ground_luminance;
    else
      sky += share.weight * lighting_.condition.sky_luminance[share.index];
  }
  return sum + sky * lighting_.condition.sky_colour;
}

// What nodes are connected to: elements lit by beams, and small emitters.
std::vector<BrightElement> Engine::bright_elements(const std::vector<LitElement>& lit) const {
  const int per_slot = mesh_->elements_per_slot();
  std::vector<BrightElement> bright;
  for (const LitElement& e : lit)
    bright.push_back({e.element, patch_reflectance_[patch_of_slot_[e.element / per_slot]] * e.illuminance});
  if (!connects_emitters_) return bright;
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p)
    if (patch_emitted_[p] != glm::vec3(0))
      for (int e = 0; e < per_slot; ++e) bright.push_back({slot_of_patch_[p] * per_slot + e, patch_emitted_[p]});
  return bright;
}

void Engine::relight(Condition condition) {
  if (options_.method == Method::kClassic) {
    begin_relight(std::move(condition));
    while (continue_relight(kShotsAtOnce)) {
    }
    return;
  }
  condition.validate(sky_index_->count() - 1);
  lighting_.condition = std::move(condition);
  const std::size_t n = slot_of_patch_.size();
  const int per_slot = mesh_->elements_per_slot();
  std::vector<LitElement> lit;
  {
    const TracePhase phase(trace_, "beams");
    lit = direct_light_->deposit(lighting_.condition.beams, slot_of_patch_, hash_seed(options_.seed, kBeamStream));
    first_bounce_ = std::make_unique<FirstBounce>(*mesh_, *rays_, bright_elements(lit));
  }
  std::vector<glm::vec3> sky(n), from_beams(n, glm::vec3(0)), direct(n);
  {
    const TracePhase phase(trace_, "sky");
    parallel_indices(n, 64, [&](std::size_t p) { sky[p] = sky_light(patch_sky_, p); });
  }
  {
    const TracePhase phase(trace_, "interreflection");
    lighting_.element_direct.assign(n * static_cast<std::size_t>(per_slot), glm::vec3(0));
    for (const LitElement& e : lit) {
      const int patch = patch_of_slot_[e.element / per_slot];
      const Slot slot = mesh_->slot(e.element / per_slot);
      from_beams[patch] +=
          e.illuminance * (mesh_->element_area(slot.face, slot.cell, e.element % per_slot) / patch_area_[patch]);
      lighting_.element_direct[patch * per_slot + e.element % per_slot] = e.illuminance;
    }
    for (std::size_t p = 0; p < n; ++p) direct[p] = sky[p] + from_beams[p];
    lighting_.patch_irradiance = direct;
    lighting_.sweeps =
        solve_interreflection(form_factors_, through_, patch_reflectance_, patch_emitted_, direct, patch_area_,
                              options_.tolerance, kMaximumSweeps, lighting_.patch_irradiance);
    lighting_.patch_smooth_radiosity.resize(n);
    for (std::size_t p = 0; p < n; ++p)
      lighting_.patch_smooth_radiosity[p] = (connects_emitters_ ? glm::vec3(0) : patch_emitted_[p]) +
                                            patch_reflectance_[p] * (lighting_.patch_irradiance[p] - from_beams[p]);
  }
  {
    const TracePhase phase(trace_, "gather");
    const std::size_t node_count = node_sky_.row_count();
    lighting_.node_sky.resize(node_count);
    lighting_.node_indirect.resize(node_count);
    parallel_indices(node_count, 64, [&](std::size_t i) {
      lighting_.node_sky[i] = sky_light(node_sky_, i);
      lighting_.node_indirect[i] = node_patches_.dot(i, lighting_.patch_smooth_radiosity);
      if (nodes_->is_exposed(i))
        lighting_.node_indirect[i] += first_bounce_->irradiance(nodes_->nodes()[i].position, nodes_->nodes()[i].normal);
    });
  }
}

glm::vec3 Engine::element_radiosity(int element) const {
  const int per_slot = mesh_->elements_per_slot();
  const int patch = patch_of_slot_[element / per_slot];
  if (patch < 0) return glm::vec3(0);
  return lighting_.patch_smooth_radiosity[patch] + (connects_emitters_ ? patch_emitted_[patch] : glm::vec3(0)) +
         patch_reflectance_[patch] * lighting_.element_direct[patch * per_slot + element % per_slot];
}

std::vector<Irradiance> Engine::illuminance(const std::vector<glm::dvec3>& points,
                                            const std::vector<glm::vec3>& normals, GatherSamples samples) const {
  std::vector<Irradiance> result(points.size());
  parallel_indices(points.size(), 1, [&](std::size_t i) {
    const glm::vec3 normal = glm::normalize(normals[i]);
    const Node node{glm::vec3(points[i] - faces_.origin) + faces_.ray_offset() * normal, normal};
    const GatherRow row =
        gatherer_->gather_at_point(node, samples, hash_seed(options_.seed, hash_seed(kSensorStream, i)));
    SparseRows sky;
    sky.append(row.sky);
    result[i].direct = direct_light_->illuminance(lighting_.condition.beams, node.position, normal);
    result[i].sky = sky_light(sky, 0);
    result[i].indirect = first_bounce_->irradiance(node.position, normal);
    for (const std::vector<Share>* shares : {&row.reached, &row.through})
      for (const Share& share : to_patches(*shares))
        result[i].indirect += share.weight * lighting_.patch_smooth_radiosity[share.index];
  });
  return result;
}

Irradiance Engine::interpolate(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const {
  if (options_.method == Method::kClassic) {
    Irradiance constant;
    const int patch = patch_of_slot_[mesh_->slot_index(face, side, mesh_->grid(face).locate(st).cell)];
    if (patch < 0) return constant;
    constant.sky = lighting_.patch_sky[patch];
    constant.indirect = lighting_.patch_irradiance[patch] - lighting_.patch_sky[patch] - lighting_.patch_sun[patch];
    return constant;
  }
  const NodeShares shares = nodes_->interpolate(face, side, st, lifted_point);
  Irradiance result;
  if (shares.count == 0) {  // no node can speak for the point: its patch does
    const int patch = patch_of_slot_[mesh_->slot_index(face, side, mesh_->grid(face).locate(st).cell)];
    if (patch < 0) return result;
    const glm::vec3 normal = side == 0 ? faces_.faces[face].normal : -faces_.faces[face].normal;
    result.sky = sky_light(patch_sky_, static_cast<std::size_t>(patch));
    result.indirect = form_factors_.dot(static_cast<std::size_t>(patch), lighting_.patch_smooth_radiosity) +
                      first_bounce_->irradiance(lifted_point, normal);
    return result;
  }
  for (int k = 0; k < shares.count; ++k) {
    result.sky += shares.weight[k] * lighting_.node_sky[shares.node[k]];
    result.indirect += shares.weight[k] * lighting_.node_indirect[shares.node[k]];
  }
  result.sky = glm::max(result.sky, glm::vec3(0));
  result.indirect = glm::max(result.indirect, glm::vec3(0));
  return result;
}

}  // namespace transom
