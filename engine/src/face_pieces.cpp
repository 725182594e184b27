#include "transom/face_pieces.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <utility>

#include "transom/box_tree.h"

namespace transom {
namespace {

struct Corner {
  glm::dvec3 position;
  glm::dvec3 normal;
};
using Polygon = std::vector<Corner>;

// A face that may cut others.
struct Cutter {
  std::vector<glm::dvec3> corner;
  glm::dvec3 normal;
  Box box;
  double least_share;  // of the cut, that this face and others in its plane must cover
  int plane = -1;      // the same for faces in the plane of a wall; of an opening its own
};

constexpr double kTolerance = 1e-6;    // of the extent: how near two faces are that meet
constexpr double kWallShare = 0.5;     // a wall that covers half of the cut parts what it stands on; furniture does not
constexpr double kWallExtent2 = 1e-3;  // least area of a wall, against the square of the scene's extent

Box box_of(const auto& corners, double margin, const auto& position) {
  Box box{position(corners[0]), position(corners[0])};
  for (const auto& c : corners) {
    box.low = glm::min(box.low, position(c));
    box.high = glm::max(box.high, position(c));
  }
  return {box.low - margin, box.high + margin};
}

// The part of the segment p q inside the cutter's convex polygon, widened by the tolerance [Cyrus & Beck 1978]: where
// it begins and ends, from 0 at p to 1 at q.
glm::dvec2 part_inside(const Cutter& cutter, glm::dvec3 p, glm::dvec3 q, double tolerance) {
  double from = 0, to = 1;
  for (std::size_t k = 0; k < cutter.corner.size(); ++k) {
    const glm::dvec3 a = cutter.corner[k], b = cutter.corner[(k + 1) % cutter.corner.size()];
    const glm::dvec3 inward = glm::normalize(glm::cross(cutter.normal, b - a));
    const double at_p = glm::dot(p - a, inward) + tolerance, at_q = glm::dot(q - a, inward) + tolerance;
    if (at_p < 0 && at_q < 0) return {0, 0};
    const double crossing = at_p / (at_p - at_q);
    if (at_p < 0) from = std::max(from, crossing);
    if (at_q < 0) to = std::min(to, crossing);
  }
  return {from, std::max(from, to)};
}

// Length of the segment p q inside any of the cutters.
double length_inside(std::span<const int> in_plane, const std::vector<Cutter>& cutters, glm::dvec3 p, glm::dvec3 q,
                     double tolerance) {
  std::vector<glm::dvec2> inside;
  for (const int index : in_plane) inside.push_back(part_inside(cutters[index], p, q, tolerance));
  std::sort(inside.begin(), inside.end(), [](glm::dvec2 a, glm::dvec2 b) { return a.x < b.x; });
  double covered = 0, end = 0;
  for (const glm::dvec2 part : inside) {
    covered += std::max(0.0, part.y - std::max(part.x, end));
    end = std::max(end, part.y);
  }
  return covered * glm::length(q - p);
}

// Cuts a convex polygon by the plane of cutters that lie in one, where they meet it. False: nothing to cut.
bool cut(const Polygon& polygon, std::span<const int> in_plane, const std::vector<Cutter>& cutters, double tolerance,
         Polygon& front, Polygon& back) {
  const Cutter& cutter = cutters[in_plane.front()];
  std::vector<double> distance;
  bool has_front = false, has_back = false;
  for (const Corner& c : polygon) {
    distance.push_back(glm::dot(c.position - cutter.corner[0], cutter.normal));
    has_front |= distance.back() > tolerance;
    has_back |= distance.back() < -tolerance;
  }
  if (!has_front || !has_back) return false;
  std::vector<glm::dvec3> on_plane;
  front.clear();
  back.clear();
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Corner& c = polygon[k];
    const Corner& next = polygon[(k + 1) % polygon.size()];
    const double d = distance[k], d_next = distance[(k + 1) % polygon.size()];
    if (d >= -tolerance) front.push_back(c);
    if (d <= tolerance) back.push_back(c);
    if (std::abs(d) <= tolerance) on_plane.push_back(c.position);
    if ((d > tolerance && d_next < -tolerance) || (d < -tolerance && d_next > tolerance)) {
      const double t = d / (d - d_next);
      const Corner crossing{glm::mix(c.position, next.position, t), glm::mix(c.normal, next.normal, t)};
      front.push_back(crossing);
      back.push_back(crossing);
      on_plane.push_back(crossing.position);
    }
  }
  if (on_plane.size() < 2) return false;
  const double covered = length_inside(in_plane, cutters, on_plane[0], on_plane[1], 2 * tolerance);
  return covered > 4 * tolerance && covered >= cutter.least_share * glm::length(on_plane[1] - on_plane[0]);
}

// A plane, its normal up to the sign and in thousandths, to be looked up by; its offset is compared with a tolerance.
// Where rounding puts faces of one wall into two planes, each of these cuts as a wall of its own.
struct Plane {
  glm::ivec3 normal;
  double offset;

  Plane(glm::dvec3 unit_normal, glm::dvec3 point)
      : normal(glm::round(1000.0 * unit_normal)), offset(glm::dot(unit_normal, point)) {
    if (std::tie(normal.x, normal.y, normal.z) >= std::make_tuple(0, 0, 0)) return;
    normal = -normal;
    offset = -offset;
  }
  bool operator<(const Plane& other) const {
    return std::tie(normal.x, normal.y, normal.z, offset) <
           std::tie(other.normal.x, other.normal.y, other.normal.z, other.offset);
  }
};

// The planes of walls, each numbered by its first wall. Windows divide a wall into faces of which each covers little of
// the floor below, and leave sills that are small themselves: what counts is the wall.
class WallPlanes {
 public:
  WallPlanes(std::vector<std::pair<Plane, int>> walls, double tolerance) : tolerance_(tolerance) {
    std::sort(walls.begin(), walls.end());
    for (const auto& [plane, number] : walls) {
      if (!planes_.empty() && is_in(plane, planes_.back().first))
        planes_.back().second = std::min(planes_.back().second, number);
      else
        planes_.emplace_back(plane, number);
    }
  }

  // -1: none of them.
  int find(Plane plane) const {
    Plane lowest = plane;
    lowest.offset -= tolerance_;
    const auto is_before = [](const std::pair<Plane, int>& entry, const Plane& other) { return entry.first < other; };
    const auto found = std::lower_bound(planes_.begin(), planes_.end(), lowest, is_before);
    return found != planes_.end() && is_in(plane, found->first) ? found->second : -1;
  }

 private:
  bool is_in(const Plane& plane, const Plane& other) const {
    return plane.normal == other.normal && std::abs(plane.offset - other.offset) <= tolerance_;
  }

  std::vector<std::pair<Plane, int>> planes_;
  double tolerance_;
};

glm::dvec3 twice_area(const Polygon& polygon) {
  glm::dvec3 sum(0);
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k)
    sum += glm::cross(polygon[k].position - polygon[0].position, polygon[k + 1].position - polygon[0].position);
  return sum;
}

}  // namespace

std::vector<FacePiece> cut_faces(const SceneGeometry& scene, glm::dvec3 origin, double extent) {
  const double tolerance = kTolerance * extent;
  const auto polygon_of = [&](std::size_t f) {
    Polygon polygon;
    const glm::ivec4& face = scene.faces[f];
    const int count = face.w >= 0 ? 4 : 3;
    for (int k = 0; k < count; ++k) {
      const glm::dvec3 normal =
          scene.corner_normals.empty() ? glm::dvec3(0) : glm::dvec3(scene.corner_normals[4 * f + k]);
      polygon.push_back({scene.vertices[face[k]] - origin, normal});
    }
    return polygon;
  };
  const auto is_opening = [&](std::size_t f) { return scene.materials[scene.face_material[f]].opening >= 0; };
  const auto plane_of = [](const Polygon& polygon) {
    return Plane(glm::normalize(twice_area(polygon)), polygon[0].position);
  };
  std::vector<std::pair<Plane, int>> walls;
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    const Polygon polygon = polygon_of(f);
    if (!is_opening(f) && glm::length(twice_area(polygon)) > 2 * kWallExtent2 * extent * extent)
      walls.emplace_back(plane_of(polygon), static_cast<int>(f));
  }
  const WallPlanes wall_planes(std::move(walls), tolerance);
  std::vector<Cutter> cutters;
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    const Polygon polygon = polygon_of(f);
    if (!(glm::length(twice_area(polygon)) > 0)) continue;
    Cutter cutter;
    cutter.plane = is_opening(f) ? static_cast<int>(f) : wall_planes.find(plane_of(polygon));
    if (cutter.plane < 0) continue;
    for (const Corner& c : polygon) cutter.corner.push_back(c.position);
    cutter.normal = glm::normalize(twice_area(polygon));
    cutter.box = box_of(cutter.corner, 2 * tolerance, [](const glm::dvec3& p) { return p; });
    cutter.least_share = is_opening(f) ? 0.0 : kWallShare;
    cutters.push_back(std::move(cutter));
  }
  // In the order of their planes, and those of one together.
  std::stable_sort(cutters.begin(), cutters.end(), [](const Cutter& a, const Cutter& b) { return a.plane < b.plane; });

  std::vector<Box> boxes;
  boxes.reserve(cutters.size());
  for (const Cutter& cutter : cutters) boxes.push_back(cutter.box);
  const BoxTree tree(std::move(boxes));
  std::vector<FacePiece> pieces;
  Polygon front, back;
  std::vector<int> near;
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    std::vector<Polygon> parts{polygon_of(f)};
    if (!is_opening(f)) {
      near.clear();
      tree.visit(box_of(parts[0], 0.0, [](const Corner& c) { return c.position; }),
                 [&](int cutter) { near.push_back(cutter); });
      std::sort(near.begin(), near.end());
      for (auto first = near.begin(); first != near.end();) {
        const int plane = cutters[*first].plane;
        const auto last = std::find_if(first, near.end(), [&](int cutter) { return cutters[cutter].plane != plane; });
        for (std::size_t k = 0, count = parts.size(); k < count; ++k)
          if (cut(parts[k], {first, last}, cutters, tolerance, front, back)) {
            parts[k] = front;
            parts.push_back(back);
          }
        first = last;
      }
    }
    for (const Polygon& part : parts)
      for (std::size_t first = 1; first + 1 < part.size();
           first += 2) {  // fan of quads, with a triangle where one is left
        FacePiece piece;
        piece.source = static_cast<int>(f);
        piece.is_quad = first + 2 < part.size();
        const std::size_t index[4]{0, first, first + 1, piece.is_quad ? first + 2 : first + 1};
        for (int k = 0; k < 4; ++k) {
          piece.corner[k] = part[index[k]].position;
          piece.corner_normal[k] = glm::vec3(part[index[k]].normal);
        }
        pieces.push_back(piece);
      }
  }
  return pieces;
}

}  // namespace transom
