#include "transom/face_pieces.h"

#include <algorithm>
#include <cmath>

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
  double least_share;  // of the cut, that the face itself must cover
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

// Length of the segment p q inside the cutter's convex polygon, widened by the tolerance [Cyrus & Beck 1978].
double length_inside(const Cutter& cutter, glm::dvec3 p, glm::dvec3 q, double tolerance) {
  double from = 0, to = 1;
  for (std::size_t k = 0; k < cutter.corner.size(); ++k) {
    const glm::dvec3 a = cutter.corner[k], b = cutter.corner[(k + 1) % cutter.corner.size()];
    const glm::dvec3 inward = glm::normalize(glm::cross(cutter.normal, b - a));
    const double at_p = glm::dot(p - a, inward) + tolerance, at_q = glm::dot(q - a, inward) + tolerance;
    if (at_p < 0 && at_q < 0) return 0;
    const double crossing = at_p / (at_p - at_q);
    if (at_p < 0) from = std::max(from, crossing);
    if (at_q < 0) to = std::min(to, crossing);
  }
  return std::max(0.0, to - from) * glm::length(q - p);
}

// Cuts a convex polygon by the cutter's plane where they meet. False: nothing to cut.
bool cut(const Polygon& polygon, const Cutter& cutter, double tolerance, Polygon& front, Polygon& back) {
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
  const double covered = length_inside(cutter, on_plane[0], on_plane[1], 2 * tolerance);
  return covered > 4 * tolerance && covered >= cutter.least_share * glm::length(on_plane[1] - on_plane[0]);
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
  std::vector<Cutter> cutters;
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    const Polygon polygon = polygon_of(f);
    const bool is_opening = scene.materials[scene.face_material[f]].opening >= 0;
    Cutter cutter;
    for (const Corner& c : polygon) cutter.corner.push_back(c.position);
    const glm::dvec3 twice_area =
        glm::cross(cutter.corner[1] - cutter.corner[0], cutter.corner[2] - cutter.corner[0]) +
        (polygon.size() == 4 ? glm::cross(cutter.corner[2] - cutter.corner[0], cutter.corner[3] - cutter.corner[0])
                             : glm::dvec3(0));
    if (!(glm::length(twice_area) > (is_opening ? 0.0 : 2 * kWallExtent2 * extent * extent))) continue;
    cutter.normal = glm::normalize(twice_area);
    cutter.box = box_of(cutter.corner, 2 * tolerance, [](const glm::dvec3& p) { return p; });
    cutter.least_share = is_opening ? 0.0 : kWallShare;
    cutters.push_back(std::move(cutter));
  }

  std::vector<Box> boxes;
  boxes.reserve(cutters.size());
  for (const Cutter& cutter : cutters) boxes.push_back(cutter.box);
  const BoxTree tree(std::move(boxes));
  std::vector<FacePiece> pieces;
  Polygon front, back;
  std::vector<int> near;
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    std::vector<Polygon> parts{polygon_of(f)};
    if (scene.materials[scene.face_material[f]].opening < 0) {
      near.clear();
      tree.visit(box_of(parts[0], 0.0, [](const Corner& c) { return c.position; }),
                 [&](int cutter) { near.push_back(cutter); });
      std::sort(near.begin(), near.end());
      for (const int index : near) {
        const Cutter& cutter = cutters[index];
        for (std::size_t k = 0, count = parts.size(); k < count; ++k)
          if (cut(parts[k], cutter, tolerance, front, back)) {
            parts[k] = front;
            parts.push_back(back);
          }
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
