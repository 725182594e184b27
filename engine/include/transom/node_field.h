/// @file The points at which light is gathered to be shown, and the interpolation between them.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

/// Nodes around a point and their weights (sum 1; slightly negative beyond the outermost nodes of a face). count 0: no
/// node can speak for the point.
struct NodeShares {
  std::array<int, 4> node{};
  std::array<float, 4> weight{};
  int count = 0;
};

/// Nodes at the corners of cells; a cell where light changes within its own size is divided once more and has nodes of
/// its own. Where something stands between the nodes of a cell, a point asks which of them it sees, so that light does
/// not leak through walls and partitions.
class NodeField {
 public:
  /// slots: the cells that need nodes. divisions: of each, 1 (none) or more per edge.
  NodeField(const LightMesh& mesh, const RayScene& rays, const std::vector<int>& slots,
            const std::vector<int>& divisions);

  const std::vector<Node>& nodes() const { return nodes_; }
  /// The face that a node lies on, times two, plus the side.
  int surface(std::size_t node) const { return surface_of_node_[node]; }

  /// Leaves out nodes that lie inside solids, and finds the cells that something divides. To be called once.
  void finish(std::vector<char> node_is_exposed);
  bool is_exposed(std::size_t node) const { return node_is_exposed_[node]; }

  /// lifted_point: where the hit is, lifted off its surface.
  NodeShares interpolate(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const;

 private:
  struct CellNodes {
    int first = -1;     // of its own nodes, or of the nodes of its face's side; -1: takes no part
    int divisions = 1;  // more than 1: own nodes, (divisions + 1)^2 on a quad
    char is_split = 0;
  };
  NodeShares around(const CellNodes& cell, int face, CellPoint point) const;
  Grid own_grid(int face, int divisions) const { return {mesh_.grid(face).is_quad, divisions, divisions}; }

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::vector<CellNodes> cells_;  // by slot
  std::vector<int> slots_;
  std::vector<Node> nodes_;
  std::vector<int> surface_of_node_;
  std::vector<char> node_is_exposed_;
};

}  // namespace transom
