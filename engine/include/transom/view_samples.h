/// @file What a camera sees that no condition changes: surfaces, the nodes that speak for them, edges of surfaces.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/engine.h"
#include "transom/transfer.h"
#include "transom/view.h"

namespace transom {

/// A point at which beams are tested.
struct BeamPoint {
  glm::vec3 position{0};  ///< lifted
  glm::vec3 normal{0};    ///< shading normal of the side seen
  int surface = -1;       ///< face * 2 + side; -1: nothing
  float weight = 0;       ///< of the pixel's light: share of the pixel times the transmittance up to the point
  int pixel = 0;
  int sample = 0;  ///< of the pixel: row of samples * edge_samples + column, or one of the below

  static constexpr int kCentre = -1,
                       kNotInMasks = -2;  ///< kNotInMasks: surface that no square of the samples is full of
};

constexpr int kFiner = 2;  ///< times as many samples an axis say how much of a pixel each surface covers

/// Where in its pixel, from its upper left corner, a sample lies. Samples are a grid turned by atan(1 /
/// samples_per_axis): each has a square of the upright grid, a column and a row of its own, so that an edge along an
/// axis of the picture, as most edges of buildings are, is found to 1 / samples_per_axis^2 of the pixel.
glm::vec2 sample_place(int sample, int samples_per_axis);

/// Where a pixel without an edge is tested for beams: one of nine places, so that any three pixels side by side find
/// light or shade of a third of a pixel between them.
glm::vec2 scattered_place(int x, int y);

/// Where the ray through a point of the picture meets the plane through another point.
glm::vec3 place_on_plane(const CameraRays& camera, glm::vec3 eye, glm::vec2 pixel, glm::vec3 of_plane,
                         glm::vec3 normal);

/// The samples of a picture. Pixels without an edge of a surface have one, at their centre. The others are parts, by
/// what is seen: edge_samples^2 samples stand for them, and a grid that is kFiner times as fine an axis says how much
/// of the pixel each part covers. All but beams is summed beforehand as weights.
struct ViewSamples {
  ViewSamples(const Engine& engine, const View& view, int edge_samples);

  View view;
  int edge_samples;
  std::vector<char> has_edge;       ///< by pixel: an edge of a surface
  std::vector<BeamPoint> centre;    ///< by pixel: the surface at its centre; where it has no edge, at `scattered_place`
  std::vector<BeamPoint> fine;      ///< samples of pixels with an edge, part by part
  std::vector<BeamPoint> on_panes;  ///< room sides of openings in front of either

  /// One surface in a pixel with an edge: ranges of its points in `fine`, and of `places`.
  struct Part {
    std::size_t first_point, last_point, first_place, last_place;
  };
  std::vector<Part> parts;
  std::vector<int> places;  ///< of the finer grid: where a part is seen

  SparseRows smooth;  ///< by pixel: shares of what Engine::shown_radiance lists

  /// Light that no condition changes [cd/m²]: of point sources, and of emitters indoors and behind openings.
  struct Constant {
    int pixel;
    glm::vec3 lamps, emitted, emitted_outdoors;
  };
  std::vector<Constant> constant;

  /// Directions in which the sky or the ground is seen.
  struct Outlook {
    int pixel;
    float weight;
    glm::vec3 direction;
  };
  std::vector<Outlook> outlooks;

  /// Exit bins of panels in which their light is seen.
  struct SeenPanel {
    int pixel;
    float weight;
    int bin;
  };
  std::vector<SeenPanel> panels;
  int edge_pixel_count = 0;
};

}  // namespace transom
