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
constexpr int kShownCycle = 1;  // of interreflection: less than 1 % of the flux is still to come

}  // namespace

SkyRadiance Engine::sky_radiance(const Lighting& lighting) const {
  const Condition& condition = lighting.condition;
  SkyRadiance radiance{condition.sky_luminance, condition.sky_colour, {glm::vec4(condition.ground_luminance, 0)}};
  for (const glm::vec3& panel : lighting.panel_radiance) radiance.beyond.push_back(glm::vec4(panel, 0));
  return radiance;
}

// What points are connected to for the light that falls on elements.
std::vector<BrightElement> Engine::bright_elements(std::span<const LitElement> lit) const {
  std::vector<BrightElement> bright;
  for (const LitElement& e : lit) {
    const glm::vec3 rho = patch_reflectance_[patch_of_slot_[e.element / mesh_->elements_per_slot()]];
    if (rho != glm::vec3(0)) bright.push_back({e.element, rho * e.illuminance});
  }
  return bright;
}

bool Engine::is_grey(const Condition& condition) const {
  const auto is_grey = [](glm::vec3 colour) { return colour.x == colour.y && colour.y == colour.z; };
  return is_grey_scene_ && is_grey(condition.sky_colour) && is_grey(condition.ground_luminance) &&
         std::all_of(condition.beams.begin(), condition.beams.end(),
                     [&](const Beam& beam) { return is_grey(beam.normal_illuminance); }) &&
         std::all_of(condition.residuals.begin(), condition.residuals.end(), [&](const Residual& rest) {
           return std::all_of(rest.radiance.begin(), rest.radiance.end(), is_grey);
         });
}

// Light that has not been reflected: of beams and point sources on elements, of the sky on patches and at nodes.
Lighting Engine::direct_light_of(Condition condition) const {
  Lighting lighting;
  lighting.condition = std::move(condition);
  find_shafts(lighting.condition, lighting.panel_residual);
  lighting.plan.is_grey = is_grey(lighting.condition);
  {
    const TracePhase phase(trace_, "beams");
    lighting.lit_elements = beam_light_->deposit(lighting.condition.beams, receivers_, &lighting.plan.beams);
    lighting.beam_lit_count = lighting.lit_elements.size();
    lighting.lit_elements.insert(lighting.lit_elements.end(), lit_by_sources_.begin(), lit_by_sources_.end());
    lighting.bright_elements = bright_elements({lighting.lit_elements.data(), lighting.beam_lit_count});
    lighting.beam_bright_count = lighting.bright_elements.size();
    lighting.bright_elements.insert(lighting.bright_elements.end(), bright_always_.begin(), bright_always_.end());
    lighting.patch_sun.assign(slot_of_patch_.size(), glm::vec3(0));
    const int per_slot = mesh_->elements_per_slot();
    for (const LitElement& e : lighting.lit_elements) {
      const int patch = patch_of_slot_[e.element / per_slot];
      lighting.patch_sun[patch] += e.illuminance * element_share_[patch * per_slot + e.element % per_slot];
    }
  }
  find_panel_radiance({}, lighting);
  find_sky_light(lighting);
  if (panel_patches_.entries.empty()) return lighting;
  // Surfaces outdoors send on most of what they will in the end once they have their direct light.
  std::vector<glm::vec3> radiosity(lighting.patch_sky.size());
  for (std::size_t p = 0; p < radiosity.size(); ++p)
    radiosity[p] = patch_emitted_[p] + patch_reflectance_[p] * (lighting.patch_sky[p] + lighting.patch_sun[p]);
  find_panel_radiance(radiosity, lighting);
  find_sky_light(lighting);
  return lighting;
}

// Light of the sky, the ground and panels on patches and at nodes.
void Engine::find_sky_light(Lighting& lighting) const {
  const TracePhase phase(trace_, "sky");
  lighting.patch_sky.resize(patch_sky_.row_count());
  lighting.node_sky.resize(node_sky_.row_count());
  const SkyRadiance radiance = sky_radiance(lighting);
  parallel_indices(lighting.patch_sky.size(), 64,
                   [&](std::size_t p) { lighting.patch_sky[p] = patch_sky_.irradiance(p, radiance); });
  for_shown_nodes([&](std::size_t i) { lighting.node_sky[i] = node_sky_.irradiance(i, radiance); });
}

// The first state of a relighting: its own direct light, and the indirect light of another, or none.
std::shared_ptr<const Lighting> Engine::with_indirect_of(Lighting lighting, const Lighting* previous) const {
  const bool is_usable = previous && previous->patch_irradiance.size() == lighting.patch_sky.size() &&
                         previous->node_indirect.size() == lighting.node_sky.size();
  lighting.is_final = false;
  lighting.node_indirect = is_usable ? previous->node_indirect : node_always_;
  lighting.patch_irradiance.resize(lighting.patch_sky.size());
  for (std::size_t p = 0; p < lighting.patch_irradiance.size(); ++p) {
    lighting.patch_irradiance[p] = lighting.patch_sky[p] + lighting.patch_sun[p];
    if (is_usable)
      lighting.patch_irradiance[p] += previous->patch_irradiance[p] - previous->patch_sky[p] - previous->patch_sun[p];
  }
  find_smooth_radiosity(lighting);
  return std::make_shared<const Lighting>(std::move(lighting));
}

void Engine::find_smooth_radiosity(Lighting& lighting) const {
  const std::size_t n = slot_of_patch_.size();
  lighting.patch_smooth_radiosity.resize(n);
  for (std::size_t p = 0; p < n; ++p)
    lighting.patch_smooth_radiosity[p] = (connects_emitters_ ? glm::vec3(0) : patch_emitted_[p]) +
                                         patch_reflectance_[p] * (lighting.patch_irradiance[p] - lighting.patch_sun[p]);
}

glm::vec3 Engine::emitted_at_node(std::size_t node) const {
  return kPi * scene_.materials[faces_.faces[nodes_->surface(node) / 2].material].luminance;
}

// Radiosity of a node, but for what beams light.
glm::vec3 Engine::sent_by_node(const Lighting& lighting, std::size_t node) const {
  return (connects_emitters_ ? glm::vec3(0) : emitted_at_node(node)) +
         reflectance(nodes_->surface(node) / 2, nodes_->surface(node) % 2) *
             (lighting.node_sky[node] + lighting.node_indirect[node]);
}

// Radiosity of every node, then of every patch, but for what beams light.
std::vector<glm::vec4> Engine::sent_by_nodes_and_patches(const Lighting& lighting) const {
  const std::size_t node_count = lighting.node_indirect.size(), patch_count = lighting.patch_smooth_radiosity.size();
  std::vector<glm::vec4> sent(node_count + patch_count);
  parallel_indices(node_count, 64, [&](std::size_t i) { sent[i] = glm::vec4(sent_by_node(lighting, i), 0); });
  for (std::size_t p = 0; p < patch_count; ++p) sent[node_count + p] = glm::vec4(lighting.patch_smooth_radiosity[p], 0);
  return sent;
}

// Indirect light at nodes, from the irradiance of patches.
void Engine::gather_indirect(Lighting& lighting, const std::vector<glm::vec3>& first_reflection) const {
  const TracePhase phase(trace_, "gather");
  find_smooth_radiosity(lighting);
  lighting.node_indirect.resize(first_reflection.size());
  const std::vector<glm::vec3>& radiosity = lighting.patch_smooth_radiosity;
  const auto gather = [&](auto& sent_by_patches) {
    interreflection_->groups().append_means(sent_by_patches);
    for_shown_nodes([&](std::size_t i) {
      lighting.node_indirect[i] = first_reflection[i] + glm::vec3(node_patches_.dot(i, sent_by_patches));
    });
  };
  if (lighting.plan.is_grey) {
    std::vector<float> greys(radiosity.size());
    for (std::size_t p = 0; p < radiosity.size(); ++p) greys[p] = radiosity[p].x;
    gather(greys);
  } else {
    std::vector<glm::vec4> colours(radiosity.size());
    for (std::size_t p = 0; p < radiosity.size(); ++p) colours[p] = glm::vec4(radiosity[p], 0);
    gather(colours);
  }
  gather_close_by(lighting);
}

// Adds to the indirect light of nodes, found from patches, what they lack of light close by. What is seen there is not
// as even as its patch: the nodes on it, as they are now, speak for it. Those that see little else come to agree first.
void Engine::gather_close_by(Lighting& lighting) const {
  const std::vector<glm::vec3> from_patches = lighting.node_indirect;
  std::vector<glm::vec4> sent = sent_by_nodes_and_patches(lighting);
  const auto add_near = [&](std::size_t i) {
    lighting.node_indirect[i] = from_patches[i] + glm::vec3(node_near_.dot(i, sent));
  };
  for (const std::vector<std::size_t>& nodes : nodes_of_round_) {
    parallel_indices(nodes.size(), 64, [&](std::size_t k) { add_near(nodes[k]); });
    parallel_indices(nodes.size(), 64,
                     [&](std::size_t k) { sent[nodes[k]] = glm::vec4(sent_by_node(lighting, nodes[k]), 0); });
  }
  for_shown_nodes(add_near);
}

std::shared_ptr<const Lighting> Engine::relight(Condition condition, const Lighting* previous,
                                                RelightFollower* follower) const {
  check(condition);
  if (options_.method == Method::kClassic) return relight_classic(std::move(condition), previous, follower);
  const auto is_wanted = [follower] { return !follower || follower->is_wanted(); };
  const auto lighting = std::make_shared<Lighting>(direct_light_of(std::move(condition)));
  if (!is_wanted()) return nullptr;
  if (follower) follower->show(with_indirect_of(*lighting, previous));
  std::vector<glm::vec3> first_reflection = node_always_;
  const auto find_first_reflection = [&] {
    const TracePhase phase(trace_, "first reflection");
    std::vector<glm::vec3> linked(shown_nodes_.size(), glm::vec3(0));
    links_->add_irradiance({lighting->bright_elements.data(), lighting->beam_bright_count}, linked);
    for (std::size_t k = 0; k < linked.size(); ++k) first_reflection[shown_nodes_[k]] += linked[k];
  };
  // A state on the way once most of the indirect light is there; later cycles change what an eye does not see.
  const auto after_cycle = [&](int cycle, const std::vector<glm::vec3>& irradiance) {
    if (!is_wanted()) return false;
    if (follower && cycle == kShownCycle) {
      const auto state = std::make_shared<Lighting>(*lighting);
      state->is_final = false;
      state->patch_irradiance = irradiance;
      gather_indirect(*state, first_reflection);
      follower->show(state);
    }
    return true;
  };
  bool is_solved = true;
  const auto interreflect = [&] { is_solved = is_wanted() && solve_with_panels(*lighting, after_cycle); };
  if (follower) {  // its state on the way has both
    find_first_reflection();
    interreflect();
  } else {
    parallel_pair(find_first_reflection, interreflect);
  }
  if (!is_solved || !is_wanted()) return nullptr;
  gather_indirect(*lighting, first_reflection);
  return lighting;
}

// By patch * elements_per_slot + element [lx].
std::vector<glm::vec3> Engine::element_direct(const Lighting& lighting) const {
  const int per_slot = mesh_->elements_per_slot();
  std::vector<glm::vec3> direct(slot_of_patch_.size() * static_cast<std::size_t>(per_slot), glm::vec3(0));
  for (const LitElement& e : lighting.lit_elements)
    direct[patch_of_slot_[e.element / per_slot] * per_slot + e.element % per_slot] += e.illuminance;
  return direct;
}

Sensors Engine::sensors(const std::vector<glm::dvec3>& points, const std::vector<glm::vec3>& normals,
                        GatherSamples samples) const {
  Sensors sensors{points, normals, samples, std::vector<Node>(points.size()), {}, {}, {}};
  std::vector<GatherRow> rows(points.size());
  std::vector<std::vector<Share>> resolved(points.size());
  parallel_indices(points.size(), 1, [&](std::size_t i) {
    const glm::vec3 normal = glm::normalize(normals[i]);
    sensors.nodes[i] = {glm::vec3(points[i] - faces_.origin) + faces_.ray_offset() * normal, normal};
    rows[i] =
        gatherer_->gather_at_point(sensors.nodes[i], samples, hash_seed(options_.seed, hash_seed(kSensorStream, i)));
    rows[i].reached.insert(rows[i].reached.end(), rows[i].through.begin(), rows[i].through.end());
    rows[i].reached = to_patches(rows[i].reached);
    if (nodes_) resolved[i] = resolved_by_nodes(rows[i].near);
  });
  sensors.sky = SkyRows(SparseRows::of(rows, &GatherRow::sky), ground_bin());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    sensors.patches.append(rows[i].reached);
    sensors.resolved.append(resolved[i]);
  }
  return sensors;
}

std::vector<Irradiance> Engine::illuminance(const Lighting& lighting, const Sensors& sensors) const {
  std::vector<Irradiance> result(sensors.nodes.size());
  const FirstBounce first_bounce(*mesh_, *rays_, lighting.bright_elements);
  const std::vector<glm::vec4> sent = sent_by_nodes_and_patches(lighting);
  const SkyRadiance radiance = sky_radiance(lighting);
  const std::vector<Beam> beams = lighting.condition.beams_at_points();
  parallel_indices(result.size(), 1, [&](std::size_t i) {
    const Node& node = sensors.nodes[i];
    result[i].direct = direct_light_->illuminance(beams, node.position, node.normal);
    result[i].sky = sensors.sky.irradiance(i, radiance);
    result[i].indirect = first_bounce.irradiance(node.position, node.normal, FirstBounce::Rays::kMany) +
                         sensors.patches.dot(i, lighting.patch_smooth_radiosity) +
                         glm::vec3(sensors.resolved.dot(i, sent));
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
  alone.node[0] = static_cast<int>(nodes_ ? nodes_->count_with_midpoints() : 0) + patch;
  alone.weight[0] = 1;
  return alone;
}

void Engine::shown_radiance(const Lighting& lighting, std::vector<glm::vec4>& sky,
                            std::vector<glm::vec4>& indirect) const {
  const std::size_t node_count = nodes_ ? nodes_->nodes().size() : 0, patch_count = slot_of_patch_.size(),
                    first_patch = nodes_ ? nodes_->count_with_midpoints() : 0;
  sky.resize(first_patch + patch_count);
  indirect.resize(first_patch + patch_count);
  parallel_indices(node_count, 1024, [&](std::size_t i) {
    const glm::vec3 scale = reflectance(nodes_->surface(i) / 2, nodes_->surface(i) % 2) / kPi;
    sky[i] = glm::vec4(scale * lighting.node_sky[i], 0);
    indirect[i] = glm::vec4(scale * lighting.node_indirect[i], 0);
  });
  // A polynomial may fall below what it goes through, and light may not below 0.
  parallel_indices(first_patch - node_count, 1024, [&](std::size_t i) {
    sky[node_count + i] = glm::max(nodes_->midpoints().dot(i, sky), 0.f);
    indirect[node_count + i] = glm::max(nodes_->midpoints().dot(i, indirect), 0.f);
  });
  parallel_indices(patch_count, 1024, [&](std::size_t p) {
    const glm::vec3 scale = patch_reflectance_[p] / kPi, from_sky = lighting.patch_sky[p];
    sky[first_patch + p] = glm::vec4(scale * from_sky, 0);
    indirect[first_patch + p] = glm::vec4(scale * (lighting.patch_irradiance[p] - from_sky - lighting.patch_sun[p]), 0);
  });
}

}  // namespace transom
