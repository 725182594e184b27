/// @file Light that leaves a glazing product, and how far it is followed inside: what its tracers have in common.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace transom {

/// Light that leaves: a direction of propagation and a share of the incident flux.
struct Exit {
  glm::dvec3 direction;
  double flux;
};

/// Where the incident flux went; the shares add up to 1.
struct ProductLight {
  std::vector<Exit> transmitted, reflected;
  double absorbed = 0;
  double unfinished = 0;  ///< carried by branches that were given up: too long, or lost between surfaces
};

struct TraceOptions {
  int ray_count = 1024;       ///< rays that stand for all of the incident light
  int maximum_events = 4000;  ///< on one path
  /// Of the flux of a ray: a weaker branch does not divide, it goes one way by chance.
  double split_share = 0.05;
  std::uint32_t seed = 1;
};

/// Gathers exits; those of one direction become one, as long as there are few of them.
class ExitSorter {
 public:
  explicit ExitSorter(bool is_inward) : is_inward_(is_inward) {}  ///< is_inward: the light comes from outdoors

  /// is_spread: from a curved or diffuse surface, so that no other exit has its direction.
  void add(glm::dvec3 direction, double flux, bool is_spread);
  void append(const ExitSorter& other);

  double absorbed = 0, unfinished = 0;

  ProductLight light() const;

 private:
  struct Side {
    std::vector<Exit> sharp, spread;
  };
  Side transmitted_, reflected_;
  bool is_inward_;
};

}  // namespace transom
