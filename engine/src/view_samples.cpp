#include "transom/view_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "transom/parallel.h"
#include "view_rays.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kSameNormal = 0.9995f;  // cosine between normals of one smooth or flat surface
constexpr float kSamePlane = 1e-4f;     // of the scene's extent, between planes of one flat surface
constexpr std::size_t kGroupSize = 64;  // points of a group: few enough to lie close together, several packets of rays

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
                     std::vector<Share>& smooth, ViewSamples::Row& row) {
  const BeamPoint point = beam_point(engine, seen, weight, pixel, sample);
  if (seen.ends_at_panel) {
    if (seen.panel_bin >= 0) row.panels.push_back({pixel, weight * seen.through, seen.panel_bin});
    return point;
  }
  if (point.surface < 0) {
    row.outlooks.push_back({pixel, weight * seen.through, seen.direction, SkyPicture::place_of(seen.direction)});
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

// What a picture sees at its pixels' centres, and where edges are beside them.
class CentreRays {
 public:
  CentreRays(const Engine& engine, const View& view);

  const Seen& at(std::size_t pixel) const { return seen_[pixel]; }
  /// Panes in front of a row, pixel by pixel; `ray` is the column.
  const std::vector<SeenPane>& panes(std::size_t row) const { return panes_[row]; }
  /// Whether two rays meet different surfaces.
  bool differ(const Seen& a, const Seen& b) const;
  /// Whether a pixel or one of the eight around it sees another surface than the pixel does.
  bool is_beside_edge(int x, int y) const;

 private:
  static constexpr std::uint8_t kRight = 1, kDownLeft = 2, kDown = 4, kDownRight = 8;

  const Engine& engine_;
  int width_, height_;
  float same_plane_;
  std::vector<Seen> seen_;
  std::vector<std::vector<SeenPane>> panes_;
  std::vector<std::uint8_t> differs_from_;  // by pixel: which of the four neighbours after it see another surface
};

CentreRays::CentreRays(const Engine& engine, const View& view)
    : engine_(engine),
      width_(view.width),
      height_(view.height),
      same_plane_(kSamePlane * engine.faces().extent),
      seen_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)),
      panes_(static_cast<std::size_t>(height_)),
      differs_from_(seen_.size()) {
  const auto row_size = static_cast<std::size_t>(width_);
  std::vector<glm::vec2> middles;
  for (int x = 0; x < width_; ++x) middles.emplace_back(static_cast<float>(x) + 0.5f, 0.5f);
  parallel_indices(panes_.size(), 2, [&](std::size_t y) {
    CameraTracer tracer(engine, view);
    tracer.trace({0, y}, middles, {&seen_[y * row_size], row_size}, &panes_[y]);
    std::stable_sort(panes_[y].begin(), panes_[y].end(),
                     [](const SeenPane& a, const SeenPane& b) { return a.ray < b.ray; });
  });
  parallel_indices(panes_.size(), 4, [&](std::size_t y) {
    for (std::size_t x = 0; x < row_size; ++x) {
      const std::size_t p = y * row_size + x;
      const bool has_left = x > 0, has_right = x + 1 < row_size, has_below = y + 1 < panes_.size();
      int bits = 0;
      if (has_right && differ(seen_[p], seen_[p + 1])) bits |= kRight;
      if (has_below && has_left && differ(seen_[p], seen_[p + row_size - 1])) bits |= kDownLeft;
      if (has_below && differ(seen_[p], seen_[p + row_size])) bits |= kDown;
      if (has_below && has_right && differ(seen_[p], seen_[p + row_size + 1])) bits |= kDownRight;
      differs_from_[p] = static_cast<std::uint8_t>(bits);
    }
  });
}

bool CentreRays::differ(const Seen& a, const Seen& b) const {
  if (a.crossings != b.crossings || (a.hit.face < 0) != (b.hit.face < 0)) return true;
  if (a.hit.face < 0) return (a.direction.z < 0) != (b.direction.z < 0);
  if (a.hit.face == b.hit.face) return a.hit.side != b.hit.side;
  const Face &f = engine_.faces().faces[a.hit.face], &g = engine_.faces().faces[b.hit.face];
  const float sense = a.hit.side == b.hit.side ? 1.f : -1.f, cosine = glm::dot(f.normal, g.normal) * sense;
  return cosine < kSameNormal ||
         std::abs(glm::dot(f.normal, f.corner[0]) - sense * glm::dot(g.normal, g.corner[0])) > same_plane_;
}

bool CentreRays::is_beside_edge(int x, int y) const {
  const std::uint8_t* own =
      &differs_from_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
  if (*own || (x > 0 && (own[-1] & kRight))) return true;
  if (y == 0) return false;
  const std::uint8_t* above = own - width_;
  return (*above & kDown) || (x > 0 && (above[-1] & kDownRight)) || (x + 1 < width_ && (above[1] & kDownLeft));
}

// The samples of the pixels of a row, one pixel after the other.
class RowSampler {
 public:
  RowSampler(const Engine& engine, const View& view, int samples_per_axis)
      : engine_(engine),
        camera_(view),
        eye_(view.position - engine.faces().origin),
        tracer_(engine, view),
        s_(samples_per_axis),
        places_(all_places(s_)),
        finer_places_(all_places(kFiner * s_)),
        found_(places_.size()),
        finer_(finer_places_.size()),
        parts_(s_) {}

  void sample(const CentreRays& middles, std::size_t y, std::span<char> has_edge, std::span<BeamPoint> centre,
              ViewSamples::Row& row);

 private:
  bool finds_edge(const Seen& middle, const CentreRays& middles, glm::vec2 corner);
  BeamPoint whole(const Seen& seen, glm::vec2 corner, int pixel, ViewSamples::Row& row);
  void add_parts(glm::vec2 corner, int pixel, ViewSamples::Row& row);

  const Engine& engine_;
  const CameraRays camera_;
  const glm::vec3 eye_;
  CameraTracer tracer_;
  int s_;
  const std::vector<glm::vec2> places_, finer_places_;
  std::vector<Seen> found_, finer_;
  std::vector<SeenPane> panes_;
  PixelParts parts_;
  std::vector<Share> shares_;  // of the pixel
};

// Whether the pixel itself, at its samples, sees another surface than its middle.
bool RowSampler::finds_edge(const Seen& middle, const CentreRays& middles, glm::vec2 corner) {
  tracer_.trace(corner, places_, found_, &panes_);
  return std::any_of(found_.begin(), found_.end(), [&](const Seen& other) { return middles.differ(middle, other); });
}

// One surface: light between nodes at the middle of the pixel, beams at its scattered place.
BeamPoint RowSampler::whole(const Seen& seen, glm::vec2 corner, int pixel, ViewSamples::Row& row) {
  BeamPoint point = add_sample(engine_, seen, 1, pixel, BeamPoint::kCentre, shares_, row);
  if (s_ > 1 && point.surface >= 0) {
    const glm::vec2 place = scattered_place(static_cast<int>(corner.x), static_cast<int>(corner.y));
    places_on_plane(camera_, eye_, corner, {&place, 1}, point.position, engine_.faces().faces[seen.hit.face].normal,
                    {&point.position, 1});
  }
  return point;
}

void RowSampler::add_parts(glm::vec2 corner, int pixel, ViewSamples::Row& row) {
  tracer_.trace(corner, finer_places_, finer_, nullptr);
  for (const PixelParts::Part& part : parts_.tell_apart(found_, finer_)) {
    const float share = static_cast<float>(part.places.size()) / static_cast<float>(finer_.size()),
                weight = share / static_cast<float>(part.samples.size());
    const std::size_t first_point = row.fine.size();
    for (const PixelParts::Sample& sample : part.samples) {
      const BeamPoint point = add_sample(engine_, *sample.seen, weight, pixel, sample.place, shares_, row);
      if (point.surface >= 0) row.fine.push_back(point);
    }
    if (row.fine.size() == first_point) continue;
    row.parts.push_back({group_of({&row.fine[first_point], row.fine.size() - first_point}, first_point),
                         row.places.size(), row.places.size() + part.places.size()});
    row.places.insert(row.places.end(), part.places.begin(), part.places.end());
  }
  const float weight = 1 / static_cast<float>(s_ * s_);
  for (const SeenPane& pane : panes_)
    row.on_panes.push_back(add_sample(engine_, pane.seen, weight, pixel, static_cast<int>(pane.ray), shares_, row));
}

void RowSampler::sample(const CentreRays& middles, std::size_t y, std::span<char> has_edge, std::span<BeamPoint> centre,
                        ViewSamples::Row& row) {
  const std::size_t width = centre.size();
  row.smooth.begin.reserve(width + 1);
  row.smooth.entries.reserve(4 * width);
  auto pane = middles.panes(y).begin();
  for (std::size_t x = 0; x < width; ++x) {
    const std::size_t p = y * width + x;
    const int pixel = static_cast<int>(p);
    const glm::vec2 corner(x, y);
    const Seen& middle = middles.at(p);
    const auto first_pane = std::exchange(
        pane, std::find_if(pane, middles.panes(y).end(), [x](const SeenPane& other) { return other.ray != x; }));
    shares_.clear();
    has_edge[x] = s_ > 1 && middles.is_beside_edge(static_cast<int>(x), static_cast<int>(y)) &&
                  finds_edge(middle, middles, corner);
    if (has_edge[x]) {
      centre[x] = beam_point(engine_, middle, 1, pixel, BeamPoint::kCentre);
      add_parts(corner, pixel, row);
    } else {
      centre[x] = whole(middle, corner, pixel, row);
      for (auto other = first_pane; other != pane; ++other)
        row.on_panes.push_back(add_sample(engine_, other->seen, 1, pixel, BeamPoint::kCentre, shares_, row));
    }
    merge_shares(shares_);
    row.smooth.append(shares_);
  }
  add_groups(centre, y * width, row.centre_groups);
  add_groups(row.on_panes, 0, row.pane_groups);
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

std::vector<glm::vec2> all_places(int samples_per_axis) {
  std::vector<glm::vec2> places;
  for (int k = 0; k < samples_per_axis * samples_per_axis; ++k) places.push_back(sample_place(k, samples_per_axis));
  return places;
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
  const auto row_count = static_cast<std::size_t>(view.height), row_size = static_cast<std::size_t>(view.width);
  const CentreRays middles(engine, view);
  has_edge.resize(row_count * row_size);
  centre.resize(row_count * row_size);
  rows.resize(row_count);
  parallel_indices(row_count, 1, [&](std::size_t y) {
    RowSampler(engine, view, edge_samples)
        .sample(middles, y, {&has_edge[y * row_size], row_size}, {&centre[y * row_size], row_size}, rows[y]);
  });
  place_of_surface.assign(2 * engine.faces().faces.size(), -1);
  const auto list_surfaces = [&](const auto& groups) {
    for (const BeamGroup& group : groups) {
      int& place = place_of_surface[static_cast<std::size_t>(group.surface)];
      if (place >= 0) continue;
      place = static_cast<int>(surfaces.size());
      surfaces.push_back(group.surface);
    }
  };
  for (const Row& row : rows) {
    list_surfaces(row.centre_groups);
    list_surfaces(row.pane_groups);
    list_surfaces(row.parts);
  }
}

}  // namespace transom
