/// @file The lines of a section as what light meets: the nearest one on a path, over all repetitions of the period.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/section.h"

namespace transom {

class SectionProfile {
 public:
  /// A line with what its meetings need.
  struct Shape {
    glm::dvec2 a{0}, b{0}, edge{0}, normal{0};
    glm::dvec2 centre{0};
    double radius = 0, curvature = 0;  // 0: straight
    double side = 1;                   // of the chord on which the arc lies: 1 left
    double low_y = 0, high_y = 0;
    bool is_pane = false;  // level and a whole period long: one endless line
  };

  explicit SectionProfile(const Section& section);

  static constexpr int kLeaves = -1;   ///< through a plane of the section
  static constexpr int kNothing = -2;  ///< runs between the planes without end

  struct Hit {
    double t = 1e300;  ///< in units of the direction `along`
    int line = kNothing;
    double shift = 0;  ///< along y, of the repetition that is met
  };

  /// from: the line that the path starts on, in its place of the first period; -1 for none.
  Hit nearest(glm::dvec2 place, glm::dvec2 along, int from) const;

  /// Where parallel light from the points of start -> end is cut by ends of lines and silhouettes of arcs: shares of
  /// the way from start to end, unsorted. False when there are too many to be worth it.
  bool cuts(glm::dvec2 start, glm::dvec2 end, glm::dvec2 along, std::vector<double>& shares) const;

  /// How far light from `place` is from the straight line of a hit, however long it were.
  double distance_to(const Hit& hit, glm::dvec2 place, glm::dvec2 along) const;

  /// Unit normal on the front of a line at a place on it.
  glm::dvec2 front_normal(int line, glm::dvec2 place) const;

  bool is_arc(int line) const { return shapes_[static_cast<std::size_t>(line)].curvature > 0; }

 private:
  double reach(glm::dvec2 place, glm::dvec2 along) const;

  double period_, per_metre_, low_z_, high_z_, close_;
  double others_low_z_ = 1e300, others_high_z_ = -1e300;  // of lines that are no panes
  std::vector<Shape> shapes_;
  std::vector<int> panes_, others_;
};

}  // namespace transom
