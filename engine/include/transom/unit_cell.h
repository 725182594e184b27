/// @file Light through a glazing product that repeats along two axes: one cell of it as triangles, traced by Embree.
/// Frame: x and y in the panel, z into the room; metres.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "transom/optical_surface.h"
#include "transom/product_light.h"

namespace transom {

/// A triangle. Its front is where its corners are seen counter-clockwise.
struct Facet {
  std::array<int, 3> corners{};
  int surface = 0;
};

/// What repeats along x and y, between the planes z = low_z (outdoors) and z = high_z (room). Facets may reach over the
/// borders of 0 <= x < period_x, 0 <= y < period_y, so long as they fit their own repetitions. Medium 0 is the air.
struct UnitCell {
  double period_x = 1, period_y = 1;
  double low_z = 0, high_z = 0;
  std::vector<Medium> media;
  std::vector<Surface> surfaces;
  std::vector<glm::dvec3> corners;
  std::vector<Facet> facets;

  /// Throws InputError for facets outside the planes, without area, or with corners or surfaces that do not exist.
  void validate() const;
};

/// A unit cell ready for light. The rules at surfaces are those of sections (optical_surface.h); positions are kept in
/// double precision, and what Embree finds in single precision is corrected to the plane of its facet. Light that comes
/// to a surface from a medium that it is not in has slipped through the mesh: it counts as unfinished.
class UnitCellTracer {
 public:
  explicit UnitCellTracer(UnitCell cell);
  ~UnitCellTracer();
  UnitCellTracer(const UnitCellTracer&) = delete;
  UnitCellTracer& operator=(const UnitCellTracer&) = delete;

  /// Sends parallel unpolarised light of one direction through, from points that are evenly spread over the cell.
  /// Throws InputError for a direction along the panel.
  ProductLight trace(glm::dvec3 direction, TraceOptions options) const;

 private:
  struct Tree;
  class Run;
  const UnitCell cell_;
  std::unique_ptr<Tree> tree_;
};

}  // namespace transom
