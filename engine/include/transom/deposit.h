/// @file Direct light of beams and point sources on the elements of patches, by area.
#pragma once

#include <glm/glm.hpp>
#include <map>
#include <span>
#include <vector>

#include "transom/light_mesh.h"
#include "transom/ray_scene.h"
#include "transom/sky.h"

namespace transom {

/// Direct illuminance of one element [lx].
struct LitElement {
  int element;  ///< counted over all slots: slot * elements_per_slot + element
  glm::vec3 illuminance;
};

/// Casts light from beams and point sources on patches and points. Openings on the way take their share.
///
/// Elements look for the sun through openings. An opening that is smaller than an element would be missed by most of
/// their samples: its light is sent from the opening instead. Light belongs to the first opening that a point sees on
/// its way to the sun, so that none is counted twice.
class DirectLight {
 public:
  /// small_opening_m2: area of an element; opening faces below it send their light themselves.
  DirectLight(const LightMesh& mesh, const RayScene& rays, const std::vector<PointSource>& sources,
              const std::vector<Material>& materials, float small_opening_m2);

  /// Mean direct illuminance of the elements of `slots` that receive any, in the order of `slots`. Stratified over each
  /// element; a patch that is partly lit is sampled again eight times as densely.
  std::vector<LitElement> deposit(const std::vector<Beam>& beams, const std::vector<int>& slots,
                                  std::uint32_t seed) const;

  /// Share of a beam that arrives at lifted points: 0 where something opaque intervenes, else the transmittance.
  void beam_transmission(glm::vec3 direction_to_source, std::span<const glm::vec3> points,
                         std::span<float> share) const;

  /// Direct illuminance at a lifted point with a shading normal [lx].
  glm::vec3 illuminance(const std::vector<Beam>& beams, glm::vec3 point, glm::vec3 normal) const;

  /// The part of it that comes from point sources.
  glm::vec3 point_source_illuminance(glm::vec3 point, glm::vec3 normal) const;

 private:
  struct LocalSource {
    glm::vec3 position, intensity;
  };
  std::vector<glm::vec3> points_on(int slot, std::span<const int> elements, int samples, std::uint32_t seed) const;
  void beam_on_slot(glm::vec3 direction, int slot, std::uint32_t seed, std::vector<float>& mean) const;
  void deposit_on_cluster(const std::vector<Beam>& beams, int element, std::uint32_t seed,
                          std::vector<LitElement>& lit) const;
  void deposit_on_slot(const std::vector<Beam>& beams, int slot, std::uint32_t seed,
                       std::vector<LitElement>& lit) const;

  void ignore_small_openings(glm::vec3 direction, std::span<const glm::vec3> points, std::span<float> share) const;
  std::map<int, glm::vec3> send_through_small_openings(const std::vector<Beam>& beams, std::uint32_t seed) const;

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::vector<LocalSource> sources_;
  std::vector<int> small_openings_;     // faces
  std::vector<char> is_small_opening_;  // by face
};

}  // namespace transom
