/// @file A regular grid on a quad or a triangle: its cells carry patches or elements.
#pragma once

#include <algorithm>
#include <glm/glm.hpp>

namespace transom {

/// Position in a cell: which one, and its own coordinates (unit square, or barycentric of corners 2 and 3).
struct CellPoint {
  int cell = 0;
  glm::vec2 local{0};
};

/// Grid over the parameters of a face. Quad: (s, t) in the unit square, u_count x v_count cells.
/// Triangle: (s, t) barycentric coordinates of corners 2 and 3; u_count = v_count = n, n * n congruent triangles.
struct Grid {
  bool is_quad = true;
  int u_count = 1;
  int v_count = 1;

  bool operator==(const Grid&) const = default;

  /// Parameters of the middle of a cell, or of an element of it, within it.
  glm::vec2 middle() const { return is_quad ? glm::vec2(0.5f) : glm::vec2(1.f / 3); }

  int cell_count() const { return is_quad ? u_count * v_count : u_count * u_count; }

  /// The cell that holds the parameters `st` (clamped to the face).
  CellPoint locate(glm::vec2 st) const {
    st = glm::clamp(st, 0.f, 1.f);
    if (!is_quad) return locate_in_triangle(st);
    const glm::vec2 scaled = st * glm::vec2(u_count, v_count);
    const int i = std::min(static_cast<int>(scaled.x), u_count - 1),
              j = std::min(static_cast<int>(scaled.y), v_count - 1);
    return {j * u_count + i, {scaled.x - static_cast<float>(i), scaled.y - static_cast<float>(j)}};
  }

  /// Parameters on the face of a point of a cell; inverse of locate.
  glm::vec2 parameters(CellPoint point) const;

 private:
  struct TriangleCell {
    int i, j;
    bool upper;
  };
  CellPoint locate_in_triangle(glm::vec2 st) const;
  TriangleCell triangle_cell(int cell) const;
};

}  // namespace transom
