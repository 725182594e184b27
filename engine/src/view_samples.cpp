#include "transom/view_samples.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kMaximumCrossings = 16;   // openings looked through, one behind another
constexpr float kSameNormal = 0.9995f;  // cosine between normals of one smooth or flat surface
constexpr int kFiner = 2;               // times as many samples an axis say how much of a pixel a surface covers

// A surface at the end of a ray from the camera, or a pane on the way.
struct Seen {
  Hit hit;              // face -1: the sky or the ground
  float through = 1;    // transmittance of the openings in front of it
  int crossings = 0;    // openings in front of it
  glm::vec3 direction;  // of the ray
  bool ends_at_panel = false;
  int panel_bin = -1;  // by which the panel's own light is seen; -1: none, from outdoors
};

struct SeenPane {
  std::size_t ray;
  Seen seen;
};

// From the camera to the first opaque surface, through any number of openings.
class Tracer {
 public:
  Tracer(const Engine& engine, const View& view)
      : engine_(engine), camera_(view), origin_(view.position - engine.faces().origin) {}

  void trace(std::span<const glm::vec2> pixels, std::vector<Seen>& seen, std::vector<SeenPane>& panes) {
    seen.assign(pixels.size(), {});
    panes.clear();
    active_.resize(pixels.size());
    rays_.resize(pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      active_[i] = i;
      rays_[i] = {origin_, camera_.direction(pixels[i])};
      seen[i].direction = rays_[i].direction;
    }
    for (int crossing = 0; crossing <= kMaximumCrossings && !active_.empty(); ++crossing) {
      hits_.resize(active_.size());
      engine_.rays().intersect(RayScene::What::kAll, rays_, hits_, RayScene::Order::kCoherent);
      std::size_t kept = 0;
      for (std::size_t k = 0; k < active_.size(); ++k) {
        Seen& here = seen[active_[k]];
        here.hit = hits_[k];
        if (here.hit.face < 0) continue;
        const Face& face = engine_.faces().faces[here.hit.face];
        const int opening = engine_.scene().materials[face.material].opening;
        if (opening < 0) continue;
        if (engine_.reflectance(here.hit.face, here.hit.side) != glm::vec3(0)) panes.push_back({active_[k], here});
        if (const Panel* panel = engine_.panels().at(here.hit.face)) {  // nothing is seen through it
          here.panel_bin = here.hit.side == 1 ? engine_.panels().bin(*panel, -here.direction) : -1;
          here.ends_at_panel = true;
          continue;
        }
        here.through *= engine_.scene().openings[opening].transmittance_at(glm::dot(face.normal, here.direction));
        ++here.crossings;
        rays_[kept] = rays_[k];
        rays_[kept].t_near = hits_[k].t + engine_.faces().ray_offset();
        active_[kept++] = active_[k];
      }
      active_.resize(kept);
      rays_.resize(kept);
    }
    for (const std::size_t i : active_) seen[i].through = 0;  // too many panes: dark
  }

 private:
  const Engine& engine_;
  const CameraRays camera_;
  const glm::vec3 origin_;
  std::vector<std::size_t> active_;
  std::vector<Ray> rays_;
  std::vector<Hit> hits_;
};

BeamPoint beam_point(const Engine& engine, const Seen& seen, float weight, int pixel, int sample) {
  const Hit& hit = seen.hit;
  if (hit.face < 0 || seen.ends_at_panel) return {glm::vec3(0), glm::vec3(0), -1, 0, pixel, sample};
  const glm::vec3 shading = engine.faces().faces[hit.face].shading_normal(hit.st);
  return {engine.mesh().lifted_position(hit.face, hit.side, hit.st),
          hit.side == 0 ? shading : -shading,
          2 * hit.face + hit.side,
          weight * seen.through,
          pixel,
          sample};
}

// Names what a ray has met: a side of a face, the sky or the ground, and how many openings are in front of it.
std::int64_t name_of(const Seen& seen) {
  const std::int64_t surface = seen.hit.face >= 0 ? 2 * std::int64_t{seen.hit.face} + seen.hit.side + 2
                                                  : (seen.direction.z < 0 ? 1 : 0);
  return surface * (kMaximumCrossings + 2) + seen.crossings;
}

// A sample of a pixel and its share of it.
struct Weighed {
  Seen seen;
  int sample;
  float weight;
};

// The samples of a pixel, weighed so that all that it sees has the share that a finer grid finds of it. What only the
// finer grid has met is one more sample, at the place of the coarser grid that it lies at.
void weigh(const std::vector<Seen>& coarse, const std::vector<Seen>& fine, int samples_per_axis,
           std::vector<Weighed>& weighed) {
  weighed.clear();
  std::vector<std::pair<std::int64_t, int>> count;  // of the finer grid, by what is met
  const auto count_of = [&](std::int64_t name) {
    return std::find_if(count.begin(), count.end(), [&](const auto& entry) { return entry.first == name; });
  };
  for (const Seen& seen : fine) {
    const auto known = count_of(name_of(seen));
    if (known == count.end())
      count.emplace_back(name_of(seen), 1);
    else
      ++known->second;
  }
  const float part = 1 / static_cast<float>(fine.size());
  for (std::size_t k = 0; k < coarse.size(); ++k) {
    const std::int64_t name = name_of(coarse[k]);
    const auto found = count_of(name);
    if (found == count.end()) continue;
    const auto like_it =
        std::count_if(coarse.begin(), coarse.end(), [&](const Seen& other) { return name_of(other) == name; });
    weighed.push_back({coarse[k], static_cast<int>(k),
                       part * static_cast<float>(found->second) / static_cast<float>(like_it)});
  }
  for (std::size_t k = 0; k < fine.size(); ++k) {
    const std::int64_t name = name_of(fine[k]);
    const auto found = count_of(name);
    if (found->second == 0 ||
        std::any_of(coarse.begin(), coarse.end(), [&](const Seen& other) { return name_of(other) == name; }))
      continue;
    const int finer = kFiner * samples_per_axis, column = static_cast<int>(k) % finer / kFiner,
              row = static_cast<int>(k) / finer / kFiner;
    weighed.push_back({fine[k], row * samples_per_axis + column, part * static_cast<float>(found->second)});
    found->second = 0;
  }
}

// What one row of the picture found, in the order of its pixels.
struct RowOfPixels {
  std::vector<BeamPoint> fine, on_panes;
  std::vector<std::vector<Share>> smooth;
  std::vector<ViewSamples::Constant> constant;
  std::vector<ViewSamples::Outlook> outlooks;
  std::vector<ViewSamples::SeenPanel> panels;
};

// Adds a sample to its pixel; gives the point at which beams are tested.
BeamPoint add_sample(const Engine& engine, const Seen& seen, float weight, int pixel, int sample,
                     std::vector<Share>& smooth, RowOfPixels& row) {
  const BeamPoint point = beam_point(engine, seen, weight, pixel, sample);
  if (seen.ends_at_panel) {
    if (seen.panel_bin >= 0) row.panels.push_back({pixel, weight * seen.through, seen.panel_bin});
    return point;
  }
  if (point.surface < 0) {
    row.outlooks.push_back({pixel, weight * seen.through, seen.direction});
    return point;
  }
  const NodeShares shares = engine.shown_at(seen.hit.face, seen.hit.side, seen.hit.st, point.position);
  for (int k = 0; k < shares.count; ++k) smooth.push_back({shares.node[k], point.weight * shares.weight[k]});
  const Material& material = engine.scene().materials[engine.faces().faces[seen.hit.face].material];
  if (material.luminance == glm::vec3(0) && engine.scene().point_sources.empty()) return point;
  if (row.constant.empty() || row.constant.back().pixel != pixel)
    row.constant.push_back({pixel, glm::vec3(0), glm::vec3(0), glm::vec3(0)});
  ViewSamples::Constant& constant = row.constant.back();
  constant.lamps += point.weight / kPi * engine.reflectance(seen.hit.face, seen.hit.side) *
                    engine.direct_light().point_source_illuminance(point.position, point.normal);
  (seen.crossings == 0 ? constant.emitted : constant.emitted_outdoors) += point.weight * material.luminance;
  return point;
}

}  // namespace

glm::vec2 sample_place(int sample, int samples_per_axis) {
  const auto n = static_cast<float>(samples_per_axis);
  const int column = sample % samples_per_axis, row = sample / samples_per_axis;
  const auto within = [n](int cell, int of_cell) {
    return (static_cast<float>(cell) + (static_cast<float>(of_cell) + 0.5f) / n) / n;
  };
  return {within(column, row), within(row, samples_per_axis - 1 - column)};
}

ViewSamples::ViewSamples(const Engine& engine, const View& camera, int samples_per_axis)
    : view(camera), edge_samples(std::max(1, samples_per_axis)) {
  const int width = view.width, height = view.height, s = edge_samples;
  const auto row_count = static_cast<std::size_t>(height), row_size = static_cast<std::size_t>(width);
  const std::size_t pixel_count = row_count * row_size;
  std::vector<Seen> seen(pixel_count);
  std::vector<std::vector<SeenPane>> panes(row_count);
  parallel_indices(row_count, 1, [&](std::size_t y) {
    Tracer tracer(engine, view);
    std::vector<glm::vec2> pixels(row_size);
    for (std::size_t x = 0; x < row_size; ++x) pixels[x] = glm::vec2(x, y) + 0.5f;
    std::vector<Seen> found;
    tracer.trace(pixels, found, panes[y]);
    std::copy(found.begin(), found.end(), seen.begin() + static_cast<std::ptrdiff_t>(y * row_size));
  });

  // Edges: where neighbours see different surfaces.
  const float same_plane = 1e-4f * engine.faces().extent;
  const auto differ = [&](const Seen& a, const Seen& b) {
    if (a.crossings != b.crossings || (a.hit.face < 0) != (b.hit.face < 0)) return true;
    if (a.hit.face < 0) return (a.direction.z < 0) != (b.direction.z < 0);
    if (a.hit.face == b.hit.face) return a.hit.side != b.hit.side;
    const Face &f = engine.faces().faces[a.hit.face], &g = engine.faces().faces[b.hit.face];
    const float cosine = glm::dot(f.normal, g.normal) * (a.hit.side == b.hit.side ? 1.f : -1.f);
    return cosine < kSameNormal ||
           std::abs(glm::dot(f.normal, f.corner[0]) -
                    (a.hit.side == b.hit.side ? 1.f : -1.f) * glm::dot(g.normal, g.corner[0])) > same_plane;
  };
  has_edge.assign(pixel_count, 0);
  if (s > 1)
    parallel_indices(row_count, 4, [&](std::size_t row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < width; ++x)
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            if (x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height)
              has_edge[y * width + x] |= differ(seen[y * width + x], seen[(y + dy) * width + x + dx]);
    });

  // Samples, row by row of the picture.
  centre.resize(pixel_count);
  std::vector<RowOfPixels> rows(row_count);
  parallel_indices(row_count, 1, [&](std::size_t y) {
    RowOfPixels& row = rows[y];
    row.smooth.resize(row_size);
    Tracer tracer(engine, view);
    std::vector<glm::vec2> points;
    std::vector<Seen> found, finer;
    std::vector<SeenPane> panes_found, finer_panes;
    std::vector<Weighed> weighed;
    const auto trace_grid = [&](std::size_t x, int of_axis, std::vector<Seen>& met, std::vector<SeenPane>& panes_met) {
      points.clear();
      for (int k = 0; k < of_axis * of_axis; ++k) points.push_back(glm::vec2(x, y) + sample_place(k, of_axis));
      tracer.trace(points, met, panes_met);
    };
    for (std::size_t x = 0; x < row_size; ++x) {
      const std::size_t p = y * row_size + x;
      const int pixel = static_cast<int>(p);
      if (has_edge[p]) {  // beside the pixel, or in it
        trace_grid(x, s, found, panes_found);
        has_edge[p] = std::any_of(found.begin(), found.end(), [&](const Seen& other) { return differ(seen[p], other); });
      }
      if (!has_edge[p]) {
        centre[p] = add_sample(engine, seen[p], 1, pixel, -1, row.smooth[x], row);
        continue;
      }
      centre[p] = beam_point(engine, seen[p], 1, pixel, -1);
      trace_grid(x, kFiner * s, finer, finer_panes);
      weigh(found, finer, s, weighed);
      for (const Weighed& sample : weighed) {
        const BeamPoint point =
            add_sample(engine, sample.seen, sample.weight, pixel, sample.sample, row.smooth[x], row);
        if (point.surface >= 0) row.fine.push_back(point);
      }
      const float weight = 1 / static_cast<float>(s * s);
      for (const SeenPane& pane : panes_found)
        row.on_panes.push_back(
            add_sample(engine, pane.seen, weight, pixel, static_cast<int>(pane.ray), row.smooth[x], row));
    }
    for (const SeenPane& pane : panes[y])
      if (!has_edge[y * row_size + pane.ray])
        row.on_panes.push_back(
            add_sample(engine, pane.seen, 1, static_cast<int>(y * row_size + pane.ray), -1, row.smooth[pane.ray], row));
    for (std::vector<Share>& shares : row.smooth) merge_shares(shares);
  });
  std::size_t share_count = 0;
  for (const RowOfPixels& row : rows)
    for (const std::vector<Share>& shares : row.smooth) share_count += shares.size();
  smooth.entries.reserve(share_count);
  smooth.begin.reserve(pixel_count + 1);
  for (const RowOfPixels& row : rows) {
    fine.insert(fine.end(), row.fine.begin(), row.fine.end());
    on_panes.insert(on_panes.end(), row.on_panes.begin(), row.on_panes.end());
    constant.insert(constant.end(), row.constant.begin(), row.constant.end());
    outlooks.insert(outlooks.end(), row.outlooks.begin(), row.outlooks.end());
    panels.insert(panels.end(), row.panels.begin(), row.panels.end());
    for (const std::vector<Share>& shares : row.smooth) smooth.append(shares);
  }
  edge_pixel_count = static_cast<int>(std::count(has_edge.begin(), has_edge.end(), 1));
}

}  // namespace transom
