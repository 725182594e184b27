#include "transom/panels.h"

#include <numbers>

#include "transom/sampling.h"

namespace transom {

Panels::Panels(const Faces& faces, const std::vector<Material>& materials, const std::vector<OpeningGroup>& openings)
    : openings_(openings), panel_of_face_(faces.faces.size(), -1) {
  for (std::size_t f = 0; f < faces.faces.size(); ++f) {
    const int opening = materials[static_cast<std::size_t>(faces.faces[f].material)].opening;
    if (opening < 0 || !openings[static_cast<std::size_t>(opening)].panel) continue;
    panel_of_face_[f] = static_cast<int>(panels_.size());
    panels_.push_back({static_cast<int>(f), opening, bin_count_});
    bin_count_ += openings[static_cast<std::size_t>(opening)].panel->bins.count();
  }
}

std::vector<GatherRow> gather_outside(const Panels& panels, const Panel& panel, const LightMesh& mesh,
                                      const RayScene& ray_scene, const SkyBinIndex& sky, int rays_per_bin,
                                      std::uint32_t seed) {
  const PanelFrame& frame = panels.frame(panel);
  const Face& face = mesh.faces().faces[static_cast<std::size_t>(panel.face)];
  const auto count = static_cast<std::size_t>(rays_per_bin);
  std::vector<GatherRow> rows(static_cast<std::size_t>(frame.bins.count()));
  std::vector<Ray> rays(count);
  std::vector<Hit> hits(count);
  std::vector<float> transmitted(count);
  for (int bin = 0; bin < frame.bins.count(); ++bin) {
    const SobolSequence points(hash_seed(seed, static_cast<std::uint64_t>(bin)));
    for (std::size_t i = 0; i < count; ++i) {
      const glm::vec4 u = points.point4(static_cast<std::uint32_t>(i));
      const glm::vec2 st = face.is_quad ? glm::vec2(u.z, u.w) : sample_triangle({u.z, u.w});
      rays[i] = {mesh.lifted_position(panel.face, 0, st), -frame.to_world(frame.bins.sample(bin, {u.x, u.y}))};
    }
    ray_scene.intersect(RayScene::What::kOpaque, rays, hits);
    for (std::size_t i = 0; i < count; ++i)
      if (hits[i].face >= 0) rays[i].t_far = hits[i].t - mesh.faces().ray_offset();
    ray_scene.transmittance(rays, transmitted);
    const float weight = frame.bins.projected_solid_angle(bin) / static_cast<float>(rays_per_bin);
    GatherRow& row = rows[static_cast<std::size_t>(bin)];
    for (std::size_t i = 0; i < count; ++i) {
      if (transmitted[i] <= 0) continue;
      if (hits[i].face < 0)
        row.sky.push_back({sky(rays[i].direction), weight * transmitted[i]});
      else if (!mesh.faces().is_inside_solid(hits[i].face, hits[i].side))
        row.through.push_back({mesh.slot_at(hits[i]), weight * transmitted[i] / std::numbers::pi_v<float>});
    }
    merge_shares(row.sky);
    merge_shares(row.through);
  }
  return rows;
}

}  // namespace transom
