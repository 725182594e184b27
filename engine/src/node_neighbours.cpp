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

// Each in front of the other's surface, or about in it. Nodes by their places among the shown ones.
std::vector<int> NodeField::nearest_on_other_surfaces(std::size_t place, const std::vector<std::size_t>& shown,
                                                      const std::vector<float>& reach, const BoxTree& tree) const {
  const Node& node = nodes_[shown[place]];
  const int surface = surface_of_node_[shown[place]];
  struct Found {
    float distance;
    int place, surface;
  };
  std::vector<Found> found;
  tree.visit(around(node, reach[place]), [&](int other_place) {
    const std::size_t other = shown[static_cast<std::size_t>(other_place)];
    if (surface_of_node_[other] == surface) return;
    const glm::vec3 offset = nodes_[other].position - node.position;
    const float distance = glm::length(offset);
    if (distance > std::max(reach[place], reach[static_cast<std::size_t>(other_place)]) ||
        glm::dot(offset, node.normal) < -kBehind * distance ||
        glm::dot(offset, nodes_[other].normal) > kBehind * distance)
      return;
    found.push_back({distance, other_place, surface_of_node_[other]});
  });
  const auto is_nearer = [](const Found& a, const Found& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.place < b.place;
  };
  std::sort(found.begin(), found.end(), [&](const Found& a, const Found& b) {
    return a.surface != b.surface ? a.surface < b.surface : is_nearer(a, b);
  });
  found.erase(
      std::unique(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.surface == b.surface; }),
      found.end());
  std::sort(found.begin(), found.end(), is_nearer);
  std::vector<int> nearest;
  for (std::size_t n = 0; n < std::min(kOnOtherSurfaces, found.size()); ++n) nearest.push_back(found[n].place);
  return nearest;
}

NodeNeighbours NodeField::neighbours(const std::vector<std::size_t>& shown) const {
  std::vector<int> place_of_node(nodes_.size(), -1);
  for (std::size_t k = 0; k < shown.size(); ++k) place_of_node[shown[k]] = static_cast<int>(k);
  std::vector<std::pair<int, int>> pairs;
  std::vector<float> reach(shown.size(), 0.f);
  for (const Part& part : parts_) {
    if (part.first_child >= 0) continue;
    std::array<int, 5> nodes;
    const std::size_t node_count = nodes_of(part, nodes);
    const glm::vec2 size = this->size(part);
    for (std::size_t a = 0; a < node_count; ++a) {
      const int place = place_of_node[nodes[a]];
      if (place < 0) continue;
      reach[place] = std::max({reach[place], size.x, size.y});
      for (std::size_t b = 0; b < node_count; ++b)
        if (place_of_node[nodes[b]] >= 0) pairs.emplace_back(place, place_of_node[nodes[b]]);
    }
  }
  NodeNeighbours neighbours;
  neighbours.begin.assign(shown.size() + 1, 0);
  if (pairs.empty()) return neighbours;
  std::vector<Box> boxes;
  for (std::size_t k = 0; k < shown.size(); ++k) boxes.push_back(around(nodes_[shown[k]], reach[k]));
  const BoxTree tree(std::move(boxes));
  std::vector<std::vector<int>> across(shown.size());
  parallel_indices(shown.size(), 64,
                   [&](std::size_t k) { across[k] = nearest_on_other_surfaces(k, shown, reach, tree); });
  for (std::size_t k = 0; k < across.size(); ++k)
    for (const int other : across[k]) {
      pairs.emplace_back(static_cast<int>(k), other);
      pairs.emplace_back(other, static_cast<int>(k));
    }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  for (const auto& [place, other] : pairs) {
    ++neighbours.begin[static_cast<std::size_t>(place) + 1];
    neighbours.node.push_back(other);
  }
  std::partial_sum(neighbours.begin.begin(), neighbours.begin.end(), neighbours.begin.begin());
  return neighbours;
}

}  // namespace transom
