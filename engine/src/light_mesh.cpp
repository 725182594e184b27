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

LightMesh::LightMesh(const Faces& faces, const std::vector<float>& maximum_edges, int elements_per_edge)
    : faces_(&faces), elements_per_edge_(elements_per_edge) {
  first_cell_.push_back(0);
  for (std::size_t f = 0; f < faces.faces.size(); ++f) {
    grids_.push_back(make_grid(faces.faces[f], maximum_edges[f]));
    first_cell_.push_back(first_cell_.back() + grids_.back().cell_count());
    face_of_cell_.resize(static_cast<std::size_t>(first_cell_.back()), static_cast<int>(f));
  }
}

Slot LightMesh::slot(int index) const {
  const int cell = index / 2;
  const int face = face_of_cell_[static_cast<std::size_t>(cell)];
  return {face, index % 2, cell - first_cell(face)};
}

int LightMesh::element_at(const Hit& hit) const {
  const CellPoint point = grid(hit.face).locate(hit.st);
  return slot_index(hit.face, hit.side, point.cell) * elements_per_slot() +
         element_grid(hit.face).locate(point.local).cell;
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
