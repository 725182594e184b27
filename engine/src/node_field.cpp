#include "transom/node_field.h"

#include <algorithm>

#include "transom/parallel.h"

namespace transom {
namespace {

// Nodes at the border of a face stand back from it by this share of their cell. At an inner corner irradiance falls or
// rises steeply in the last centimetres; a node there would speak for half of its cell.
constexpr float kInset = 0.15f;
constexpr float kTriangleInset = 0.02f;
constexpr float kLeastWeight = 1e-3f;

// Parameters of a node, off the border of the face by the inset of a cell that spans `cell_size` of the parameters.
glm::vec2 inside_face(bool is_quad, glm::vec2 st, glm::vec2 cell_size) {
  if (is_quad) return glm::clamp(st, kInset * cell_size, 1.f - kInset * cell_size);
  return glm::mix(st, glm::vec2(1.f / 3), kTriangleInset * cell_size.x);
}

// Position between the nodes of cell i of n along one axis, of which the outermost nodes are inset: below 0 and above 1
// beyond them.
float between_nodes(float local, int i, int n) {
  const float low = i == 0 ? kInset : 0, high = i == n - 1 ? 1 - kInset : 1;
  return (local - low) / (high - low);
}

}  // namespace

NodeField::NodeField(const LightMesh& mesh, const RayScene& rays, const std::vector<int>& slots,
                     const std::vector<int>& divisions)
    : mesh_(mesh), rays_(rays), cells_(static_cast<std::size_t>(mesh.slot_count())), slots_(slots) {
  const auto make_node = [&](const Slot& slot, glm::vec2 st, int division) {
    const Grid& grid = mesh.grid(slot.face);
    const Face& face = mesh.faces().faces[slot.face];
    st = inside_face(grid.is_quad, st, 1.f / (static_cast<float>(division) * glm::vec2(grid.u_count, grid.v_count)));
    const glm::vec3 normal = face.shading_normal(st);
    surface_of_node_.push_back(2 * slot.face + slot.side);
    return Node{mesh.lifted_position(slot.face, slot.side, st), slot.side == 0 ? normal : -normal};
  };
  std::vector<int> first_of_side(2 * mesh.faces().faces.size(), -1);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const Slot slot = mesh.slot(slots[i]);
    CellNodes& cell = cells_[slots[i]];
    cell.divisions = std::max(1, divisions[i]);
    if (cell.divisions > 1) {
      cell.first = static_cast<int>(nodes_.size());
      const Grid own = own_grid(slot.face, cell.divisions);
      for (int k = 0; k < own.node_count(); ++k)
        nodes_.push_back(
            make_node(slot, mesh.cell_parameters(slot.face, slot.cell, own.node_parameters(k)), cell.divisions));
      continue;
    }
    int& first = first_of_side[2 * slot.face + slot.side];
    if (first < 0) {
      first = static_cast<int>(nodes_.size());
      const Grid& grid = mesh.grid(slot.face);
      for (int k = 0; k < grid.node_count(); ++k) nodes_.push_back(make_node(slot, grid.node_parameters(k), 1));
    }
    cell.first = first;
  }
}

NodeShares NodeField::around(const CellNodes& cell, int face, CellPoint point) const {
  const Grid& grid = mesh_.grid(face);
  const int d = cell.divisions;
  NodeWeights weights;
  if (d > 1) {
    const Grid own = own_grid(face, d);
    CellPoint part = own.locate(point.local);
    if (own.is_quad)
      part.local = {between_nodes(part.local.x, point.cell % grid.u_count * d + part.cell % d, grid.u_count * d),
                    between_nodes(part.local.y, point.cell / grid.u_count * d + part.cell / d, grid.v_count * d)};
    weights = own.interpolate(part);
  } else {
    if (grid.is_quad)
      point.local = {between_nodes(point.local.x, point.cell % grid.u_count, grid.u_count),
                     between_nodes(point.local.y, point.cell / grid.u_count, grid.v_count)};
    weights = grid.interpolate(point);
  }
  NodeShares shares;
  shares.count = weights.count;
  for (int k = 0; k < weights.count; ++k) {
    shares.node[k] = cell.first + weights.node[k];
    shares.weight[k] = weights.weight[k];
  }
  return shares;
}

void NodeField::finish(std::vector<char> node_is_exposed) {
  node_is_exposed_ = std::move(node_is_exposed);
  parallel_indices(slots_.size(), 8, [&](std::size_t i) {
    const Slot slot = mesh_.slot(slots_[i]);
    CellNodes& cell = cells_[slots_[i]];
    const Grid own = own_grid(slot.face, cell.divisions);
    for (int part = 0; part < own.cell_count() && !cell.is_split; ++part) {
      const CellPoint middle{slot.cell, own.parameters({part, glm::vec2(1.f / 3)})};
      const NodeShares corners = around(cell, slot.face, middle);
      Ray rays[6];
      std::uint8_t blocked[6];
      std::size_t count = 0;
      for (int a = 0; a < corners.count; ++a) {
        cell.is_split |= !node_is_exposed_[corners.node[a]];
        const glm::vec3 from = nodes_[corners.node[a]].position;
        for (int b = a + 1; b < corners.count; ++b)
          rays[count++] = {from, nodes_[corners.node[b]].position - from, 0, 1};
      }
      rays_.occluded(RayScene::What::kOpaque, {rays, count}, {blocked, count});
      for (std::size_t k = 0; k < count; ++k) cell.is_split |= blocked[k];
    }
  });
}

NodeShares NodeField::interpolate(int face, Side side, glm::vec2 st, glm::vec3 lifted_point) const {
  const CellPoint point = mesh_.grid(face).locate(st);
  const CellNodes& cell = cells_[mesh_.slot_index(face, side, point.cell)];
  if (cell.first < 0) return {};
  NodeShares shares = around(cell, face, point);
  if (!cell.is_split) return shares;
  Ray rays[4];
  std::uint8_t blocked[4];
  const auto count = static_cast<std::size_t>(shares.count);
  for (std::size_t k = 0; k < count; ++k)
    rays[k] = {lifted_point, nodes_[shares.node[k]].position - lifted_point, 0, 1};
  rays_.occluded(RayScene::What::kOpaque, {rays, count}, {blocked, count});
  float sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (blocked[k] || !node_is_exposed_[shares.node[k]]) shares.weight[k] = 0;
    shares.weight[k] = std::max(0.f, shares.weight[k]);  // no extrapolation from a part of the nodes
    sum += shares.weight[k];
  }
  if (sum < kLeastWeight) return {};
  for (std::size_t k = 0; k < count; ++k) shares.weight[k] /= sum;
  return shares;
}

}  // namespace transom
