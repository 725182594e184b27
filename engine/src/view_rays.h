/// @file Rays from a camera through the places of its pixels, and what the places of one pixel see told apart.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "transom/engine.h"
#include "transom/view_samples.h"

namespace transom {

/// A surface at the end of a ray from the camera, or a pane on the way.
struct Seen {
  Hit hit;                 ///< face -1: the sky or the ground
  float through = 1;       ///< transmittance of the openings in front of it
  int crossings = 0;       ///< openings in front of it
  glm::vec3 direction{0};  ///< of the ray
  bool ends_at_panel = false;
  int panel_bin = -1;  ///< by which the panel's own light is seen; -1: none, from outdoors
};

struct SeenPane {
  std::size_t ray;
  Seen seen;
};

/// From the camera to the first opaque surface, through any number of openings.
class CameraTracer {
 public:
  CameraTracer(const Engine& engine, const View& view)
      : engine_(engine), camera_(view), origin_(view.position - engine.faces().origin) {}

  /// places: from the upper left corner of a pixel. seen: of the same size. panes: replaced; those that reflect. Null:
  /// nobody asks for them.
  void trace(glm::vec2 corner, std::span<const glm::vec2> places, std::span<Seen> seen, std::vector<SeenPane>* panes);

 private:
  bool passes(std::size_t ray, Seen& here, std::vector<SeenPane>* panes) const;

  const Engine& engine_;
  const CameraRays camera_;
  const glm::vec3 origin_;
  std::vector<float> x_, y_, z_;
  std::vector<std::size_t> active_, before_;
  std::vector<Ray> rays_;
  std::vector<Hit> hits_;
};

/// Tells apart what the places of a pixel see, by two grids: each part has the samples of the coarser one, or of the
/// finer one where the coarser has missed it, and covers as much of the pixel as the finer one says.
class PixelParts {
 public:
  explicit PixelParts(int samples_per_axis) : s_(samples_per_axis) {}

  struct Sample {
    const Seen* seen;
    int place;  ///< BeamPoint::sample
  };
  /// All that is alike of what a pixel sees.
  struct Part {
    std::vector<Sample> samples;
    std::vector<int> places;  ///< of the finer grid, at which it is seen
  };
  /// Valid until asked again, and as long as the seen are.
  std::span<const Part> tell_apart(std::span<const Seen> coarse, std::span<const Seen> finer);

 private:
  std::size_t part_of(std::int64_t name) const;
  void find_whole_places();
  int place_in_masks(std::size_t part, int own) const;

  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  int s_;
  std::vector<std::int64_t> names_;
  std::vector<Part> parts_;           // the first of them, as many as there are names
  std::vector<std::size_t> part_at_;  // by place of the finer grid
  std::vector<std::size_t> whole_;    // by place of the coarser grid
};

}  // namespace transom
