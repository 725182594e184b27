#include "transom/first_bounce.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "transom/closed_form.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kAdjacent = 3;         // diameters below which an element needs its closed form
constexpr float kRaysPerShare = 2000;  // rays to an element for each 1 of form factor
constexpr int kMostRays = 64;          // to one element

struct Connection {
  Ray ray;
  glm::vec3 irradiance;
};

// Lifted point of an element, the i-th of a sequence that fills it evenly [Roberts 2018, the R2 sequence].
glm::vec3 point_of(const ElementShape& shape, int i) {
  const float u = std::fmod(0.5f + 0.7548776662f * static_cast<float>(i), 1.f),
              v = std::fmod(0.5f + 0.5698402910f * static_cast<float>(i), 1.f);
  const glm::vec3* c = shape.corner;
  if (shape.corner_count == 0) return shape.middle;
  if (shape.corner_count == 4) {
    const glm::vec3 lift = shape.middle - 0.25f * (c[0] + c[1] + c[2] + c[3]);
    return (1 - u) * (1 - v) * c[0] + u * (1 - v) * c[1] + u * v * c[2] + (1 - u) * v * c[3] + lift;
  }
  const glm::vec2 b = u + v > 1 ? glm::vec2(1 - u, 1 - v) : glm::vec2(u, v);
  const glm::vec3 lift = shape.middle - (c[0] + c[1] + c[2]) / 3.f;
  return c[0] + b.x * (c[1] - c[0]) + b.y * (c[2] - c[0]) + lift;
}

}  // namespace

ElementShape element_shape(const LightMesh& mesh, int element_index) {
  const Node middle = mesh.middle_of_element(element_index);
  ElementShape shape;
  shape.middle = middle.position;
  shape.normal = middle.normal;
  shape.area = mesh.element_area(element_index);
  if (mesh.is_cluster(element_index / mesh.elements_per_slot())) return shape;
  const Slot slot = mesh.slot(element_index / mesh.elements_per_slot());
  const int element = element_index % mesh.elements_per_slot();
  const bool is_quad = mesh.grid(slot.face).is_quad;
  shape.corner_count = is_quad ? 4 : 3;
  const glm::vec2 quad_corner[4]{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, triangle_corner[3]{{0, 0}, {1, 0}, {0, 1}};
  for (int k = 0; k < shape.corner_count; ++k) {
    const glm::vec2 local = is_quad ? quad_corner[k] : triangle_corner[k];
    // In a triangle's grid every second cell is turned; its corners keep their sense, since it is turned by half a
    // circle.
    const int place = slot.side == 0 ? k : shape.corner_count - 1 - k;
    shape.corner[place] =
        mesh.faces().faces[slot.face].position(mesh.element_parameters(slot.face, slot.cell, element, local));
  }
  return shape;
}

float element_share(glm::vec3 point, glm::vec3 normal, const ElementShape& shape) {
  const glm::vec3 to_element = shape.middle - point;
  const float distance2 = glm::dot(to_element, to_element);
  if (shape.corner_count == 0) {  // as a disc of that area, seen along its axis
    const float facing = glm::dot(to_element, normal), away = -glm::dot(to_element, shape.normal);
    if (facing <= 0 || away <= 0) return 0;
    return shape.area * facing * away / (distance2 * (kPi * distance2 + shape.area));
  }
  if (distance2 <= kAdjacent * kAdjacent * 2 * shape.area)
    return point_to_polygon(point, normal, {shape.corner, static_cast<std::size_t>(shape.corner_count)});
  const float cosine = glm::dot(to_element, normal), height = -glm::dot(to_element, shape.normal);
  if (cosine <= 0 || height <= 0) return 0;
  return shape.area * cosine * height / (kPi * distance2 * distance2);
}

FirstBounce::FirstBounce(const LightMesh& mesh, const RayScene& rays, const std::vector<BrightElement>& bright)
    : mesh_(mesh), rays_(rays) {
  for (const BrightElement& element : bright) add(element);
}

void FirstBounce::add(const BrightElement& bright) {
  const int slot_index = bright.element / mesh_.elements_per_slot();
  const float strength = bright.radiosity.x + bright.radiosity.y + bright.radiosity.z;
  if (!(strength > 0)) return;
  if (patches_.empty() || patches_.back().slot != slot_index)
    patches_.push_back({slot_index, pieces_.size(), pieces_.size(), glm::vec3(0), mesh_.normal_of(slot_index),
                        glm::vec3(0), 0, std::sqrt(2 * mesh_.slot_area(slot_index)), mesh_.is_cluster(slot_index)});
  LitPatch& patch = patches_.back();
  pieces_.push_back({element_shape(mesh_, bright.element), bright.radiosity});
  const ElementShape& shape = pieces_.back().shape;
  const float weight = shape.area * strength;
  patch.last_element = pieces_.size();
  patch.centroid = (patch.centroid * patch.weight + shape.middle * weight) / (patch.weight + weight);
  patch.weight += weight;
  patch.flux += shape.area * bright.radiosity;
}

glm::vec3 FirstBounce::irradiance(glm::vec3 point, glm::vec3 normal, Rays precision) const {
  thread_local std::vector<Connection> connections;
  thread_local std::vector<Ray> rays;
  thread_local std::vector<std::uint8_t> blocked;
  thread_local std::vector<float> shares;
  connections.clear();
  const auto connect = [&](glm::vec3 place, glm::vec3 irradiance) {
    connections.push_back({{point, place - point, 0, 1}, irradiance});
  };
  for (const LitPatch& patch : patches_) {
    const glm::vec3 to_patch = patch.centroid - point;
    const float height = -glm::dot(to_patch, patch.normal);
    if (height <= 0 && !patch.is_cluster) continue;  // all of a planar patch is seen from behind
    const float distance2 = glm::dot(to_patch, to_patch);
    if (precision == Rays::kOne && !patch.is_cluster && distance2 > kFarPatch * kFarPatch * patch.size * patch.size) {
      const float cosine = glm::dot(to_patch, normal);
      if (cosine > 0) connect(patch.centroid, patch.flux * (cosine * height / (kPi * distance2 * distance2)));
      continue;
    }
    for (std::size_t k = patch.first_element; k < patch.last_element; ++k) {
      const LitPiece& piece = pieces_[k];
      const float share = element_share(point, normal, piece.shape);
      if (share <= 0) continue;
      const int count =
          precision == Rays::kOne ? 1 : std::clamp(static_cast<int>(std::ceil(kRaysPerShare * share)), 1, kMostRays);
      // Another part of the sequence for each element, so that neighbours do not repeat each other.
      const int first = count == 1 && precision == Rays::kMany ? static_cast<int>(k) : 0;
      for (int i = 0; i < count; ++i)
        connect(point_of(piece.shape, first + i), piece.radiosity * (share / static_cast<float>(count)));
    }
  }
  if (connections.empty()) return glm::vec3(0);
  rays.clear();
  for (const Connection& c : connections) rays.push_back(c.ray);
  blocked.resize(rays.size());
  rays_.occluded(RayScene::What::kOpaque, rays, blocked);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < connections.size(); ++k)
    if (!blocked[k]) {
      rays[kept] = rays[k];
      connections[kept++] = connections[k];
    }
  rays.resize(kept);
  shares.resize(kept);
  rays_.transmittance(rays, shares);
  glm::vec3 sum(0);
  for (std::size_t k = 0; k < kept; ++k) sum += connections[k].irradiance * shares[k];
  return sum;
}

}  // namespace transom
