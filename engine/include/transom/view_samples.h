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

/// Points one after the other that lie on one side of a face, close together.
struct BeamGroup {
  int surface;              ///< face * 2 + side
  std::size_t first, last;  ///< points
  glm::vec3 low{0}, high{0};
};

constexpr int kFiner = 2;  ///< times as many samples an axis say how much of a pixel a surface covers or a beam lights

/// Where in its pixel, from its upper left corner, a sample lies. Samples are a grid turned by atan(1 /
/// samples_per_axis): each has a square of the upright grid, a column and a row of its own, so that an edge along an
/// axis of the picture, as most edges of buildings are, is found to 1 / samples_per_axis^2 of the pixel.
glm::vec2 sample_place(int sample, int samples_per_axis);
std::vector<glm::vec2> all_places(int samples_per_axis);

/// Where a pixel without an edge is tested for beams: one of nine places, so that any three pixels side by side find
/// light or shade of a third of a pixel between them.
glm::vec2 scattered_place(int x, int y);

/// Where the rays through places of a pixel, from its upper left corner, meet the plane through another point.
void places_on_plane(const CameraRays& camera, glm::vec3 eye, glm::vec2 corner, std::span<const glm::vec2> places,
                     glm::vec3 of_plane, glm::vec3 normal, std::span<glm::vec3> met);

/// The samples of a picture. Pixels without an edge of a surface have one, at their centre. The others are parts, by
/// what is seen: edge_samples^2 samples stand for them, and a grid that is kFiner times as fine an axis says how much
/// of the pixel each part covers. All but beams is summed beforehand as weights.
struct ViewSamples {
  ViewSamples(const Engine& engine, const View& view, int edge_samples);

  /// One surface in a pixel with an edge: its points in `fine`, and a range of `places`.
  struct Part : BeamGroup {
    std::size_t first_place, last_place;
  };

  /// Light that no condition changes [cd/m²]: of point sources, and of emitters indoors and behind openings.
  struct Constant {
    int pixel;
    glm::vec3 lamps, emitted, emitted_outdoors;
  };

  /// Directions in which the sky or the ground is seen.
  struct Outlook {
    int pixel;
    float weight;
    glm::vec3 direction;
    glm::vec2 place;  ///< SkyPicture::place_of
  };

  /// Exit bins of panels in which their light is seen.
  struct SeenPanel {
    int pixel;
    float weight;
    int bin;
  };

  /// What belongs to one row of the picture.
  struct Row {
    std::vector<BeamGroup> centre_groups;  ///< of `centre`: all that beams may reach
    std::vector<BeamPoint> fine;           ///< samples of pixels with an edge, part by part
    std::vector<Part> parts;
    std::vector<int> places;          ///< of the finer grid: where a part is seen
    std::vector<BeamPoint> on_panes;  ///< room sides of openings in front of either
    std::vector<BeamGroup> pane_groups;
    SparseRows smooth;  ///< by column: shares of what Engine::shown_radiance lists
    std::vector<Constant> constant;
    std::vector<Outlook> outlooks;
    std::vector<SeenPanel> panels;
  };

  View view;
  int edge_samples;
  std::vector<char> has_edge;     ///< by pixel: an edge of a surface
  std::vector<BeamPoint> centre;  ///< by pixel: the surface at its centre; where it has no edge, at `scattered_place`,
                                  ///< unless there is one sample a pixel
  std::vector<Row> rows;
  std::vector<int> surfaces;          ///< all that groups and parts lie on, each once
  std::vector<int> place_of_surface;  ///< among them; -1: is not
};

}  // namespace transom
