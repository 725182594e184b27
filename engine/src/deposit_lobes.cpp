// Lobes of panels on points and elements: the part of an element inside a shaft is exact, what stands in the way is
// found by rays.
#include <algorithm>
#include <array>
#include <cmath>

#include "transom/deposit.h"
#include "transom/first_bounce.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr std::size_t kGrain = 4;
constexpr std::uint32_t kRaysPerPart = 4;          // to a part of an element, to find out whether all of it is lit
constexpr std::uint32_t kRefinedRaysPerPart = 32;  // where some of it is

// The part of an element inside a shaft.
struct LitPart {
  int element;
  std::vector<glm::vec3> corner;
  float area_share;  // of the element
};

// Point of a convex polygon, uniform by area for each of the fan's triangles alike.
glm::vec3 point_of(const std::vector<glm::vec3>& corner, glm::vec2 u) {
  float total = 0;
  const auto area = [&](std::size_t k) {
    return glm::length(glm::cross(corner[k - 1] - corner[0], corner[k] - corner[0]));
  };
  for (std::size_t k = 2; k < corner.size(); ++k) total += area(k);
  float rest = u.x * total;
  std::size_t k = 2;
  for (; k + 1 < corner.size() && rest >= area(k); ++k) rest -= area(k);
  const glm::vec2 b = sample_triangle({std::clamp(rest / std::max(area(k), 1e-30f), 0.f, 1.f), u.y});
  return corner[0] + b.x * (corner[k - 1] - corner[0]) + b.y * (corner[k] - corner[0]);
}

struct Box {
  glm::vec3 low, high;
};

Box box_of(const std::array<glm::vec3, 4>& corner) {
  return {glm::min(glm::min(corner[0], corner[1]), glm::min(corner[2], corner[3])),
          glm::max(glm::max(corner[0], corner[1]), glm::max(corner[2], corner[3]))};
}

}  // namespace

// Lifted corners of the elements of a slot.
std::vector<std::vector<glm::vec3>> DirectLight::element_outlines(int slot_index, const Corners& corners) const {
  std::vector<std::vector<glm::vec3>> outlines(static_cast<std::size_t>(mesh_.elements_per_slot()));
  const Slot slot = mesh_.slot(slot_index);
  if (!mesh_.grid(slot.face).is_quad) {
    const Face& face = mesh_.faces().faces[static_cast<std::size_t>(slot.face)];
    const glm::vec3 lift = mesh_.faces().ray_offset() * (slot.side == 0 ? face.normal : -face.normal);
    for (std::size_t e = 0; e < outlines.size(); ++e) {
      const ElementShape shape = element_shape(mesh_, slot_index * mesh_.elements_per_slot() + static_cast<int>(e));
      for (int k = 0; k < shape.corner_count; ++k) outlines[e].push_back(shape.corner[k] + lift);
    }
    return outlines;
  }
  const auto edge = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<float>(outlines.size()))));
  const auto place = [&](std::size_t i, std::size_t j) {
    const float u = static_cast<float>(i) / static_cast<float>(edge),
                v = static_cast<float>(j) / static_cast<float>(edge);
    return (1 - v) * ((1 - u) * corners[0] + u * corners[1]) + v * ((1 - u) * corners[3] + u * corners[2]);
  };
  for (std::size_t e = 0; e < outlines.size(); ++e) {
    const std::size_t i = e % edge, j = e / edge;
    outlines[e] = {place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)};
  }
  return outlines;
}

void DirectLight::shaft_transmission(const Beam& lobe, std::span<const glm::vec3> points,
                                     std::span<float> share) const {
  thread_local std::vector<Ray> rays;
  thread_local std::vector<std::size_t> point;  // of each ray
  thread_local std::vector<float> arriving;     // along each that meets nothing
  thread_local std::vector<std::uint8_t> blocked;
  std::fill(share.begin(), share.end(), 0.f);
  if (!lobe.shafts) return;
  rays.clear();
  point.clear();
  arriving.clear();
  find_rays_to_panels(*lobe.shafts, points, mesh_.faces().ray_offset(), [&](std::size_t i, const Ray& ray, float left) {
    rays.push_back(ray);
    point.push_back(i);
    arriving.push_back(left);
  });
  blocked.resize(rays.size());
  rays_.occluded(RayScene::What::kAll, rays, blocked, RayScene::Order::kCoherent);
  for (std::size_t k = 0; k < rays.size(); ++k)
    if (!blocked[k] && share[point[k]] == 0) share[point[k]] = arriving[k];
}

// Receivers whose corners' box a shaft may meet, on the side that faces the lobe.
std::vector<std::size_t> DirectLight::reached_by_lobe(const Beam& lobe, const Receivers& receivers) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < receivers.slots.size() && !lobe.shafts->empty(); ++i) {
    if (mesh_.is_cluster(receivers.slots[i]) || glm::dot(lobe.direction_to_source, receivers.normals[i]) <= 0) continue;
    const Box box = box_of(receivers.corners[i]);
    if (std::any_of(lobe.shafts->begin(), lobe.shafts->end(),
                    [&](const LightShaft& shaft) { return shaft.may_meet(box.low, box.high); }))
      found.push_back(i);
  }
  return found;
}

// Adds a lobe to the light of elements, by receiver.
void DirectLight::add_lobe(const Beam& lobe, const Receivers& receivers, std::vector<std::vector<glm::vec3>>& sum,
                           BeamPlan& plan) const {
  const std::vector<std::size_t> candidates = reached_by_lobe(lobe, receivers);
  plan.patches += static_cast<int>(candidates.size());
  plan.beams += !candidates.empty();
  const auto per_slot = static_cast<std::size_t>(mesh_.elements_per_slot());
  parallel_indices(candidates.size(), kGrain, [&](std::size_t k) {
    const std::size_t i = candidates[k];
    std::vector<float> mean;
    lobe_on_slot(lobe, receivers.slots[i], receivers.corners[i], mean);
    const glm::vec3 full = lobe.normal_illuminance * glm::dot(lobe.direction_to_source, receivers.normals[i]);
    sum[i].resize(per_slot, glm::vec3(0));
    for (std::size_t e = 0; e < per_slot; ++e) sum[i][e] += mean[e] * full;
  });
}

// Mean share of a lobe on each element of a slot.
void DirectLight::lobe_on_slot(const Beam& lobe, int slot_index, const Corners& corners,
                               std::vector<float>& mean) const {
  mean.assign(static_cast<std::size_t>(mesh_.elements_per_slot()), 0.f);
  const std::vector<std::vector<glm::vec3>> outlines = element_outlines(slot_index, corners);
  const auto [low, high] = box_of(corners);
  std::vector<LitPart> parts;
  std::vector<Ray> rays;
  std::vector<std::uint8_t> blocked;
  for (const LightShaft& shaft : *lobe.shafts) {
    if (!shaft.may_meet(low, high)) continue;
    parts.clear();
    const bool is_whole =
        std::all_of(corners.begin(), corners.end(), [&](glm::vec3 corner) { return shaft.holds(corner); });
    for (std::size_t e = 0; e < outlines.size(); ++e) {
      if (is_whole) {
        parts.push_back({static_cast<int>(e), outlines[e], 1.f});
        continue;
      }
      std::vector<glm::vec3> inside = clip_to_shaft(outlines[e], shaft);
      const double share = inside.empty() ? 0 : polygon_area(inside) / std::max(polygon_area(outlines[e]), 1e-30);
      if (share > 0)
        parts.push_back({static_cast<int>(e), std::move(inside), static_cast<float>(std::min(share, 1.0))});
    }
    if (parts.empty()) continue;
    const auto cast = [&](std::uint32_t count) {
      rays.clear();
      for (const LitPart& part : parts) {
        const SobolSequence sequence(
            hash_seed(seed_, static_cast<std::uint64_t>(slot_index) * mesh_.elements_per_slot() + part.element));
        for (std::uint32_t i = 0; i < count; ++i)
          rays.push_back(shaft.ray_to_panel(point_of(part.corner, sequence.point2(i)), mesh_.faces().ray_offset()));
      }
      blocked.resize(rays.size());
      rays_.occluded(RayScene::What::kAll, rays, blocked, RayScene::Order::kCoherent);
    };
    std::uint32_t count = kRaysPerPart;
    cast(count);
    const auto dark = std::count(blocked.begin(), blocked.end(), 1);
    if (dark == static_cast<std::ptrdiff_t>(blocked.size())) continue;
    if (dark > 0) cast(count = kRefinedRaysPerPart);
    for (std::size_t k = 0; k < parts.size(); ++k) {
      const auto first = blocked.begin() + static_cast<std::ptrdiff_t>(k * count);
      const auto seen = std::count(first, first + static_cast<std::ptrdiff_t>(count), 0);
      mean[static_cast<std::size_t>(parts[k].element)] +=
          shaft.share * parts[k].area_share * static_cast<float>(seen) / static_cast<float>(count);
    }
  }
}

}  // namespace transom
