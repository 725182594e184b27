#include "section_profile.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace transom {
namespace {

using Shape = SectionProfile::Shape;
using Hit = SectionProfile::Hit;

constexpr double kClose = 1e-12;     // of the period: a hit nearer than this is where the path is
constexpr double kEndSlack = 1e-12;  // of its chord: an arc reaches so far past its ends
constexpr double kWholePane = 1e-9;  // of the period, by which a pane may miss it
constexpr double kStride = 1;        // periods looked at together along a path
constexpr int kMaximumStrides = 1000;
constexpr double kMaximumImages = 64;  // of a line that may cut one beam

double cross2(glm::dvec2 a, glm::dvec2 b) {
  return a.x * b.y - a.y * b.x;
}

bool is_on_arc(const Shape& shape, glm::dvec2 place) {
  return shape.side * glm::dot(place - shape.a, shape.normal) >= -kEndSlack * shape.radius;
}

void meet_straight(const Shape& shape, glm::dvec2 place, glm::dvec2 along, double close, int line, double shift,
                   Hit& best) {
  const double denominator = cross2(along, shape.edge);
  if (denominator == 0) return;
  const glm::dvec2 to_start(shape.a.x + shift - place.x, shape.a.y - place.y);
  const double t = cross2(to_start, shape.edge) / denominator, s = cross2(to_start, along) / denominator;
  if (t > close && t < best.t && s >= 0 && s <= 1) best = {t, line, shift};
}

void meet_arc(const Shape& shape, glm::dvec2 place, glm::dvec2 along, double close, int line, double shift,
              bool starts_on_it, Hit& best) {
  const glm::dvec2 from_centre(place.x - shift - shape.centre.x, place.y - shape.centre.y);
  const double a = glm::dot(along, along), b = glm::dot(from_centre, along);
  const auto consider = [&](double t) {
    if (t > close && t < best.t && is_on_arc(shape, {place.x - shift + t * along.x, place.y + t * along.y}))
      best = {t, line, shift};
  };
  if (starts_on_it) {  // the other end of the chord through the circle
    if (b < 0) consider(-2 * b / a);
    return;
  }
  const double discriminant = b * b - a * (glm::dot(from_centre, from_centre) - shape.radius * shape.radius);
  if (discriminant <= 0) return;
  const double root = std::sqrt(discriminant);
  if (b > root) return;  // the circle is behind
  consider((-b - root) / a);
  consider((-b + root) / a);
}

}  // namespace

SectionProfile::SectionProfile(const Section& section)
    : period_(section.period),
      per_metre_(1 / section.period),
      low_z_(section.low_z),
      high_z_(section.high_z),
      close_(kClose * section.period) {
  for (const Line& line : section.lines) {
    Shape shape;
    shape.a = line.a;
    shape.b = line.b;
    shape.edge = line.b - line.a;
    const double chord = glm::length(shape.edge);
    shape.normal = glm::dvec2(-shape.edge.y, shape.edge.x) / chord;
    shape.low_y = std::min(line.a.x, line.b.x);
    shape.high_y = std::max(line.a.x, line.b.x);
    if (line.bow != 0) {
      const double rise = std::abs(line.bow);
      shape.side = line.bow > 0 ? 1 : -1;
      shape.radius = (0.25 * chord * chord + rise * rise) / (2 * rise);
      shape.curvature = 1 / shape.radius;
      shape.centre = 0.5 * (line.a + line.b) + shape.side * (rise - shape.radius) * shape.normal;
      for (const double sign : {-1.0, 1.0}) {  // where it turns back in y
        const glm::dvec2 turn = shape.centre + glm::dvec2(sign * shape.radius, 0);
        if (!is_on_arc(shape, turn)) continue;
        shape.low_y = std::min(shape.low_y, turn.x);
        shape.high_y = std::max(shape.high_y, turn.x);
      }
    }
    shape.is_pane = line.bow == 0 && line.a.y == line.b.y && std::abs(chord - period_) <= kWholePane * period_;
    (shape.is_pane ? panes_ : others_).push_back(static_cast<int>(shapes_.size()));
    if (!shape.is_pane) {
      const double rise = std::abs(line.bow);  // an arc is nowhere farther from its chord
      others_low_z_ = std::min(others_low_z_, std::min(line.a.y, line.b.y) - rise - close_);
      others_high_z_ = std::max(others_high_z_, std::max(line.a.y, line.b.y) + rise + close_);
    }
    shapes_.push_back(shape);
  }
}

double SectionProfile::reach(glm::dvec2 place, glm::dvec2 along) const {
  return along.y > 0 ? (high_z_ - place.y) / along.y : along.y < 0 ? (low_z_ - place.y) / along.y : 1e300;
}

SectionProfile::Hit SectionProfile::nearest(glm::dvec2 place, glm::dvec2 along, int from) const {
  Hit best;
  if (along.y != 0) {
    best = {std::max(reach(place, along), 0.0), kLeaves, 0};
    for (const int line : panes_) {
      const double t = (shapes_[static_cast<std::size_t>(line)].a.y - place.y) / along.y;
      if (line != from && t > 0 && t < best.t) best = {t, line, 0};
    }
    if (best.line >= 0) best.shift = std::floor((place.x + best.t * along.x) / period_) * period_;
  }
  // Lines that are no panes are met only between the least and the greatest z of them all.
  double begin = 0, until = best.t;
  if (along.y != 0) {
    const double to_low = (others_low_z_ - place.y) / along.y, to_high = (others_high_z_ - place.y) / along.y;
    begin = std::max(std::min(to_low, to_high), 0.0);
    until = std::min(std::max(to_low, to_high), best.t);
  } else if (place.y < others_low_z_ || place.y > others_high_z_) {
    until = -1;
  }
  const double stride = along.x != 0 ? kStride * period_ / std::abs(along.x) : 1e300;
  for (int k = 0; begin <= until; ++k) {
    if (k == kMaximumStrides) return {};
    const double end = std::min(begin + stride, until);
    const double y0 = place.x + begin * along.x, y1 = along.x != 0 ? place.x + end * along.x : place.x;
    for (const int line : others_) {
      const Shape& shape = shapes_[static_cast<std::size_t>(line)];
      const auto first = static_cast<std::int64_t>(std::ceil((std::min(y0, y1) - shape.high_y) * per_metre_ - kClose));
      const auto last = static_cast<std::int64_t>(std::floor((std::max(y0, y1) - shape.low_y) * per_metre_ + kClose));
      for (std::int64_t image = first; image <= last; ++image) {
        const bool starts_on_it = line == from && image == 0;
        if (shape.radius > 0)
          meet_arc(shape, place, along, close_, line, image * period_, starts_on_it, best);
        else if (!starts_on_it)
          meet_straight(shape, place, along, close_, line, image * period_, best);
      }
    }
    if (best.t <= end) break;
    begin += stride;
  }
  return best;
}

bool SectionProfile::cuts(glm::dvec2 start, glm::dvec2 end, glm::dvec2 along, std::vector<double>& shares) const {
  if (along.y == 0) return false;
  double low = 1e300, high = -1e300;
  for (const glm::dvec2 place : {start, end}) {
    double t = reach(place, along);
    for (const int line : panes_) {
      const double to_pane = (shapes_[static_cast<std::size_t>(line)].a.y - place.y) / along.y;
      if (to_pane > close_) t = std::min(t, to_pane);
    }
    low = std::min({low, place.x, place.x + t * along.x});
    high = std::max({high, place.x, place.x + t * along.x});
  }
  const double from = cross2(along, start), width = cross2(along, end) - from;
  const auto cut = [&](glm::dvec2 place, double shift) {
    shares.push_back((cross2(along, {place.x + shift, place.y}) - from) / width);
  };
  if (high - low > kMaximumImages * period_) return false;
  const glm::dvec2 sideways = glm::dvec2(-along.y, along.x) / glm::length(along);
  for (const int line : others_) {
    const Shape& shape = shapes_[static_cast<std::size_t>(line)];
    const auto first = static_cast<std::int64_t>(std::ceil((low - shape.high_y) / period_ - kClose));
    const auto last = static_cast<std::int64_t>(std::floor((high - shape.low_y) / period_ + kClose));
    for (std::int64_t image = first; image <= last; ++image) {
      cut(shape.a, image * period_);
      cut(shape.b, image * period_);
      for (const double sign : {-1.0, 1.0}) {
        const glm::dvec2 silhouette = shape.centre + sign * shape.radius * sideways;
        if (shape.radius > 0 && is_on_arc(shape, silhouette)) cut(silhouette, image * period_);
      }
    }
  }
  return true;
}

double SectionProfile::distance_to(const Hit& hit, glm::dvec2 place, glm::dvec2 along) const {
  const Shape& shape = shapes_[static_cast<std::size_t>(hit.line)];
  const glm::dvec2 to_start(shape.a.x + hit.shift - place.x, shape.a.y - place.y);
  return std::max(cross2(to_start, shape.edge) / cross2(along, shape.edge), 0.0);
}

glm::dvec2 SectionProfile::front_normal(int line, glm::dvec2 place) const {
  const Shape& shape = shapes_[static_cast<std::size_t>(line)];
  return shape.curvature > 0 ? shape.side * shape.curvature * (place - shape.centre) : shape.normal;
}

}  // namespace transom
