#include "transom/box_tree.h"

#include <algorithm>
#include <numeric>

namespace transom {
namespace {

constexpr std::size_t kLeafSize = 4;

}  // namespace

BoxTree::BoxTree(std::vector<Box> boxes) : boxes_(std::move(boxes)), order_(boxes_.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(boxes_.size());
  if (!boxes_.empty()) build(0, boxes_.size());
}

// Halves the boxes at the median of their middles along the longest axis.
int BoxTree::build(std::size_t first, std::size_t last) {
  Node node{boxes_[static_cast<std::size_t>(order_[first])], first, last};
  for (std::size_t k = first; k < last; ++k) {
    const Box& box = boxes_[static_cast<std::size_t>(order_[k])];
    node.box.low = glm::min(node.box.low, box.low);
    node.box.high = glm::max(node.box.high, box.high);
  }
  const int number = static_cast<int>(nodes_.size());
  nodes_.push_back(node);
  if (last - first <= kLeafSize) return number;
  const glm::dvec3 size = node.box.high - node.box.low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const auto at = [&](std::size_t k) { return order_.begin() + static_cast<std::ptrdiff_t>(k); };
  const std::size_t middle = (first + last) / 2;
  const auto place = [&](int i) {
    return boxes_[static_cast<std::size_t>(i)].low[axis] + boxes_[static_cast<std::size_t>(i)].high[axis];
  };
  std::nth_element(at(first), at(middle), at(last),
                   [&](int a, int b) { return place(a) != place(b) ? place(a) < place(b) : a < b; });
  build(first, middle);
  const int right = build(middle, last);
  nodes_[static_cast<std::size_t>(number)].right = right;
  return number;
}

}  // namespace transom
