#include "transom/sunlit_polygon.h"

#include <algorithm>
#include <cmath>

#include "transom/ray_scene.h"
#include "transom/sampling.h"

namespace transom {
namespace {

using Polygon = std::vector<glm::dvec3>;

constexpr double kSmallestPiece = 1e-9;  // of the face's area: less is rounding
constexpr double kEdgeOnCosine = 1e-7;   // to the sun, below which a face casts no shadow: the rounding of vertices

struct Plane {
  glm::dvec3 normal;
  double offset;
  double at(glm::dvec3 p) const { return glm::dot(normal, p) + offset; }
};

// The parts of a convex polygon on both sides of a plane [after Sutherland & Hodgman 1974].
void split(const Polygon& polygon, const Plane& plane, Polygon& above, Polygon& below) {
  above.clear();
  below.clear();
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const glm::dvec3 a = polygon[k], b = polygon[(k + 1) % polygon.size()];
    const double at_a = plane.at(a), at_b = plane.at(b);
    (at_a >= 0 ? above : below).push_back(a);
    if ((at_a >= 0) != (at_b >= 0)) {
      const glm::dvec3 crossing = a + at_a / (at_a - at_b) * (b - a);
      above.push_back(crossing);
      below.push_back(crossing);
    }
  }
}

double area_of(const Polygon& polygon) {
  glm::dvec3 twice_area(0);
  for (std::size_t k = 2; k < polygon.size(); ++k)
    twice_area += glm::cross(polygon[k - 1] - polygon[0], polygon[k] - polygon[0]);
  return 0.5 * glm::length(twice_area);
}

Polygon corners_of(const Face& face) {
  Polygon polygon;
  for (const glm::vec3& corner : face.corners()) polygon.push_back(glm::dvec3(corner));
  return polygon;
}

// Planes along the sun through the edges of a convex polygon; their insides are above.
std::vector<Plane> sides_along(const Polygon& polygon, glm::dvec3 sun) {
  glm::dvec3 middle(0);
  for (const glm::dvec3& corner : polygon) middle += corner / static_cast<double>(polygon.size());
  std::vector<Plane> sides;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const glm::dvec3 a = polygon[k], across = glm::cross(polygon[(k + 1) % polygon.size()] - a, sun);
    const double length = glm::length(across);
    if (!(length > 0)) continue;
    const glm::dvec3 normal = across * ((glm::dot(across, middle - a) < 0 ? -1 : 1) / length);
    sides.push_back({normal, -glm::dot(normal, a)});
  }
  return sides;
}

bool all_below(const Polygon& polygon, const Plane& plane, double margin) {
  return std::all_of(polygon.begin(), polygon.end(), [&](glm::dvec3 p) { return plane.at(p) <= margin; });
}

// Cuts the shadow of a caster, given by its sides, out of the pieces; there only `transmitted` of the light is left.
void cast_shadow(const std::vector<Plane>& sides, float transmitted, double smallest,
                 std::vector<SunlitPiece>& pieces) {
  std::vector<SunlitPiece> result;
  for (const SunlitPiece& piece : pieces) {
    const bool misses =
        std::any_of(sides.begin(), sides.end(), [&](const Plane& side) { return all_below(piece.corner, side, 0); });
    if (misses) {
      result.push_back(piece);
      continue;
    }
    Polygon rest = piece.corner, inside, outside;
    for (const Plane& side : sides) {
      split(rest, side, inside, outside);
      if (area_of(outside) > smallest) result.push_back({outside, piece.share});
      rest.swap(inside);
      if (rest.size() < 3) break;
    }
    if (transmitted > 0 && area_of(rest) > smallest) result.push_back({rest, piece.share * transmitted});
  }
  pieces.swap(result);
}

}  // namespace

SunlitFaces::SunlitFaces(const Faces& faces, const std::vector<Material>& materials,
                         const std::vector<OpeningGroup>& openings, glm::dvec3 direction_to_sun)
    : faces_(faces), materials_(materials), openings_(openings), sun_(direction_to_sun) {
  const glm::dmat3 along_sun = glm::transpose(glm::dmat3(frame_from_normal(glm::vec3(direction_to_sun))));
  const double margin = faces.ray_offset();  // large against the rounding of axes
  boxes_.reserve(faces.faces.size());
  for (const Face& face : faces.faces) {
    Box box{glm::dvec3(Ray::kInfinity), glm::dvec3(-Ray::kInfinity)};
    for (const glm::vec3& corner : face.corners()) {
      const glm::dvec3 place = along_sun * glm::dvec3(corner);
      box.low = glm::min(box.low, place - margin);
      box.high = glm::max(box.high, place + margin);
    }
    boxes_.push_back(box);
  }
}

std::vector<SunlitPiece> SunlitFaces::pieces(int face_index) const {
  const auto number = static_cast<std::size_t>(face_index);
  const Face& face = faces_.faces[number];
  const glm::dvec3 normal(face.normal);
  if (glm::dot(normal, sun_) <= 0) return {};
  const Polygon panel = corners_of(face);
  const std::vector<Plane> sides = sides_along(panel, sun_);
  const double smallest = kSmallestPiece * static_cast<double>(face.area), margin = faces_.ray_offset();
  const Plane before{normal, -glm::dot(normal, panel[0])};
  Box towards_sun = boxes_[number];
  towards_sun.high.z = Ray::kInfinity;
  std::vector<SunlitPiece> pieces{{panel, 1.f}};
  Polygon front, behind;
  for (std::size_t f = 0; f < faces_.faces.size() && !pieces.empty(); ++f) {
    if (f == number || !overlap(boxes_[f], towards_sun)) continue;
    const Face& other = faces_.faces[f];
    const double cosine = glm::dot(glm::dvec3(other.normal), sun_);
    if (std::abs(cosine) < kEdgeOnCosine) continue;
    const Polygon caster = corners_of(other);
    if (all_below(caster, before, margin) ||
        std::any_of(sides.begin(), sides.end(), [&](const Plane& side) { return all_below(caster, side, 0); }))
      continue;
    split(caster, before, front, behind);
    if (front.size() < 3) continue;
    const int opening = materials_[static_cast<std::size_t>(other.material)].opening;
    const float transmitted =
        opening < 0 ? 0.f : openings_[static_cast<std::size_t>(opening)].transmittance_at(static_cast<float>(cosine));
    cast_shadow(sides_along(front, sun_), transmitted, smallest, pieces);
  }
  return pieces;
}

double sunlit_share(const Face& face, const std::vector<SunlitPiece>& pieces) {
  double area = 0;
  for (const SunlitPiece& piece : pieces) area += static_cast<double>(piece.share) * area_of(piece.corner);
  return std::min(1.0, area / area_of(corners_of(face)));
}

}  // namespace transom
