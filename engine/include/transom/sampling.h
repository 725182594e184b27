/// @file Points with low discrepancy, and their warps to hemispheres, triangles and spherical triangles.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace transom {

/// Mixes two integers into a well-spread seed (finaliser of SplitMix64).
inline std::uint32_t hash_seed(std::uint64_t a, std::uint64_t b) {
  std::uint64_t x = a * 0x9e3779b97f4a7c15ULL + b + 0x632be59bd9b4e019ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return static_cast<std::uint32_t>((x ^ (x >> 31)) >> 16);
}

/// As many as rays are traced at once.
inline constexpr std::size_t kPointsAtOnce = 16;

/// Sobol's sequence in up to four dimensions (direction numbers of Joe & Kuo 2008), each dimension scrambled after
/// Owen by hashing [Burley 2020, "Practical hash-based Owen scrambling"]. Every aligned block of 2^k points is a net.
class SobolSequence {
 public:
  explicit SobolSequence(std::uint32_t seed);

  /// Point number `index`; coordinates in [0, 1).
  glm::vec2 point2(std::uint32_t index) const;
  glm::vec4 point4(std::uint32_t index) const;

  /// The first two coordinates of the points of these numbers.
  void points2(const std::uint32_t (&indices)[kPointsAtOnce], float (&x)[kPointsAtOnce],
               float (&y)[kPointsAtOnce]) const;

  /// The cell of the first two coordinates, of 2^bits an axis, that point number `index` lies in.
  glm::ivec2 cell2(std::uint32_t index, int bits) const;

 private:
  std::array<std::uint32_t, 4> seeds_;  // by dimension
};

/// Coordinate in [0, 1) of point `index` of a one-dimensional sequence that is even over any aligned block of 2^k
/// indices: van der Corput's, its order and digits scrambled after Owen by `seed`, so that sequences of two seeds can
/// be used together [Burley 2020, section 4].
double scrambled_coordinate(std::uint32_t index, std::uint32_t seed);

/// The indices of a Sobol sequence below the least power of two that holds `count`, in an order in which each sixteen
/// lie close together in the first two dimensions, whatever the seed: scrambling moves cells of the square as a whole.
/// For rays traced in packets; leave out those from `count` on.
const std::vector<std::uint32_t>& coherent_order(int count);

/// Of each coordinate: the order above passes through the square in cells of 2^-bits by 2^-bits, one after another.
int coherent_bits(int count);

/// Maps the unit square to the unit disc, preserving area and neighbourhood [Shirley & Chiu 1997].
glm::vec2 sample_disc(glm::vec2 u);

/// Direction in the hemisphere around +z with density cos(theta) / pi.
glm::vec3 sample_cosine_hemisphere(glm::vec2 u);

struct Directions {
  float x[kPointsAtOnce], y[kPointsAtOnce], z[kPointsAtOnce];
};

/// The same, around the third axis of `frame`, of the points of these numbers, at most kPointsAtOnce. Each direction
/// depends on its number alone, not on how many there are.
void sample_hemisphere(const SobolSequence& points, std::span<const std::uint32_t> indices, const glm::mat3& frame,
                       Directions& directions);

/// Right-handed orthonormal axes with `normal` as the third [Duff et al. 2017].
glm::mat3 frame_from_normal(glm::vec3 normal);

/// Barycentric coordinates (of the second and third corner), uniform in area.
glm::vec2 sample_triangle(glm::vec2 u);

/// The part of the unit sphere covered by a triangle seen from a point.
class SphericalTriangle {
 public:
  /// Corners as unit directions from the point.
  SphericalTriangle(glm::dvec3 a, glm::dvec3 b, glm::dvec3 c);

  /// Solid angle [sr]; 0 for a degenerate triangle.
  double solid_angle() const { return solid_angle_; }

  /// Unit direction with density 1 / solid_angle [Arvo 1995].
  glm::dvec3 sample(glm::dvec2 u) const;

 private:
  glm::dvec3 a_, b_, towards_c_{0};  // the last: at a, along the arc to the third corner
  double alpha_ = 0, sin_alpha_ = 0, cos_alpha_ = 1, solid_angle_ = 0, cos_c_ = 0;
};

}  // namespace transom
