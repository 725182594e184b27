// An edited scene, solved with what an earlier solve found, against the same scene solved afresh.
#include <gtest/gtest.h>

#include "rooms.h"
#include "transom/engine.h"

namespace transom {
namespace {

using test::add_box;
using test::add_quad;
using test::diffuse;
using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions options() {
  SolveOptions options;
  options.target_patch_count = 500;
  options.patch_samples = {256, 128};
  options.node_samples = {256, 128};
  return options;
}

// A room with a glazed roof light, a table, a lamp on the floor, and a ground outdoors.
SceneGeometry furnished_room() {
  SceneGeometry scene = roof_light_room(0.6f, 0.8f);
  scene.openings[0].diffuse_reflectance = 0.1f;
  scene.materials.push_back(diffuse(0.4f));
  scene.materials.push_back({glm::vec3(0.5f), glm::vec3(200), false, -1});
  scene.materials.push_back(diffuse(0.2f));
  add_box(scene, {1, 1, 0.7}, {2, 2, 0.8}, 2);
  add_box(scene, {3, 3, 0.01}, {3.2, 3.2, 0.2}, 3);
  add_quad(scene, {-9, -9, -1}, {9, -9, -1}, {9, 9, -1}, {-9, 9, -1}, 4);
  add_box(scene, {1.2, 1.2, 5}, {2, 2, 6}, 4);  // hangs over the roof light: seen through it
  return scene;
}

void expect_equal_light(const Engine& edited, const Engine& fresh) {
  Condition condition = uniform_sky(5000, 800);
  condition.beams.push_back({glm::normalize(glm::vec3(0.2f, 0.3f, 1)), glm::vec3(80000)});
  const auto a = edited.relight(condition), b = fresh.relight(condition);
  EXPECT_EQ(edited.patch_slots(), fresh.patch_slots());
  EXPECT_EQ(a->patch_irradiance, b->patch_irradiance);
  EXPECT_EQ(a->node_sky, b->node_sky);
  EXPECT_EQ(a->node_indirect, b->node_indirect);
}

// Solves the scene before and after an edit.
template <typename Edit>
SolveFacts expect_fresh(const Edit& edit) {
  SceneGeometry scene = furnished_room();
  const Engine before(scene, tregenza(), options());
  edit(scene);
  SolveOptions same_edge = options();
  same_edge.maximum_edge_m = before.facts().maximum_edge_m;
  const Engine edited(before, scene), fresh(scene, tregenza(), same_edge);
  expect_equal_light(edited, fresh);
  return edited.facts();
}

TEST(Edit, ReflectanceIsThatOfAFreshSolveAndKeepsAllRows) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { scene.materials[2].reflectance = glm::vec3(0.1f); });
  EXPECT_EQ(facts.kept_patch_rows, facts.patch_count);
  EXPECT_EQ(facts.kept_node_rows, facts.node_count);
}

TEST(Edit, BlackThatBecomesGreyGetsNodes) {
  SceneGeometry scene = furnished_room();
  scene.materials[2].reflectance = glm::vec3(0);
  const Engine before(scene, tregenza(), options());
  scene.materials[2].reflectance = glm::vec3(0.5f);
  const Engine edited(before, scene), fresh(scene, tregenza(), options());
  EXPECT_GT(edited.facts().node_count, before.facts().node_count);
  expect_equal_light(edited, fresh);
}

TEST(Edit, LuminanceOfALampIsThatOfAFreshSolve) {
  expect_fresh([](SceneGeometry& scene) { scene.materials[3].luminance = glm::vec3(900, 700, 500); });
}

TEST(Edit, GlazingIsThatOfAFreshSolveAndKeepsWhatIsSeenIndoors) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { scene.openings[0] = {{0.f, 0.3f, 0.5f}, 0.2f}; });
  EXPECT_EQ(facts.kept_patch_rows, facts.patch_count);
  EXPECT_EQ(facts.kept_node_rows, facts.node_count);
}

TEST(Edit, DarkGlassThatIsClearedShowsWhatNothingHasSeenBefore) {
  SceneGeometry scene = furnished_room();
  scene.openings[0].transmittance = {0.f, 0.f};
  const Engine before(scene, tregenza(), options());
  scene.openings[0].transmittance = {0.9f, 0.9f};
  const Engine edited(before, scene), fresh(scene, tregenza(), options());
  EXPECT_GT(edited.facts().patch_count, before.facts().patch_count);
  expect_equal_light(edited, fresh);
}

TEST(Edit, AnOpeningClosedByAnOpaqueSurfaceIsThatOfAFreshSolve) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) {
    for (std::size_t f = 0; f < scene.faces.size(); ++f)
      if (scene.materials[scene.face_material[f]].opening >= 0) scene.face_material[f] = 2;
  });
  EXPECT_GT(facts.kept_patch_rows, facts.patch_count / 2);
}

TEST(Edit, TheEngineThatIsEditedKeepsItsLight) {
  SceneGeometry scene = furnished_room();
  const Engine before(scene, tregenza(), options());
  const auto light = before.relight(uniform_sky(5000));
  scene.materials[0].reflectance = glm::vec3(0.1f);
  { const Engine edited(before, scene); }
  EXPECT_EQ(before.relight(uniform_sky(5000))->node_indirect, light->node_indirect);
}

TEST(Edit, AnEditedEngineOutlivesTheOneThatItComesFrom) {
  SceneGeometry scene = furnished_room();
  auto before = std::make_unique<Engine>(scene, tregenza(), options());
  scene.openings[0].transmittance = {0.5f, 0.5f};
  const Engine edited(*before, scene);
  before.reset();
  expect_equal_light(edited, Engine(scene, tregenza(), options()));
}

}  // namespace
}  // namespace transom
