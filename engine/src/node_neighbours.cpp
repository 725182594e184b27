// Which nodes are beside each other.
#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "transom/box_tree.h"
#include "transom/node_field.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr std::size_t kOnOtherSurfaces = 6;  // neighbours of a node at most, one on each
constexpr float kBehind = 0.1f;              // sine of an angle up to which a node is not behind the other's surface

// Boxes of two nodes meet wherever these are no farther apart than the larger reach.
Box around(const Node& node, float reach) {
  return {node.position - reach, node.position + reach};
}

}  // namespace

// Each in front of the other's surface, or about in it.
std::vector<int> NodeField::nearest_on_other_surfaces(int index, const std::vector<float>& reach,
                                                      const BoxTree& tree) const {
  const auto i = static_cast<std::size_t>(index);
  const Node& node = nodes_[i];
  struct Found {
    float distance;
    int node, surface;
  };
  std::vector<Found> found;
  tree.visit(around(node, reach[i]), [&](int other_index) {
    const auto k = static_cast<std::size_t>(other_index);
    if (!(reach[k] > 0) || surface_of_node_[k] == surface_of_node_[i]) return;
    const glm::vec3 offset = nodes_[k].position - node.position;
    const float distance = glm::length(offset);
    if (distance > std::max(reach[i], reach[k]) || glm::dot(offset, node.normal) < -kBehind * distance ||
        glm::dot(offset, nodes_[k].normal) > kBehind * distance)
      return;
    found.push_back({distance, other_index, surface_of_node_[k]});
  });
  const auto is_nearer = [](const Found& a, const Found& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.node < b.node;
  };
  std::sort(found.begin(), found.end(), [&](const Found& a, const Found& b) {
    return a.surface != b.surface ? a.surface < b.surface : is_nearer(a, b);
  });
  found.erase(
      std::unique(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.surface == b.surface; }),
      found.end());
  std::sort(found.begin(), found.end(), is_nearer);
  std::vector<int> nearest;
  for (std::size_t n = 0; n < std::min(kOnOtherSurfaces, found.size()); ++n) nearest.push_back(found[n].node);
  return nearest;
}

NodeNeighbours NodeField::neighbours() const {
  std::vector<std::pair<int, int>> pairs;
  std::vector<float> reach(nodes_.size(), 0.f);  // 0: not exposed, or of divided parts alone
  for (const Part& part : parts_) {
    if (part.first_child >= 0) continue;
    std::array<int, 5> nodes;
    const std::size_t node_count = nodes_of(part, nodes);
    const glm::vec2 size = this->size(part);
    for (std::size_t a = 0; a < node_count; ++a) {
      if (!node_is_exposed_[nodes[a]]) continue;
      reach[nodes[a]] = std::max({reach[nodes[a]], size.x, size.y});
      for (std::size_t b = 0; b < node_count; ++b)
        if (node_is_exposed_[nodes[b]]) pairs.emplace_back(nodes[a], nodes[b]);
    }
  }
  NodeNeighbours neighbours;
  neighbours.begin.assign(nodes_.size() + 1, 0);
  if (pairs.empty()) return neighbours;
  std::vector<Box> boxes;
  for (std::size_t i = 0; i < nodes_.size(); ++i) boxes.push_back(around(nodes_[i], reach[i]));
  const BoxTree tree(std::move(boxes));
  std::vector<std::vector<int>> across(nodes_.size());
  parallel_indices(nodes_.size(), 64, [&](std::size_t i) {
    if (reach[i] > 0) across[i] = nearest_on_other_surfaces(static_cast<int>(i), reach, tree);
  });
  for (std::size_t i = 0; i < across.size(); ++i)
    for (const int other : across[i]) {
      pairs.emplace_back(static_cast<int>(i), other);
      pairs.emplace_back(other, static_cast<int>(i));
    }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  for (const auto& [node, other] : pairs) {
    ++neighbours.begin[static_cast<std::size_t>(node) + 1];
    neighbours.node.push_back(other);
  }
  std::partial_sum(neighbours.begin.begin(), neighbours.begin.end(), neighbours.begin.begin());
  return neighbours;
}

}  // namespace transom
