/// @file Light through the section of a glazing product that is extruded along one axis and repeats along another: a
/// goniophotometer that needs no laboratory. Frame: x along the extrusion, y up, z into the room; metres.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace transom {

/// What fills an area of the section.
struct Medium {
  double index = 1;       ///< of refraction
  double absorption = 0;  ///< [1/m]
};

/// What happens at a line of the section. kInterface: Fresnel's equations between the media of its sides. kGap: a thin
/// gap of air inside the medium, whose two faces act together. kMirror: specular with `reflectance`. kDiffuse:
/// Lambertian with `reflectance` and `transmittance`. Of kMirror and kDiffuse, `openness` is the share that is holes.
enum class LineKind { kInterface, kGap, kMirror, kDiffuse };

/// A straight line of the section from a to b, as (y, z).
struct Line {
  glm::dvec2 a{0}, b{0};
  LineKind kind = LineKind::kInterface;
  int left = 0, right = 0;       ///< media to the left and right of a -> b, seen with y to the right and z up
  double reflectance = 0;        ///< of the left side
  double reflectance_right = 0;  ///< of the right side
  double transmittance = 0;      ///< kDiffuse
  double openness = 0;
};

/// One period, 0 <= y < period, between the planes z = low_z (outdoors) and z = high_z (room). Medium 0 is the air
/// around.
struct Section {
  double period = 1;
  double low_z = 0, high_z = 0;
  std::vector<Medium> media;
  std::vector<Line> lines;

  /// Throws InputError for lines outside the period or the planes, media out of range, or impossible coefficients.
  void validate() const;
};

/// Light that leaves the section: a direction of propagation and a share of the incident flux.
struct Exit {
  glm::dvec3 direction;
  double flux;
};

/// Where the incident flux went; the shares add up to 1.
struct SectionLight {
  std::vector<Exit> transmitted, reflected;
  double absorbed = 0;
  double unfinished = 0;  ///< carried by branches too weak or too long to follow
};

/// How far branches are followed.
struct SectionOptions {
  int ray_count = 1024;       ///< stratified over the period
  int maximum_events = 4000;  ///< on one path
  double split_share = 0.01;  ///< of the flux of a ray; a weaker branch does not divide, it goes one way by chance
  std::uint32_t seed = 1;
};

/// Sends parallel unpolarised light of one direction through a section. Branches of reflection and refraction are
/// followed with their polarisation (Stokes vectors and Fresnel's Mueller matrices [Born & Wolf 1999, sections 1.5 and
/// 10.9]); diffuse surfaces send one random ray a way. The x component of the optical direction is constant, so that
/// a path moves in the plane. Exits of one direction are added up.
SectionLight trace_section(const Section& section, glm::dvec3 direction, SectionOptions options);

}  // namespace transom
