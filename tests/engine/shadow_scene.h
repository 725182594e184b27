/// @file Scenes of triangles, for tests of shadow volumes and their casters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace transom::test {

struct TestScene {
  std::vector<glm::vec3> vertices;
  std::vector<glm::uvec3> opaque;
  std::vector<std::vector<glm::uvec3>> openings;

  /// Two triangles with vertices of their own, as meshes with normals have them. group -1: opaque.
  void add_quad(glm::vec3 corner, glm::vec3 u, glm::vec3 v, int group = -1) {
    const auto first = static_cast<std::uint32_t>(vertices.size());
    for (const glm::vec3& vertex : {corner, corner + u, corner + u + v, corner + v}) vertices.push_back(vertex);
    if (group >= static_cast<int>(openings.size())) openings.resize(static_cast<std::size_t>(group) + 1);
    auto& triangles = group < 0 ? opaque : openings[static_cast<std::size_t>(group)];
    triangles.emplace_back(first, first + 1, first + 2);
    triangles.emplace_back(first, first + 2, first + 3);
  }

  /// A closed box, normals outwards.
  void add_box(glm::vec3 low, glm::vec3 high, bool inwards = false) {
    const glm::vec3 x(high.x - low.x, 0, 0), y(0, high.y - low.y, 0), z(0, 0, high.z - low.z);
    const auto side = [&](glm::vec3 corner, glm::vec3 u, glm::vec3 v) {
      inwards ? add_quad(corner, v, u) : add_quad(corner, u, v);
    };
    side(low, y, x), side(low, x, z), side(low, z, y);
    side(low + z, x, y), side(low + y, z, x), side(low + x, y, z);
  }

  /// A wall in the plane y = constant from x = 0 to `width`, with holes given by (low x, low z, high x, high z), cut
  /// into strips that leave T-junctions.
  void add_facade(float y, float width, float height, const std::vector<glm::vec4>& holes) {
    float x = 0;
    for (const glm::vec4& hole : holes) {
      add_quad({x, y, 0}, {hole.x - x, 0, 0}, {0, 0, height});
      add_quad({hole.x, y, 0}, {hole.z - hole.x, 0, 0}, {0, 0, hole.y});
      add_quad({hole.x, y, hole.w}, {hole.z - hole.x, 0, 0}, {0, 0, height - hole.w});
      x = hole.z;
    }
    add_quad({x, y, 0}, {width - x, 0, 0}, {0, 0, height});
  }
};

}  // namespace transom::test
