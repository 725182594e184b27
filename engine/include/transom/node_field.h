/// @file The points at which light is gathered to be shown, and the interpolation between them.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <unordered_map>
#include <vector>

#include "transom/compact_rows.h"
#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

/// Nodes around a point, or midpoints, whose numbers follow those of the nodes; and their weights (sum 1; negative
/// beyond the outermost nodes of a face). count 0: no node can speak for the point.
struct NodeShares {
  std::array<int, 4> node{};
  std::array<float, 4> weight{};
  int count = 0;
};

/// For each of some nodes, by their places among these, those around it and itself.
struct NodeNeighbours {
  std::vector<std::size_t> begin;  ///< in `node`; one more than nodes, or none
  std::vector<int> node;
  std::span<const int> of(std::size_t i) const {
    return begin.empty() ? std::span<const int>() : std::span(node.data() + begin[i], begin[i + 1] - begin[i]);
  }
  bool operator==(const NodeNeighbours&) const = default;
};

/// A light's irradiance by node, read at shown ones. Differences are relative to `dark` at least.
struct LightAtNodes {
  std::span<const float> irradiance;
  float dark = 0;
};

class BoxTree;

/// Nodes at the corners of cells, and of the parts into which cells are divided where light changes within them. Parts
/// of one side of a face share the nodes that they have in common. Where something stands between the nodes of a part,
/// a point asks which of them it sees, so that light does not leak through walls and partitions. Where something covers
/// some nodes of a part closely and others not, those speak for a point that are as it is: a gap does not darken what
/// stands out of it.
///
/// Use: make it and say which nodes are exposed; then, as often as wanted, give parts a middle or divide them, and say
/// the same of the new nodes. In the end find midpoints, which follow how light bends from part to part.
class NodeField {
 public:
  /// slots: the cells that need nodes. Each begins as one part. thin: width [m] below which light is taken not to
  /// change across a part.
  NodeField(const LightMesh& mesh, const RayScene& rays, const std::vector<int>& slots, float thin);

  const std::vector<Node>& nodes() const { return nodes_; }
  /// The face that a node lies on, times two, plus the side.
  int surface(std::size_t node) const { return surface_of_node_[node]; }
  bool is_exposed(std::size_t node) const { return node_is_exposed_[node]; }

  /// Says of the nodes that have been added since the last call whether they lie outside solids, and finds the parts
  /// from number `first_part` on that something divides or covers in part.
  void expose(const std::vector<char>& is_exposed, int first_part);

  int part_count() const { return static_cast<int>(parts_.size()); }
  /// Whether something stands between nodes of a part or covers some of them, or one of them lies inside a solid.
  bool is_split(int part) const { return parts_[part].is_split; }
  /// Whether something opaque stands within `reach` [m] in front of some places of a part and not of others.
  bool is_partly_covered(int part, float reach) const;
  /// Corners of a part: 4, or 3 on a triangle.
  int corner_count(int part) const { return is_quad(parts_[part]) ? 4 : 3; }
  const std::array<int, 4>& corners(int part) const { return parts_[part].corner_node; }
  /// Those that some place is shown by: exposed ones, but for those of divided parts alone. Ascending.
  std::vector<std::size_t> shown_nodes() const;
  /// Of shown nodes: those that share a part which is not divided, and the nearest ones on other surfaces that are no
  /// farther than such parts are long.
  NodeNeighbours neighbours(const std::vector<std::size_t>& shown) const;
  /// Lengths of a part along its two axes [m].
  glm::vec2 size(int part) const { return size(parts_[part]); }

  /// Gives a part a node in its middle, between which and the corners light is then interpolated.
  void add_middle(int part);
  /// The node in the middle of a part; -1: none.
  int middle(int part) const { return parts_[part].middle_node; }
  /// What the corners alone say of the middle.
  NodeShares predict_middle(int part) const;
  /// Divides a part: in four, or in two along its longer axis where that is much the longer one.
  void divide(int part);

  /// Finds midpoints of four-sided parts that nothing splits: in the middle of their borders, and of themselves,
  /// unless a node is there. Light at the middle of a border is that of the polynomial through its ends and the next
  /// node beyond each, as far as each of the typical lights goes on smoothly to there [as in essentially
  /// non-oscillatory schemes: Harten et al. 1987]. The middle of a part blends its borders [Coons 1967]. shown: as
  /// `shown_nodes` has them.
  void find_midpoints(const std::vector<std::size_t>& shown, std::span<const LightAtNodes> lights);
  std::size_t count_with_midpoints() const { return nodes_.size() + midpoints_.row_count(); }
  /// Midpoints as weights of nodes, which add up to 1.
  const ExactRows& midpoints() const { return midpoints_; }

  /// Of nodes alone, until midpoints have been found. lifted_point: where the hit is, lifted off its surface.
  NodeShares interpolate(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const;

 private:
  /// A quad or triangle of the parameters of a face: corner + a u + b v for its own coordinates (a, b).
  struct Part {
    int surface;
    glm::vec2 corner, u, v;
    glm::vec2 low{0}, high{1};  // own coordinates of the corner nodes of a quad
    std::array<int, 4> corner_node{};
    int middle_node = -1;
    int first_child = -1;
    std::uint8_t division = 0;  // of u: bit 0; of v: bit 1
    char is_split = 0;
    std::uint8_t covered = 0;  // which of its corners and its middle are, bit by bit; 0 where all are
    // Nodes or midpoints: of the border from corner k to the next; and of the part, -1 if it has none.
    std::array<int, 4> between{};
    int centre = -1;
  };
  class Lines;
  struct Border;
  std::vector<int> nearest_on_other_surfaces(std::size_t place, const std::vector<std::size_t>& shown,
                                             const std::vector<float>& reach, const BoxTree& tree) const;
  bool is_quad(const Part& part) const { return mesh_.grid(part.surface / 2).is_quad; }
  glm::vec2 size(const Part& part) const;
  void add_part(int surface, glm::vec2 corner, glm::vec2 u, glm::vec2 v);
  int node_at(int surface, glm::vec2 st);
  std::size_t nodes_of(const Part& part, std::array<int, 5>& nodes) const;
  bool is_parted(const Part& part) const;
  Ray cover_ray(const Part& part, const Node& place) const;
  std::uint8_t covered_nodes(const Part& part) const;
  NodeShares between_corners(const Part& part, glm::vec2 own) const;
  NodeShares between_middle_and_corners(const Part& part, glm::vec2 own) const;
  NodeShares between_midpoints(const Part& part, glm::vec2 own) const;
  std::array<Border, 4> borders(const Part& part) const;
  std::vector<Share> midway(const Border& border, const Lines& lines, std::span<const LightAtNodes> lights) const;
  std::vector<Share> blended(const Part& part, const std::array<std::span<const Share>, 4>& borders) const;
  bool is_open_between(int a, int b) const;
  bool keep_fitting(const Part& part, const Node& place, NodeShares& shares) const;
  bool keep_visible(glm::vec3 point, NodeShares& shares) const;

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::vector<int> part_of_slot_;  // -1: takes no part
  std::vector<Part> parts_;        // children of one part stand together
  std::vector<Node> nodes_;
  std::vector<int> surface_of_node_;
  std::vector<glm::vec2> parameters_of_node_;
  std::vector<char> node_is_exposed_;
  std::vector<std::unordered_map<std::uint64_t, int>> node_of_place_;  // by surface
  ExactRows midpoints_;
  float thin_;
};

}  // namespace transom
