// Rooms that nothing can shade are found, and lit without looking for shade.
#include "transom/convex_room.h"

#include <gtest/gtest.h>

#include "rooms.h"

namespace transom {
namespace {

using test::add_box;
using test::add_quad;
using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions few_rays() {
  return test::quick(600, {64, 64}, {64, 16});
}

SceneGeometry turned(SceneGeometry scene) {
  const double a = 0.7, b = 0.4;
  for (glm::dvec3& v : scene.vertices) {
    v = {std::cos(a) * v.x - std::sin(a) * v.y, std::sin(a) * v.x + std::cos(a) * v.y, v.z};
    v = {v.x, std::cos(b) * v.y - std::sin(b) * v.z, std::sin(b) * v.y + std::cos(b) * v.z};
    v += glm::dvec3(700, -300, 40);
  }
  return scene;
}

// A sphere without its poles, in rows of trapezoids.
SceneGeometry sphere(int rows) {
  SceneGeometry scene;
  scene.materials = {test::diffuse(0.5f)};
  const auto at = [&](int row, int column) {
    const double polar = 3.14159265 * row / rows, azimuth = 3.14159265 * column / rows;
    return glm::dvec3(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar));
  };
  for (int row = 1; row < rows - 1; ++row)
    for (int column = 0; column < 2 * rows; ++column)
      add_quad(scene, at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1), 0);
  return scene;
}

bool is_convex(const SceneGeometry& scene) {
  return is_convex_room(make_faces(scene));
}

TEST(ConvexRoom, AnEmptyRoomIsConvexWhereverItStands) {
  EXPECT_TRUE(is_convex(roof_light_room(0.5f)));
  EXPECT_TRUE(is_convex(turned(roof_light_room(0.5f))));
}

TEST(ConvexRoom, WhatStandsInsideOrOutsideOrInTheOpeningMakesItNotConvex) {
  SceneGeometry furnished = roof_light_room(0.5f), shaded = furnished, with_reveal = furnished, neighbour = furnished;
  add_box(furnished, {2, 2, 1}, {2.1, 2.1, 1.1}, 0);
  add_quad(shaded, {0, 0, 4}, {1, 0, 4}, {1, 1, 4}, {0, 1, 4}, 0);
  add_quad(with_reveal, {1, 1, 3}, {3, 1, 3}, {3, 1, 3.01}, {1, 1, 3.01}, 0);
  add_box(neighbour, {9, 0, 0}, {10, 1, 1}, 0);
  for (const SceneGeometry& scene : {furnished, shaded, with_reveal, neighbour}) {
    EXPECT_FALSE(is_convex(scene));
    EXPECT_FALSE(is_convex(turned(scene)));
  }
}

TEST(ConvexRoom, FacesOfOnePlaneCountOnceAndMoreThanSomeHundredPlanesAreNotLookedAt) {
  SceneGeometry divided;
  divided.materials = {test::diffuse(0.5f)};
  const int count = 20;
  for (int i = 0; i < count * count; ++i) {
    const double x = i % count, y = i / count, high = count;
    add_quad(divided, {x, y, 0}, {x + 1, y, 0}, {x + 1, y + 1, 0}, {x, y + 1, 0}, 0);
    add_quad(divided, {x, y, high}, {x + 1, y, high}, {x + 1, y + 1, high}, {x, y + 1, high}, 0);
    add_quad(divided, {x, 0, y}, {x + 1, 0, y}, {x + 1, 0, y + 1}, {x, 0, y + 1}, 0);
    add_quad(divided, {x, high, y}, {x + 1, high, y}, {x + 1, high, y + 1}, {x, high, y + 1}, 0);
  }
  EXPECT_TRUE(is_convex(divided));
  EXPECT_TRUE(is_convex(turned(divided)));
  EXPECT_TRUE(is_convex(sphere(8)));
  EXPECT_FALSE(is_convex(sphere(16)));
}

TEST(ConvexRoom, LightIsBitByBitThatFoundByRays) {
  for (const SceneGeometry& scene : {roof_light_room(0.5f, 0.8f), turned(roof_light_room(0.5f))}) {
    const Engine engine(scene, tregenza(), few_rays());
    std::vector<int> slots;
    for (const int slot : engine.patch_slots())
      if (engine.scene().materials[engine.faces().faces[engine.mesh().slot(slot).face].material].opening < 0)
        slots.push_back(slot);
    const DirectLight& light = engine.direct_light();
    // Rays look for shade where patches are not known to lie behind openings.
    const auto behind = light.receivers(slots, std::vector<char>(slots.size(), 1)),
               anywhere = light.receivers(slots, {});
    int lit = 0;
    for (int k = 0; k < 40; ++k) {
      const float azimuth = 0.7f * static_cast<float>(k), height = 0.05f + 0.09f * static_cast<float>(k % 11);
      const Beam beam{glm::normalize(glm::vec3(std::cos(azimuth), std::sin(azimuth), height)), glm::vec3(1000)};
      BeamPlan plan;
      const std::vector<LitElement> skipped = light.deposit({beam}, behind, &plan),
                                    traced = light.deposit({beam}, anywhere);
      ASSERT_EQ(skipped.size(), traced.size()) << k;
      EXPECT_EQ(plan.is_unshaded, plan.beams > 0);
      for (std::size_t i = 0; i < traced.size(); ++i) {
        ASSERT_EQ(skipped[i].element, traced[i].element);
        ASSERT_EQ(skipped[i].illuminance, traced[i].illuminance) << k;
      }
      lit += static_cast<int>(traced.size());
    }
    EXPECT_GT(lit, 1000);
  }
}

TEST(ConvexRoom, APlanSaysWhetherShadeWasLookedFor) {
  Condition sunny = uniform_sky(1000);
  sunny.beams = {{{0, 0, 1}, glm::vec3(60000)}};
  SceneGeometry furnished = roof_light_room(0.5f);
  add_box(furnished, {1.5, 1.5, 1}, {2.5, 2.5, 1.2}, 0);
  const Engine empty(roof_light_room(0.5f), tregenza(), few_rays()), full(furnished, tregenza(), few_rays());
  EXPECT_TRUE(empty.relight(sunny)->plan.beams.is_unshaded);
  EXPECT_FALSE(empty.relight(uniform_sky(1000))->plan.beams.is_unshaded);
  EXPECT_FALSE(full.relight(sunny)->plan.beams.is_unshaded);
  // An edit that clears the room finds it convex, one that furnishes it does not.
  EXPECT_TRUE(Engine(full, roof_light_room(0.5f)).relight(sunny)->plan.beams.is_unshaded);
  EXPECT_FALSE(Engine(empty, furnished).relight(sunny)->plan.beams.is_unshaded);
}

}  // namespace
}  // namespace transom
