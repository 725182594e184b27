#include "transom/survey.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "streams.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kRaysPerSource = 256;         // from each face or point that light starts at
constexpr std::uint32_t kRaysPerSlot = 16;  // of a slot or a side that nothing has seen
constexpr int kLeastSeen = 2;               // of them on patches indoors: one may have slipped through an edge
constexpr int kReflections = 6;             // followed to find what lies indoors
constexpr float kHollowShare = 0.25f;       // of a source's rays on the inside of a solid: then it is a room
constexpr double kOutdoorPatchCount = 400;  // at most about so many patches outdoors

char side_bit(Side side) {
  return static_cast<char>(1 << side);
}

glm::vec3 sample_sphere(glm::vec2 u) {
  const float z = 1 - 2 * u.x, r = std::sqrt(std::max(0.f, 1 - z * z));
  return {r * std::cos(2 * kPi * u.y), r * std::sin(2 * kPi * u.y), z};
}

glm::vec3 leave(const Faces& faces, int face, Side side, glm::vec2 st, glm::vec2 u, glm::vec3& direction) {
  const Face& f = faces.faces[face];
  const glm::vec3 normal = side == 0 ? f.normal : -f.normal;
  direction = frame_from_normal(normal) * sample_cosine_hemisphere(u);
  return f.position(st) + faces.ray_offset() * normal;
}

class Surveyor {
 public:
  Surveyor(const SceneGeometry& scene, const RayScene& rays, Faces& faces, std::uint32_t seed)
      : scene_(scene), ray_scene_(rays), faces_(faces), seed_(seed), is_indoors_(faces.faces.size(), 0) {}

  std::vector<char> run() {
    for (const PointSource& source : scene_.point_sources) {
      begin_source(2 * faces_.faces.size() + static_cast<std::size_t>(&source - scene_.point_sources.data()));
      const SobolSequence points = next_sequence();
      for (std::uint32_t i = 0; i < kRaysPerSource; ++i)
        rays_.push_back({glm::vec3(source.position - faces_.origin), sample_sphere(points.point2(i))});
      follow();
    }
    for (std::size_t f = 0; f < faces_.faces.size(); ++f) {
      const Material& material = scene_.materials[faces_.faces[f].material];
      const bool is_opening = material.opening >= 0;
      if (!is_opening && material.luminance == glm::vec3(0)) continue;
      // Room sides of openings; both sides of emitters, since either may look into a room.
      for (Side side = is_opening ? 1 : 0; side < 2; ++side) {
        begin_source(2 * f + static_cast<std::size_t>(side));
        if (!is_opening && faces_.is_inside_solid(static_cast<int>(f), side)) {
          // A luminous solid may be a room with luminous walls: its inside must speak for itself.
          if (!sees_only_itself(static_cast<int>(f))) continue;
        }
        is_indoors_[f] |= side_bit(side);
        start_from(static_cast<int>(f), side);
        follow();
      }
    }
    return is_indoors_;
  }

 private:
  SobolSequence next_sequence() { return SobolSequence(hash_seed(source_seed_, ++sequence_)); }

  // Each source has samples of its own: one less changes nothing that others find.
  void begin_source(std::uint64_t number) {
    source_seed_ = hash_seed(seed_, number);
    sequence_ = 0;
  }

  void start_from(int face, Side side) {
    const SobolSequence points = next_sequence();
    for (std::uint32_t i = 0; i < kRaysPerSource; ++i) {
      const glm::vec4 u = points.point4(i);
      const glm::vec2 st = faces_.faces[face].is_quad ? glm::vec2(u.z, u.w) : sample_triangle({u.z, u.w});
      Ray ray;
      ray.origin = leave(faces_, face, side, st, {u.x, u.y}, ray.direction);
      rays_.push_back(ray);
    }
  }

  // The component emits everywhere and light from its front leaves the scene: what it lights is its inside.
  bool sees_only_itself(int face) {
    start_from(face, 0);
    trace();
    rays_.clear();
    return std::none_of(hits_.begin(), hits_.end(), [](const Hit& hit) { return hit.face >= 0; });
  }

  void trace() {
    hits_.resize(rays_.size());
    ray_scene_.intersect(RayScene::What::kAll, rays_, hits_);
  }

  void follow() {
    for (int reflection = 0; reflection < kReflections && !rays_.empty(); ++reflection) {
      trace();
      if (reflection == 0) open_hollow();
      const SobolSequence points = next_sequence();
      std::size_t kept = 0;
      for (std::size_t i = 0; i < hits_.size(); ++i) {
        const Hit& hit = hits_[i];
        if (hit.face < 0 || faces_.is_inside_solid(hit.face, hit.side)) continue;
        if (scene_.materials[faces_.faces[hit.face].material].opening >= 0) continue;
        is_indoors_[hit.face] |= side_bit(hit.side);
        Ray next;
        next.origin =
            leave(faces_, hit.face, hit.side, hit.st, points.point2(static_cast<std::uint32_t>(i)), next.direction);
        rays_[kept++] = next;
      }
      rays_.resize(kept);
    }
    rays_.clear();
  }

  void open_hollow() {
    std::vector<int> count(faces_.component_is_solid.size(), 0);
    for (const Hit& hit : hits_)
      if (hit.face >= 0 && faces_.is_inside_solid(hit.face, hit.side)) ++count[faces_.faces[hit.face].component];
    for (std::size_t c = 0; c < count.size(); ++c)
      if (static_cast<float>(count[c]) > kHollowShare * static_cast<float>(hits_.size()))
        faces_.component_is_solid[c] = 0;
  }

  const SceneGeometry& scene_;
  const RayScene& ray_scene_;
  Faces& faces_;
  std::uint32_t seed_, source_seed_ = 0;
  std::uint64_t sequence_ = 0;
  std::vector<char> is_indoors_;
  std::vector<Ray> rays_;
  std::vector<Hit> hits_;
};

}  // namespace

std::vector<char> survey_interior(const SceneGeometry& scene, const RayScene& rays, Faces& faces, std::uint32_t seed) {
  return Surveyor(scene, rays, faces, seed).run();
}

void add_sides_that_see_indoors(const SceneGeometry& scene, const Faces& faces, const RayScene& rays,
                                std::uint32_t seed, std::vector<char>& is_indoors) {
  std::vector<int> unseen;  // sides, as 2 * face + side
  for (int side = 0; side < 2 * static_cast<int>(faces.faces.size()); ++side) {
    const Face& face = faces.faces[static_cast<std::size_t>(side / 2)];
    if (scene.materials[face.material].opening < 0 && !faces.is_inside_solid(side / 2, side % 2) &&
        !(is_indoors[side / 2] & side_bit(side % 2)))
      unseen.push_back(side);
  }
  for (bool any = true; any;) {
    std::vector<char> sees(unseen.size(), 0);
    parallel_indices(unseen.size(), 64, [&](std::size_t i) {
      const int face = unseen[i] / 2, side = unseen[i] % 2;
      const Face& own_face = faces.faces[static_cast<std::size_t>(face)];
      const SobolSequence points(
          place_seed(seed, kSurveyStream,
                     {own_face.corner[0] + own_face.corner[2], side == 0 ? own_face.normal : -own_face.normal}));
      Ray own[kRaysPerSlot];
      Hit hits[kRaysPerSlot];
      for (std::uint32_t k = 0; k < kRaysPerSlot; ++k) {
        const glm::vec4 u = points.point4(k);
        const glm::vec2 st = own_face.is_quad ? glm::vec2(u.z, u.w) : sample_triangle({u.z, u.w});
        own[k].origin = leave(faces, face, side, st, {u.x, u.y}, own[k].direction);
      }
      rays.intersect(RayScene::What::kAll, own, hits);
      int seen = 0;
      for (const Hit& hit : hits) {
        if (hit.face < 0) return;  // outdoors
        seen += (is_indoors[hit.face] & side_bit(hit.side)) != 0;
      }
      sees[i] = seen >= kLeastSeen;
    });
    std::size_t kept = 0;
    for (std::size_t i = 0; i < unseen.size(); ++i) {
      if (sees[i])
        is_indoors[unseen[i] / 2] |= side_bit(unseen[i] % 2);
      else
        unseen[kept++] = unseen[i];
    }
    any = kept < unseen.size();
    unseen.resize(kept);
  }
}

std::vector<int> slots_that_see(const std::vector<char>& is_interior, const std::vector<int>& patch_of_slot,
                                const LightMesh& mesh, const RayScene& rays, std::uint32_t seed) {
  std::vector<char> sees(patch_of_slot.size(), 0);
  parallel_indices(patch_of_slot.size(), 64, [&](std::size_t i) {
    const int index = static_cast<int>(i);
    const Slot slot = mesh.slot(index);
    if (patch_of_slot[i] >= 0 || mesh.faces().is_inside_solid(slot.face, slot.side)) return;
    const SobolSequence points(hash_seed(seed, i));
    Ray own[kRaysPerSlot];
    Hit hits[kRaysPerSlot];
    for (std::uint32_t k = 0; k < kRaysPerSlot; ++k) {
      const glm::vec4 u = points.point4(k);
      const Node place = mesh.place_on(index, {u.z, u.w});
      own[k] = {place.position, frame_from_normal(place.normal) * sample_cosine_hemisphere({u.x, u.y})};
    }
    rays.intersect(RayScene::What::kAll, own, hits);
    int seen = 0;
    for (const Hit& hit : hits) {
      if (hit.face < 0) return;  // outdoors
      seen += is_interior[mesh.slot_at(hit)];
    }
    sees[i] = seen >= kLeastSeen;
  });
  std::vector<int> found;
  for (std::size_t i = 0; i < sees.size(); ++i)
    if (sees[i]) found.push_back(static_cast<int>(i));
  return found;
}

std::vector<float> choose_edges(const Faces& faces, const std::vector<char>& is_indoors, float maximum_edge,
                                float outdoor_edge, int target_patch_count) {
  double indoors = 0, outdoors = 0;
  for (std::size_t f = 0; f < faces.faces.size(); ++f) {
    const double sides = faces.is_inside_solid(static_cast<int>(f), 1) ? 1 : 2;
    (is_indoors[f] ? indoors : outdoors) += sides * faces.faces[f].area;
  }
  if (indoors == 0) std::swap(indoors, outdoors);
  const double edge = maximum_edge > 0 ? maximum_edge : std::sqrt(indoors / target_patch_count);
  const double edge_outdoors =
      std::max(edge, outdoor_edge > 0 ? outdoor_edge : std::sqrt(outdoors / kOutdoorPatchCount));
  std::vector<float> edges;
  edges.reserve(is_indoors.size());
  for (const char indoor : is_indoors)
    edges.push_back(static_cast<float>(indoor || indoors == 0 ? edge : edge_outdoors));
  return edges;
}

}  // namespace transom
