#include "transom/node_field.h"

#include <algorithm>
#include <cmath>

#include "transom/parallel.h"

namespace transom {
namespace {

// Nodes at the border of a face stand back from it by this share of their part. At an inner corner irradiance falls or
// rises steeply in the last centimetres; a node there would speak for half of its part.
constexpr float kInset = 0.15f;
constexpr float kTriangleInset = 0.02f;
constexpr float kBorder = 1e-4f;  // of a part: nearer than that is at the border of the face
constexpr float kLeastWeight = 1e-3f;
constexpr float kCoverPlaces[]{0.02f, 0.34f, 0.66f, 0.97f};  // along each axis of a part
constexpr float kCovered = 0.3f;     // of the length of a part: what stands nearer to a place leaves it little light
constexpr float kLongAspect = 1.6f;  // from which a part is divided along its longer axis alone
constexpr float kFlatCosine = 0.99999f;  // between shading normals of corners: across a curve light does change
constexpr float kPlaceScale = 1 << 20;   // steps of the parameters of a face that tell places of nodes apart
constexpr float kSamePlace = 0.1f;       // of a step: what rounding makes of one place at most

float determinant(glm::vec2 a, glm::vec2 b) {
  return a.x * b.y - a.y * b.x;
}

}  // namespace

NodeField::NodeField(const LightMesh& mesh, const RayScene& rays, const std::vector<int>& slots, float thin)
    : mesh_(mesh),
      rays_(rays),
      part_of_slot_(static_cast<std::size_t>(mesh.slot_count()), -1),
      node_of_place_(2 * mesh.faces().faces.size()),
      thin_(thin) {
  for (const int index : slots) {
    const Slot slot = mesh.slot(index);
    const auto at = [&](glm::vec2 local) { return mesh.cell_parameters(slot.face, slot.cell, local); };
    part_of_slot_[index] = part_count();
    add_part(2 * slot.face + slot.side, at({0, 0}), at({1, 0}) - at({0, 0}), at({0, 1}) - at({0, 0}));
  }
}

void NodeField::add_part(int surface, glm::vec2 corner, glm::vec2 u, glm::vec2 v) {
  Part part{surface, corner, u, v};
  if (is_quad(part)) {
    const glm::vec2 size(u.x, v.y), end = corner + size;
    for (int axis = 0; axis < 2; ++axis) {
      if (corner[axis] < kBorder * size[axis]) part.low[axis] = kInset;
      if (1 - end[axis] < kBorder * size[axis]) part.high[axis] = 1 - kInset;
    }
    const glm::vec2 length = this->size(part);
    const Face& face = mesh_.faces().faces[surface / 2];
    const bool is_flat = glm::dot(face.shading_normal(corner), face.shading_normal(end)) > kFlatCosine;
    for (int axis = 0; axis < 2 && is_flat; ++axis)
      if (length[axis] < thin_) part.low[axis] = part.high[axis] = 0.5f;
    const glm::vec2 first = corner + part.low * size, last = corner + part.high * size;
    part.corner_node = {node_at(surface, first), node_at(surface, {last.x, first.y}), node_at(surface, last),
                        node_at(surface, {first.x, last.y})};
  } else {
    const float inset = kTriangleInset * std::max(std::abs(u.x), std::abs(u.y));
    const glm::vec2 corners[3]{corner, corner + u, corner + v};
    for (int k = 0; k < 3; ++k) {
      glm::vec3 weight(1 - corners[k].x - corners[k].y, corners[k].x, corners[k].y);
      weight = glm::max(weight, glm::vec3(inset));
      weight /= weight.x + weight.y + weight.z;
      part.corner_node[k] = node_at(surface, {weight.y, weight.z});
    }
  }
  parts_.push_back(part);
}

int NodeField::node_at(int surface, glm::vec2 st) {
  const auto step = [](float steps) { return static_cast<std::uint64_t>(std::lround(steps)); };
  const glm::vec2 steps = st * kPlaceScale;
  // Two parts may say the same place differently by a little, on both sides of where steps part.
  for (const float dx : {-kSamePlace, kSamePlace})
    for (const float dy : {-kSamePlace, kSamePlace}) {
      const auto known = node_of_place_[surface].find(step(steps.x + dx) << 32 | step(steps.y + dy));
      if (known != node_of_place_[surface].end()) return known->second;
    }
  const std::uint64_t place = step(steps.x) << 32 | step(steps.y);
  const auto [entry, is_new] = node_of_place_[surface].try_emplace(place, static_cast<int>(nodes_.size()));
  if (is_new) {
    const int face = surface / 2, side = surface % 2;
    const glm::vec3 normal = mesh_.faces().faces[face].shading_normal(st);
    nodes_.push_back({mesh_.lifted_position(face, side, st), side == 0 ? normal : -normal});
    surface_of_node_.push_back(surface);
    parameters_of_node_.push_back(st);
  }
  return entry->second;
}

glm::vec2 NodeField::size(const Part& part) const {
  const Face& face = mesh_.faces().faces[part.surface / 2];
  const glm::vec3 corner = face.position(part.corner);
  return {glm::length(face.position(part.corner + part.u) - corner),
          glm::length(face.position(part.corner + part.v) - corner)};
}

void NodeField::add_middle(int index) {
  const glm::vec2 middle = is_quad(parts_[index]) ? glm::vec2(0.5f) : glm::vec2(1.f / 3);
  const Part& part = parts_[index];
  parts_[index].middle_node = node_at(part.surface, part.corner + middle.x * part.u + middle.y * part.v);
}

void NodeField::divide(int index) {
  const Part part = parts_[index];
  parts_[index].first_child = part_count();
  const glm::vec2 u = 0.5f * part.u, v = 0.5f * part.v;
  if (!is_quad(part)) {
    parts_[index].division = 3;
    const Grid halves{false, 2, 2};
    for (int k = 0; k < 4; ++k) {
      const auto at = [&](glm::vec2 local) {
        const glm::vec2 own = halves.parameters({k, local});
        return part.corner + own.x * part.u + own.y * part.v;
      };
      add_part(part.surface, at({0, 0}), at({1, 0}) - at({0, 0}), at({0, 1}) - at({0, 0}));
    }
    return;
  }
  const glm::vec2 length = size(index);
  const bool is_long_u = length.x > kLongAspect * length.y, is_long_v = length.y > kLongAspect * length.x;
  parts_[index].division = is_long_u ? 1 : is_long_v ? 2 : 3;
  for (int j = 0; j < (is_long_u ? 1 : 2); ++j)
    for (int i = 0; i < (is_long_v ? 1 : 2); ++i)
      add_part(part.surface, part.corner + static_cast<float>(i) * u + static_cast<float>(j) * v,
               is_long_v ? part.u : u, is_long_u ? part.v : v);
}

void NodeField::expose(const std::vector<char>& is_exposed, int first_part) {
  node_is_exposed_.insert(node_is_exposed_.end(), is_exposed.begin(), is_exposed.end());
  parallel_ranges(parts_.size() - static_cast<std::size_t>(first_part), 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      Part& part = parts_[static_cast<std::size_t>(first_part) + p];
      if (part.first_child >= 0) continue;
      part.covered = covered_nodes(part);
      part.is_split = part.covered != 0 || is_parted(part);
    }
  });
}

// Its corners, and the one in the middle if there is one; returns how many.
std::size_t NodeField::nodes_of(const Part& part, std::array<int, 5>& nodes) const {
  std::size_t count = is_quad(part) ? 4 : 3;
  std::copy_n(part.corner_node.begin(), count, nodes.begin());
  if (part.middle_node >= 0) nodes[count++] = part.middle_node;
  return count;
}

bool NodeField::is_parted(const Part& part) const {
  std::array<int, 5> nodes;
  const std::size_t node_count = nodes_of(part, nodes);
  Ray rays[10];
  std::uint8_t blocked[10];
  std::size_t count = 0;
  for (std::size_t a = 0; a < node_count; ++a) {
    if (!node_is_exposed_[nodes[a]]) return true;
    const glm::vec3 from = nodes_[nodes[a]].position;
    for (std::size_t b = a + 1; b < node_count; ++b)
      if (nodes[a] != nodes[b]) rays[count++] = {from, nodes_[nodes[b]].position - from, 0, 1};
  }
  rays_.occluded(RayScene::What::kOpaque, {rays, count}, {blocked, count});
  return std::any_of(blocked, blocked + count, [](std::uint8_t b) { return b != 0; });
}

// Along it something covers a place of a part.
Ray NodeField::cover_ray(const Part& part, const Node& place) const {
  const glm::vec2 size = this->size(part);
  return {place.position, kCovered * std::max(size.x, size.y) * place.normal, 0, 1};
}

// As Part has them.
std::uint8_t NodeField::covered_nodes(const Part& part) const {
  std::array<int, 5> nodes;
  const std::size_t node_count = nodes_of(part, nodes);
  Ray rays[5];
  std::uint8_t blocked[5];
  for (std::size_t k = 0; k < node_count; ++k) rays[k] = cover_ray(part, nodes_[nodes[k]]);
  rays_.occluded(RayScene::What::kOpaque, {rays, node_count}, {blocked, node_count});
  unsigned covered = 0;
  for (std::size_t k = 0; k < node_count; ++k) covered |= (blocked[k] ? 1u : 0u) << k;
  return static_cast<std::uint8_t>(covered + 1 == 1u << node_count ? 0 : covered);
}

// Asked along the normal, also right beside the borders: there most gaps end.
bool NodeField::is_partly_covered(int index, float reach) const {
  const Part& part = parts_[index];
  const int face = part.surface / 2, side = part.surface % 2;
  std::vector<Ray> rays;
  for (const float v : kCoverPlaces)
    for (const float u : kCoverPlaces) {
      const glm::vec2 st = part.corner + (is_quad(part) ? u : u * (1 - v)) * part.u + v * part.v;
      const glm::vec3 normal = mesh_.faces().faces[face].shading_normal(st);
      rays.push_back({mesh_.lifted_position(face, side, st), (side == 0 ? reach : -reach) * normal, 0, 1});
    }
  std::vector<std::uint8_t> covered(rays.size());
  rays_.occluded(RayScene::What::kOpaque, rays, covered);
  return std::any_of(covered.begin(), covered.end(), [&](std::uint8_t c) { return c != covered.front(); });
}

NodeShares NodeField::between_corners(const Part& part, glm::vec2 own) const {
  NodeShares shares;
  shares.node = part.corner_node;
  if (is_quad(part)) {
    const glm::vec2 span = part.high - part.low;
    const glm::vec2 p(span.x > 0 ? (own.x - part.low.x) / span.x : 0.f,
                      span.y > 0 ? (own.y - part.low.y) / span.y : 0.f);
    shares.count = 4;
    shares.weight = {(1 - p.x) * (1 - p.y), p.x * (1 - p.y), p.x * p.y, (1 - p.x) * p.y};
  } else {
    shares.count = 3;
    shares.weight = {std::max(0.f, 1 - own.x - own.y), own.x, own.y, 0};
  }
  return shares;
}

// The middle and the two corners next to the point: light is linear between them.
NodeShares NodeField::between_middle_and_corners(const Part& part, glm::vec2 own) const {
  NodeShares shares;
  shares.count = 3;
  int first, second;
  if (is_quad(part)) {
    if (part.low.x == part.high.x) own.x = 0.5f;
    if (part.low.y == part.high.y) own.y = 0.5f;
    // Offset from the middle, in units of half the distance of the corner nodes towards where the point lies.
    const auto between = [](float x, float low, float high) {
      return x < 0.5f ? (x - 0.5f) / (0.5f - low) : x > 0.5f ? (x - 0.5f) / (high - 0.5f) : 0.f;
    };
    const glm::vec2 offset(between(own.x, part.low.x, part.high.x), between(own.y, part.low.y, part.high.y));
    const bool is_along_x = std::abs(offset.x) > std::abs(offset.y);
    const float outwards = std::max(std::abs(offset.x), std::abs(offset.y));
    float across = 0;  // from the first to the second corner, as -outwards to outwards
    if (is_along_x) {
      first = offset.x < 0 ? 3 : 1;
      second = offset.x < 0 ? 0 : 2;
      across = offset.x < 0 ? -offset.y : offset.y;
    } else {
      first = offset.y < 0 ? 0 : 2;
      second = offset.y < 0 ? 1 : 3;
      across = offset.y < 0 ? offset.x : -offset.x;
    }
    shares.weight = {1 - outwards, 0.5f * (outwards - across), 0.5f * (outwards + across), 0};
  } else {
    const float weight[3]{1 - own.x - own.y, own.x, own.y};
    const auto least = static_cast<int>(std::min_element(weight, weight + 3) - weight);
    first = (least + 1) % 3;
    second = (least + 2) % 3;
    const float of_middle = std::max(0.f, weight[least]);
    shares.weight = {3 * of_middle, weight[first] - of_middle, weight[second] - of_middle, 0};
  }
  shares.node = {part.middle_node, part.corner_node[first], part.corner_node[second], 0};
  return shares;
}

// Where some nodes of a part are covered and others not, those speak for a place that are as it is, if it sees any.
bool NodeField::keep_fitting(const Part& part, const Node& place, NodeShares& shares) const {
  if (part.covered != 0) {
    std::array<int, 5> nodes;
    const std::size_t node_count = nodes_of(part, nodes);
    NodeShares alike = shares;
    const Ray ray = cover_ray(part, place);
    std::uint8_t is_covered = 0;
    rays_.occluded(RayScene::What::kOpaque, {&ray, 1}, {&is_covered, 1});
    for (std::size_t n = 0; n < node_count; ++n)
      for (int k = 0; k < alike.count; ++k)
        if (alike.node[k] == nodes[n] && (part.covered >> n & 1) != (is_covered != 0)) alike.weight[k] = 0;
    if (keep_visible(place.position, alike)) {
      shares = alike;
      return true;
    }
  }
  return keep_visible(place.position, shares);
}

bool NodeField::keep_visible(glm::vec3 point, NodeShares& shares) const {
  Ray rays[4];
  std::uint8_t blocked[4];
  const auto count = static_cast<std::size_t>(shares.count);
  for (std::size_t k = 0; k < count; ++k) rays[k] = {point, nodes_[shares.node[k]].position - point, 0, 1};
  rays_.occluded(RayScene::What::kOpaque, {rays, count}, {blocked, count});
  float sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (blocked[k] || !node_is_exposed_[shares.node[k]]) shares.weight[k] = 0;
    shares.weight[k] = std::max(0.f, shares.weight[k]);  // no extrapolation from a part of the nodes
    sum += shares.weight[k];
  }
  if (sum < kLeastWeight) return false;
  for (std::size_t k = 0; k < count; ++k) shares.weight[k] /= sum;
  return true;
}

NodeShares NodeField::predict_middle(int index) const {
  const Part& part = parts_[index];
  NodeShares shares = between_corners(part, is_quad(part) ? glm::vec2(0.5f) : glm::vec2(1.f / 3));
  if (part.is_split && !keep_fitting(part, nodes_[part.middle_node], shares)) return {};
  return shares;
}

std::vector<std::size_t> NodeField::shown_nodes() const {
  std::vector<char> is_shown(nodes_.size(), 0);
  for (const Part& part : parts_) {
    if (part.first_child >= 0) continue;
    std::array<int, 5> nodes;
    const std::size_t node_count = nodes_of(part, nodes);
    for (std::size_t k = 0; k < node_count; ++k) is_shown[nodes[k]] = node_is_exposed_[nodes[k]];
  }
  std::vector<std::size_t> shown;
  for (std::size_t i = 0; i < is_shown.size(); ++i)
    if (is_shown[i]) shown.push_back(i);
  return shown;
}

NodeShares NodeField::interpolate(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const {
  const int cell = mesh_.grid(face).locate(st).cell;
  int index = part_of_slot_[mesh_.slot_index(face, side, cell)];
  if (index < 0) return {};
  const auto own_coordinates = [&](const Part& part) {
    const glm::vec2 offset = st - part.corner;
    const float area = determinant(part.u, part.v);
    return glm::vec2(determinant(offset, part.v), determinant(part.u, offset)) / area;
  };
  glm::vec2 own = own_coordinates(parts_[index]);
  while (parts_[index].first_child >= 0) {
    const Part& part = parts_[index];
    const int along_u = part.division & 1 ? (own.x > 0.5f ? 1 : 0) : 0, along_v = own.y > 0.5f ? 1 : 0;
    int child = part.division == 1 ? along_u : part.division == 2 ? along_v : 2 * along_v + along_u;
    if (!is_quad(part)) child = Grid{false, 2, 2}.locate(own).cell;
    index = part.first_child + child;
    own = own_coordinates(parts_[index]);
  }
  const Part& part = parts_[index];
  if (part.centre >= 0) return between_midpoints(part, own);
  const bool has_middle = part.middle_node >= 0 && node_is_exposed_[part.middle_node];
  NodeShares shares = has_middle ? between_middle_and_corners(part, own) : between_corners(part, own);
  if (!part.is_split) return shares;
  const glm::vec3 front = mesh_.faces().faces[face].shading_normal(st);
  const Node place{lifted_point, side == 0 ? front : -front};
  if (keep_fitting(part, place, shares)) return shares;
  if (!has_middle) return {};
  shares = between_corners(part, own);
  return keep_fitting(part, place, shares) ? shares : NodeShares{};
}

}  // namespace transom
