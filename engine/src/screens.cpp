#include "transom/screens.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr std::size_t kWordBits = 64;

// Of the lift of points off surfaces: segments between points that lie on one side of a surface pass so far beside it,
// after they have been moved aside (0.3) and the face may have been set back (0.4).
constexpr float kClearance = 0.75f;

}  // namespace

Screens::Box Screens::box_of(std::span<const glm::vec3> positions) {
  Box box{positions.front(), positions.front()};
  for (const glm::vec3& position : positions) {
    box.low = glm::min(box.low, position);
    box.high = glm::max(box.high, position);
  }
  return box;
}

Screens::Screens(const Faces& faces, const std::vector<int>& screens, std::span<const Node> points,
                 std::size_t block_size)
    : word_count_((screens.size() + kWordBits - 1) / kWordBits),
      blocks_((points.size() + block_size - 1) / block_size),
      is_front_(blocks_.size() * word_count_, 0),
      is_back_(blocks_.size() * word_count_, 0) {
  for (const int index : screens) {
    const Face& face = faces.faces[static_cast<std::size_t>(index)];
    float thickness = 0;  // how far corners lie off the plane
    for (const glm::vec3& corner : face.corners())
      thickness = std::max(thickness, std::abs(glm::dot(corner - face.corner[0], face.normal)));
    const float clearance = thickness + kClearance * faces.ray_offset();
    const Box box = box_of(face.corners());
    screens_.push_back({face.corner[0], face.normal, clearance, {box.low - clearance, box.high + clearance}});
  }
  parallel_indices(blocks_.size(), 1, [&](std::size_t b) {
    std::vector<glm::vec3> positions;
    for (const Node& point : points.subspan(b * block_size, std::min(block_size, points.size() - b * block_size)))
      positions.push_back(point.position);
    blocks_[b] = box_of(positions);
    mark_sides(positions, is_front_.data() + b * word_count_, is_back_.data() + b * word_count_);
  });
}

// Bits beyond the last screen stay 0 in both.
void Screens::mark_sides(std::span<const glm::vec3> positions, std::uint64_t* is_front, std::uint64_t* is_back) const {
  for (std::size_t k = 0; k < screens_.size(); ++k) {
    const Screen& screen = screens_[k];
    float least = Ray::kInfinity, most = -Ray::kInfinity;
    for (const glm::vec3& position : positions) {
      const float height = glm::dot(position - screen.corner, screen.normal);
      least = std::min(least, height);
      most = std::max(most, height);
    }
    const std::uint64_t bit = std::uint64_t{1} << k % kWordBits;
    if (least > screen.clearance) is_front[k / kWordBits] |= bit;
    if (most < -screen.clearance) is_back[k / kWordBits] |= bit;
  }
}

Screens::Places Screens::places(std::span<const glm::vec3> positions) const {
  const Box box = box_of(positions);
  Places places{std::vector<std::uint64_t>(word_count_, 0), std::vector<std::uint64_t>(word_count_, 0), box.low,
                box.high};
  mark_sides(positions, places.is_front.data(), places.is_back.data());
  return places;
}

bool Screens::may_hide(const Places& places, std::size_t block) const {
  const glm::vec3 low = glm::min(places.low, blocks_[block].low), high = glm::max(places.high, blocks_[block].high);
  for (std::size_t w = 0; w < word_count_; ++w) {
    const std::size_t word = block * word_count_ + w;
    std::uint64_t parting = ~((is_front_[word] & places.is_front[w]) | (is_back_[word] & places.is_back[w]));
    for (; parting != 0; parting &= parting - 1) {
      const std::size_t k = w * kWordBits + static_cast<std::size_t>(std::countr_zero(parting));
      if (k >= screens_.size()) break;
      const Box& box = screens_[k].box;
      if (!glm::any(glm::greaterThan(box.low, high)) && !glm::any(glm::greaterThan(low, box.high))) return true;
    }
  }
  return false;
}

}  // namespace transom
