/// @file Axis-aligned boxes in a tree, to find those that meet another box without looking at all of them.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace transom {

struct Box {
  glm::dvec3 low, high;
};

inline bool overlap(const Box& a, const Box& b) {
  return glm::all(glm::lessThanEqual(a.low, b.high)) && glm::all(glm::lessThanEqual(b.low, a.high));
}

/// Built once: memory in proportion to the boxes, time n log n.
class BoxTree {
 public:
  explicit BoxTree(std::vector<Box> boxes);

  /// Calls body(index) for every box that meets `query`, in an order that depends on the boxes alone.
  template <typename Body>
  void visit(const Box& query, const Body& body) const {
    if (nodes_.empty()) return;
    std::vector<int> stack{0};
    while (!stack.empty()) {
      const Node& node = nodes_[static_cast<std::size_t>(stack.back())];
      stack.pop_back();
      if (!overlap(node.box, query)) continue;
      if (node.right > 0) {
        stack.push_back(node.right);
        stack.push_back(static_cast<int>(&node - nodes_.data()) + 1);
        continue;
      }
      for (std::size_t k = node.first; k < node.last; ++k)
        if (overlap(boxes_[static_cast<std::size_t>(order_[k])], query)) body(order_[k]);
    }
  }

 private:
  struct Node {
    Box box;
    std::size_t first, last;  // into order_
    int right = 0;            // the second child; the first follows its parent; 0: a leaf
  };
  int build(std::size_t first, std::size_t last);

  std::vector<Box> boxes_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace transom
