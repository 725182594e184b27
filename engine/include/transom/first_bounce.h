/// @file Light of small bright surfaces on its way to points: what beams and point sources have lit, and small
/// emitters. It is found by connecting points to bright elements instead of waiting for rays to hit them.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

/// Diameters from which a patch counts as a point: then it errs by about 1 % of its share.
inline constexpr float kFarPatch = 4;

/// An element that sends out light of its own, or a beam's: radiosity [lm/m²].
struct BrightElement {
  int element;  ///< counted over all slots
  glm::vec3 radiosity;
};

/// An element as points see it.
struct ElementShape {
  glm::vec3 corner[4];   ///< counter-clockwise from the lit side
  int corner_count = 0;  ///< 0: of a cluster of small faces
  glm::vec3 middle;      ///< lifted
  glm::vec3 normal;
  float area = 0;  ///< [m²]
};
ElementShape element_shape(const LightMesh& mesh, int element);

/// Form factor from a point to an unoccluded element: a closed form if it is adjacent, else as if all of it were at its
/// middle.
float element_share(glm::vec3 point, glm::vec3 normal, const ElementShape& shape);

/// The bright elements of a condition, by patch, ready to be looked at from points.
class FirstBounce {
 public:
  /// Elements of one slot stand together.
  FirstBounce(const LightMesh& mesh, const RayScene& rays, const std::vector<BrightElement>& bright);

  /// How well it is known what stands between. kOne: a far patch counts as a point at the centroid of its light, a near
  /// one element by element; each with one ray. kMany: always element by element, the more rays all over an element the
  /// more light it sends, so that what is partly hidden by an edge is partly seen.
  enum class Rays { kOne, kMany };

  /// Irradiance at a lifted point [lx]; an adjacent element by its closed form.
  glm::vec3 irradiance(glm::vec3 point, glm::vec3 normal, Rays rays) const;

 private:
  struct LitPatch {
    int slot;
    std::size_t first_element, last_element;
    glm::vec3 centroid;  // of the light, lifted
    glm::vec3 normal;
    glm::vec3 flux;  // reflected [lm]
    float weight;    // sum of the weights of the centroid
    float size;      // diameter [m]
    bool is_cluster;
  };
  struct LitPiece {
    ElementShape shape;
    glm::vec3 radiosity;  // [lm/m²]
  };
  void add(const BrightElement& bright);

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::vector<LitPatch> patches_;
  std::vector<LitPiece> pieces_;
};

}  // namespace transom
