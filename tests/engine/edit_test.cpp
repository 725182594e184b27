// An edited scene, solved with what an earlier solve found, against the same scene solved afresh.
#include <gtest/gtest.h>

#include <algorithm>

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
  options.target_patch_count = 300;
  options.patch_samples = options.node_samples = {256, 64};
  options.node_tolerance = 0.15f;
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
  EXPECT_NE(std::count(b->node_sky.begin(), b->node_sky.end(), glm::vec3(0)), 0);  // nodes that nothing shows
  EXPECT_EQ(edited.patch_slots(), fresh.patch_slots());
  EXPECT_EQ(a->patch_irradiance, b->patch_irradiance);
  EXPECT_EQ(a->node_sky, b->node_sky);
  EXPECT_EQ(a->node_indirect, b->node_indirect);
  std::vector<glm::vec4> sky_of_edited, indirect_of_edited, sky, indirect;
  edited.shown_radiance(*a, sky_of_edited, indirect_of_edited);
  fresh.shown_radiance(*b, sky, indirect);
  EXPECT_EQ(sky_of_edited, sky);
  EXPECT_EQ(indirect_of_edited, indirect);
}

// The options of a fresh solve whose patches are as long as those of an edit of `solved`.
SolveOptions same_edges(const Engine& solved) {
  SolveOptions same = options();
  same.maximum_edge_m = solved.facts().maximum_edge_m;
  same.outdoor_edge_m = solved.facts().outdoor_edge_m;
  return same;
}

// Moves the vertices of a box of `furnished_room`, of which `number` counts from 0.
void move_box(SceneGeometry& scene, int number, glm::dvec3 offset) {
  const std::size_t count = roof_light_room(0.6f).vertices.size();
  const std::size_t first[]{count, count + 8, count + 20};  // the ground outdoors stands between the second and third
  for (std::size_t k = 0; k < 8; ++k) scene.vertices[first[number] + k] += offset;
}

void remove_faces(SceneGeometry& scene, int material) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    if (scene.face_material[f] == material) continue;
    scene.faces[kept] = scene.faces[f];
    scene.face_material[kept++] = scene.face_material[f];
  }
  scene.faces.resize(kept);
  scene.face_material.resize(kept);
}

// Solves the scene before and after an edit.
template <typename Edit>
SolveFacts expect_fresh(const Edit& edit) {
  SceneGeometry scene = furnished_room();
  const Engine before(scene, tregenza(), options());
  edit(scene);
  const Engine edited(before, scene);
  expect_equal_light(edited, Engine(scene, tregenza(), same_edges(before)));
  return edited.facts();
}

// Nodes are where light changes, so that an edit that changes light moves a few of them.
constexpr double kNodesThatStay = 0.97;

TEST(Edit, ReflectanceIsThatOfAFreshSolveAndKeepsRows) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { scene.materials[2].reflectance = glm::vec3(0.1f); });
  EXPECT_EQ(facts.kept_patch_rows, facts.patch_count);
  EXPECT_GT(facts.kept_node_rows, kNodesThatStay * facts.node_count);
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
  EXPECT_GT(facts.kept_node_rows, kNodesThatStay * facts.node_count);
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

// One half of the roof light is shut. What hangs outdoors is seen through the other.
TEST(Edit, AnOpaqueSurfaceThatIsOpenedBesideAnOpeningIsThatOfAFreshSolveAndSoIsTheWayBack) {
  SceneGeometry open = furnished_room();
  const auto roof_light = std::find(open.face_material.begin(), open.face_material.end(), 1);
  const auto number = static_cast<std::size_t>(roof_light - open.face_material.begin());
  open.faces.erase(open.faces.begin() + static_cast<std::ptrdiff_t>(number));
  open.face_material.erase(roof_light);
  add_quad(open, {1, 1, 3}, {2, 1, 3}, {2, 3, 3}, {1, 3, 3}, 1);
  add_quad(open, {2, 1, 3}, {3, 1, 3}, {3, 3, 3}, {2, 3, 3}, 1);
  SceneGeometry shut = open;
  shut.face_material.back() = 2;
  const Engine before(shut, tregenza(), options());
  const Engine opened(before, open), fresh(open, tregenza(), same_edges(before));
  expect_equal_light(opened, fresh);
  expect_equal_light(Engine(fresh, shut), before);
}

// Rows that are begun from known ones, of patches and nodes, where a small object changes.
constexpr double kRowsThatStay = 0.8;

TEST(Edit, AMovedObjectIsThatOfAFreshSolveAndKeepsRows) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { move_box(scene, 0, {0.6, 0.3, 0.2}); });
  EXPECT_GT(facts.kept_patch_rows, kRowsThatStay * facts.patch_count);
  EXPECT_GT(facts.kept_node_rows, kRowsThatStay * facts.node_count);
}

TEST(Edit, AMovedLampIsThatOfAFreshSolve) {
  expect_fresh([](SceneGeometry& scene) { move_box(scene, 1, {-1, -0.4, 0.5}); });
}

TEST(Edit, AnObjectMovedOutdoorsBeforeAnOpeningIsThatOfAFreshSolve) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { move_box(scene, 2, {0.5, 0.7, 0}); });
  EXPECT_GT(facts.kept_node_rows, kRowsThatStay * facts.node_count);
}

TEST(Edit, AnAddedObjectIsThatOfAFreshSolveAndKeepsRows) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { add_box(scene, {2.5, 0.5, 1}, {3, 1.5, 1.6}, 2); });
  EXPECT_GT(facts.kept_patch_rows, kRowsThatStay * facts.patch_count);
  EXPECT_GT(facts.kept_node_rows, kRowsThatStay * facts.node_count);
}

TEST(Edit, AnObjectRemovedFromAmongOthersIsThatOfAFreshSolveAndKeepsRows) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { remove_faces(scene, 3); });
  EXPECT_GT(facts.kept_patch_rows, kRowsThatStay * facts.patch_count);
  EXPECT_GT(facts.kept_node_rows, kRowsThatStay * facts.node_count);
}

TEST(Edit, ABoxPutOnTheFloorCoversWhatItStandsOn) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { move_box(scene, 0, {0.3, 0.2, -0.7}); });
  EXPECT_GT(facts.kept_patch_rows, kRowsThatStay * facts.patch_count);
}

TEST(Edit, ABoxThatStandsOnTheFloorUncoversItWhenItLeaves) {
  SceneGeometry scene = furnished_room();
  add_box(scene, {0.5, 2.2, 0}, {1.5, 3.4, 0.6}, 2);
  const Engine before(scene, tregenza(), options());
  remove_faces(scene, 2);
  expect_equal_light(Engine(before, scene), Engine(scene, tregenza(), same_edges(before)));
}

// Rays that start below what stands in a corner, or within it, meet faces that lie on each other. Which of them is met
// must not hang on how the tree is built, which many new faces change.
TEST(Edit, ObjectsAddedBesideCabinetsInACornerAreThoseOfAFreshSolve) {
  SceneGeometry scene = furnished_room();
  for (int k = 0; k < 4; ++k) add_box(scene, {0, 0.5 * k, 0}, {0.5, 0.5 * k + 0.5, 1.1 + 0.2 * k}, 2);
  const Engine before(scene, tregenza(), options());
  for (int k = 0; k < 16; ++k) {
    const glm::dvec3 low(1 + 0.5 * (k % 4), 2.6 + 0.3 * (k / 4), 1.2 + 0.1 * (k % 3));
    add_box(scene, low, low + 0.15, 2);
  }
  expect_equal_light(Engine(before, scene), Engine(scene, tregenza(), same_edges(before)));
}

TEST(Edit, ABoxThroughAWallIsThatOfAFreshSolve) {
  expect_fresh([](SceneGeometry& scene) { move_box(scene, 0, {2.5, 0.4, 0.3}); });
}

TEST(Edit, AWallThatCutsTheFloorIsThatOfAFreshSolve) {
  expect_fresh([](SceneGeometry& scene) { add_quad(scene, {2.6, 0, 0}, {2.6, 4, 0}, {2.6, 4, 2}, {2.6, 0, 2}, 2); });
}

TEST(Edit, AnObjectThatMovesTheMiddleOfTheSceneIsThatOfAFreshSolve) {
  const SolveFacts facts = expect_fresh([](SceneGeometry& scene) { move_box(scene, 2, {20, 0, 0}); });
  EXPECT_EQ(facts.kept_patch_rows, 0);
}

TEST(Edit, EditsInSequenceAreThoseOfAFreshSolveAndThereAndBackIsTheBeginning) {
  SceneGeometry scene = furnished_room();
  const Engine before(scene, tregenza(), same_edges(Engine(scene, tregenza(), options())));
  move_box(scene, 0, {0.6, 0.3, 0.2});
  const Engine once(before, scene);
  scene.openings[0].transmittance = {0.f, 0.4f};
  move_box(scene, 1, {-0.5, -0.5, 0.4});
  const Engine twice(once, scene);
  expect_equal_light(twice, Engine(scene, tregenza(), same_edges(before)));
  expect_equal_light(Engine(twice, furnished_room()), before);
}

// Enough faces that small ones share patches.
TEST(Edit, AnObjectMovedAmongClusteredFacesIsThatOfAFreshSolve) {
  SolveOptions few = options();
  few.target_patch_count = 150;
  SceneGeometry scene = furnished_room();
  for (int i = 0; i < 64; ++i) {
    const glm::dvec3 low(0.3 + 0.4 * (i % 8), 0.3 + 0.4 * (i / 8), 0.3);
    add_box(scene, low, low + 0.08, 2);
  }
  const Engine before(scene, tregenza(), few);
  for (std::size_t k = 1; k <= 8; ++k) scene.vertices[scene.vertices.size() - k] += glm::dvec3(0.05, -0.1, 1.2);
  few.maximum_edge_m = before.facts().maximum_edge_m;
  few.outdoor_edge_m = before.facts().outdoor_edge_m;
  const Engine edited(before, scene);
  expect_equal_light(edited, Engine(scene, tregenza(), few));
  EXPECT_GT(edited.facts().kept_patch_rows, edited.facts().patch_count / 2);
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
