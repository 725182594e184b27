/// @file Light that beams and point sources throw on surfaces, on its way to points: the brightest and sharpest part of
/// indirect light, found by connecting points to lit elements instead of waiting for rays to hit them.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/deposit.h"
#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

/// The lit elements of a condition, by patch, ready to be looked at from points.
class FirstBounce {
 public:
  /// lit: as deposited, in the order of their slots. reflectance_of_slot: of each slot that is lit.
  template <typename ReflectanceOfSlot>
  FirstBounce(const LightMesh& mesh, const RayScene& rays, const std::vector<LitElement>& lit,
              const ReflectanceOfSlot& reflectance_of_slot)
      : mesh_(mesh), rays_(rays) {
    for (const LitElement& e : lit) add(e, reflectance_of_slot(e.element / mesh.elements_per_slot()));
  }

  /// Irradiance at a lifted point [lx]. A far patch counts as a point at the centroid of its light, a near one element by
  /// element, an adjacent element by its closed form; each with one ray for what stands between.
  glm::vec3 irradiance(glm::vec3 point, glm::vec3 normal) const;

 private:
  struct LitPatch {
    int slot;
    std::size_t first_element, last_element;
    glm::vec3 centroid;   // of the light, lifted
    glm::vec3 normal;
    glm::vec3 flux;       // reflected [lm]
    float weight;         // sum of the weights of the centroid
    float size;           // diameter [m]
  };
  struct LitPiece {
    glm::vec3 corner[4];
    int corner_count;
    glm::vec3 middle;     // lifted
    glm::vec3 radiosity;  // [lm/m²]
    float area;
  };
  void add(const LitElement& lit, glm::vec3 reflectance);

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::vector<LitPatch> patches_;
  std::vector<LitPiece> pieces_;
};

}  // namespace transom
