/// @file Silhouettes by signed edges: every caster triangle, turned towards the sun, adds its three directed edges;
/// what two neighbours add in opposite directions vanishes; what remains, with its multiplicity, bounds the volume.
/// Exact for open sheets, for edges shared by any number of triangles and for solids alike. [Heidmann 1991; McGuire et
/// al. 2003]
#include "shadow_casters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

namespace transom {

namespace {

/// |cosine| to the sun below which a triangle is edge-on and casts nothing: the rounding of float vertices.
constexpr double kEdgeOnCosine = 1e-7;

constexpr int kColumns = 64;  // along the light, each way, in which shaded points are looked up

std::size_t column_number(int x, int y) {
  return static_cast<std::size_t>(y) * kColumns + static_cast<std::size_t>(x);
}

/// Sets that can be merged; the representative of each is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }

  std::uint32_t find(std::uint32_t member) {
    while (parent_[member] != member) member = parent_[member] = parent_[parent_[member]];
    return member;
  }
  void merge(std::uint32_t a, std::uint32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

std::vector<std::uint32_t> weld_vertices(std::span<const glm::vec3> vertices) {
  std::vector<std::uint32_t> order(vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t i) { return std::tuple(vertices[i].x, vertices[i].y, vertices[i].z); };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple_cat(key(a), std::tuple(a)) < std::tuple_cat(key(b), std::tuple(b));
  });
  std::vector<std::uint32_t> welded(vertices.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool repeats = i > 0 && key(order[i]) == key(order[i - 1]);
    welded[order[i]] = repeats ? welded[order[i - 1]] : order[i];
  }
  return welded;
}

ShadowCasters::ShadowCasters(std::span<const glm::vec3> vertices, std::span<const std::uint32_t> welded,
                             std::span<const glm::uvec3> triangles, CasterCount count) {
  triangles_.reserve(triangles.size());
  for (const glm::uvec3& original : triangles) {
    const glm::uvec3 corner(welded[original.x], welded[original.y], welded[original.z]);
    const glm::dvec3 a(vertices[corner.x]), b(vertices[corner.y]), c(vertices[corner.z]);
    const glm::dvec3 twice_area = glm::cross(b - a, c - a);
    const double length = glm::length(twice_area);
    if (length > 0) triangles_.push_back({corner, {}, {}, twice_area / length});
  }
  connect_edges();
  if (count == CasterCount::kSolidsOnce) find_solids(vertices);
}

void ShadowCasters::connect_edges() {
  std::vector<std::array<std::uint32_t, 4>> sides;  // smaller vertex, larger vertex, triangle, corner
  sides.reserve(3 * triangles_.size());
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t a = triangles_[t].vertices[static_cast<int>(corner)];
      const std::uint32_t b = triangles_[t].vertices[static_cast<int>((corner + 1) % 3)];
      sides.push_back({std::min(a, b), std::max(a, b), t, corner});
      triangles_[t].along[static_cast<int>(corner)] = a < b ? 1 : -1;
    }
  }
  std::sort(sides.begin(), sides.end());
  for (const auto& [from, to, t, corner] : sides) {
    if (edges_.empty() || edges_.back().from != from || edges_.back().to != to) edges_.push_back({from, to});
    triangles_[t].edges[static_cast<int>(corner)] = static_cast<std::uint32_t>(edges_.size() - 1);
  }
}

/// Finds the closed, consistently oriented solids and lets only one of their two sides cast.
///
/// The triangles that a ray to the sun leaves a solid through face the sun, those it enters through face away. From a
/// point that is not inside, both are equally many; from a point inside a solid whose normals look out, there is one
/// more to leave through; inside a room whose normals look in, one more of the others. So fronts suffice for the former
/// (positive enclosed volume), backs for the latter, wherever the point is.
void ShadowCasters::find_solids(std::span<const glm::vec3> vertices) {
  std::vector<std::vector<std::pair<std::uint32_t, int>>> sharers(edges_.size());  // triangle, direction along the edge
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    for (int i = 0; i < 3; ++i) sharers[triangles_[t].edges[i]].emplace_back(t, triangles_[t].along[i]);
  }
  // Shells hold together through edges of exactly two triangles: bodies that merely touch along an edge stay apart.
  DisjointSets shells(triangles_.size());
  for (const auto& triangles : sharers) {
    if (triangles.size() == 2) shells.merge(triangles[0].first, triangles[1].first);
  }
  std::vector<bool> is_closed(triangles_.size(), true);
  for (const auto& triangles : sharers) {
    for (const auto& [triangle, along] : triangles) {
      int balance = 0;
      for (const auto& [other, other_along] : triangles) {
        if (shells.find(other) == shells.find(triangle)) balance += other_along;
      }
      if (balance != 0) is_closed[shells.find(triangle)] = false;
    }
  }
  std::vector<double> volume(triangles_.size(), 0.0);  // six times the enclosed volume
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    const glm::uvec3 corner = triangles_[t].vertices;
    const glm::dvec3 a(vertices[corner.x]), b(vertices[corner.y]), c(vertices[corner.z]);
    volume[shells.find(t)] += glm::dot(a, glm::cross(b, c));
  }
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    const std::uint32_t shell = shells.find(t);
    if (is_closed[shell] && volume[shell] != 0) {
      triangles_[t].casting = volume[shell] > 0 ? Casting::kFronts : Casting::kBacks;
    }
  }
}

/// +1: casts, front to the sun. -1: casts, back to the sun. 0: edge-on, or the side of a solid that does not cast.
int ShadowCasters::facing(const Triangle& triangle, glm::dvec3 direction_to_sun) {
  const double cosine = glm::dot(triangle.normal, direction_to_sun);
  if (cosine > kEdgeOnCosine) return triangle.casting == Casting::kBacks ? 0 : 1;
  if (cosine < -kEdgeOnCosine) return triangle.casting == Casting::kFronts ? 0 : -1;
  return 0;
}

ShadedPoints::ShadedPoints(glm::dvec3 direction_to_sun, std::span<const std::pair<glm::vec3, glm::vec3>> boxes)
    : are_all_(boxes.empty()),
      low_(std::numeric_limits<double>::infinity()),
      high_(-std::numeric_limits<double>::infinity()),
      farthest_(static_cast<std::size_t>(kColumns * kColumns), std::numeric_limits<double>::infinity()) {
  const glm::dvec3 towards = glm::normalize(direction_to_sun),
                   other = std::abs(towards.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0),
                   across = glm::normalize(glm::cross(other, towards));
  beam_from_world_ = glm::transpose(glm::dmat3(across, glm::cross(towards, across), towards));
  const glm::dmat3 reach(glm::abs(beam_from_world_[0]), glm::abs(beam_from_world_[1]), glm::abs(beam_from_world_[2]));
  std::vector<std::pair<glm::dvec3, glm::dvec3>> seen;
  for (const auto& [low, high] : boxes) {
    const glm::dvec3 middle = beam_from_world_ * (0.5 * (glm::dvec3(low) + glm::dvec3(high))),
                     half = reach * (0.5 * (glm::dvec3(high) - glm::dvec3(low)));
    seen.emplace_back(middle - half, middle + half);
    low_ = glm::min(low_, glm::dvec2(seen.back().first));
    high_ = glm::max(high_, glm::dvec2(seen.back().second));
  }
  for (const auto& [low, high] : seen) {
    const Columns reached = columns(glm::dvec2(low), glm::dvec2(high));
    for (int y = reached.first.y; y < reached.last.y; ++y)
      for (int x = reached.first.x; x < reached.last.x; ++x) {
        double& farthest = farthest_[column_number(x, y)];
        farthest = std::min(farthest, low.z);
      }
  }
}

ShadedPoints::Columns ShadedPoints::columns(glm::dvec2 low, glm::dvec2 high) const {
  if (low.x > high_.x || low.y > high_.y || high.x < low_.x || high.y < low_.y) return {glm::ivec2(0), glm::ivec2(0)};
  const glm::dvec2 scale = static_cast<double>(kColumns) / glm::max(high_ - low_, glm::dvec2(1e-12));
  const auto column = [&](glm::dvec2 at) { return glm::ivec2(glm::clamp((at - low_) * scale, 0.0, kColumns - 1.0)); };
  return {column(low), column(high) + 1};
}

bool ShadedPoints::may_be_shaded_by(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) const {
  if (are_all_) return true;
  const glm::dvec3 at_a = beam_from_world_ * glm::dvec3(a), at_b = beam_from_world_ * glm::dvec3(b),
                   at_c = beam_from_world_ * glm::dvec3(c);
  const glm::dvec3 low = glm::min(at_a, glm::min(at_b, at_c)), high = glm::max(at_a, glm::max(at_b, at_c));
  const Columns reached = columns(glm::dvec2(low), glm::dvec2(high));
  for (int y = reached.first.y; y < reached.last.y; ++y)
    for (int x = reached.first.x; x < reached.last.x; ++x)
      if (farthest_[column_number(x, y)] <= high.z) return true;
  return false;
}

// Each triangle's own volume is closed: those of the others are right without it.
VolumeTriangles ShadowCasters::volume(glm::dvec3 direction_to_sun, std::uint32_t infinity_index,
                                      std::span<const glm::vec3> vertices, const ShadedPoints& points) const {
  const auto casts = [&](const glm::uvec3& corner) {
    return points.may_be_shaded_by(vertices[corner.x], vertices[corner.y], vertices[corner.z]);
  };
  VolumeTriangles volume;
  std::vector<int> multiplicity(edges_.size(), 0);  // in the direction from -> to
  std::vector<std::uint32_t> fronts;
  for (const Triangle& triangle : triangles_) {
    const int side = facing(triangle, direction_to_sun);
    if (side == 0 || !casts(triangle.vertices)) continue;
    for (int i = 0; i < 3; ++i) {
      multiplicity[triangle.edges[i]] += side * triangle.along[i];
      (side > 0 ? fronts : volume.indices).push_back(triangle.vertices[i]);
    }
  }
  volume.clockwise_count = volume.indices.size();
  volume.indices.insert(volume.indices.end(), fronts.begin(), fronts.end());
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    auto [from, to] = edges_[e];
    if (multiplicity[e] < 0) std::swap(from, to);
    for (int copy = 0; copy < std::abs(multiplicity[e]); ++copy) {
      volume.indices.insert(volume.indices.end(), {to, from, infinity_index});
    }
  }
  return volume;
}

}  // namespace transom
