#include "transom/screens.h"

#include <gtest/gtest.h>

#include "rooms.h"
#include "transom/ray_scene.h"
#include "transom/sampling.h"

namespace transom {
namespace {

using test::add_quad;
using test::diffuse;

// Slanting screens in a space, and points in rows through it.
struct ScreenedSpace {
  static constexpr std::size_t kBlock = 8;
  SceneGeometry scene;
  Faces faces;
  std::vector<Node> points;

  ScreenedSpace() {
    scene.materials = {diffuse(0.5f)};
    add_quad(scene, {1, 1, 0}, {3, 1, 0.5}, {3, 2, 0.5}, {1, 2, 0}, 0);
    add_quad(scene, {4, 0, 0}, {4, 3, 0}, {4, 3, 2}, {4, 0, 2}, 0);
    faces = make_faces(scene);
    for (int i = 0; i < 20 * static_cast<int>(kBlock); ++i)
      points.push_back({{-3.f + 0.3f * static_cast<float>(i % 20), -2.f + 0.025f * static_cast<float>(i), 0.4f}, {}});
  }
};

TEST(Screens, WhatTheySayNeverHidesIsMetByNoRay) {
  const ScreenedSpace space;
  const RayScene rays(space.faces, space.scene.materials, space.scene.openings);
  const Screens screens(space.faces, {0, 1}, space.points, ScreenedSpace::kBlock);
  const SobolSequence random(3);
  int clear = 0, hidden = 0;
  for (std::uint32_t k = 0; k < 64; ++k) {
    const glm::vec4 u = random.point4(k);
    const glm::vec3 place(-4 + 8 * u.x, -3 + 6 * u.y, -2 + 4 * u.z);
    const Screens::Places places = screens.places({&place, 1});
    for (std::size_t block = 0; block * ScreenedSpace::kBlock < space.points.size(); ++block) {
      bool is_met = false;
      for (std::size_t i = 0; i < ScreenedSpace::kBlock; ++i) {
        const Ray ray{place, space.points[block * ScreenedSpace::kBlock + i].position - place, 0, 1};
        std::uint8_t blocked = 0;
        rays.occluded(RayScene::What::kOpaque, {&ray, 1}, {&blocked, 1});
        is_met |= blocked != 0;
      }
      const bool may_hide = screens.may_hide(places, block);
      EXPECT_TRUE(may_hide || !is_met) << k << " " << block;
      clear += !may_hide;
      hidden += is_met;
    }
  }
  EXPECT_GT(hidden, 50);  // both happen,
  EXPECT_GT(clear, 300);  // and much of what is clear is found to be
}

TEST(Screens, PlacesOnBothSidesOfAPlaneMayBeHidden) {
  const ScreenedSpace space;
  const Screens screens(space.faces, {1}, space.points, ScreenedSpace::kBlock);
  const glm::vec3 one_side = space.points[0].position, other_side(3, 0, 0);
  const glm::vec3 both[]{one_side, other_side};
  EXPECT_FALSE(screens.may_hide(screens.places({both, 1}), 0));
  EXPECT_TRUE(screens.may_hide(screens.places(both), 0));
}

TEST(Screens, WhatIsNearerToAPlaneThanRaysMayBeMovedAsideMayBeHidden) {
  const ScreenedSpace space;
  const Screens screens(space.faces, {1}, space.points, ScreenedSpace::kBlock);
  const Face& face = space.faces.faces[1];
  const glm::vec3 middle = face.position({0.5f, 0.5f});
  const float side = glm::dot(space.points[0].position - middle, face.normal) > 0 ? 1.f : -1.f;
  for (const float offsets : {0.f, 0.5f, 3.f}) {
    const glm::vec3 place = middle + side * offsets * space.faces.ray_offset() * face.normal;
    EXPECT_EQ(screens.may_hide(screens.places({&place, 1}), 0), offsets < 1) << offsets;
  }
}

TEST(Screens, NoFacesHideNothing) {
  const ScreenedSpace space;
  const Screens screens(space.faces, {}, space.points, ScreenedSpace::kBlock);
  EXPECT_FALSE(screens.may_hide(screens.places({&space.points[0].position, 1}), 3));
}

}  // namespace
}  // namespace transom
