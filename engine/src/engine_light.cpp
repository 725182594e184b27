// The engine after its solve: the light of a condition, and who asks for it.
#include <algorithm>
#include <numbers>

#include "streams.h"
#include "transom/engine.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kMaximumCycles = 20000;
constexpr int kShotsAtOnce = 1 << 20;

}  // namespace

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

// What points are connected to for the light that falls on elements.
std::vector<BrightElement> Engine::bright_elements(const std::vector<LitElement>& lit) const {
  std::vector<BrightElement> bright;
  for (const LitElement& e : lit) {
    const glm::vec3 rho = patch_reflectance_[patch_of_slot_[e.element / mesh_->elements_per_slot()]];
    if (rho != glm::vec3(0)) bright.push_back({e.element, rho * e.illuminance});
  }
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
  std::vector<LitElement>& lit = lighting_.lit_elements;
  {
    const TracePhase phase(trace_, "beams");
    lit = beam_light_->deposit(lighting_.condition.beams, slot_of_patch_, hash_seed(options_.seed, kBeamStream));
    lighting_.bright_elements = bright_elements(lit);
  }
  std::vector<glm::vec3>&sky = lighting_.patch_sky, &sun = lighting_.patch_sun;
  sky.resize(n);
  sun.assign(n, glm::vec3(0));
  {
    const TracePhase phase(trace_, "sky");
    parallel_indices(n, 64, [&](std::size_t p) { sky[p] = sky_light(patch_sky_, p); });
  }
  const std::size_t node_count = node_sky_.row_count();
  lighting_.node_indirect = node_always_;
  {
    const TracePhase phase(trace_, "first reflection");
    links_->add_irradiance(lighting_.bright_elements, lighting_.node_indirect);
  }
  lit.insert(lit.end(), lit_by_sources_.begin(), lit_by_sources_.end());
  lighting_.bright_elements.insert(lighting_.bright_elements.end(), bright_always_.begin(), bright_always_.end());
  {
    const TracePhase phase(trace_, "interreflection");
    for (const LitElement& e : lit) {
      const int patch = patch_of_slot_[e.element / per_slot];
      const Slot slot = mesh_->slot(e.element / per_slot);
      sun[patch] +=
          e.illuminance * (mesh_->element_area(slot.face, slot.cell, e.element % per_slot) / patch_area_[patch]);
    }
    std::vector<glm::vec3> direct(n);
    for (std::size_t p = 0; p < n; ++p) direct[p] = sky[p] + sun[p];
    lighting_.sweeps =
        interreflection_->solve(patch_emitted_, direct, options_.tolerance, kMaximumCycles, lighting_.patch_irradiance);
    lighting_.patch_smooth_radiosity.resize(n);
    for (std::size_t p = 0; p < n; ++p)
      lighting_.patch_smooth_radiosity[p] = (connects_emitters_ ? glm::vec3(0) : patch_emitted_[p]) +
                                            patch_reflectance_[p] * (lighting_.patch_irradiance[p] - sun[p]);
  }
  {
    const TracePhase phase(trace_, "gather");
    lighting_.node_sky.resize(node_count);
    std::vector<glm::vec4> radiosity(n);
    for (std::size_t p = 0; p < n; ++p) radiosity[p] = glm::vec4(lighting_.patch_smooth_radiosity[p], 0);
    parallel_indices(node_count, 64, [&](std::size_t i) {
      lighting_.node_sky[i] = sky_light(node_sky_, i);
      lighting_.node_indirect[i] += glm::vec3(node_patches_.dot(i, radiosity));
    });
    // What is seen close by is not as even as its patch: the nodes on it, as they are now, speak for it.
    std::vector<glm::vec4> sent(node_count);
    parallel_indices(node_count, 64, [&](std::size_t i) {
      const int face = nodes_->surface(i) / 2;
      const glm::vec3 emitted = kPi * scene_.materials[faces_.faces[face].material].luminance;
      sent[i] = glm::vec4(
          (connects_emitters_ ? glm::vec3(0) : emitted) +
              reflectance(face, nodes_->surface(i) % 2) * (lighting_.node_sky[i] + lighting_.node_indirect[i]),
          0);
    });
    sent.insert(sent.end(), radiosity.begin(), radiosity.end());
    parallel_indices(node_count, 64,
                     [&](std::size_t i) { lighting_.node_indirect[i] += glm::vec3(node_near_.dot(i, sent)); });
  }
}

// By patch * elements_per_slot + element [lx].
std::vector<glm::vec3> Engine::element_direct() const {
  const int per_slot = mesh_->elements_per_slot();
  std::vector<glm::vec3> direct(slot_of_patch_.size() * static_cast<std::size_t>(per_slot), glm::vec3(0));
  for (const LitElement& e : lighting_.lit_elements)
    direct[patch_of_slot_[e.element / per_slot] * per_slot + e.element % per_slot] += e.illuminance;
  return direct;
}

void Engine::gather_sensors(const std::vector<glm::dvec3>& points, const std::vector<glm::vec3>& normals,
                            GatherSamples samples) {
  if (sensors_.points == points && sensors_.normals == normals && sensors_.samples == samples) return;
  sensors_ = {points, normals, samples, std::vector<Node>(points.size()), {}, {}};
  std::vector<GatherRow> rows(points.size());
  parallel_indices(points.size(), 1, [&](std::size_t i) {
    const glm::vec3 normal = glm::normalize(normals[i]);
    sensors_.nodes[i] = {glm::vec3(points[i] - faces_.origin) + faces_.ray_offset() * normal, normal};
    rows[i] =
        gatherer_->gather_at_point(sensors_.nodes[i], samples, hash_seed(options_.seed, hash_seed(kSensorStream, i)));
    rows[i].reached.insert(rows[i].reached.end(), rows[i].through.begin(), rows[i].through.end());
    rows[i].reached = to_patches(rows[i].reached);
  });
  for (const GatherRow& row : rows) {
    sensors_.sky.append(row.sky);
    sensors_.patches.append(row.reached);
  }
}

std::vector<Irradiance> Engine::illuminance(const std::vector<glm::dvec3>& points,
                                            const std::vector<glm::vec3>& normals, GatherSamples samples) {
  gather_sensors(points, normals, samples);
  std::vector<Irradiance> result(points.size());
  const FirstBounce first_bounce(*mesh_, *rays_, lighting_.bright_elements);
  parallel_indices(points.size(), 1, [&](std::size_t i) {
    const Node& node = sensors_.nodes[i];
    result[i].direct = direct_light_->illuminance(lighting_.condition.beams, node.position, node.normal);
    result[i].sky = sky_light(sensors_.sky, i);
    result[i].indirect = first_bounce.irradiance(node.position, node.normal, FirstBounce::Rays::kMany) +
                         sensors_.patches.dot(i, lighting_.patch_smooth_radiosity);
  });
  return result;
}

NodeShares Engine::shown_at(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const {
  if (nodes_) {
    const NodeShares shares = nodes_->interpolate(face, side, st, lifted_point);
    if (shares.count > 0) return shares;
  }
  NodeShares alone;  // no node can speak for the point: its patch does
  const int patch = patch_of_slot_[mesh_->slot_index(face, side, mesh_->grid(face).locate(st).cell)];
  if (patch < 0) return alone;
  alone.count = 1;
  alone.node[0] = static_cast<int>(nodes_ ? nodes_->nodes().size() : 0) + patch;
  alone.weight[0] = 1;
  return alone;
}

void Engine::shown_radiance(std::vector<glm::vec4>& sky, std::vector<glm::vec4>& indirect) const {
  const std::size_t node_count = nodes_ ? nodes_->nodes().size() : 0, patch_count = slot_of_patch_.size();
  sky.resize(node_count + patch_count);
  indirect.resize(node_count + patch_count);
  parallel_indices(node_count, 1024, [&](std::size_t i) {
    const glm::vec3 scale = reflectance(nodes_->surface(i) / 2, nodes_->surface(i) % 2) / kPi;
    sky[i] = glm::vec4(scale * lighting_.node_sky[i], 0);
    indirect[i] = glm::vec4(scale * lighting_.node_indirect[i], 0);
  });
  for (std::size_t p = 0; p < patch_count; ++p) {
    const glm::vec3 scale = patch_reflectance_[p] / kPi, from_sky = lighting_.patch_sky[p];
    sky[node_count + p] = glm::vec4(scale * from_sky, 0);
    indirect[node_count + p] =
        glm::vec4(scale * (lighting_.patch_irradiance[p] - from_sky - lighting_.patch_sun[p]), 0);
  }
}

}  // namespace transom
