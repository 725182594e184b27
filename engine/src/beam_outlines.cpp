#include "transom/beam_outlines.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kEdgeOn = 1e-6f;     // cosine below which a passage lets nothing through
constexpr float kMarginOffsets = 4;  // of Faces::ray_offset: what rounding and lifted points may shift an outline by

// Whether an edge of `a` parts two convex polygons by more than the margin [separating axes].
bool has_separating_edge(const BeamOutline& a, const BeamOutline& b, float margin) {
  for (int k = 0; k < a.corner_count; ++k) {
    const glm::vec2 from = a.corner[k], edge = a.corner[(k + 1) % a.corner_count] - from;
    const glm::vec2 out = glm::vec2(edge.y, -edge.x);
    const auto side = [&](const BeamOutline& polygon) {
      float least = std::numeric_limits<float>::max(), most = -least;
      for (int i = 0; i < polygon.corner_count; ++i) {
        const float distance = glm::dot(out, polygon.corner[i] - from);
        least = std::min(least, distance);
        most = std::max(most, distance);
      }
      return glm::vec2(least, most);
    };
    const glm::vec2 own = side(a), other = side(b);
    const float gap = std::max(other.x - own.y, own.x - other.y);
    if (gap > margin * glm::length(out)) return true;
  }
  return false;
}

}  // namespace

BeamOutlines::BeamOutlines(const Faces& faces, const std::vector<int>& passages, glm::vec3 direction_to_source)
    : margin_(kMarginOffsets * faces.ray_offset()) {
  towards_ = glm::normalize(direction_to_source);
  const glm::mat3 frame = frame_from_normal(towards_);
  across_ = frame[0];
  along_ = frame[1];
  for (const int f : passages) {
    const Face& face = faces.faces[static_cast<std::size_t>(f)];
    Passage passage;
    passage.outline = outline(face.corners());
    const float facing = glm::dot(face.normal, towards_), sense = facing > 0 ? 1.f : -1.f;
    passage.is_edge_on = std::abs(facing) < kEdgeOn;
    for (int k = 0; k < passage.outline.corner_count; ++k) {
      const glm::vec2 from = passage.outline.corner[k],
                      edge = passage.outline.corner[(k + 1) % passage.outline.corner_count] - from;
      const glm::vec2 in = sense * glm::vec2(-edge.y, edge.x);
      passage.inwards[k] = {in, -glm::dot(in, from)};
    }
    // Of a point (x, y, depth) on the plane: normal . (x across + y along + depth towards) is that of a corner.
    if (!passage.is_edge_on)
      passage.depth = glm::vec3(-glm::dot(face.normal, across_), -glm::dot(face.normal, along_),
                                glm::dot(face.normal, face.corner[0])) /
                      facing;
    passages_.push_back(passage);
  }
}

BeamOutline BeamOutlines::outline(std::span<const glm::vec3> corners) const {
  BeamOutline result;
  result.corner_count = static_cast<int>(corners.size());
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const glm::vec2 place(glm::dot(corners[k], across_), glm::dot(corners[k], along_));
    const float depth = glm::dot(corners[k], towards_);
    result.corner[k] = place;
    result.low = k == 0 ? place : glm::min(result.low, place);
    result.high = k == 0 ? place : glm::max(result.high, place);
    result.nearest = k == 0 ? depth : std::min(result.nearest, depth);
    result.farthest = k == 0 ? depth : std::max(result.farthest, depth);
  }
  return result;
}

bool BeamOutlines::may_cover(int k, glm::vec3 low, glm::vec3 high) const {
  const BeamOutline& passage = passages_[static_cast<std::size_t>(k)].outline;
  if (passage.farthest < low.z - margin_) return false;
  for (int axis = 0; axis < 2; ++axis)
    if (passage.low[axis] > high[axis] + margin_ || low[axis] > passage.high[axis] + margin_) return false;
  return true;
}

bool BeamOutlines::covers(int k, const BeamOutline& polygon) const {
  if (!may_cover(k, {polygon.low, polygon.nearest}, {polygon.high, polygon.farthest})) return false;
  const BeamOutline& passage = passages_[static_cast<std::size_t>(k)].outline;
  return !has_separating_edge(passage, polygon, margin_) && !has_separating_edge(polygon, passage, margin_);
}

void BeamOutlines::covering(const BeamOutline& polygon, std::vector<int>& passages) const {
  passages.clear();
  for (int k = 0; k < static_cast<int>(passages_.size()); ++k)
    if (covers(k, polygon)) passages.push_back(k);
}

void BeamOutlines::along_beam(const Points& points, Points& seen) const {
  seen.resize(points.size());
  const auto coordinate = [&](glm::vec3 axis, std::vector<float>& result) {
    const float *x = points.x.data(), *y = points.y.data(), *z = points.z.data();
    float* to = result.data();
    for (std::size_t i = 0; i < points.size(); ++i) to[i] = axis.x * x[i] + axis.y * y[i] + axis.z * z[i];
  };
  coordinate(across_, seen.x);
  coordinate(along_, seen.y);
  coordinate(towards_, seen.z);
}

void BeamOutlines::mark_behind(int k, std::span<const float> x, std::span<const float> y, std::span<const float> z,
                               std::span<int> is_behind) const {
  const Passage& passage = passages_[static_cast<std::size_t>(k)];
  const auto [a, b, c, d] = passage.inwards;
  const glm::vec3 depth = passage.depth;
  const int lets_light_in = passage.is_edge_on ? 0 : 1;
  for (std::size_t i = 0; i < is_behind.size(); ++i) {
    const auto along = [&](glm::vec3 line) { return line.x * x[i] + line.y * y[i] + line.z; };
    is_behind[i] = static_cast<int>(along(a) >= 0) & static_cast<int>(along(b) >= 0) & static_cast<int>(along(c) >= 0) &
                   static_cast<int>(along(d) >= 0) & static_cast<int>(along(depth) > z[i]) & lets_light_in;
  }
}

}  // namespace transom
