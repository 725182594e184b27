// Beams in the rows of a picture: at the one point of each pixel first, then at many where light ends.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "frame_drawing.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kSameShare = 0.02f;          // of a beam, between neighbouring pixels without an edge
constexpr float kSameCurve = 0.9f;           // cosine between normals of neighbouring pixels on one surface
constexpr std::size_t kPixelsFollowed = 16;  // at once

float mean_of(std::span<const float> shares) {
  return std::accumulate(shares.begin(), shares.end(), 0.f) / static_cast<float>(shares.size());
}

// Whether a point is on the surface of another one, flat or curved.
bool is_continued(const BeamPoint& a, const BeamPoint& b) {
  if (b.surface < 0 || glm::dot(a.normal, b.normal) < kSameCurve) return false;
  const glm::vec3 between = b.position - a.position;
  return std::abs(glm::dot(between, a.normal)) < (1 - kSameCurve) * glm::length(between);
}

}  // namespace

const float* FrameRenderer::centre_shares(std::size_t beam, int row) const {
  const auto height = static_cast<std::size_t>(samples_->view.height),
             width = static_cast<std::size_t>(samples_->view.width), y = static_cast<std::size_t>(row);
  return is_lit_row_[beam * height + y] ? &centre_share_[beam][y * width] : dark_row_.data();
}

void FrameRenderer::find_centre_shares(const Drawing& drawing, std::size_t beam, int row) {
  thread_local ShadowRays rays;
  const auto y = static_cast<std::size_t>(row), width = static_cast<std::size_t>(samples_->view.width);
  float* const shares = &centre_share_[beam][y * width];
  const SeenBeam& seen = drawing.beams[beam];
  bool is_reached = false;
  for (const BeamGroup& group : samples_->rows[y].centre_groups) {
    if (!seen.may_light(group)) continue;
    if (!std::exchange(is_reached, true)) std::fill(shares, shares + width, 0.f);
    const std::span<const BeamPoint> points(&samples_->centre[group.first], group.last - group.first);
    const std::span<float> of_group(shares + group.first - y * width, points.size());
    if (drawing.masks)
      for (std::size_t i = 0; i < points.size(); ++i)
        of_group[i] =
            seen.faces(points[i]) ? drawing.mask_share[drawing.masks->index(points[i].pixel, BeamPoint::kCentre)] : 0.f;
    else
      seen.find_shares(group.surface, points, of_group, rays);
  }
  seen.trace(rays);
  is_lit_row_[beam * static_cast<std::size_t>(samples_->view.height) + y] =
      is_reached && std::any_of(shares, shares + width, [](float share) { return share > 0; });
}

void FrameRenderer::add_beam(const Drawing& drawing, std::size_t beam, int row, glm::vec3* sun) {
  thread_local Scratch scratch;
  add_to_pixels(drawing, beam, row, scratch, sun);
  add_to_parts(drawing, beam, row, scratch, sun);
  add_to_panes(drawing, beam, row, scratch, sun);
}

// Pixels on one surface: one point speaks for them, unless neighbours are lit otherwise. Then samples are tested on its
// plane.
void FrameRenderer::add_to_pixels(const Drawing& drawing, std::size_t beam, int row, Scratch& scratch, glm::vec3* sun) {
  const ViewSamples& samples = *samples_;
  const SeenBeam& seen = drawing.beams[beam];
  const int width = samples.view.width, height = samples.view.height, s = samples.edge_samples;
  const std::size_t first = static_cast<std::size_t>(row) * static_cast<std::size_t>(width);
  const float* const own = centre_shares(beam, row);
  const float* const above = row > 0 ? centre_shares(beam, row - 1) : own;
  const float* const below = row + 1 < height ? centre_shares(beam, row + 1) : own;
  const bool is_dark = own == dark_row_.data() && above == own && below == own;
  if (!drawing.masks && is_dark) return;
  scratch.highest.resize(static_cast<std::size_t>(width));
  scratch.lowest.resize(static_cast<std::size_t>(width));
  float *const highest = scratch.highest.data(), *const lowest = scratch.lowest.data();
  for (int x = 0; x < width; ++x) {
    highest[x] = std::max(std::max(above[x], below[x]), own[x]);
    lowest[x] = std::min(std::min(above[x], below[x]), own[x]);
  }
  const auto differs = [&](int x) {
    const int left = std::max(x - 1, 0), right = std::min(x + 1, width - 1);
    return std::max(std::max(highest[left], highest[right]), highest[x]) - own[x] > kSameShare ||
           own[x] - std::min(std::min(lowest[left], lowest[right]), lowest[x]) > kSameShare;
  };
  scratch.chosen.clear();
  for (const BeamGroup& group : samples.rows[row].centre_groups) {
    if (!seen.may_light(group.surface)) continue;
    for (std::size_t p = group.first; p < group.last; ++p) {
      if (samples.has_edge[p]) continue;
      const int x = samples.centre[p].pixel - row * width;
      if (s > 1 && (differs(x) || (drawing.masks && drawing.masks->holds(x, row) &&
                                   drawing.masks->light_ends_at(x, row, drawing.mask_share))))
        scratch.chosen.push_back(p);
      else if (own[x] > 0)
        sun[x] += seen.reflected(samples.centre[p], own[x]);
    }
  }
  test_samples(drawing, beam, scratch.chosen, scratch);
  for (std::size_t k = 0; k < scratch.chosen.size(); ++k) {
    const std::size_t p = scratch.chosen[k];
    const PixelShare share = scratch.pixel_shares[k];
    if (share.mean > 0) sun[p - first] += seen.reflected(samples.centre[p], share.mean);
    if (share.has_end) ends_[beam * static_cast<std::size_t>(height) + static_cast<std::size_t>(row)].push_back(p);
  }
}

// Of points on one surface, from number `first` on.
void FrameRenderer::find_shares_of_pixel(const SeenBeam& seen, std::size_t first, std::size_t count, Scratch& scratch) {
  seen.find_shares(scratch.points[first].surface, {&scratch.points[first], count}, {&scratch.shares[first], count},
                   scratch.rays);
}

// Finds what pixels receive of a beam, at all samples on the planes of their points. Where it ends among them, the
// places of the finer grid are tested that are in the squares of samples beside its end.
void FrameRenderer::test_samples(const Drawing& drawing, std::size_t beam, std::span<const std::size_t> pixels,
                                 Scratch& scratch) {
  const SeenBeam& seen = drawing.beams[beam];
  const std::size_t sample_count = places_.size();
  scratch.points.clear();
  for (const std::size_t p : pixels) {
    is_edge_[p] = 1;
    is_tested_[beam][p] = 1;
    put_on_plane(drawing, samples_->centre[p], places_, scratch);
  }
  scratch.shares.resize(scratch.points.size());
  for (std::size_t k = 0; k < scratch.points.size(); k += sample_count)
    find_shares_of_pixel(seen, k, sample_count, scratch);
  seen.trace(scratch.rays);

  scratch.points.clear();
  scratch.ending.clear();
  scratch.pixel_shares.clear();
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const std::span<const float> shares(&scratch.shares[k * sample_count], sample_count);
    const auto [least, most] = std::minmax_element(shares.begin(), shares.end());
    scratch.pixel_shares.push_back({mean_of(shares), *most - *least > kSameShare});
    if (!scratch.pixel_shares.back().has_end) continue;
    const float known = choose_beside_end(shares, scratch);
    if (scratch.places.empty()) continue;  // it fades, without an end between samples
    scratch.ending.push_back({k, scratch.points.size(), scratch.places.size(), known});
    put_on_plane(drawing, samples_->centre[pixels[k]], scratch.places, scratch);
  }
  scratch.shares.resize(scratch.points.size());
  for (const EndingPixel& pixel : scratch.ending) find_shares_of_pixel(seen, pixel.first, pixel.count, scratch);
  seen.trace(scratch.rays);
  for (const EndingPixel& pixel : scratch.ending) {
    const auto first = scratch.shares.begin() + static_cast<std::ptrdiff_t>(pixel.first);
    scratch.pixel_shares[pixel.number].mean =
        std::accumulate(first, first + static_cast<std::ptrdiff_t>(pixel.count), pixel.known) /
        static_cast<float>(finer_places_.size());
  }
}

// Of a pixel in which light ends, by what its samples receive: the places of the finer grid in the squares of those
// that one beside them, in a row or a column, differs from. Returns the sum of what the other places receive.
float FrameRenderer::choose_beside_end(std::span<const float> shares, Scratch& scratch) const {
  const int s = samples_->edge_samples;
  float known = 0;
  scratch.places.clear();
  for (int y = 0; y < s; ++y)
    for (int x = 0; x < s; ++x) {
      const float own = shares[static_cast<std::size_t>(y * s + x)];
      const auto differs = [&](int i, int j) {
        return i >= 0 && i < s && j >= 0 && j < s &&
               std::abs(shares[static_cast<std::size_t>(j * s + i)] - own) > kSameShare;
      };
      if (!differs(x - 1, y) && !differs(x + 1, y) && !differs(x, y - 1) && !differs(x, y + 1)) {
        known += kFiner * kFiner * own;
        continue;
      }
      for (int j = kFiner * y; j < kFiner * (y + 1); ++j)
        for (int i = kFiner * x; i < kFiner * (x + 1); ++i)
          scratch.places.push_back(finer_places_[static_cast<std::size_t>(j * kFiner * s + i)]);
    }
  return known;
}

// Where light ends in a pixel it goes on ending in one beside it: light or shade narrower than a pixel may pass between
// the one points of several pixels on its way.
void FrameRenderer::follow_ends(const Drawing& drawing, std::size_t beam, Picture& sun) {
  const SeenBeam& seen = drawing.beams[beam];
  const auto width = static_cast<std::size_t>(samples_->view.width),
             height = static_cast<std::size_t>(samples_->view.height);
  std::vector<std::size_t> ends, beside;
  for (std::size_t y = 0; y < height; ++y) {
    const std::vector<std::size_t>& of_row = ends_[beam * height + y];
    ends.insert(ends.end(), of_row.begin(), of_row.end());
  }
  const auto visit = [&](std::size_t p) {
    if (is_tested_[beam][p] || samples_->has_edge[p]) return;
    const int surface = samples_->centre[p].surface;
    if (surface < 0 || !seen.may_light(surface)) return;
    is_tested_[beam][p] = 1;
    beside.push_back(p);
  };
  while (!ends.empty()) {
    beside.clear();
    for (const std::size_t p : ends) {
      const std::size_t x = p % width, y = p / width;
      for (std::size_t row = y - std::min<std::size_t>(y, 1); row <= std::min(y + 1, height - 1); ++row)
        for (std::size_t i = x - std::min<std::size_t>(x, 1); i <= std::min(x + 1, width - 1); ++i)
          visit(row * width + i);
    }
    std::vector<char> has_end(beside.size());
    parallel_ranges(beside.size(), kPixelsFollowed, [&](std::size_t begin, std::size_t end) {
      thread_local Scratch scratch;
      test_samples(drawing, beam, {&beside[begin], end - begin}, scratch);
      for (std::size_t k = begin; k < end; ++k) {
        const std::size_t p = beside[k];
        const BeamPoint& point = samples_->centre[p];
        const PixelShare share = scratch.pixel_shares[k - begin];
        const float at_point = centre_shares(beam, static_cast<int>(p / width))[p % width];
        if (share.mean != at_point)
          sun[p] = glm::max(sun[p] - seen.reflected(point, at_point), glm::vec3(0)) + seen.reflected(point, share.mean);
        has_end[k] = share.has_end;
      }
    });
    ends.clear();
    for (std::size_t k = 0; k < beside.size(); ++k)
      if (has_end[k]) ends.push_back(beside[k]);
  }
}

// Adds points of a pixel on the plane of one of them.
void FrameRenderer::put_on_plane(const Drawing& drawing, BeamPoint point, std::span<const glm::vec2> places,
                                 Scratch& scratch) const {
  scratch.positions.resize(places.size());
  const int width = samples_->view.width;
  places_on_plane(drawing.camera, drawing.eye, glm::vec2(point.pixel % width, point.pixel / width), places,
                  point.position, engine_.faces().faces[point.surface / 2].normal, scratch.positions);
  for (const glm::vec3& position : scratch.positions) {
    point.position = position;
    scratch.points.push_back(point);
  }
}

// Pixels with an edge of a surface: every sample for itself, unless a beam ends within what is seen of a surface. Then
// all places at which that is seen are tested on its plane.
void FrameRenderer::add_to_parts(const Drawing& drawing, std::size_t beam, int row, Scratch& scratch, glm::vec3* sun) {
  const ViewSamples::Row& samples = samples_->rows[row];
  const SeenBeam& seen = drawing.beams[beam];
  const int width = samples_->view.width, height = samples_->view.height;
  if (samples.parts.empty()) return;
  scratch.shares.assign(samples.fine.size(), 0.f);
  const auto shares_of = [&](const ViewSamples::Part& part) {
    return std::span<float>(&scratch.shares[part.first], part.last - part.first);
  };
  scratch.chosen.clear();
  for (std::size_t i = 0; i < samples.parts.size(); ++i) {
    const ViewSamples::Part& part = samples.parts[i];
    if (!seen.may_light(part.surface)) continue;
    scratch.chosen.push_back(i);
    if (!seen.may_light(part)) continue;
    const std::span<const BeamPoint> points(&samples.fine[part.first], part.last - part.first);
    const std::span<float> shares = shares_of(part);
    if (!drawing.masks || points[0].sample == BeamPoint::kNotInMasks)
      seen.find_shares(part.surface, points, shares, scratch.rays);
    else
      for (std::size_t k = 0; k < points.size(); ++k)
        shares[k] =
            seen.faces(points[k]) ? drawing.mask_share[drawing.masks->index(points[k].pixel, points[k].sample)] : 0.f;
  }
  seen.trace(scratch.rays);

  const int first_row = std::max(row - 1, 0), last_row = std::min(row + 1, height - 1);
  const float* around[3]{};
  for (int y = first_row; y <= last_row; ++y) around[y - first_row] = centre_shares(beam, y);
  const auto light_ends_in = [&](const ViewSamples::Part& part) {
    const std::span<const float> shares = shares_of(part);
    const auto is_other = [&](float other) { return std::abs(other - shares[0]) > kSameShare; };
    if (std::any_of(shares.begin(), shares.end(), is_other)) return true;
    const BeamPoint& first = samples.fine[part.first];
    const int x = first.pixel - row * width;
    for (int y = first_row; y <= last_row; ++y)
      for (int i = std::max(x - 1, 0); i <= std::min(x + 1, width - 1); ++i)
        if (is_other(around[y - first_row][i]) && is_continued(first, samples_->centre[y * width + i])) return true;
    return false;
  };
  std::erase_if(scratch.chosen, [&](std::size_t i) {
    const ViewSamples::Part& part = samples.parts[i];
    if (light_ends_in(part)) return false;
    const std::span<const float> shares = shares_of(part);
    for (std::size_t k = 0; k < shares.size(); ++k)
      if (shares[k] > 0)
        sun[samples.fine[part.first + k].pixel - row * width] +=
            seen.reflected(samples.fine[part.first + k], shares[k]);
    return true;
  });

  scratch.points.clear();
  for (const std::size_t i : scratch.chosen) {
    const ViewSamples::Part& part = samples.parts[i];
    scratch.places.clear();
    for (std::size_t k = part.first_place; k < part.last_place; ++k)
      scratch.places.push_back(finer_places_[samples.places[k]]);
    put_on_plane(drawing, samples.fine[part.first], scratch.places, scratch);
  }
  scratch.shares.resize(scratch.points.size());
  const auto for_chosen = [&](const auto& visit) {
    std::size_t begin = 0;
    for (const std::size_t i : scratch.chosen) {
      const ViewSamples::Part& part = samples.parts[i];
      visit(part, begin, part.last_place - part.first_place);
      begin += part.last_place - part.first_place;
    }
  };
  for_chosen([&](const ViewSamples::Part& part, std::size_t begin, std::size_t size) {
    seen.find_shares(part.surface, {&scratch.points[begin], size}, {&scratch.shares[begin], size}, scratch.rays);
  });
  seen.trace(scratch.rays);
  for_chosen([&](const ViewSamples::Part& part, std::size_t begin, std::size_t size) {
    const float mean = mean_of({&scratch.shares[begin], size});
    for (std::size_t k = part.first; k < part.last && mean > 0; ++k)
      sun[samples.fine[k].pixel - row * width] += seen.reflected(samples.fine[k], mean);
  });
}

void FrameRenderer::add_to_panes(const Drawing& drawing, std::size_t beam, int row, Scratch& scratch,
                                 glm::vec3* sun) const {
  const ViewSamples::Row& samples = samples_->rows[row];
  const SeenBeam& seen = drawing.beams[beam];
  for (const BeamGroup& group : samples.pane_groups) {
    if (!seen.may_light(group)) continue;
    const std::span<const BeamPoint> points(&samples.on_panes[group.first], group.last - group.first);
    scratch.shares.resize(points.size());
    seen.find_shares(group.surface, points, scratch.shares, scratch.rays);
    seen.trace(scratch.rays);
    for (std::size_t k = 0; k < points.size(); ++k)
      if (scratch.shares[k] > 0)
        sun[points[k].pixel - row * samples_->view.width] += seen.reflected(points[k], scratch.shares[k]);
  }
}

}  // namespace transom
