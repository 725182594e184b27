#include "transom/ray_scene.h"

#include <algorithm>
#include <cmath>

#include "embree_device.h"

namespace transom {
namespace {

constexpr std::size_t kWidth = 16;
constexpr float kMeeting = 0.1f;  // of the lift of ray origins: faces so near to each other meet
constexpr float kSetBack = 0.4f;  // of the same: by which faces lie deeper in their solid that are set back

// Embree 3 takes a context, Embree 4 optional arguments.
#if TRANSOM_EMBREE_MAJOR >= 4
void intersect16(const int* valid, RTCScene scene, RTCRayHit16* rays, RayScene::Order order) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  if (order == RayScene::Order::kCoherent) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcIntersect16(valid, scene, rays, &arguments);
}
void occluded16(const int* valid, RTCScene scene, RTCRay16* rays, RayScene::Order order) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  if (order == RayScene::Order::kCoherent) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcOccluded16(valid, scene, rays, &arguments);
}
#else
RTCIntersectContext context_for(RayScene::Order order) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  if (order == RayScene::Order::kCoherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  return context;
}
void intersect16(const int* valid, RTCScene scene, RTCRayHit16* rays, RayScene::Order order) {
  RTCIntersectContext context = context_for(order);
  rtcIntersect16(valid, scene, &context, rays);
}
void occluded16(const int* valid, RTCScene scene, RTCRay16* rays, RayScene::Order order) {
  RTCIntersectContext context = context_for(order);
  rtcOccluded16(valid, scene, &context, rays);
}
#endif

void load_rays(std::span<const Ray> rays, RTCRay16& packet, int* valid) {
  for (std::size_t i = 0; i < kWidth; ++i) {
    const Ray& ray = rays[std::min(i, rays.size() - 1)];
    valid[i] = i < rays.size() ? -1 : 0;
    packet.org_x[i] = ray.origin.x;
    packet.org_y[i] = ray.origin.y;
    packet.org_z[i] = ray.origin.z;
    packet.dir_x[i] = ray.direction.x;
    packet.dir_y[i] = ray.direction.y;
    packet.dir_z[i] = ray.direction.z;
    packet.tnear[i] = ray.t_near;
    packet.tfar[i] = ray.t_far;
    packet.time[i] = 0;
    packet.mask[i] = 0xffffffffu;
    packet.id[i] = 0;
    packet.flags[i] = 0;
  }
}

void forget_hits(RTCHit16& hit) {
  for (std::size_t i = 0; i < kWidth; ++i) {
    hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

struct Triangle {
  glm::vec3 a, b, c;
};

// As rays meet it.
Triangle triangle_of(const Faces& faces, const Face& face, int part) {
  const glm::vec3 offset = (face.is_set_back ? -kSetBack * faces.ray_offset() : 0.f) * face.normal;
  return {face.corner[0] + offset, face.corner[1 + part] + offset, face.corner[2 + part] + offset};
}

// Whether a triangle comes before another by its place: an order that knows no numbers.
bool is_before(const Triangle& s, const Triangle& t) {
  for (const auto corner : {&Triangle::a, &Triangle::b, &Triangle::c})
    for (int axis = 0; axis < 3; ++axis)
      if ((s.*corner)[axis] != (t.*corner)[axis]) return (s.*corner)[axis] < (t.*corner)[axis];
  return false;
}

// The largest barycentric coordinate of places no farther than `distance` from an edge.
float edge_share(const Triangle& t, float distance) {
  const float longest = std::max({glm::length(t.b - t.a), glm::length(t.c - t.b), glm::length(t.a - t.c)});
  return distance * longest / glm::length(glm::cross(t.b - t.a, t.c - t.a));
}

}  // namespace

struct RayScene::Tree {
  RTCScene scene = nullptr;
  std::vector<int> face_of_triangle;
  std::vector<std::uint8_t> part_of_triangle;  // 0: corners a, b, c; 1: corners a, c, d
  std::vector<float> edge_share;               // barycentric coordinate below which a hit is at an edge of its triangle
  ~Tree() {
    if (scene) rtcReleaseScene(scene);
  }
};

// All triangles that a ray meets at one place, and of them the one that it is said to have met.
struct RayScene::Meeting {
  const Faces& faces;
  const Tree& tree;
  const Ray& ray;
  float t;                 // about where
  Hit hit;                 // face -1: none so far
  bool is_inside = false;  // of its triangle, and not at an edge
  Triangle place{};

  void consider(unsigned triangle) {
    const int face_index = tree.face_of_triangle[triangle], part = tree.part_of_triangle[triangle];
    const Face& face = faces.faces[static_cast<std::size_t>(face_index)];
    const Triangle own = triangle_of(faces, face, part);
    const double tolerance = kMeeting * faces.ray_offset();
    const glm::dvec3 a(own.a), ab = glm::dvec3(own.b) - a, ac = glm::dvec3(own.c) - a, direction(ray.direction);
    const glm::dvec3 normal = glm::cross(ab, ac);
    const double facing = glm::dot(normal, direction), twice_area = glm::length(normal);
    if (facing == 0 || !(twice_area > 0)) return;
    const double distance = glm::dot(normal, a - glm::dvec3(ray.origin)) / facing;
    if (distance < ray.t_near || distance > ray.t_far || std::abs(distance - t) * glm::length(direction) > tolerance)
      return;
    const glm::dvec3 from_a = glm::dvec3(ray.origin) + distance * direction - a;
    const double of_b = glm::dot(glm::cross(from_a, ac), normal) / (twice_area * twice_area),
                 of_c = glm::dot(glm::cross(ab, from_a), normal) / (twice_area * twice_area);
    const double depth = twice_area * std::min({(1 - of_b - of_c) / glm::length(ac - ab), of_b / glm::length(ac),
                                                of_c / glm::length(ab)});  // within the nearest edge
    if (depth < -tolerance) return;
    const bool is_own_inside = depth > tolerance;
    if (hit.face >= 0 && (is_own_inside != is_inside ? is_inside : !is_before(own, place))) return;
    is_inside = is_own_inside;
    place = own;
    hit.face = face_index;
    hit.side = glm::dot(ray.direction, face.normal) < 0 ? 0 : 1;
    hit.t = static_cast<float>(distance);
    const auto v = static_cast<float>(std::clamp(of_c, 0.0, 1.0));
    hit.st = face.parameters(part, {std::clamp(static_cast<float>(of_b), 0.f, 1 - v), v});
  }
};

// Where faces meet, it hangs on how the tree happens to be built which of them is hit first, and in a tree of other
// faces it may be another. The ray is said to meet the triangle that it meets inside, as of a floor at the edge of what
// stands on it, or else the first by place.
void RayScene::settle(const Tree& tree, const Ray& ray, Hit& hit) const {
  Meeting meeting{faces_, tree, ray, hit.t, {}};
  const glm::vec3 place = ray.origin + hit.t * ray.direction;
  RTCPointQuery query{place.x, place.y, place.z, 0, 2 * kMeeting * faces_.ray_offset()};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  const auto consider = [](RTCPointQueryFunctionArguments* found) {
    static_cast<Meeting*>(found->userPtr)->consider(found->primID);
    return false;  // the radius stays
  };
  rtcPointQuery(tree.scene, &query, &context, consider, &meeting);
  if (meeting.hit.face >= 0) hit = meeting.hit;
}

RayScene::RayScene(const Faces& faces, const std::vector<Material>& materials,
                   const std::vector<OpeningGroup>& openings)
    : faces_(faces), materials_(materials), openings_(openings) {
  for (const What what : {What::kOpaque, What::kOpenings, What::kAll}) {
    auto tree = std::make_unique<Tree>();
    std::vector<glm::vec3> corners;
    for (std::size_t f = 0; f < faces.faces.size(); ++f) {
      const Face& face = faces.faces[f];
      const bool is_opening = materials[face.material].opening >= 0;
      has_openings_ |= is_opening;
      if (what != What::kAll && is_opening != (what == What::kOpenings)) continue;
      for (int part = 0; part < (face.is_quad ? 2 : 1); ++part) {
        const Triangle own = triangle_of(faces, face, part);
        corners.insert(corners.end(), {own.a, own.b, own.c});
        tree->face_of_triangle.push_back(static_cast<int>(f));
        tree->part_of_triangle.push_back(static_cast<std::uint8_t>(part));
        tree->edge_share.push_back(edge_share(own, kMeeting * faces.ray_offset()));
      }
    }
    tree->scene = rtcNewScene(shared_device());
    rtcSetSceneFlags(tree->scene, RTC_SCENE_FLAG_ROBUST);
    if (!corners.empty()) {
      RTCGeometry geometry = rtcNewGeometry(shared_device(), RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float), corners.size()));
      auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(unsigned), corners.size() / 3));
      for (std::size_t i = 0; i < corners.size(); ++i) {
        for (int axis = 0; axis < 3; ++axis) vertex[3 * i + static_cast<std::size_t>(axis)] = corners[i][axis];
        index[i] = static_cast<unsigned>(i);
      }
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(tree->scene, geometry);
      rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(tree->scene);
    trees_[static_cast<std::size_t>(what)] = std::move(tree);
  }
}

RayScene::~RayScene() = default;

std::vector<int> RayScene::faces_of(What what) const {
  std::vector<int> faces = trees_[static_cast<std::size_t>(what)]->face_of_triangle;  // both triangles of a quad
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  return faces;
}

void RayScene::intersect(What what, std::span<const Ray> rays, std::span<Hit> hits, Order order) const {
  const Tree& tree = *trees_[static_cast<std::size_t>(what)];
  alignas(64) int valid[kWidth];
  RTCRayHit16 packet;
  for (std::size_t begin = 0; begin < rays.size(); begin += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - begin);
    load_rays(rays.subspan(begin, count), packet.ray, valid);
    forget_hits(packet.hit);
    intersect16(valid, tree.scene, &packet, order);
    for (std::size_t i = 0; i < count; ++i)
      hits[begin + i] = packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID
                            ? Hit{}
                            : hit_of(tree, packet.hit.primID[i], {packet.hit.u[i], packet.hit.v[i]}, packet.ray.tfar[i],
                                     rays[begin + i]);
  }
}

void RayScene::intersect_from(glm::vec3 origin, const float* x, const float* y, const float* z, What what,
                              std::span<Hit> hits) const {
  const Tree& tree = *trees_[static_cast<std::size_t>(what)];
  alignas(64) int valid[kWidth];
  RTCRayHit16 packet;
  const Ray ray{origin};
  load_rays({&ray, 1}, packet.ray, valid);
  for (std::size_t begin = 0; begin < hits.size(); begin += kWidth) {
    const std::size_t count = std::min(kWidth, hits.size() - begin);
    for (std::size_t i = 0; i < kWidth; ++i) {
      const std::size_t k = begin + std::min(i, count - 1);
      valid[i] = i < count ? -1 : 0;
      packet.ray.dir_x[i] = x[k];
      packet.ray.dir_y[i] = y[k];
      packet.ray.dir_z[i] = z[k];
      packet.ray.tfar[i] = Ray::kInfinity;
    }
    forget_hits(packet.hit);
    intersect16(valid, tree.scene, &packet, Order::kCoherent);
    for (std::size_t i = 0; i < count; ++i)
      hits[begin + i] = packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID
                            ? Hit{}
                            : hit_of(tree, packet.hit.primID[i], {packet.hit.u[i], packet.hit.v[i]}, packet.ray.tfar[i],
                                     {origin, {x[begin + i], y[begin + i], z[begin + i]}});
  }
}

Hit RayScene::hit_of(const Tree& tree, unsigned triangle, glm::vec2 barycentric, float t, const Ray& ray) const {
  Hit hit;
  hit.face = tree.face_of_triangle[triangle];
  const Face& face = faces_.faces[static_cast<std::size_t>(hit.face)];
  hit.side = glm::dot(ray.direction, face.normal) < 0 ? 0 : 1;
  hit.t = t;
  hit.st = face.parameters(tree.part_of_triangle[triangle], barycentric);
  const float u = barycentric.x, v = barycentric.y;
  if (std::min({u, v, 1 - u - v}) < tree.edge_share[triangle]) settle(tree, ray, hit);
  return hit;
}

void RayScene::occluded(What what, std::span<const Ray> rays, std::span<std::uint8_t> blocked, Order order) const {
  const Tree& tree = *trees_[static_cast<std::size_t>(what)];
  alignas(64) int valid[kWidth];
  RTCRay16 packet;
  for (std::size_t begin = 0; begin < rays.size(); begin += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - begin);
    load_rays(rays.subspan(begin, count), packet, valid);
    occluded16(valid, tree.scene, &packet, order);
    for (std::size_t i = 0; i < count; ++i) blocked[begin + i] = packet.tfar[i] < 0;
  }
}

void RayScene::occluded_along(glm::vec3 direction, const float* x, const float* y, const float* z, What what,
                              std::span<std::uint8_t> blocked) const {
  const Tree& tree = *trees_[static_cast<std::size_t>(what)];
  alignas(64) int valid[kWidth];
  RTCRay16 packet;
  const Ray ray{{}, direction};
  load_rays({&ray, 1}, packet, valid);
  for (std::size_t begin = 0; begin < blocked.size(); begin += kWidth) {
    const std::size_t count = std::min(kWidth, blocked.size() - begin);
    for (std::size_t i = 0; i < kWidth; ++i) {
      const std::size_t k = begin + std::min(i, count - 1);
      valid[i] = i < count ? -1 : 0;
      packet.org_x[i] = x[k];
      packet.org_y[i] = y[k];
      packet.org_z[i] = z[k];
      packet.tfar[i] = ray.t_far;
    }
    occluded16(valid, tree.scene, &packet, Order::kCoherent);
    for (std::size_t i = 0; i < count; ++i) blocked[begin + i] = packet.tfar[i] < 0;
  }
}

void RayScene::transmittance(std::span<const Ray> rays, std::span<float> shares, Order order) const {
  constexpr int kMaximumCrossings = 64;
  std::fill(shares.begin(), shares.end(), 1.f);
  if (!has_openings_ || rays.empty()) return;
  std::vector<Ray> rest(rays.begin(), rays.end());
  std::vector<std::size_t> index(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) index[i] = i;
  std::vector<Hit> hits(rays.size());
  for (int crossing = 0; crossing < kMaximumCrossings && !rest.empty(); ++crossing) {
    intersect(What::kOpenings, rest, {hits.data(), rest.size()}, order);
    std::size_t kept = 0;
    for (std::size_t k = 0; k < rest.size(); ++k) {
      const Hit& hit = hits[k];
      if (hit.face < 0) continue;
      const float length = glm::length(rest[k].direction);
      shares[index[k]] *= opening_transmittance(hit.face, rest[k].direction / length);
      rest[kept] = rest[k];
      rest[kept].t_near = hit.t * (1 + 4e-6f) + 0.1f * faces_.ray_offset() / length;
      index[kept++] = index[k];
    }
    rest.resize(kept);
  }
}

float RayScene::opening_transmittance(int face_index, glm::vec3 direction) const {
  const Face& face = faces_.faces[static_cast<std::size_t>(face_index)];
  return openings_[materials_[face.material].opening].transmittance_at(glm::dot(face.normal, direction));
}

float RayScene::transmittance(const Ray& ray) const {
  float share = 1;
  transmittance({&ray, 1}, {&share, 1});
  return share;
}

}  // namespace transom
