#include "transom/product_light.h"

#include <algorithm>
#include <span>

namespace transom {
namespace {

constexpr double kSameDirection = 1e-9;  // between unit vectors that are one exit
constexpr std::size_t kFewExits = 256;

void add_sharp(std::vector<Exit>& exits, glm::dvec3 direction, double flux) {
  for (Exit& exit : std::span(exits).first(std::min(exits.size(), kFewExits))) {
    const glm::dvec3 apart = exit.direction - direction;
    if (glm::dot(apart, apart) < kSameDirection * kSameDirection) {
      exit.flux += flux;
      return;
    }
  }
  exits.push_back({direction, flux});
}

}  // namespace

void ExitSorter::add(glm::dvec3 direction, double flux, bool is_spread) {
  Side& side = (direction.z > 0) == is_inward_ ? transmitted_ : reflected_;
  if (is_spread)
    side.spread.push_back({direction, flux});
  else
    add_sharp(side.sharp, direction, flux);
}

void ExitSorter::append(const ExitSorter& other) {
  for (const auto& [from, to] : {std::pair{&other.transmitted_, &transmitted_}, {&other.reflected_, &reflected_}}) {
    for (const Exit& exit : from->sharp) add_sharp(to->sharp, exit.direction, exit.flux);
    to->spread.insert(to->spread.end(), from->spread.begin(), from->spread.end());
  }
  absorbed += other.absorbed;
  unfinished += other.unfinished;
}

ProductLight ExitSorter::light() const {
  ProductLight light;
  for (const auto& [from, to] : {std::pair{&transmitted_, &light.transmitted}, {&reflected_, &light.reflected}}) {
    *to = from->sharp;
    to->insert(to->end(), from->spread.begin(), from->spread.end());
  }
  light.absorbed = absorbed;
  light.unfinished = unfinished;
  return light;
}

}  // namespace transom
