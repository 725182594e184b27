/// @file The outlines of openings along a beam: which polygons its light may reach through them. No rays.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/geometry.h"

namespace transom {

/// A convex polygon of up to four corners as seen along a beam: on a plane across it, and how far towards the source.
struct BeamOutline {
  std::array<glm::vec2, 4> corner{};
  int corner_count = 0;
  glm::vec2 low{0}, high{0};        ///< of the corners
  float nearest = 0, farthest = 0;  ///< along the direction to the source [m]
};

/// Outlines of faces along one direction.
class BeamOutlines {
 public:
  /// passages: numbers of faces that light may pass, such as openings.
  BeamOutlines(const Faces& faces, const std::vector<int>& passages, glm::vec3 direction_to_source);

  BeamOutline outline(std::span<const glm::vec3> corners) const;

  /// The passages that cover some of a polygon and do not lie wholly behind it. Conservative: one that covers nothing
  /// may be named, none that covers something is left out.
  void covering(const BeamOutline& polygon, std::vector<int>& passages) const;

  /// Whether passage k may cover some of a box as along_beam has it, in the same sense.
  bool may_cover(int k, glm::vec3 low, glm::vec3 high) const;

  /// Whether passage k may cover some of a polygon, in the same sense.
  bool covers(int k, const BeamOutline& polygon) const;

  /// Points, coordinate by coordinate.
  struct Points {
    std::vector<float> x, y, z;

    static Points of(std::span<const glm::vec3> positions) {
      Points points;
      points.resize(positions.size());
      for (std::size_t i = 0; i < positions.size(); ++i) points.set(i, positions[i]);
      return points;
    }
    void resize(std::size_t count) {
      for (std::vector<float>* list : {&x, &y, &z}) list->resize(count);
    }
    std::size_t size() const { return x.size(); }
    glm::vec3 operator[](std::size_t i) const { return {x[i], y[i], z[i]}; }
    void set(std::size_t i, glm::vec3 point) {
      x[i] = point.x;
      y[i] = point.y;
      z[i] = point.z;
    }
  };

  /// A point as seen along the beam: its place across it, and in z how far towards the source it is [m].
  glm::vec3 along_beam(glm::vec3 point) const {
    return {glm::dot(point, across_), glm::dot(point, along_), glm::dot(point, towards_)};
  }
  void along_beam(const Points& points, Points& seen) const;
  /// Half the size of the box, as along_beam has it, around one whose half size is `half`.
  glm::vec3 half_along_beam(glm::vec3 half) const {
    return {glm::dot(half, glm::abs(across_)), glm::dot(half, glm::abs(along_)), glm::dot(half, glm::abs(towards_))};
  }

  /// Which points (as along_beam has them: coordinates x, y and z, one after the other) lie behind passage k, a planar
  /// one: light that arrives there along the beam has come through it. Exactly; is_behind: 1 or 0 for each.
  void mark_behind(int k, std::span<const float> x, std::span<const float> y, std::span<const float> z,
                   std::span<int> is_behind) const;

 private:
  struct Passage {
    BeamOutline outline;
    // Of each edge: (a, b, c) with a x + b y + c >= 0 on its inner side. A triangle has one that all points pass.
    std::array<glm::vec3, 4> inwards{glm::vec3(0), glm::vec3(0), glm::vec3(0), glm::vec3(0)};
    glm::vec3 depth{0};  // the same, of how far towards the source its plane is
    bool is_edge_on = false;
  };

  glm::vec3 across_, along_, towards_;
  float margin_;
  std::vector<Passage> passages_;
};

}  // namespace transom
