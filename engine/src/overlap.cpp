#include "transom/overlap.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "transom/box_tree.h"
#include "transom/error.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kParallelCosine = 0.99999f;  // of the normals of faces in one plane
constexpr double kLeastShare = 1e-3;         // of the smaller face's area: less is the rounding of neighbours
constexpr double kLeastExtent2 = 1e-5;       // of the scene's extent squared: a strip as wide as the lift of rays
constexpr std::uint32_t kRayCount = 16;
constexpr std::uint32_t kSeed = 1;  // of a check: the same scene is always right or wrong

Box box_of(const Face& face, float margin) {
  Box box{face.corner[0], face.corner[0]};
  for (const glm::vec3& corner : face.corners()) {
    box.low = glm::min(box.low, glm::dvec3(corner));
    box.high = glm::max(box.high, glm::dvec3(corner));
  }
  return {box.low - static_cast<double>(margin), box.high + static_cast<double>(margin)};
}

// Area and middle of the part of a face that lies over another, projected along the other's normal [Sutherland &
// Hodgman 1974].
double overlap_area(const Face& face, const Face& other, glm::dvec3& middle) {
  std::vector<glm::dvec3> polygon, clipped;
  for (const glm::vec3& corner : face.corners()) polygon.emplace_back(corner);
  const glm::dvec3 normal(other.normal);
  const int count = static_cast<int>(other.corners().size());
  for (int k = 0; k < count && !polygon.empty(); ++k) {
    const glm::dvec3 a(other.corner[k]), inward = glm::cross(normal, glm::dvec3(other.corner[(k + 1) % count]) - a);
    clipped.clear();
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const glm::dvec3 p = polygon[i], q = polygon[(i + 1) % polygon.size()];
      const double at_p = glm::dot(p - a, inward), at_q = glm::dot(q - a, inward);
      if (at_p >= 0) clipped.push_back(p);
      if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) clipped.push_back(glm::mix(p, q, at_p / (at_p - at_q)));
    }
    polygon.swap(clipped);
  }
  if (polygon.size() < 3) return 0;
  glm::dvec3 twice_area(0);
  middle = polygon[0] + polygon[1];
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    twice_area += glm::cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]);
    middle += polygon[i];
  }
  middle /= static_cast<double>(polygon.size());
  return 0.5 * glm::length(twice_area);
}

// Whether two faces lie in one plane and on each other; then also the area and the middle of what they share.
bool lie_on_each_other(const Faces& faces, int a, int b, double& area, glm::dvec3& middle) {
  const Face &first = faces.faces[a], &second = faces.faces[b];
  if (std::abs(glm::dot(first.normal, second.normal)) < kParallelCosine) return false;
  const auto off_plane = [&](glm::vec3 p) { return std::abs(glm::dot(p - first.corner[0], first.normal)); };
  if (std::max({off_plane(second.corner[0]), off_plane(second.corner[1]), off_plane(second.corners().back())}) >
      faces.ray_offset())
    return false;
  area = overlap_area(second, first, middle);
  return area > kLeastShare * std::min(first.area, second.area);
}

// Whether a place between two faces that lie on each other sees a lit side indoors, to the front or the back of one.
bool is_lit(const Faces& faces, const std::vector<char>& is_indoors, const RayScene& rays, glm::vec3 place,
            glm::vec3 normal) {
  const SobolSequence points(kSeed);
  for (const glm::vec3 up : {normal, -normal}) {
    Ray own[kRayCount];
    Hit hits[kRayCount];
    for (std::uint32_t k = 0; k < kRayCount; ++k)
      own[k] = {place + 2 * faces.ray_offset() * up,
                frame_from_normal(up) * sample_cosine_hemisphere(points.point2(k))};
    rays.intersect(RayScene::What::kAll, own, hits);
    bool is_buried = false, sees_light = false;
    for (const Hit& hit : hits) {
      if (hit.face < 0) continue;
      is_buried |= faces.is_inside_solid(hit.face, hit.side);
      sees_light |= (is_indoors[hit.face] >> hit.side & 1) != 0;
    }
    if (sees_light && !is_buried) return true;
  }
  return false;
}

// Of all faces, wide enough for those to meet that lie on each other.
std::vector<Box> boxes_of(const Faces& faces) {
  std::vector<Box> boxes;
  for (const Face& face : faces.faces) boxes.push_back(box_of(face, 0.5f * faces.ray_offset()));
  return boxes;
}

// Area and middle of what two faces in one plane share, where light meets it; 0: they do not lie on each other.
double lit_overlap(const Faces& faces, const std::vector<char>& is_indoors, const RayScene& rays, int a, int b,
                   glm::dvec3& middle) {
  const Face &first = faces.faces[a], &second = faces.faces[b];
  double area = 0;
  if (first.source == second.source || !(is_indoors[a] || is_indoors[b]) ||
      !lie_on_each_other(faces, a, b, area, middle) || area <= kLeastExtent2 * faces.extent * faces.extent)
    return 0;
  return is_lit(faces, is_indoors, rays, glm::vec3(middle), first.normal) ? area : 0;
}

}  // namespace

void set_back_contacts(Faces& all) {
  const std::size_t count = all.faces.size();
  const std::vector<Box> boxes = boxes_of(all);
  const BoxTree tree(boxes);
  const auto is_solid = [&](const Face& face) {
    return all.component_is_solid[static_cast<std::size_t>(face.component)] != 0;
  };
  const auto gives_way = [&](const Face& face, const Face& other) {
    if (!is_solid(other) || face.area != other.area) return !is_solid(other) || face.area < other.area;
    for (int k = 0; k < 4; ++k)
      for (int axis = 0; axis < 3; ++axis)
        if (face.corner[k][axis] != other.corner[k][axis]) return face.corner[k][axis] < other.corner[k][axis];
    return false;
  };
  parallel_indices(count, 64, [&](std::size_t f) {
    Face& face = all.faces[f];
    face.is_set_back = false;
    if (!is_solid(face)) return;
    tree.visit(boxes[f], [&](int other) {
      double area = 0;
      glm::dvec3 middle(0);
      if (!face.is_set_back && all.faces[other].component != face.component && gives_way(face, all.faces[other]) &&
          lie_on_each_other(all, static_cast<int>(f), other, area, middle))
        face.is_set_back = true;
    });
  });
}

void check_overlaps(const Faces& faces, const std::vector<char>& is_indoors, const RayScene& rays) {
  const std::size_t count = faces.faces.size();
  const std::vector<Box> boxes = boxes_of(faces);
  const BoxTree tree(boxes);
  std::vector<int> partner(count, -1);  // the first face that each lies on
  parallel_indices(count, 64, [&](std::size_t b) {
    tree.visit(boxes[b], [&](int a) {
      glm::dvec3 middle(0);
      if (a < static_cast<int>(b) && (partner[b] < 0 || a < partner[b]) &&
          lit_overlap(faces, is_indoors, rays, a, static_cast<int>(b), middle) > 0)
        partner[b] = a;
    });
  });
  for (std::size_t b = 0; b < count; ++b) {
    if (partner[b] < 0) continue;
    glm::dvec3 middle(0);
    const double area = lit_overlap(faces, is_indoors, rays, partner[b], static_cast<int>(b), middle);
    middle += faces.origin;
    const auto [low, high] = std::minmax(faces.faces[partner[b]].source, faces.faces[b].source);
    std::ostringstream text;
    text.precision(3);
    text << "face " << high << ", lies in the plane of face " << low << ", and on " << area << " m² of it, near ("
         << middle.x << ", " << middle.y << ", " << middle.z
         << ") m: which of the two light meets would be chance. Delete one of them, cut a hole, or move it off by "
         << 2 * faces.ray_offset() << " m";
    throw InputError(text.str());
  }
}

}  // namespace transom
