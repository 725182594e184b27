#include "transom/ray_scene.h"

#include <algorithm>

#include "embree_device.h"
#include "transom/error.h"

namespace transom {
namespace {

constexpr std::size_t kWidth = 16;

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

}  // namespace

struct RayScene::Tree {
  RTCScene scene = nullptr;
  std::vector<int> face_of_triangle;
  std::vector<std::uint8_t> part_of_triangle;  // 0: corners a, b, c; 1: corners a, c, d
  ~Tree() {
    if (scene) rtcReleaseScene(scene);
  }
};

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
        corners.insert(corners.end(), {face.corner[0], face.corner[1 + part], face.corner[2 + part]});
        tree->face_of_triangle.push_back(static_cast<int>(f));
        tree->part_of_triangle.push_back(static_cast<std::uint8_t>(part));
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
                                     rays[begin + i].direction);
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
                                     {x[begin + i], y[begin + i], z[begin + i]});
  }
}

Hit RayScene::hit_of(const Tree& tree, unsigned triangle, glm::vec2 barycentric, float t, glm::vec3 direction) const {
  const int index = tree.face_of_triangle[triangle];
  const Face& face = faces_.faces[static_cast<std::size_t>(index)];
  return {index, glm::dot(direction, face.normal) < 0 ? 0 : 1, t,
          face.parameters(tree.part_of_triangle[triangle], barycentric)};
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
