/// @file What the engine is given: faces, materials, openings, sources. Metres, z up; a face has two sides.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "transom/angle_bins.h"

namespace transom {

/// Diffuse on both sides, or the face of an opening (`opening` >= 0).
struct Material {
  glm::vec3 reflectance{0};  ///< linear Rec. 709, 0..1 (below 1)
  glm::vec3 luminance{0};    ///< own luminance of both sides [cd/m²]
  bool smooth = false;       ///< shaded with the corner normals
  int opening = -1;          ///< opening group, or -1 for an opaque surface
};

/// Faces that daylight passes, with one angular transmittance. Their fronts look outdoors. With a `panel` they hold a
/// glazing product: all of one orientation, and nothing passes them straight (transmittance 0).
struct OpeningGroup {
  std::vector<float> transmittance;  ///< at cos(theta) = i / (size - 1); linear in between; the same both ways
  float diffuse_reflectance = 0;     ///< of the room side, hemispherical; panels have their product's
  std::optional<PanelFrame> panel = std::nullopt;

  float transmittance_at(float cos_theta) const;
};

/// Isotropic point source. Intensity as linear RGB whose Y is candela.
struct PointSource {
  glm::dvec3 position{0};
  glm::vec3 intensity{0};
};

/// The scene as arrays. faces: vertex indices, the fourth -1 for a triangle; counter-clockwise seen from the front.
/// corner_normals: four a face, or empty.
struct SceneGeometry {
  std::vector<glm::dvec3> vertices;
  std::vector<glm::ivec4> faces;
  std::vector<int> face_material;
  std::vector<glm::vec3> corner_normals;
  std::vector<Material> materials;
  std::vector<OpeningGroup> openings;
  std::vector<PointSource> point_sources;

  /// Throws InputError for an index out of range, a value that is not finite, or an impossible material or source.
  void validate() const;
};

/// One side of a face. 0: front, the side its normal looks to; 1: back.
using Side = int;

/// A face, or a piece of one (see face_pieces.h), in the engine's own frame: single precision, relative
/// to the middle of the scene.
struct Face {
  glm::vec3 corner[4];
  glm::vec3 corner_normal[4];
  glm::vec3 normal{0};
  float area = 0;
  bool is_quad = false;
  bool is_parallelogram = false;
  bool is_opening = false;
  bool is_set_back = false;  ///< of a solid that stands on another face, or stands under it: see set_back_contacts
  int material = 0;
  int source = 0;     ///< face of the scene that this is, or is a piece of
  int component = 0;  ///< faces joined at vertices; see Faces::component_is_solid

  std::span<const glm::vec3> corners() const { return {corner, is_quad ? 4u : 3u}; }
  glm::vec3 position(glm::vec2 st) const;
  /// Shading normal of the front side: interpolated corner normals.
  glm::vec3 shading_normal(glm::vec2 st) const;
  /// Parameters of a point of the face, from the barycentric coordinates of its triangle 0 (a, b, c) or 1 (a, c, d).
  glm::vec2 parameters(int triangle, glm::vec2 barycentric) const;
};

/// 0 to 5: the axis, and its sense, that a normal is nearest to.
int main_direction(glm::vec3 normal);

/// All faces, and the frame they are in: engine = world - origin.
struct Faces {
  glm::dvec3 origin{0};
  float extent = 1;  ///< longest side of the scene's bounding box [m]
  std::vector<Face> faces;
  std::vector<char> component_is_solid;  ///< closed and looking outwards: the backs of its faces are never lit

  bool is_inside_solid(int face, Side side) const {
    return side == 1 && component_is_solid[static_cast<std::size_t>(faces[static_cast<std::size_t>(face)].component)];
  }

  /// Lift of ray origins off a surface, small against the scene and large against the rounding of positions [m].
  float ray_offset() const { return 1e-5f * extent; }
};

/// Recentres the scene in double precision, cuts faces at openings and walls, then finds normals, areas and closed
/// solids.
Faces make_faces(const SceneGeometry& scene);

}  // namespace transom
