#include "transom/engine.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <numbers>

#include "rooms.h"
#include "transom/error.h"
#include "transom/frame.h"

namespace transom {
namespace {

using test::add_box;
using test::diffuse;
using test::illuminance;
using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

constexpr GatherSamples kSensorSamples{4096, 4096};

SolveOptions small_options() {
  return test::quick(600, {256, 128}, {256, 256});
}

TEST(Engine, SkyThroughARoofLightMatchesTheClosedForm) {
  Engine engine(roof_light_room(0), tregenza(), small_options());
  const auto light = engine.relight(uniform_sky(1000));
  // Under the middle of a 2 x 2 m hole at 3 m: four corners of 1 x 1 at 3.
  const double x = 1.0 / 3, root = std::sqrt(1 + x * x);
  const double integral = 4 * 0.5 * 2 * (x / root * std::atan(x / root));
  const auto e = illuminance(engine, *light, {{2, 2, 0}}, {{0, 0, 1}}, kSensorSamples);
  EXPECT_NEAR(e[0].sky.y / (1000 * integral), 1, 2e-3);
  EXPECT_EQ(e[0].indirect.y, 0);
}

TEST(Engine, GlassTakesItsShareOnce) {
  Engine clear(roof_light_room(0), tregenza(), small_options()),
      tinted(roof_light_room(0, 0.5f), tregenza(), small_options());
  const auto a = illuminance(clear, *clear.relight(uniform_sky(1000)), {{1, 2, 0}}, {{0, 0, 1}}, kSensorSamples);
  const auto b = illuminance(tinted, *tinted.relight(uniform_sky(1000)), {{1, 2, 0}}, {{0, 0, 1}}, kSensorSamples);
  EXPECT_NEAR(b[0].sky.y, 0.5f * a[0].sky.y, 1e-3f * a[0].sky.y);
}

TEST(Engine, FluxInIsFluxAbsorbedAndOut) {
  Engine engine(roof_light_room(0.6f, 0.8f), tregenza(), small_options());
  Condition condition = uniform_sky(5000, 800);
  condition.beams.push_back({glm::normalize(glm::vec3(0.2f, 0.3f, 1)), glm::vec3(80000)});
  const EnergyAudit audit = engine.audit(*engine.relight(condition), 1 << 16);
  EXPECT_GT(audit.in_beams.y, 0);
  EXPECT_NEAR((audit.absorbed + audit.out).y / audit.in().y, 1, 1e-3);
}

TEST(Engine, RelightingIsTheSameAsSolvingAfresh) {
  Engine engine(roof_light_room(0.5f), tregenza(), small_options()),
      fresh(roof_light_room(0.5f), tregenza(), small_options());
  Condition sunny = uniform_sky(3000);
  sunny.beams.push_back({glm::normalize(glm::vec3(0.3f, 0.1f, 1)), glm::vec3(60000)});
  engine.relight(sunny);
  const auto again = engine.relight(uniform_sky(1234)), first = fresh.relight(uniform_sky(1234));
  EXPECT_EQ(again->node_indirect, first->node_indirect);
  EXPECT_EQ(again->node_sky, first->node_sky);
}

TEST(Engine, LightAddsUp) {
  Engine engine(roof_light_room(0.5f), tregenza(), small_options());
  Condition sky = uniform_sky(2000), sun = uniform_sky(0), both = uniform_sky(2000);
  sun.beams.push_back({glm::normalize(glm::vec3(0.1f, 0.3f, 1)), glm::vec3(50000)});
  both.beams = sun.beams;
  const std::vector<glm::dvec3> points{{0.5, 0.5, 0}, {2, 2, 0}, {3.5, 1, 0}};
  const std::vector<glm::vec3> up(3, {0, 0, 1});
  std::vector<double> total;
  for (const Condition* condition : {&sky, &sun, &both}) {
    const auto light = engine.relight(*condition);
    double sum = 0;
    for (const Irradiance& e : illuminance(engine, *light, points, up, kSensorSamples))
      sum += (e.direct + e.sky + e.indirect).y;
    total.push_back(sum);
  }
  EXPECT_NEAR((total[0] + total[1]) / total[2], 1, 1e-5);
}

TEST(Engine, AnswerDoesNotDependOnThreads) {
  std::vector<std::vector<glm::vec3>> answers;
  for (const std::size_t threads : {1u, 2u, 4u}) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Engine engine(roof_light_room(0.5f), tregenza(), small_options());
    Condition condition = uniform_sky(2000);
    condition.beams.push_back({glm::normalize(glm::vec3(0.1f, 0.3f, 1)), glm::vec3(50000)});
    answers.push_back(engine.relight(condition)->node_indirect);
  }
  EXPECT_EQ(answers[0], answers[1]);
  EXPECT_EQ(answers[0], answers[2]);
}

TEST(Engine, OpenWallIsNamedWithItsPlace) {
  SceneGeometry scene = roof_light_room(0.5f);
  scene.faces.erase(scene.faces.begin() + 1);
  scene.face_material.erase(scene.face_material.begin() + 1);
  try {
    Engine engine(scene, tregenza(), small_options());
    FAIL() << "an open wall went unnoticed";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("open wall"), std::string::npos) << error.what();
  }
}

TEST(Engine, WhatStandsCloseTogetherKeepsNoLightFromTheRoom) {
  // Slabs 12 cm apart: patches see out between them with a part of theirs alone. Even ones kept 0.8 % from the wall.
  SceneGeometry scene = test::roof_light_room(0.7f);
  for (int k = 0; k < 6; ++k) test::add_box(scene, {0.6, 0.6 + 0.3 * k, 0.2}, {3.2, 0.78 + 0.3 * k, 1.6}, 0);
  std::vector<glm::dvec3> points;
  for (double x = 0.4; x < 3.8; x += 0.4)
    for (double z = 0.3; z < 2.6; z += 0.4) points.push_back({x, 2.99, z});
  const auto mean = [&](int patches) {
    SolveOptions options;
    options.target_patch_count = patches;
    options.node_samples = {512, 256};
    const Engine engine(scene, test::tregenza(), options);
    const auto light = engine.relight(test::uniform_sky(1000));
    double sum = 0;
    for (const Irradiance& e : engine.illuminance(
             *light, engine.sensors(points, std::vector<glm::vec3>(points.size(), {0, -1, 0}), {4096, 1024})))
      sum += e.indirect.y;
    return sum;
  };
  EXPECT_NEAR(mean(1500) / mean(16000), 1, 0.006);
}

TEST(Engine, OpeningThatLooksIndoorsIsRefused) {
  SceneGeometry scene = roof_light_room(0.5f);
  glm::ivec4& pane = scene.faces.back();
  pane = {pane.w, pane.z, pane.y, pane.x};
  EXPECT_THROW(Engine(scene, tregenza(), small_options()), InputError);
}

TEST(Engine, ClosedEmittingBoxIsAFurnace) {
  for (const float rho : {0.f, 0.5f, 0.9f}) {
    SceneGeometry scene;
    scene.materials = {{glm::vec3(rho), glm::vec3(100), false, -1}};
    add_box(scene, {0, 0, 0}, {3, 4, 5}, 0, true);
    Engine engine(scene, tregenza(), small_options());
    const auto light = engine.relight(uniform_sky(0));
    const auto e = illuminance(engine, *light, {{1, 1, 1}}, {{0, 0, 1}}, kSensorSamples);
    EXPECT_NEAR(e[0].indirect.y / (std::numbers::pi * 100 / (1 - rho)), 1, 1e-3) << rho;
  }
}

TEST(Frame, ComponentsAddUpAndAFurnaceIsEvenlyBright) {
  SceneGeometry scene;
  scene.materials = {{glm::vec3(0.5f), glm::vec3(100), false, -1}};
  add_box(scene, {0, 0, 0}, {3, 4, 5}, 0, true);
  Engine engine(scene, tregenza(), small_options());
  const auto light = engine.relight(uniform_sky(0));
  FrameRenderer renderer(engine);
  View view;
  view.position = {0.5, 0.5, 0.5};
  view.target = {3, 4, 4};
  view.width = 32;
  view.height = 24;
  const Frame frame = renderer.render(view, *light, {});
  for (std::size_t p = 0; p < frame.radiance.size(); ++p) {
    EXPECT_NEAR(frame.radiance[p].y, 200, 0.2);
    const glm::vec3 sum = frame.sun[p] + frame.sky[p] + frame.indirect[p] + frame.emitted[p] + frame.exterior[p];
    EXPECT_NEAR(frame.radiance[p].y, sum.y, 1e-3);
  }
}

TEST(Engine, ASensorBeforeAWallReadsWhatTheWallSendsThere) {
  // Patches as large as these do not tell one height from another.
  SolveOptions options = small_options();
  options.maximum_edge_m = 0.6f;
  options.node_samples = {4096, 2048};
  constexpr float kReflectance = 0.5f;
  Engine engine(roof_light_room(kReflectance), test::tregenza(), options);
  const auto light = engine.relight(test::uniform_sky(1000));
  std::vector<glm::dvec3> before, on;
  for (double z = 0.1; z < 1.4; z += 0.15) {
    before.emplace_back(0.02, 2.1, z);
    on.emplace_back(0, 2.1, z);
  }
  const GatherSamples samples{16384, 4096};
  const auto sent =
                 test::illuminance(engine, *light, before, std::vector<glm::vec3>(before.size(), {-1, 0, 0}), samples),
             received = test::illuminance(engine, *light, on, std::vector<glm::vec3>(on.size(), {1, 0, 0}), samples);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const float expected = kReflectance * (received[i].sky.y + received[i].indirect.y);
    EXPECT_NEAR(sent[i].indirect.y / expected, 1, 0.02f) << before[i].z;
  }
}

TEST(Engine, PartitionCastsNoLightThroughItself) {
  // A sheet from floor to ceiling parts the room; the side without the roof light is dark.
  SceneGeometry scene = roof_light_room(0.5f);
  test::add_quad(scene, {3.5, 0, 0}, {3.5, 4, 0}, {3.5, 4, 3}, {3.5, 0, 3}, 0);
  Engine engine(scene, tregenza(), small_options());
  const auto light = engine.relight(uniform_sky(10000));
  const auto e = illuminance(engine, *light, {{3.75, 2, 0}, {2, 2, 0}}, {{0, 0, 1}, {0, 0, 1}}, kSensorSamples);
  EXPECT_LT((e[0].sky + e[0].indirect).y, 1e-3f * e[1].sky.y);
}

TEST(Engine, ALampIndoorsMakesNoRoomOfTheGroundOutdoors) {
  SceneGeometry scene = roof_light_room(0.5f, 0.8f);
  scene.materials.push_back(diffuse(0.2f));
  test::add_quad(scene, {-9, -9, -1}, {9, -9, -1}, {9, 9, -1}, {-9, 9, -1}, 2);
  add_box(scene, {1.2, 1.2, 5}, {2, 2, 6}, 2);  // seen through the roof light, and sees the ground
  scene.point_sources.push_back({{2, 2, 1}, glm::vec3(100)});
  const Engine engine(scene, tregenza(), small_options());
  int outdoor_count = 0;
  for (std::size_t p = 0; p < engine.patch_slots().size(); ++p) {
    const Slot slot = engine.mesh().slot(engine.patch_slots()[p]);
    const Face& face = engine.faces().faces[slot.face];
    const bool is_outdoors = face.material == 2, is_floor = face.source == 0 && slot.side == 0;
    EXPECT_FALSE(is_outdoors && engine.is_interior(p)) << p;
    EXPECT_TRUE(!is_floor || engine.is_interior(p)) << p;
    outdoor_count += is_outdoors;
  }
  EXPECT_GT(outdoor_count, 0);
  const EnergyAudit audit = engine.audit(*engine.relight(uniform_sky(0)), 1 << 14);
  EXPECT_NEAR((audit.absorbed + audit.out).y / audit.in().y, 1, 0.01f);
}

}  // namespace
}  // namespace transom
