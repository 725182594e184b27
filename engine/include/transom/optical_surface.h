/// @file What light does where it meets a surface of a glazing product: Fresnel's equations with polarisation, mirrors,
/// diffuse sheets and holes. Shared by the tracers of sections and of unit cells.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

namespace transom {

/// What fills a part of a product. Medium 0 is the air around.
struct Medium {
  double index = 1;       ///< of refraction
  double absorption = 0;  ///< [1/m]
};

/// kInterface: Fresnel's equations between the media of its sides. kGap: a thin gap of air inside a medium, whose two
/// faces act together. kMirror: specular with `reflectance`. kDiffuse: Lambertian with `reflectance` and
/// `transmittance`. Of kMirror and kDiffuse, `openness` is the share that is holes.
enum class SurfaceKind { kInterface, kGap, kMirror, kDiffuse };

struct Surface {
  SurfaceKind kind = SurfaceKind::kInterface;
  int front = 0, back = 0;      ///< media on its two sides
  double reflectance = 0;       ///< of the front
  double reflectance_back = 0;  ///< of the back
  double transmittance = 0;     ///< kDiffuse
  double openness = 0;

  /// Why it cannot be, or nullptr. `media_count`: media are numbered below it.
  const char* fault(std::size_t media_count) const;
};

/// Throws InputError for an index below 1, negative absorption, or no medium at all.
void validate(const std::vector<Medium>& media);

/// Intensity and polarisation against an axis that is perpendicular to the direction [Born & Wolf 1999, section 1.4].
struct Stokes {
  double i = 1, q = 0, u = 0, v = 0;
};

inline Stokes operator*(double scale, const Stokes& a) {
  return {scale * a.i, scale * a.q, scale * a.u, scale * a.v};
}

/// A unit vector perpendicular to a unit vector.
glm::dvec3 perpendicular(glm::dvec3 direction);

/// A direction about `axis` with density cos / pi, from two numbers in [0, 1).
glm::dvec3 lambertian_direction(glm::dvec3 axis, double u, double v);

/// Light that goes on from a surface. Of a diffuse way `direction` is the axis of its Lambertian lobe.
struct Way {
  glm::dvec3 direction, reference;  ///< reference: the axis of `light`
  Stokes light;
  bool is_diffuse = false;
};

/// All that happens to light that meets a surface: at most straight on or refracted, mirrored, and diffuse both ways.
struct Meeting {
  std::array<Way, 4> ways;
  int count = 0;
  double absorbed = 0;

  /// Leaves one way, with the light of all, by a number in [0, 1): right on average.
  void leave_one(double chance);
};

/// normal: unit, towards the side that the light comes from; is_front: that side is the surface's front. Total internal
/// reflection keeps the phase between s and p waves [Born & Wolf 1999, sections 1.5.2 and 1.5.4].
Meeting meet(const Surface& surface, const std::vector<Medium>& media, glm::dvec3 direction, glm::dvec3 reference,
             const Stokes& light, glm::dvec3 normal, bool is_front);

}  // namespace transom
