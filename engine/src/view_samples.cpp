#include "transom/view_samples.h"

#include <algorithm>
#include <array>
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
constexpr std::size_t kGroupSize = 64;  // points of a group: few enough to lie close together, several packets of rays

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
  const std::int64_t surface =
      seen.hit.face >= 0 ? 2 * std::int64_t{seen.hit.face} + seen.hit.side + 2 : (seen.direction.z < 0 ? 1 : 0);
  return surface * (kMaximumCrossings + 2) + seen.crossings;
}

// A sample of a pixel.
struct Sample {
  Seen seen;
  int place;  // BeamPoint::sample
};

// All that is alike of what a pixel sees.
struct PartOfPixel {
  std::vector<Sample> samples;
  std::vector<int> places;  // of the finer grid, at which it is seen
};

// Tells apart what the samples of a pixel see, by two grids: each part has the samples of the coarser one, or of the
// finer one where the coarser has missed it, and covers as much of the pixel as the finer one says.
class PixelParts {
 public:
  explicit PixelParts(int samples_per_axis) : s_(samples_per_axis) {}

  const std::vector<PartOfPixel>& tell_apart(const std::vector<Seen>& coarse, const std::vector<Seen>& finer) {
    parts_.clear();
    names_.clear();
    part_at_.clear();
    for (std::size_t k = 0; k < finer.size(); ++k) {
      const std::size_t part = part_of(name_of(finer[k]));
      if (part == parts_.size()) {
        names_.push_back(name_of(finer[k]));
        parts_.emplace_back();
      }
      parts_[part].places.push_back(static_cast<int>(k));
      part_at_.push_back(part);
    }
    for (std::size_t k = 0; k < coarse.size(); ++k) {
      const std::size_t part = part_of(name_of(coarse[k]));
      if (part < parts_.size()) parts_[part].samples.push_back({coarse[k], place_in_masks(part, static_cast<int>(k))});
    }
    for (std::size_t part = 0; part < parts_.size(); ++part)
      if (parts_[part].samples.empty())
        parts_[part].samples.push_back(
            {finer[static_cast<std::size_t>(parts_[part].places.front())], place_in_masks(part, 0)});
    return parts_;
  }

 private:
  std::size_t part_of(std::int64_t name) const {
    return static_cast<std::size_t>(std::find(names_.begin(), names_.end(), name) - names_.begin());
  }
  // A place of the coarser grid around which only this part is seen, so that the middle of its square, where masks are
  // drawn, sees it too: the own one, or another.
  int place_in_masks(std::size_t part, int own) const {
    const auto is_whole = [&](int place) {
      for (int j = 0; j < kFiner; ++j)
        for (int i = 0; i < kFiner; ++i)
          if (part_at_[static_cast<std::size_t>((place / s_ * kFiner + j) * kFiner * s_ + place % s_ * kFiner + i)] !=
              part)
            return false;
      return true;
    };
    if (is_whole(own)) return own;
    for (int place = 0; place < s_ * s_; ++place)
      if (is_whole(place)) return place;
    return BeamPoint::kNotInMasks;
  }

  int s_;
  std::vector<std::int64_t> names_;
  std::vector<PartOfPixel> parts_;
  std::vector<std::size_t> part_at_;  // by place of the finer grid
};

// What one row of the picture found, in the order of its pixels.
struct RowOfPixels {
  std::vector<BeamPoint> fine, on_panes;
  std::vector<BeamGroup> centre_groups, pane_groups;
  std::vector<ViewSamples::Part> parts;
  std::vector<int> places;
  std::vector<std::vector<Share>> smooth;
  std::vector<ViewSamples::Constant> constant;
  std::vector<ViewSamples::Outlook> outlooks;
  std::vector<ViewSamples::SeenPanel> panels;
};

// Points of one surface, from number `first` on.
BeamGroup group_of(std::span<const BeamPoint> points, std::size_t first) {
  BeamGroup group{points[0].surface, first, first + points.size(), points[0].position, points[0].position};
  for (const BeamPoint& point : points) {
    group.low = glm::min(group.low, point.position);
    group.high = glm::max(group.high, point.position);
  }
  return group;
}

// Groups points that follow each other on one surface; the first of them has the number `first`.
void add_groups(std::span<const BeamPoint> points, std::size_t first, std::vector<BeamGroup>& groups) {
  for (std::size_t begin = 0, end = 0; begin < points.size(); begin = end) {
    end = begin + 1;
    if (points[begin].surface < 0) continue;
    while (end < std::min(points.size(), begin + kGroupSize) && points[end].surface == points[begin].surface) ++end;
    groups.push_back(group_of(points.subspan(begin, end - begin), first + begin));
  }
}

// Adds a sample to its pixel; gives the point at which beams are tested.
BeamPoint add_sample(const Engine& engine, const Seen& seen, float weight, int pixel, int sample,
                     std::vector<Share>& smooth, RowOfPixels& row) {
  const BeamPoint point = beam_point(engine, seen, weight, pixel, sample);
  if (seen.ends_at_panel) {
    if (seen.panel_bin >= 0) row.panels.push_back({pixel, weight * seen.through, seen.panel_bin});
    return point;
  }
  if (point.surface < 0) {
    row.outlooks.push_back(
        {pixel, weight * seen.through, seen.direction, Condition::place_in_pictures(seen.direction)});
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

glm::vec2 scattered_place(int x, int y) {
  constexpr int kPeriod = 3;
  return sample_place(x % kPeriod * kPeriod + y % kPeriod, kPeriod);
}

void places_on_plane(const CameraRays& camera, glm::vec3 eye, glm::vec2 corner, std::span<const glm::vec2> places,
                     glm::vec3 of_plane, glm::vec3 normal, std::span<glm::vec3> met) {
  constexpr std::size_t kChunk = 64;
  std::array<float, kChunk> x, y, z;
  const float distance = glm::dot(of_plane - eye, normal);
  for (std::size_t begin = 0; begin < places.size(); begin += kChunk) {
    const std::size_t size = std::min(kChunk, places.size() - begin);
    camera.directions(corner, places.subspan(begin, size), x.data(), y.data(), z.data());
    for (std::size_t i = 0; i < size; ++i) {
      const glm::vec3 direction(x[i], y[i], z[i]);
      met[begin + i] = eye + direction * (distance / glm::dot(direction, normal));
    }
  }
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
  const CameraRays camera_rays(view);
  const glm::vec3 eye(view.position - engine.faces().origin);
  centre.resize(pixel_count);
  std::vector<RowOfPixels> rows(row_count);
  parallel_indices(row_count, 1, [&](std::size_t y) {
    RowOfPixels& row = rows[y];
    row.smooth.resize(row_size);
    Tracer tracer(engine, view);
    std::vector<glm::vec2> points;
    std::vector<Seen> found, finer;
    std::vector<SeenPane> panes_found, finer_panes;
    PixelParts pixel_parts(s);
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
        has_edge[p] =
            std::any_of(found.begin(), found.end(), [&](const Seen& other) { return differ(seen[p], other); });
      }
      if (!has_edge[p]) {
        centre[p] = add_sample(engine, seen[p], 1, pixel, BeamPoint::kCentre, row.smooth[x], row);
        if (s > 1 && centre[p].surface >= 0)
          places_on_plane(camera_rays, eye, glm::vec2(x, y),
                          std::array{scattered_place(static_cast<int>(x), static_cast<int>(y))}, centre[p].position,
                          engine.faces().faces[seen[p].hit.face].normal, {&centre[p].position, 1});
        continue;
      }
      centre[p] = beam_point(engine, seen[p], 1, pixel, BeamPoint::kCentre);
      trace_grid(x, kFiner * s, finer, finer_panes);
      for (const PartOfPixel& part : pixel_parts.tell_apart(found, finer)) {
        const float share = static_cast<float>(part.places.size()) / static_cast<float>(finer.size()),
                    weight = share / static_cast<float>(part.samples.size());
        const std::size_t first_point = row.fine.size();
        for (const Sample& sample : part.samples) {
          const BeamPoint point = add_sample(engine, sample.seen, weight, pixel, sample.place, row.smooth[x], row);
          if (point.surface >= 0) row.fine.push_back(point);
        }
        if (row.fine.size() == first_point) continue;
        const std::span<const BeamPoint> of_part(&row.fine[first_point], row.fine.size() - first_point);
        row.parts.push_back(
            {group_of(of_part, first_point), row.places.size(), row.places.size() + part.places.size()});
        row.places.insert(row.places.end(), part.places.begin(), part.places.end());
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
    add_groups({&centre[y * row_size], row_size}, y * row_size, row.centre_groups);
    add_groups(row.on_panes, 0, row.pane_groups);
  });
  std::size_t share_count = 0;
  for (const RowOfPixels& row : rows)
    for (const std::vector<Share>& shares : row.smooth) share_count += shares.size();
  smooth.entries.reserve(share_count);
  smooth.begin.reserve(pixel_count + 1);
  const auto append = [](const auto& from, auto& to) { to.insert(to.end(), from.begin(), from.end()); };
  const auto begin_row = [&] {
    row_starts.push_back(
        {centre_groups.size(), pane_groups.size(), parts.size(), constant.size(), outlooks.size(), panels.size()});
  };
  for (const RowOfPixels& row : rows) {
    begin_row();
    const auto moved = [](auto group, std::size_t by) {
      group.first += by;
      group.last += by;
      return group;
    };
    for (Part part : row.parts) {
      part.first_place += places.size();
      part.last_place += places.size();
      parts.push_back(moved(part, fine.size()));
    }
    for (const BeamGroup& group : row.pane_groups) pane_groups.push_back(moved(group, on_panes.size()));
    append(row.centre_groups, centre_groups);
    append(row.places, places);
    append(row.fine, fine);
    append(row.on_panes, on_panes);
    append(row.constant, constant);
    append(row.outlooks, outlooks);
    append(row.panels, panels);
    for (const std::vector<Share>& shares : row.smooth) smooth.append(shares);
  }
  begin_row();
  std::vector<char> is_listed(2 * engine.faces().faces.size(), 0);
  const auto list_surfaces = [&](const auto& groups) {
    for (const BeamGroup& group : groups)
      if (!std::exchange(is_listed[static_cast<std::size_t>(group.surface)], 1)) surfaces.push_back(group.surface);
  };
  list_surfaces(centre_groups);
  list_surfaces(pane_groups);
  list_surfaces(parts);
  edge_pixel_count = static_cast<int>(std::count(has_edge.begin(), has_edge.end(), 1));
}

}  // namespace transom
