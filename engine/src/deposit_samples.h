/// @file Where direct light is sampled on elements.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "transom/deposit.h"
#include "transom/sampling.h"

namespace transom {

inline constexpr std::uint32_t kPatternCount = 64;
inline constexpr std::uint32_t kPatternPoints = 32;

// Places of samples in an element, evenly spread: one of some patterns, moved by an offset of the element's own
// [Cranley & Patterson 1976], so that no two elements repeat each other. Neighbours that did would err alike about
// stripes of light.
class DirectLight::Patterns {
 public:
  explicit Patterns(std::uint32_t seed) : seed_(seed) {
    for (std::uint32_t pattern = 0; pattern < kPatternCount; ++pattern) {
      const SobolSequence sequence(hash_seed(seed, pattern));
      for (std::uint32_t i = 0; i < kPatternPoints; ++i) {
        const glm::vec2 point = sequence.point2(i);
        x_.push_back(point.x);
        y_.push_back(point.y);
      }
    }
  }

  class Pattern {
   public:
    Pattern(const float* x, const float* y, glm::vec2 offset) : x_(x), y_(y), offset_(offset) {}
    glm::vec2 operator[](std::size_t i) const { return {moved(x_[i], offset_.x), moved(y_[i], offset_.y)}; }

   private:
    static float moved(float place, float offset) { return place + offset < 1 ? place + offset : place + offset - 1; }
    const float *x_, *y_;
    glm::vec2 offset_;
  };
  Pattern of(int element) const {
    const std::uint32_t hash = hash_seed(seed_, static_cast<std::uint64_t>(element));
    const auto part = [hash](int shift) { return static_cast<float>(hash >> shift & 0xfffu) / 4096; };
    const std::size_t first = static_cast<std::size_t>(hash % kPatternCount) * kPatternPoints;
    return {&x_[first], &y_[first], {part(8), part(20)}};
  }

 private:
  std::uint32_t seed_;
  std::vector<float> x_, y_;
};

}  // namespace transom
