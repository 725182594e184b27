/// @file Light of small bright surfaces on its way to points: what beams and point sources have lit, and small
/// emitters. It is found by connecting points to bright elements instead of waiting for rays to hit them.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

/// An element that sends out light of its own, or a beam's: radiosity [lm/m²].
struct BrightElement {
  int element;  ///< counted over all slots
  glm::vec3 radiosity;
};

/// The bright elements of a condition, by patch, ready to be looked at from points.
class FirstBounce {
 public:
  /// Elements of one slot stand together.
  FirstBounce(const LightMesh& mesh, const RayScene& rays, const std::vector<BrightElement>& bright);

  /// Irradiance at a lifted point [lx]. A far patch counts as a point at the centroid of its light, a near one element
  /// by element, an adjacent element by its closed form; each with one ray for what stands between.
  glm::vec3 irradiance(glm::vec3 point, glm::vec3 normal) const;

 private:
  struct LitPatch {
    int slot;
    std::size_t first_element, last_element;
    glm::vec3 centroid;  // of the light, lifted
    glm::vec3 normal;
    glm::vec3 flux;  // reflected [lm]
    float weight;    // sum of the weights of the centroid
    float size;      // diameter [m]
  };
  struct LitPiece {
    glm::vec3 corner[4];
    int corner_count;
    glm::vec3 middle;     // lifted
    glm::vec3 radiosity;  // [lm/m²]
    float area;
  };
  void add(const BrightElement& bright);

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::vector<LitPatch> patches_;
  std::vector<LitPiece> pieces_;
};

}  // namespace transom
