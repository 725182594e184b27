#include "transom/grid.h"

#include <algorithm>
#include <cmath>

namespace transom {

CellPoint Grid::locate_in_triangle(glm::vec2 st) const {
  const int n = u_count;
  if (st.x + st.y > 1) st /= st.x + st.y;
  const glm::vec2 scaled = st * static_cast<float>(n);
  const int j = std::min(static_cast<int>(scaled.y), n - 1);
  const int i = std::min(static_cast<int>(scaled.x), n - 1 - j);
  glm::vec2 local = glm::clamp(scaled - glm::vec2(i, j), 0.f, 1.f);
  const bool upper = local.x + local.y > 1 && i + j < n - 1;
  if (upper) local = 1.f - local;
  if (local.x + local.y > 1) local /= local.x + local.y;
  return {2 * n * j - j * j + 2 * i + (upper ? 1 : 0), local};
}

Grid::TriangleCell Grid::triangle_cell(int cell) const {
  const int n = u_count;
  // Row j begins at 2 n j - j^2: the largest j whose row begins at or before `cell`.
  int j = static_cast<int>(static_cast<float>(n) - std::sqrt(std::max(0.f, static_cast<float>(n * n - cell))));
  j = std::clamp(j, 0, n - 1);
  while (j + 1 < n && 2 * n * (j + 1) - (j + 1) * (j + 1) <= cell) ++j;
  while (2 * n * j - j * j > cell) --j;
  const int rest = cell - (2 * n * j - j * j);
  return {rest / 2, j, rest % 2 == 1};
}

glm::vec2 Grid::parameters(CellPoint point) const {
  if (is_quad) {
    const int i = point.cell % u_count, j = point.cell / u_count;
    return (glm::vec2(i, j) + point.local) / glm::vec2(u_count, v_count);
  }
  const TriangleCell cell = triangle_cell(point.cell);
  const glm::vec2 local = cell.upper ? 1.f - point.local : point.local;
  return (glm::vec2(cell.i, cell.j) + local) / static_cast<float>(u_count);
}

}  // namespace transom
