/// @file The triangles that bound a shadow volume: caps and silhouette sides. Pure geometry, no OpenGL.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <utility>
#include <vector>

namespace transom {

/// For each vertex the first vertex at exactly the same position (0 and -0 alike): meshes repeat vertices where normals
/// or materials change, and a silhouette must not see a border there.
std::vector<std::uint32_t> weld_vertices(std::span<const glm::vec3> vertices);

/// What may be counted between a point and the sun.
enum class CasterCount {
  kEveryTriangle,  ///< each sheet crossed counts once: openings
  kSolidsOnce,     ///< a closed solid counts once for each time that it is passed through: fewer sides to draw
};

/// Triangles, as indices, whose signed crossings along a line give the count of casters between a point and the sun.
/// Seen from outside the volume they run counter-clockwise, except the first `clockwise_count` indices, which run
/// clockwise: the caps keep their own vertex order, so that they are drawn at exactly the depth at which the surface
/// was drawn.
struct VolumeTriangles {
  std::vector<std::uint32_t> indices;
  std::size_t clockwise_count = 0;

  bool empty() const { return indices.empty(); }
};

/// Points on which shade is wanted, as parallel light sees them: in columns along it, from where each begins.
class ShadedPoints {
 public:
  /// boxes: two corners each; none: all points there are.
  ShadedPoints(glm::dvec3 direction_to_sun, std::span<const std::pair<glm::vec3, glm::vec3>> boxes);
  /// Whether shade of a triangle may fall on any of them.
  bool may_be_shaded_by(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) const;

 private:
  /// Columns that bounds across the light lie in; none where `first` is not below `last`.
  struct Columns {
    glm::ivec2 first, last;
  };
  Columns columns(glm::dvec2 low, glm::dvec2 high) const;

  glm::dmat3 beam_from_world_;  // across the light: x and y; towards its source: z
  bool are_all_;
  glm::dvec2 low_, high_;
  std::vector<double> farthest_;  // by column: least z of a point
};

/// Shadow casters, prepared once for any sun.
class ShadowCasters {
 public:
  /// triangles: indices of `vertices`, through `welded` (see weld_vertices). Triangles without area are dropped.
  ShadowCasters(std::span<const glm::vec3> vertices, std::span<const std::uint32_t> welded,
                std::span<const glm::uvec3> triangles, CasterCount count);

  /// The near caps and the silhouette sides of the volume away from the unit vector `direction_to_sun`. A side is a
  /// triangle, its third vertex `infinity_index` the point at infinity: parallel light needs no far cap, since it would
  /// be that one point [Everitt & Kilgard 2002].
  /// Of the triangles whose shade may fall on some points. vertices: those that the casters were made of.
  VolumeTriangles volume(glm::dvec3 direction_to_sun, std::uint32_t infinity_index, std::span<const glm::vec3> vertices,
                         const ShadedPoints& points) const;

 private:
  struct Edge {
    std::uint32_t from, to;  // from < to
  };
  enum class Casting : std::int8_t { kBoth, kFronts, kBacks };

  struct Triangle {
    glm::uvec3 vertices;
    glm::uvec3 edges;   // edge i runs between vertices i and i + 1
    glm::ivec3 along;   // +1 if the triangle runs along the edge, -1 against it
    glm::dvec3 normal;  // unit
    Casting casting = Casting::kBoth;
  };

  void connect_edges();
  void find_solids(std::span<const glm::vec3> vertices);
  static int facing(const Triangle& triangle, glm::dvec3 direction_to_sun);

  std::vector<Triangle> triangles_;
  std::vector<Edge> edges_;
};

}  // namespace transom
