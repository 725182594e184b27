/// @file Which pixels the sun reaches, and through how many openings, by stencil shadow volumes.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "transom/gl_context.h"

namespace transom {

/// Side of a picture at most [pixels].
inline constexpr int kLargestVolumePicture = 4096;

/// Pinhole camera. Pixel (0, 0) is at the top left; the pixel's centre, at +0.5, is what is sampled.
struct VolumeCamera {
  glm::dvec3 position{0}, target{0}, up{0, 0, 1};
  double vertical_fov_rad = 1;
  int width = 0, height = 0;  ///< up to kLargestVolumePicture each, and to what the OpenGL renderer allows

  bool operator==(const VolumeCamera&) const = default;
};

/// Where answers are wanted. The less that is, the fewer pixels and casters are drawn.
struct VolumeRange {
  /// Pixels of the picture: from (left, top) on, below (right, bottom).
  int left = 0, top = 0, right = 0, bottom = 0;
  int width() const { return right - left; }
  int height() const { return bottom - top; }
  std::size_t pixel_count() const { return static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()); }
  /// Visible points in these pixels, in boxes: two corners each. Empty: any. Of others the answers may be anything.
  std::vector<std::pair<glm::vec3, glm::vec3>> boxes;
};

/// Sun visibility of the visible point of each pixel of a range, rows from its top: index = (y - top) * width + x -
/// left.
///
/// Meaningful where an opaque surface is seen on the side that faces the sun. On a side that faces away (unlit by its
/// cosine in any case) and where no surface is seen, the values may be anything.
struct BeamMask {
  int width = 0, height = 0;           ///< of the range
  std::vector<std::uint8_t> shadowed;  ///< 1: an opaque triangle lies between the visible point and the sun; else 0
  std::vector<std::vector<std::uint8_t>> crossings;  ///< [group]: that group's openings between visible point and sun
};

/// Triangles of their own that cast volumes beside those of the scene: the lit part of a panel, or what stands behind
/// it. `are_solids`: closed solids among them count once, as the scene's do.
class VolumeCasters {
 public:
  VolumeCasters(std::vector<glm::vec3> vertices, std::span<const glm::uvec3> triangles, bool are_solids);
  ~VolumeCasters();
  VolumeCasters(VolumeCasters&&) noexcept;

 private:
  friend class ShadowVolumes;
  struct Prepared;
  std::unique_ptr<Prepared> prepared_;
};

/// Stencil shadow volumes of a fixed scene, for any camera and any beam of parallel light.
///
/// Both sides of a triangle cast: single sheets, closed solids, any orientation, T-junctions and interpenetration. A
/// surface never shadows itself. Exact for each pixel's centre but for the depth buffer's resolution (24 bits between
/// the nearest and the farthest surface): shadow edges stand within a pixel of where rays put them. Elsewhere about one
/// pixel in a million is wrong, where the rasteriser gives a volume's side, seen edge-on, no sound depth. The stencil
/// counts modulo 256: exactly 256 sheets, or openings of one group, one behind another would count as none. A closed,
/// consistently oriented solid counts once for each time that the ray to the sun goes through it, a sheet once.
///
/// Any thread may use an object, one at a time (see GlContext, which must outlive it and serves any number of objects).
/// [Crow 1977; Heidmann 1991; Everitt & Kilgard 2002; McGuire et al. 2003]
class ShadowVolumes {
 public:
  /// vertices: recentred near the origin, any unit. opaque_triangles and opening_triangles_by_group: indices of
  /// vertices; glass hides nothing and casts nothing, so it belongs to the openings alone. Triangles without area are
  /// ignored. Throws InputError for an index out of range or a vertex that is not finite, GlError if OpenGL fails.
  ShadowVolumes(GlContext& context, std::span<const glm::vec3> vertices, std::span<const glm::uvec3> opaque_triangles,
                std::span<const std::vector<glm::uvec3>> opening_triangles_by_group);
  ~ShadowVolumes();
  ShadowVolumes(const ShadowVolumes&) = delete;
  ShadowVolumes& operator=(const ShadowVolumes&) = delete;

  /// direction_to_sun: any length but zero. Throws InputError for an impossible camera or direction, GlError if OpenGL
  /// fails.
  BeamMask render(const VolumeCamera& camera, glm::dvec3 direction_to_sun);
  BeamMask render(const VolumeCamera& camera, glm::dvec3 direction_to_sun, const VolumeRange& range);

  /// How many of the casters lie between each visible point of a range and the source of parallel light, modulo 256.
  std::vector<std::uint8_t> count(const VolumeCamera& camera, glm::dvec3 direction_to_source,
                                  const VolumeCasters& casters, const VolumeRange& range);

  /// Passes of the last render or count: one for visible surfaces unless the camera is the previous one, one for opaque
  /// casters, one for each opening group whose light can be in the picture.
  int pass_count() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace transom
