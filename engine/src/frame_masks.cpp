// Beams of a picture by stencil volumes: shadows of the sun, and shafts of lobes less what stands in them.
#include "frame_masks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "frame_beams.h"
#include "transom/parallel.h"

namespace transom {
namespace {

using Triangle = std::array<glm::vec3, 3>;

// The part of a triangle below a plane's distance, as triangles; whole where it is all there, to its very corners.
void keep_behind(const Triangle& triangle, glm::vec4 plane, float margin, std::vector<Triangle>& kept) {
  float depth[3];
  for (int k = 0; k < 3; ++k) depth[k] = glm::dot(plane, glm::vec4(triangle[k], 1));
  if (std::max({depth[0], depth[1], depth[2]}) <= margin) return;
  if (std::min({depth[0], depth[1], depth[2]}) >= -margin) {
    kept.push_back(triangle);
    return;
  }
  std::vector<glm::vec3> part;
  for (int k = 0; k < 3; ++k) {
    const glm::vec3 a = triangle[k], b = triangle[(k + 1) % 3];
    const float at_a = depth[k], at_b = depth[(k + 1) % 3];
    if (at_a >= 0) part.push_back(a);
    if ((at_a >= 0) != (at_b >= 0)) part.push_back(a + at_a / (at_a - at_b) * (b - a));
  }
  for (std::size_t k = 2; k < part.size(); ++k) kept.push_back({part[0], part[k - 1], part[k]});
}

VolumeCasters casters_of(const std::vector<Triangle>& triangles, bool are_solids) {
  std::vector<glm::vec3> vertices;
  std::vector<glm::uvec3> indices;
  for (const Triangle& triangle : triangles) {
    const auto base = static_cast<unsigned>(vertices.size());
    vertices.insert(vertices.end(), triangle.begin(), triangle.end());
    indices.push_back({base, base + 1, base + 2});
  }
  return VolumeCasters(std::move(vertices), indices, are_solids);
}

}  // namespace

// The pixels that a beam may light, and their points. A margin of a pixel holds the samples around these.
VolumeRange FrameRenderer::lit_range(const SeenBeam& seen) const {
  const int width = samples_->view.width, height = samples_->view.height;
  VolumeRange range{width, height, 0, 0, {}};
  const auto take = [&](const BeamGroup& group, const BeamPoint& first, const BeamPoint& last) {
    if (!seen.may_light(group)) return;
    const int y = first.pixel / width;
    range.left = std::min(range.left, std::max(first.pixel % width - 1, 0));
    range.right = std::max(range.right, std::min(last.pixel % width + 2, width));
    range.top = std::min(range.top, std::max(y - 1, 0));
    range.bottom = std::max(range.bottom, std::min(y + 2, height));
    const glm::vec3 margin = glm::max(group.high - group.low, glm::vec3(engine_.faces().ray_offset()));
    range.boxes.emplace_back(group.low - margin, group.high + margin);
  };
  for (const ViewSamples::Row& row : samples_->rows) {
    for (const BeamGroup& group : row.centre_groups)
      take(group, samples_->centre[group.first], samples_->centre[group.last - 1]);
    for (const ViewSamples::Part& part : row.parts) take(part, row.fine[part.first], row.fine[part.last - 1]);
  }
  return range;
}

void FrameRenderer::make_volumes() {
  if (volumes_) return;
  std::vector<glm::vec3> vertices;
  std::vector<glm::uvec3> opaque;
  std::vector<std::vector<glm::uvec3>> openings;
  std::map<std::tuple<int, int, int, int>, std::size_t> group_of;
  for (const Face& face : engine_.faces().faces) {
    const int opening = engine_.scene().materials[face.material].opening;
    std::vector<glm::uvec3>* list = &opaque;
    if (opening >= 0) {
      const glm::ivec3 n(glm::round(1e3f * face.normal));
      const auto [entry, is_new] = group_of.try_emplace({opening, n.x, n.y, n.z}, openings.size());
      if (is_new) {
        openings.emplace_back();
        volume_groups_.push_back({opening, face.normal});
      }
      list = &openings[entry->second];
    }
    const unsigned base = static_cast<unsigned>(vertices.size());
    vertices.insert(vertices.end(), face.corners().begin(), face.corners().end());
    list->push_back({base, base + 1, base + 2});
    if (face.is_quad) list->push_back({base, base + 2, base + 3});
  }
  context_ = std::make_unique<GlContext>();
  volumes_ = std::make_unique<ShadowVolumes>(*context_, vertices, opaque, openings);
}

// All faces, openings too, as far as they are on the room side of a plane of panels: what a lobe may meet first.
const VolumeCasters& FrameRenderer::casters_behind(glm::vec4 plane) {
  const float same = engine_.faces().ray_offset();
  for (const auto& [known, casters] : behind_planes_)
    if (glm::distance(glm::vec3(known), glm::vec3(plane)) < 1e-5f && std::abs(known.w - plane.w) < same) return casters;
  std::vector<Triangle> kept;
  for (const Face& face : engine_.faces().faces)
    for (int part = 0; part < (face.is_quad ? 2 : 1); ++part)
      keep_behind({face.corner[0], face.corner[1 + part], face.corner[2 + part]}, plane, same, kept);
  behind_planes_.emplace_back(plane, casters_of(kept, true));
  return behind_planes_.back().second;
}

// Share of a beam at each sample: lit or not by the stencil, times the transmittance of the openings that it counted.
// Returns the number of passes.
int FrameRenderer::render_mask(const Beam& beam, const View& view, const Masks& masks, std::vector<float>& share) {
  make_volumes();
  const glm::dvec3 origin = engine_.faces().origin;
  const VolumeCamera camera{view.position - origin, view.target - origin,       view.up,
                            view.vertical_fov_rad,  view.width * masks.scale(), view.height * masks.scale()};
  if (masks.is_empty()) {
    share.clear();
    return 0;
  }
  if (beam.opening >= 0) return render_shafts(beam, camera, masks, share);
  const BeamMask mask = volumes_->render(camera, glm::dvec3(beam.direction_to_source), masks.range());
  std::vector<float> transmittance;
  for (const VolumeGroup& group : volume_groups_)
    transmittance.push_back(
        engine_.scene().openings[group.opening].transmittance_at(glm::dot(group.normal, beam.direction_to_source)));
  share.resize(mask.shadowed.size());
  parallel_indices(share.size(), 4096, [&](std::size_t i) {
    share[i] = mask.shadowed[i] ? 0.f : 1.f;
    for (std::size_t g = 0; g < transmittance.size() && share[i] > 0; ++g)
      for (int n = 0; n < mask.crossings[g][i]; ++n) share[i] *= transmittance[g];
  });
  return volumes_->pass_count();
}

// The same for a lobe: two passes for its shafts behind each plane of panels, and for each share that panes before it
// leave.
int FrameRenderer::render_shafts(const Beam& lobe, const VolumeCamera& camera, const Masks& masks,
                                 std::vector<float>& share) {
  const VolumeRange range = masks.range();
  share.assign(range.pixel_count(), 0.f);
  int passes = 0;
  const glm::dvec3 source(lobe.direction_to_source);
  std::vector<const LightShaft*> rest;
  for (const LightShaft& shaft : *lobe.shafts) rest.push_back(&shaft);
  while (!rest.empty()) {
    const LightShaft& first = *rest.front();
    const auto is_alike = [&](const LightShaft* shaft) {
      return shaft->share == first.share && glm::distance(shaft->plane, first.plane) < engine_.faces().ray_offset();
    };
    std::vector<Triangle> lit;
    for (const LightShaft* shaft : rest)
      for (std::size_t k = 2; is_alike(shaft) && k < shaft->corner.size(); ++k)
        lit.push_back({shaft->corner[0], shaft->corner[k - 1], shaft->corner[k]});
    const std::vector<std::uint8_t> inside = volumes_->count(camera, source, casters_of(lit, false), range);
    passes += volumes_->pass_count();
    if (std::any_of(inside.begin(), inside.end(), [](std::uint8_t n) { return n > 0; })) {
      const std::vector<std::uint8_t> blocked = volumes_->count(camera, source, casters_behind(first.plane), range);
      passes += volumes_->pass_count();
      for (std::size_t i = 0; i < share.size(); ++i)
        if (inside[i] && !blocked[i]) share[i] = first.share;
    }
    std::erase_if(rest, is_alike);
  }
  return passes;
}

}  // namespace transom
