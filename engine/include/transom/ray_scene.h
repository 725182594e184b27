/// @file Rays against the scene, sixteen at a time (Embree 3 or 4).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "transom/geometry.h"

namespace transom {

/// A ray or, with a finite t_far, a segment. Distances are in units of |direction|.
struct Ray {
  glm::vec3 origin{0};
  glm::vec3 direction{0};
  float t_near = 0;
  float t_far = kInfinity;
  static constexpr float kInfinity = 1e30f;
};

/// The first surface on a ray. face -1: nothing.
struct Hit {
  int face = -1;
  Side side = 0;
  float t = 0;
  glm::vec2 st{0};  ///< parameters on the face
};

/// Acceleration structures over the opaque faces, the openings, and both.
class RayScene {
 public:
  enum class What { kOpaque, kOpenings, kAll };

  /// Whether each sixteen rays in a row go about the same way. Says how to trace them, not what they meet, but for
  /// `occluded`: a ray along the very edge of a face is stopped by it or not as the rays beside it are.
  enum class Order { kScattered, kCoherent };

  RayScene(const Faces& faces, const std::vector<Material>& materials, const std::vector<OpeningGroup>& openings);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// First hit of every ray. `hits` has the size of `rays`. A hit depends on the ray and on the faces at its place
  /// alone, even where several meet there: not on other rays, nor on faces elsewhere.
  void intersect(What what, std::span<const Ray> rays, std::span<Hit> hits, Order order = Order::kScattered) const;

  /// The same of rays from one point, in order; x, y and z: their directions, as many as `hits`.
  void intersect_from(glm::vec3 origin, const float* x, const float* y, const float* z, What what,
                      std::span<Hit> hits) const;

  /// 1 where something opaque (or of `what`) lies between t_near and t_far, else 0.
  void occluded(What what, std::span<const Ray> rays, std::span<std::uint8_t> blocked,
                Order order = Order::kScattered) const;

  /// The same of rays that all go one way, without end; x, y and z: where they start, as many as `blocked`.
  void occluded_along(glm::vec3 direction, const float* x, const float* y, const float* z, What what,
                      std::span<std::uint8_t> blocked) const;

  /// Product of the transmittances of all openings between t_near and t_far of each ray. Opaque surfaces are not looked
  /// at.
  void transmittance(std::span<const Ray> rays, std::span<float> shares, Order order = Order::kScattered) const;
  float transmittance(const Ray& ray) const;

  /// Transmittance of the opening that a face belongs to, for light along `direction` or against it.
  float opening_transmittance(int face, glm::vec3 direction) const;

  /// The faces that rays of this kind may meet, ascending.
  std::vector<int> faces_of(What what) const;

 private:
  struct Tree;
  struct Meeting;
  Hit hit_of(const Tree& tree, unsigned triangle, glm::vec2 barycentric, float t, const Ray& ray) const;
  void settle(const Tree& tree, const Ray& ray, Hit& hit) const;

  const Faces& faces_;
  const std::vector<Material>& materials_;
  const std::vector<OpeningGroup>& openings_;
  std::unique_ptr<Tree> trees_[3];
  bool has_openings_ = false;
};

}  // namespace transom
