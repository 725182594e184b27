/// @file The subdivision of faces on which light is held: patches exchange it, elements resolve where beams fall.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/face_clusters.h"
#include "transom/geometry.h"
#include "transom/grid.h"
#include "transom/ray_scene.h"

namespace transom {

/// A cell of a face's grid seen from one side: its slot is 2 * cell + side, with cells counted over all faces. Or a
/// cluster of small faces, for which one of them stands: then `face` and `side` are its own, and `cell` is 0.
struct Slot {
  int face;
  Side side;
  int cell;  ///< within the face's grid
};

/// A point at which irradiance is gathered.
struct Node {
  glm::vec3 position{0};  ///< lifted off its surface by Faces::ray_offset
  glm::vec3 normal{0};    ///< unit; on a surface the shading normal of its side

  bool operator==(const Node&) const = default;
};

/// Grids over all faces but small ones, which are taken together: cells no longer than the face's maximum edge, each
/// split into elements_per_edge^2 elements.
class LightMesh {
 public:
  LightMesh(const Faces& faces, const std::vector<float>& maximum_edges, int elements_per_edge,
            FaceClusters clusters = {});

  const Faces& faces() const { return *faces_; }
  const FaceClusters& clusters() const { return clusters_; }
  int slot_count() const { return first_cluster_slot() + clusters_.count(); }
  int elements_per_edge() const { return elements_per_edge_; }
  int elements_per_slot() const { return elements_per_edge_ * elements_per_edge_; }
  const Grid& grid(int face) const { return grids_[static_cast<std::size_t>(face)]; }

  Slot slot(int index) const;
  int slot_index(int face, Side side, int cell) const {
    const int cluster = clusters_.cluster_of(face, side);
    if (cluster >= 0) return first_cluster_slot() + cluster;
    return 2 * (first_cell_[static_cast<std::size_t>(face)] + cell) + side;
  }
  bool is_cluster(int slot) const { return slot >= first_cluster_slot(); }
  int first_cell(int face) const { return first_cell_[static_cast<std::size_t>(face)]; }

  /// Slot under a hit.
  int slot_at(const Hit& hit) const { return slot_index(hit.face, hit.side, grid(hit.face).locate(hit.st).cell); }

  /// Element under a hit, counted over all slots: slot * elements_per_slot + element.
  int element_at(const Hit& hit) const;

  /// Area of a slot, and of an element counted over all slots [m²].
  float slot_area(int slot) const;
  float element_area(int element) const;

  /// Unit normal of a slot; of a cluster the mean of its faces.
  glm::vec3 normal_of(int slot) const;

  /// A place of a slot from two uniform numbers, uniform in area on congruent cells: lifted, with the face's normal.
  Node place_on(int slot, glm::vec2 u) const;
  /// The element of a slot, from 0, that this place is on; -1 on a cluster.
  int element_of_place(int slot, glm::vec2 u) const;
  /// The same as place_on of an element.
  Node place_on_element(int element, glm::vec2 u) const;
  /// The middle of a slot or an element, lifted. The normal of a cluster is 0, since it faces many ways; that of an
  /// element of one is the mean of its faces.
  Node middle_of(int slot) const;
  Node middle_of_element(int element) const;

  /// Parameters on the face of a point given in the unit square (quad) or unit triangle of an element, or of the cell.
  glm::vec2 element_parameters(int face, int cell, int element, glm::vec2 local) const;
  glm::vec2 cell_parameters(int face, int cell, glm::vec2 local) const;

  /// Point of a face lifted off one side, from where rays may start.
  glm::vec3 lifted_position(int face, Side side, glm::vec2 st) const;

  /// Maps two uniform numbers to the local parameters of a cell or element, uniform in area for congruent cells.
  glm::vec2 sample_local(int face, glm::vec2 u) const;

 private:
  int first_cluster_slot() const { return 2 * first_cell_.back(); }
  int cluster(int slot) const { return slot - first_cluster_slot(); }
  Node place_on_side(int side, glm::vec2 st) const;
  float cell_area(int face, int cell) const;
  float element_area(int face, int cell, int element) const;
  Grid element_grid(int face) const {
    return {faces_->faces[static_cast<std::size_t>(face)].is_quad, elements_per_edge_, elements_per_edge_};
  }
  float area_between(int face, glm::vec2 a, glm::vec2 b, glm::vec2 c) const;

  const Faces* faces_;
  int elements_per_edge_;
  std::vector<Grid> grids_;  // of a small face: one cell without a slot
  FaceClusters clusters_;
  std::vector<int> first_cell_;  // one more entry than faces: the last is the number of cells
  std::vector<int> face_of_cell_;
};

}  // namespace transom
