// The nodes of an engine: where light is gathered to be shown, the more densely the more it changes.
#include <algorithm>
#include <cmath>
#include <utility>

#include "streams.h"
#include "transom/engine.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr std::size_t kGrain = 8;
constexpr float kExposedNode = 0.5f;  // a node counts when at least this share of its rays is outside solids

constexpr float kSunnySky = 0.25f;  // share of the sky in what makes light indoors, where the sun does the rest
constexpr float kDark = 0.05f;      // of the mean over nodes: errors below it are not seen

// Parts are divided at most so often, and not when they are shorter than this share of the longest edge of patches.
constexpr int kLevels = 4;
constexpr float kFinest = 0.13f;
constexpr float kThin = 0.12f;        // of that edge: across less, light does not change
constexpr float kLevelGrowth = 2;     // of the tolerance, from level to level: a smaller part is less of a picture
constexpr float kSmallness = 0.35f;   // exponent of the same between parts of different area
constexpr int kBuriedLevels = 2;      // divisions of parts of which nothing can be said but that a solid ends there
constexpr float kLargeForBuried = 3;  // and the leniency up to which they are

// A part is looked at when light differs between its corners by more than these multiples of the tolerance.
constexpr float kLookNear = 1.5f, kLookFar = 2, kLookSplit = 0.5f;
constexpr float kSteep = 6;    // and is divided whatever its middle says: a step may be half up in the middle
constexpr float kSloping = 2;  // from which on the middle is to be right to this share of the tolerance:
constexpr float kSlopingShare = 0.35f;
constexpr float kNear = 0.18f;  // length of a part against the distance of what it sees
constexpr float kGap = 0.05f;   // distance of what nodes see against that length: they are in a gap between surfaces

constexpr float kGrouping = 1.5e-4f;  // of what a node receives from patches: what a group of these may err by

constexpr int kMostRounds = 10;        // of gathering what is close by, before the one that all nodes take part in
constexpr float kAgreement = 0.03f;    // of the light of a node, with which it leaves them
constexpr float kWorthARound = 0.03f;  // of that, which a sender lacks

}  // namespace

/// Some light whose shape at the nodes is that of the light of many conditions.
struct Engine::TrialLight {
  std::vector<float> radiosity;  // of patches
  float sky;                     // luminance
  std::vector<float> at_nodes;
  float dark = 0;  // differences are relative to no less

  float of(const NodeShares& shares) const {
    float sum = 0;
    for (int k = 0; k < shares.count; ++k) sum += shares.weight[k] * at_nodes[shares.node[k]];
    return sum;
  }
};

/// Nodes as far as they have been gathered.
struct Engine::NodeTrial {
  std::vector<GatherRow> rows;  // by slot
  std::vector<TrialLight> lights;
  std::vector<std::vector<Share>> own_sky;  // seen without looking through an opening
  std::vector<std::vector<Share>> patches;  // all that are seen
  float longest_edge;

  // Larger for parts that are a smaller part of a picture.
  float leniency(const NodeField& nodes, int part) const {
    const glm::vec2 size = nodes.size(part);
    const float share = size.x * size.y / (longest_edge * longest_edge);
    return share > 0 ? std::max(1.f, std::pow(share, -kSmallness)) : Ray::kInfinity;
  }

  // Between the exposed corners of a part, relative to the largest.
  float difference(const NodeField& nodes, int part) const {
    float difference = 0;
    for (const TrialLight& light : lights) {
      float least = Ray::kInfinity, most = light.dark;
      for (int k = 0; k < nodes.corner_count(part); ++k) {
        const int node = nodes.corners(part)[k];
        if (!nodes.is_exposed(node)) continue;
        least = std::min(least, std::max(light.at_nodes[node], light.dark));
        most = std::max(most, light.at_nodes[node]);
      }
      if (most > 0) difference = std::max(difference, 1 - least / most);
    }
    return difference;
  }
};

// An even sky, all of it seen; the same mostly as what it makes surfaces send, which is the shape of what the sun makes
// them send on the mean over its places; and what lamps do.
std::vector<Engine::TrialLight> Engine::trial_lights() const {
  std::vector<TrialLight> lights;
  if (has_sky_)
    for (const float sky : {1.f, kSunnySky}) lights.push_back({smooth_lights_.front(), sky, {}});
  if (smooth_lights_.size() > (has_sky_ ? 1 : 0)) lights.push_back({smooth_lights_.back(), 0, {}});
  return lights;
}

// What a node sees without looking through openings, by slot; from what the other engine knows, if it does.
GatherRow Engine::surroundings_of_node(const Node& node, int known_node, const Known& known) const {
  GatherRow row;
  if (known_node >= 0) {
    const auto other = static_cast<std::size_t>(known_node);
    const NodeRows& rows = *known.engine->node_rows_;
    row.reached = known.change->renumbered(rows.reached.row(other));
    row.sky = rows.sky.row(other);
    row.near = known.change->renumbered_elements(rows.near.row(other));
    row.exposure = rows.exposure[other];
    row.harmonic_distance = rows.harmonic_distance[other];
    row.inverse_distance = rows.inverse_distance[other];
    if (known.change->is_none()) return row;
    return gatherer_->surroundings_of_point(node, options_.node_samples, node_seed(node), std::move(row),
                                            *known.engine->gatherer_, *known.change);
  }
  return gatherer_->surroundings_of_point(node, options_.node_samples, node_seed(node));
}

// What a node sees through openings, and all that it sees of the sky, added to its surroundings, by slot.
void Engine::look_through_openings(const Node& node, int known_node, const Known& known, GatherRow& row) const {
  if (known_node >= 0 && known.has_openings) {
    const auto other = static_cast<std::size_t>(known_node);
    const NodeRows& rows = *known.engine->node_rows_;
    if (row.exposure == rows.exposure[other] && row.sky == rows.sky.row(other) &&
        !gatherer_->may_meet_through_openings(node, options_.node_samples, node_seed(node), *known.change)) {
      row.sky = known.engine->node_sky_.row(other);
      row.through = known.change->renumbered(rows.through.row(other));
      return;
    }
  }
  gatherer_->look_through_openings(node, options_.node_samples, node_seed(node), row);
}

// Gathers at the nodes that have been added. Their samples depend on their places alone.
void Engine::gather_new_nodes(NodeTrial& trial, int first_part, Known& known) {
  const std::vector<Node>& nodes = nodes_->nodes();
  const std::size_t first = trial.rows.size(), count = nodes.size() - first;
  trial.rows.resize(nodes.size());
  trial.own_sky.resize(nodes.size());
  trial.patches.resize(nodes.size());
  for (TrialLight& light : trial.lights) light.at_nodes.resize(nodes.size());
  known.node.resize(nodes.size(), -1);
  std::vector<char> is_exposed(count);
  parallel_indices(count, kGrain, [&](std::size_t k) {
    const std::size_t i = first + k;
    const auto [begin, end] = known.nodes_by_seed.equal_range(node_seed(nodes[i]));
    for (auto entry = begin; entry != end; ++entry)
      if (known.engine->nodes_->nodes()[static_cast<std::size_t>(entry->second)] == nodes[i])
        known.node[i] = entry->second;
    GatherRow& row = trial.rows[i];
    row = surroundings_of_node(nodes[i], known.node[i], known);
    trial.own_sky[i] = row.sky;
    look_through_openings(nodes[i], known.node[i], known, row);
    is_exposed[k] = row.exposure >= kExposedNode;
    std::vector<Share>& patches = trial.patches[i];
    patches = to_patches(row.reached);
    const auto reached_count = static_cast<std::ptrdiff_t>(patches.size());
    const std::vector<Share> through = to_patches(row.through);
    patches.insert(patches.end(), through.begin(), through.end());
    float sky = 0;
    for (const Share& share : row.sky) sky += share.weight;
    for (TrialLight& light : trial.lights) {
      light.at_nodes[i] = light.sky * sky;
      for (const Share& share : patches) light.at_nodes[i] += share.weight * light.radiosity[share.index];
    }
    std::inplace_merge(patches.begin(), patches.begin() + reached_count, patches.end(),
                       [](const Share& a, const Share& b) { return a.index < b.index; });
    merge_shares(patches);
  });
  nodes_->expose(is_exposed, first_part);
}

// What elements send as the nodes around them say, less what their patches do.
std::vector<Share> Engine::resolved_by_nodes(const std::vector<Share>& elements) const {
  const int per_slot = mesh_->elements_per_slot(), node_count = static_cast<int>(nodes_->nodes().size());
  std::vector<Share> row;
  for (const Share& share : elements) {
    const int patch = patch_of_slot_[share.index / per_slot];
    if (patch < 0) continue;
    const auto element = static_cast<std::size_t>(patch) * static_cast<std::size_t>(per_slot) +
                         static_cast<std::size_t>(share.index % per_slot);
    const NodeShares& nodes = nodes_at_element_[element];
    if (nodes.count == 0) continue;
    for (int k = 0; k < nodes.count; ++k) row.push_back({nodes.node[k], share.weight * nodes.weight[k]});
    row.push_back({node_count + patch, -share.weight});
  }
  merge_shares(row);
  return row;
}

// Close by it matters that the light of a patch is not even: its elements get theirs from the nodes around them.
void Engine::resolve_near_light(const NodeTrial& trial) {
  const int per_slot = mesh_->elements_per_slot();
  nodes_at_element_.assign(slot_of_patch_.size() * static_cast<std::size_t>(per_slot), {});
  parallel_indices(slot_of_patch_.size(), kGrain, [&](std::size_t p) {
    if (mesh_->is_cluster(slot_of_patch_[p])) return;
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    const glm::vec2 middle = mesh_->grid(slot.face).middle();
    for (int e = 0; e < per_slot; ++e) {
      const glm::vec2 st = mesh_->element_parameters(slot.face, slot.cell, e, middle);
      nodes_at_element_[p * static_cast<std::size_t>(per_slot) + static_cast<std::size_t>(e)] =
          nodes_->interpolate(slot.face, slot.side, st, mesh_->lifted_position(slot.face, slot.side, st));
    }
  });
  std::vector<std::vector<Share>> rows(nodes_->nodes().size());
  parallel_indices(rows.size(), kGrain, [&](std::size_t i) { rows[i] = resolved_by_nodes(trial.rows[i].near); });
  node_near_ = ExactRows(SparseRows::of(rows));
}

// What nodes have of a light after they have gathered what is close by, those of each round first and then all.
// before: what they had when they were gathered from for the last time.
std::vector<float> Engine::gathered_in_rounds(const TrialLight& light, const std::vector<int>& rounds,
                                              std::vector<float>& before) const {
  const std::size_t node_count = nodes_->nodes().size();
  before = light.at_nodes;
  std::vector<float> sent(node_count), next(node_count);
  sent.insert(sent.end(), light.radiosity.begin(), light.radiosity.end());
  const auto gather = [&](std::size_t i) { next[i] = light.at_nodes[i] + node_near_.dot(i, sent); };
  const auto send = [&](std::size_t i) { sent[i] = sent_of_trial(light, i, before[i]); };
  parallel_indices(node_count, 64, send);
  const int last = rounds.empty() ? 0 : *std::max_element(rounds.begin(), rounds.end());
  for (int round = 1; round <= last; ++round) {
    parallel_indices(node_count, 64, [&](std::size_t i) {
      if (rounds[i] >= round) gather(i);
    });
    parallel_indices(node_count, 64, [&](std::size_t i) {
      if (rounds[i] < round) return;
      before[i] = next[i];
      send(i);
    });
  }
  parallel_indices(node_count, 64, gather);
  return next;
}

// Which nodes have to gather what is close by more than once: those that send to others what is far from right before.
// Under a slab light decays over many reflections between places that a patch does not tell apart, and what nodes send
// comes to agree only round by round. Returns what nodes have then of the first of the trial's lights; nothing without
// light.
std::vector<float> Engine::find_rounds(const NodeTrial& trial) {
  const std::size_t node_count = nodes_->nodes().size();
  std::vector<int> rounds(node_count, 0);
  std::vector<float> of_first_light, before;
  for (const TrialLight& light : trial.lights) {
    if (light.sky == kSunnySky) continue;  // its patches are lit by more sky than its nodes
    const std::vector<float> settled = gathered_in_rounds(light, std::vector<int>(node_count, kMostRounds), before);
    if (of_first_light.empty()) of_first_light = settled;
    for (bool any = true; any;) {
      const std::vector<float> found = gathered_in_rounds(light, rounds, before);
      std::vector<char> is_wanted(node_count, 0);
      for (const std::size_t i : shown_nodes_) {
        const float bound = kAgreement * std::max(settled[i], light.dark);
        if (std::abs(found[i] - settled[i]) <= bound) continue;
        for (const Share& share : node_near_.row(i)) {
          const auto sender = static_cast<std::size_t>(share.index);
          if (sender >= node_count || rounds[sender] == kMostRounds) continue;
          const float lacking =
              sent_of_trial(light, sender, before[sender]) - sent_of_trial(light, sender, settled[sender]);
          is_wanted[sender] |= std::abs(share.weight * lacking) > kWorthARound * bound;
        }
      }
      any = false;
      for (std::size_t i = 0; i < node_count; ++i) {
        rounds[i] += is_wanted[i];
        any |= is_wanted[i] != 0;
      }
    }
  }
  nodes_of_round_.clear();
  for (int round = 1; round <= kMostRounds; ++round) {
    std::vector<std::size_t> nodes;
    for (std::size_t i = 0; i < node_count; ++i)
      if (rounds[i] >= round) nodes.push_back(i);
    if (nodes.empty()) break;
    nodes_of_round_.push_back(std::move(nodes));
  }
  return of_first_light;
}

// Radiosity of a node under a trial's light, mean over the channels.
float Engine::sent_of_trial(const TrialLight& light, std::size_t node, float irradiance) const {
  const glm::vec3 all = reflectance(nodes_->surface(node) / 2, nodes_->surface(node) % 2) * irradiance +
                        (light.sky > 0 ? glm::vec3(0) : emitted_at_node(node));
  return (all.x + all.y + all.z) / 3;
}

// Whether light may change within a part otherwise than linearly, so that it is worth a node in its middle.
bool Engine::is_worth_a_look(const NodeTrial& trial, int part, int level, float tolerance) const {
  const glm::vec2 size = nodes_->size(part);
  const float length = std::max(size.x, size.y);
  if (length < kFinest * trial.longest_edge) return false;
  const int corner_count = nodes_->corner_count(part);
  int exposed = 0;
  float distance = Ray::kInfinity;
  for (int k = 0; k < corner_count; ++k) {
    const int node = nodes_->corners(part)[k];
    if (!nodes_->is_exposed(node)) continue;
    ++exposed;
    distance = std::min(distance, trial.rows[node].harmonic_distance);
  }
  if (exposed == 0) return level == 0;
  if (is_at_mouth_of_gap(trial, part)) return true;
  if (exposed < corner_count) return true;
  if (level == 0 && length > distance) return true;
  const float limit = nodes_->is_split(part) ? kLookSplit : length > kNear * distance ? kLookNear : kLookFar;
  return trial.difference(*nodes_, part) > limit * tolerance * trial.leniency(*nodes_, part);
}

// Whether all corners of a part are in a gap between surfaces, and some places of it are not: they say nothing of
// these.
bool Engine::is_at_mouth_of_gap(const NodeTrial& trial, int part) const {
  const glm::vec2 size = nodes_->size(part);
  const float gap = kGap * std::max(size.x, size.y);
  for (int k = 0; k < nodes_->corner_count(part); ++k) {
    const int node = nodes_->corners(part)[k];
    if (nodes_->is_exposed(node) && trial.rows[node].harmonic_distance > gap) return false;
  }
  return nodes_->is_partly_covered(part, 2 * gap);
}

// Whether the corners of a part are wrong about its middle.
bool Engine::is_to_be_divided(const NodeTrial& trial, int part, int level, float tolerance) const {
  const int middle = nodes_->middle(part);
  const NodeShares predicted = nodes_->is_exposed(middle) ? nodes_->predict_middle(part) : NodeShares{};
  const float leniency = trial.leniency(*nodes_, part);
  if (predicted.count == 0) {
    bool is_any_exposed = nodes_->is_exposed(middle);
    for (int k = 0; k < nodes_->corner_count(part); ++k) is_any_exposed |= nodes_->is_exposed(nodes_->corners(part)[k]);
    return is_any_exposed && level < kBuriedLevels && leniency < kLargeForBuried;
  }
  const float difference = trial.difference(*nodes_, part);
  if (difference > kSteep * tolerance * leniency || is_at_mouth_of_gap(trial, part)) return true;
  const float bound = tolerance * leniency * (difference > kSloping * tolerance * leniency ? kSlopingShare : 1.f);
  return std::any_of(trial.lights.begin(), trial.lights.end(), [&](const TrialLight& light) {
    const float found = light.at_nodes[middle];
    return std::abs(found - light.of(predicted)) > bound * std::max(found, light.dark);
  });
}

// Cells begin with nodes at their corners. Where these are wrong about the middle of a part, it is divided: light is
// tested, not geometry, so that nodes are many where light changes and nowhere else.
void Engine::gather_nodes(Known& known) {
  std::vector<int> slots;
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p)
    if (patch_reflectance_[p] != glm::vec3(0) && !mesh_->is_cluster(slot_of_patch_[p]))  // a cluster shows its patch
      slots.push_back(slot_of_patch_[p]);
  std::sort(slots.begin(), slots.end());  // not in the order in which patches are found
  if (known.engine && known.engine->nodes_)
    for (std::size_t i = 0; i < known.engine->nodes_->nodes().size(); ++i)
      known.nodes_by_seed.emplace(node_seed(known.engine->nodes_->nodes()[i]), static_cast<int>(i));
  const float edge = facts_.maximum_edge_m;
  nodes_ = std::make_unique<NodeField>(*mesh_, *rays_, slots, kThin * edge);
  NodeTrial trial{{}, trial_lights(), {}, {}, edge};
  gather_new_nodes(trial, 0, known);
  for (TrialLight& light : trial.lights) {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < light.at_nodes.size(); ++i)
      if (nodes_->is_exposed(i)) {
        sum += light.at_nodes[i];
        ++count;
      }
    light.dark = kDark * static_cast<float>(sum / std::max(1.0, count));
  }
  float tolerance = options_.node_tolerance;
  for (int level = 0, first_part = 0; level < kLevels; ++level, tolerance *= kLevelGrowth) {
    const int last_part = nodes_->part_count();
    std::vector<int> looked_at;
    for (int part = first_part; part < last_part; ++part)
      if (is_worth_a_look(trial, part, level, tolerance)) looked_at.push_back(part);
    for (const int part : looked_at) nodes_->add_middle(part);
    gather_new_nodes(trial, first_part, known);
    for (const int part : looked_at)
      if (is_to_be_divided(trial, part, level, tolerance)) nodes_->divide(part);
    gather_new_nodes(trial, last_part, known);
    first_part = last_part;
  }
  shown_nodes_ = nodes_->shown_nodes();
  resolve_near_light(trial);
  const std::vector<float> settled = find_rounds(trial);
  if (!settled.empty()) {
    const std::vector<float> seen_from_afar = send_unevenly(settled);
    for_shown_nodes([&](std::size_t i) { see_from_afar(seen_from_afar, trial.rows[i].near, trial.patches[i]); });
  }
  // Only now: to what sends close by, nodes alone may speak for elements.
  std::vector<LightAtNodes> lights;
  for (const TrialLight& light : trial.lights) lights.push_back({light.at_nodes, light.dark});
  nodes_->find_midpoints(shown_nodes_, lights);
  interreflection_->prepare(smooth_lights_);
  keep_node_rows(trial, known);
}

// Rows of shown nodes, in which far patches have given way to groups of them; those of other nodes serve no more.
std::vector<std::vector<Share>> Engine::with_far_patches_grouped(std::vector<std::vector<Share>> rows) const {
  const PatchGroups& groups = interreflection_->groups();
  std::vector<PatchGroups::TypicalLight> lights;
  for (const std::vector<float>& light : smooth_lights_) lights.push_back(groups.typical(light));
  std::vector<std::vector<Share>> grouped(rows.size());
  for_shown_nodes([&](std::size_t i) { grouped[i] = groups.grouped(std::exchange(rows[i], {}), lights, kGrouping); });
  return grouped;
}

// Moves what the nodes have seen to where relighting and later edits look for it.
void Engine::keep_node_rows(NodeTrial& trial, Known& known) {
  facts_.node_count = static_cast<int>(trial.rows.size());
  facts_.kept_node_rows =
      static_cast<int>(std::count_if(known.node.begin(), known.node.end(), [](int node) { return node >= 0; }));
  known.has_same_nodes = known.has_same_faces() && nodes_->nodes() == known.engine->nodes_->nodes();
  node_patches_ = CompactRows(SparseRows::of(with_far_patches_grouped(std::move(trial.patches))));
  node_sky_ = SkyRows(SparseRows::of(trial.rows, &GatherRow::sky), ground_bin());
  const auto found = std::make_shared<NodeRows>();
  found->reached = SparseRows::of(trial.rows, &GatherRow::reached);
  found->through = SparseRows::of(trial.rows, &GatherRow::through);
  found->sky = SparseRows::of(trial.own_sky);
  found->near = SparseRows::of(trial.rows, &GatherRow::near);
  for (const GatherRow& row : trial.rows) {
    found->exposure.push_back(row.exposure);
    found->harmonic_distance.push_back(row.harmonic_distance);
    found->inverse_distance.push_back(row.inverse_distance);
  }
  node_rows_ = found;
}

// Only nodes that are shown are linked, by their places among these.
void Engine::link_nodes(const Known& known) {
  std::vector<Node> points;
  points.reserve(shown_nodes_.size());
  for (const std::size_t node : shown_nodes_) points.push_back(nodes_->nodes()[node]);
  links_ = std::make_unique<PointLinks>(*mesh_, *rays_, points, nodes_->neighbours(shown_nodes_));
  PointLinks::Known known_links;
  if (known.engine && known.engine->links_) {
    const std::vector<std::size_t>& shown_before = known.engine->shown_nodes_;
    std::vector<int> place_before(known.engine->nodes_->nodes().size(), -1), point;
    for (std::size_t k = 0; k < shown_before.size(); ++k) place_before[shown_before[k]] = static_cast<int>(k);
    for (const std::size_t node : shown_nodes_)
      point.push_back(known.node[node] < 0 ? -1 : place_before[known.node[node]]);
    known_links = {known.engine->links_.get(), known.change.get(), std::move(point),
                   known.has_same_nodes && shown_before == shown_nodes_, known.has_openings};
  }
  links_->prepare(beam_slots(), known_links);
  facts_.link_bytes = links_->byte_count();
}

// Samples of a node depend on where it is alone, so that another object in the room does not change them.
std::uint32_t Engine::node_seed(const Node& node) const {
  return place_seed(options_.seed, kNodeStream, node);
}

}  // namespace transom
