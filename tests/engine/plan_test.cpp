// A relighting does no more than its scene and its condition need, and says so.
#include <gtest/gtest.h>

#include "rooms.h"
#include "transom/beam_outlines.h"
#include "transom/sampling.h"

namespace transom {
namespace {

using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions small_options() {
  return test::quick(600, {128, 64}, {64, 64});
}

Condition sunny(glm::vec3 to_sun, glm::vec3 illuminance) {
  Condition condition = uniform_sky(3000, 500);
  condition.beams.push_back({glm::normalize(to_sun), illuminance});
  return condition;
}

TEST(Plan, AGreySceneInGreyLightComputesOneChannelAndFindsWhatThreeFind) {
  const Engine engine(roof_light_room(0.6f, 0.8f), tregenza(), small_options());
  const glm::vec3 to_sun(0.2f, 0.3f, 1);
  const auto grey = engine.relight(sunny(to_sun, glm::vec3(60000))),
             coloured = engine.relight(sunny(to_sun, {60000, 59000, 61000}));
  EXPECT_TRUE(grey->plan.is_grey);
  EXPECT_FALSE(coloured->plan.is_grey);
  ASSERT_EQ(grey->sweeps, coloured->sweeps);
  for (std::size_t i = 0; i < grey->node_indirect.size(); ++i) {
    EXPECT_FLOAT_EQ(grey->node_indirect[i].x, coloured->node_indirect[i].x);
    EXPECT_EQ(grey->node_indirect[i], glm::vec3(grey->node_indirect[i].x));
  }
  for (std::size_t p = 0; p < grey->patch_irradiance.size(); ++p)
    EXPECT_FLOAT_EQ(grey->patch_irradiance[p].x, coloured->patch_irradiance[p].x);
}

TEST(Plan, AColouredReflectanceMakesTheSceneColoured) {
  SceneGeometry scene = roof_light_room(0.6f);
  scene.materials[0].reflectance = {0.6f, 0.6f, 0.5f};
  const Engine engine(scene, tregenza(), small_options());
  EXPECT_FALSE(engine.relight(uniform_sky(1000))->plan.is_grey);
}

TEST(Plan, AnOvercastSkyHasNoBeams) {
  const Engine engine(roof_light_room(0.6f), tregenza(), small_options());
  const auto light = engine.relight(uniform_sky(1000));
  EXPECT_EQ(light->plan.beams.beams, 0);
  EXPECT_EQ(light->plan.beams.patches, 0);
  EXPECT_TRUE(light->lit_elements.empty());
}

TEST(Plan, ABeamThatNoOpeningFacesIsLeftOut) {
  const Engine engine(roof_light_room(0.6f), tregenza(), small_options());
  const auto below = engine.relight(sunny({0.2f, 0.3f, -1}, glm::vec3(60000))),
             above = engine.relight(sunny({0.2f, 0.3f, 1}, glm::vec3(60000)));
  EXPECT_EQ(below->plan.beams.beams, 0);
  EXPECT_EQ(below->plan.beams.facing_openings, 0);
  EXPECT_TRUE(below->lit_elements.empty());
  EXPECT_EQ(above->plan.beams.beams, 1);
  EXPECT_GT(above->plan.beams.facing_openings, 0);
}

TEST(Plan, OnlyPatchesThatTheOutlineOfAnOpeningFallsOnAreLookedAt) {
  // 4 x 4 of the floor's 8 x 8 patches are lit; those around them, which the outline touches, are looked at too.
  const Engine engine(roof_light_room(0.6f), tregenza(), small_options());
  const auto light = engine.relight(sunny({0, 0, 1}, glm::vec3(60000)));
  double lit = 0;
  int floor_patches = 0;
  for (const LitElement& e : light->lit_elements) lit += e.illuminance.y * engine.mesh().element_area(e.element);
  for (const int slot : engine.patch_slots()) floor_patches += engine.mesh().slot(slot).face == 0;
  EXPECT_NEAR(lit / (4 * 60000), 1, 5e-3);
  EXPECT_EQ(floor_patches, 64);
  EXPECT_EQ(light->plan.beams.patches, 36);
}

TEST(Plan, OutlinesLoseNoLight) {
  // Every element has the light that it has when all patches that face the beam are looked at.
  const Engine engine(roof_light_room(0.6f), tregenza(), small_options());
  const DirectLight& light = engine.direct_light();
  std::vector<int> indoors;
  for (const int slot : engine.patch_slots())
    if (engine.scene().materials[engine.faces().faces[engine.mesh().slot(slot).face].material].opening < 0)
      indoors.push_back(slot);
  const auto outlined = light.receivers(indoors, std::vector<char>(indoors.size(), 1)),
             all = light.receivers(indoors, {});
  for (int k = 0; k < 12; ++k) {
    const float azimuth = 0.5f * static_cast<float>(k), height = 0.3f + 0.2f * static_cast<float>(k % 5);
    const Beam beam{glm::normalize(glm::vec3(std::cos(azimuth), std::sin(azimuth), height)), glm::vec3(1000)};
    const std::vector<LitElement> few = light.deposit({beam}, outlined), many = light.deposit({beam}, all);
    ASSERT_EQ(few.size(), many.size()) << k;
    for (std::size_t i = 0; i < few.size(); ++i) {
      EXPECT_EQ(few[i].element, many[i].element);
      EXPECT_EQ(few[i].illuminance, many[i].illuminance);
    }
  }
}

TEST(Plan, OutlinesKnowWhatLightHasPassedAsRaysDo) {
  // Two panes behind each other, and one aside; a beam that passes none, one or two of them.
  SceneGeometry scene;
  scene.materials = {{glm::vec3(0), glm::vec3(0), false, 0}};
  scene.openings = {{std::vector<float>(2, 0.5f), 0.f}};
  test::add_quad(scene, {0, 0, 1}, {2, 0, 1.5f}, {2, 2, 1.5f}, {0, 2, 1}, 0);
  test::add_quad(scene, {1, 1, 3}, {1, 3, 3}, {3, 3, 3}, {3, 1, 3}, 0);
  test::add_quad(scene, {4, 0, 1}, {6, 0, 1}, {6, 2, 3}, {4, 2, 3}, 0);
  const Faces faces = make_faces(scene);
  const RayScene rays(faces, scene.materials, scene.openings);
  const SobolSequence sequence(3);
  for (const glm::vec3 to_sun : {glm::vec3(0, 0, 1), glm::vec3(0.4f, 0.3f, 1), glm::vec3(-1, 0.2f, 0.3f)}) {
    const BeamOutlines outlines(faces, {0, 1, 2}, to_sun);
    BeamOutlines::Points points, seen;
    std::vector<float> share(2000, 1.f);
    points.resize(share.size());
    for (std::uint32_t i = 0; i < share.size(); ++i) {
      const glm::vec4 u = sequence.point4(i);
      points.set(i, glm::vec3(7 * u.x, 4 * u.y, 4 * u.z) - glm::vec3(faces.origin));
    }
    outlines.along_beam(points, seen);
    for (int k = 0; k < 3; ++k) {
      std::vector<int> is_behind(points.size());
      outlines.mark_behind(k, seen.x, seen.y, seen.z, is_behind);
      for (std::size_t i = 0; i < points.size(); ++i) share[i] *= is_behind[i] ? 0.5f : 1.f;
    }
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_NEAR(share[i], rays.transmittance({points[i], glm::normalize(to_sun)}), 1e-5f);
    const auto passed = std::count_if(share.begin(), share.end(), [](float value) { return value < 1; });
    EXPECT_GT(passed, 50);
  }
}

}  // namespace
}  // namespace transom
