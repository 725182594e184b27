#include "transom/light_mesh.h"

#include <algorithm>
#include <cmath>

#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kMaximumDivisions = 512;

int divisions(float length, float maximum_edge) {
  return std::clamp(static_cast<int>(std::ceil(length / maximum_edge - 1e-4f)), 1, kMaximumDivisions);
}

Grid make_grid(const Face& face, float maximum_edge) {
  const auto side = [&](int a, int b) { return glm::length(face.corner[a] - face.corner[b]); };
  if (face.is_quad)
    return {true, divisions(std::max(side(0, 1), side(2, 3)), maximum_edge),
            divisions(std::max(side(1, 2), side(3, 0)), maximum_edge)};
  const int n = divisions(std::max({side(0, 1), side(1, 2), side(2, 0)}), maximum_edge);
  return {false, n, n};
}

}  // namespace

LightMesh::LightMesh(const Faces& faces, const std::vector<float>& maximum_edges, int elements_per_edge,
                     FaceClusters clusters)
    : faces_(&faces), elements_per_edge_(elements_per_edge), clusters_(std::move(clusters)) {
  first_cell_.push_back(0);
  for (std::size_t f = 0; f < faces.faces.size(); ++f) {
    const bool is_small = clusters_.cluster_of(static_cast<int>(f), 0) >= 0;
    grids_.push_back(is_small ? Grid{faces.faces[f].is_quad, 1, 1} : make_grid(faces.faces[f], maximum_edges[f]));
    first_cell_.push_back(first_cell_.back() + (is_small ? 0 : grids_.back().cell_count()));
    face_of_cell_.resize(static_cast<std::size_t>(first_cell_.back()), static_cast<int>(f));
  }
}

Slot LightMesh::slot(int index) const {
  if (is_cluster(index)) {
    const int side = clusters_.main_side(cluster(index));
    return {side / 2, side % 2, 0};
  }
  const int cell = index / 2;
  const int face = face_of_cell_[static_cast<std::size_t>(cell)];
  return {face, index % 2, cell - first_cell(face)};
}

int LightMesh::element_at(const Hit& hit) const {
  const CellPoint point = grid(hit.face).locate(hit.st);
  const int slot = slot_index(hit.face, hit.side, point.cell);
  return slot * elements_per_slot() + (is_cluster(slot) ? clusters_.element_of(hit.face, hit.side)
                                                        : element_grid(hit.face).locate(point.local).cell);
}

float LightMesh::slot_area(int index) const {
  if (is_cluster(index)) return clusters_.area(cluster(index));
  const Slot own = slot(index);
  return cell_area(own.face, own.cell);
}

float LightMesh::element_area(int element) const {
  const int index = element / elements_per_slot(), part = element % elements_per_slot();
  if (is_cluster(index)) return clusters_.element(cluster(index), part).area;
  const Slot own = slot(index);
  return element_area(own.face, own.cell, part);
}

glm::vec3 LightMesh::normal_of(int index) const {
  const Slot own = slot(index);
  const glm::vec3 front = faces_->faces[static_cast<std::size_t>(own.face)].normal;
  const glm::vec3 normal = own.side == 0 ? front : -front;
  if (!is_cluster(index)) return normal;
  glm::vec3 sum(0);
  for (int part = 0; part < elements_per_slot(); ++part) {
    const ClusterElement& element = clusters_.element(cluster(index), part);
    sum += element.area * element.normal;
  }
  return glm::length(sum) > 0 ? glm::normalize(sum) : normal;
}

Node LightMesh::place_on_side(int side, glm::vec2 st) const {
  const glm::vec3 normal = faces_->faces[static_cast<std::size_t>(side / 2)].normal;
  return {lifted_position(side / 2, side % 2, st), side % 2 == 0 ? normal : -normal};
}

Node LightMesh::place_on(int index, glm::vec2 u) const {
  if (is_cluster(index)) {
    const int side = clusters_.sample_side(cluster(index), u.x);
    return place_on_side(side, sample_local(side / 2, u));
  }
  const Slot own = slot(index);
  return place_on_side(2 * own.face + own.side, cell_parameters(own.face, own.cell, sample_local(own.face, u)));
}

int LightMesh::element_of_place(int index, glm::vec2 u) const {
  if (is_cluster(index)) return -1;
  const int face = slot(index).face;
  return element_grid(face).locate(sample_local(face, u)).cell;
}

Node LightMesh::place_on_element(int element, glm::vec2 u) const {
  const int index = element / elements_per_slot(), part = element % elements_per_slot();
  if (is_cluster(index)) {
    const int side = clusters_.sample_side(cluster(index), part, u.x);
    return place_on_side(side, sample_local(side / 2, u));
  }
  const Slot own = slot(index);
  return place_on_side(2 * own.face + own.side,
                       element_parameters(own.face, own.cell, part, sample_local(own.face, u)));
}

Node LightMesh::middle_of(int index) const {
  const Slot own = slot(index);
  const glm::vec2 middle = grid(own.face).middle();
  Node node = place_on_side(2 * own.face + own.side, cell_parameters(own.face, own.cell, middle));
  if (is_cluster(index)) node.normal = glm::vec3(0);
  return node;
}

Node LightMesh::middle_of_element(int element) const {
  const int index = element / elements_per_slot(), part = element % elements_per_slot();
  if (is_cluster(index)) {
    const ClusterElement& own = clusters_.element(cluster(index), part);
    return {own.middle, own.normal};
  }
  const Slot own = slot(index);
  const glm::vec2 middle = grid(own.face).middle();
  return place_on_side(2 * own.face + own.side, element_parameters(own.face, own.cell, part, middle));
}

float LightMesh::area_between(int face, glm::vec2 a, glm::vec2 b, glm::vec2 c) const {
  const Face& f = faces_->faces[static_cast<std::size_t>(face)];
  const glm::vec3 p = f.position(a);
  return 0.5f * glm::length(glm::cross(f.position(b) - p, f.position(c) - p));
}

float LightMesh::cell_area(int face, int cell) const {
  const auto at = [&](float s, float t) { return cell_parameters(face, cell, {s, t}); };
  const float half = area_between(face, at(0, 0), at(1, 0), at(0, 1));
  return grid(face).is_quad ? half + area_between(face, at(1, 1), at(0, 1), at(1, 0)) : half;
}

float LightMesh::element_area(int face, int cell, int element) const {
  const auto at = [&](float s, float t) { return element_parameters(face, cell, element, {s, t}); };
  const float half = area_between(face, at(0, 0), at(1, 0), at(0, 1));
  return grid(face).is_quad ? half + area_between(face, at(1, 1), at(0, 1), at(1, 0)) : half;
}

glm::vec2 LightMesh::cell_parameters(int face, int cell, glm::vec2 local) const {
  return grid(face).parameters({cell, local});
}

glm::vec2 LightMesh::element_parameters(int face, int cell, int element, glm::vec2 local) const {
  return cell_parameters(face, cell, element_grid(face).parameters({element, local}));
}

glm::vec3 LightMesh::lifted_position(int face, Side side, glm::vec2 st) const {
  const Face& f = faces_->faces[static_cast<std::size_t>(face)];
  const float lift = side == 0 ? faces_->ray_offset() : -faces_->ray_offset();
  return f.position(st) + lift * f.normal;
}

glm::vec2 LightMesh::sample_local(int face, glm::vec2 u) const {
  return grid(face).is_quad ? u : sample_triangle(u);
}

}  // namespace transom
