#include "transom/geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "rooms.h"
#include "transom/error.h"
#include "transom/sampling.h"

namespace transom {
namespace {

using test::add_box;
using test::add_quad;
using test::diffuse;

TEST(Faces, ClosedOutwardBoxIsSolidAndInwardOneIsNot) {
  for (const bool inward : {false, true}) {
    SceneGeometry scene;
    scene.materials = {diffuse(0.5f)};
    add_box(scene, {0, 0, 0}, {1, 2, 3}, 0, inward);
    const Faces faces = make_faces(scene);
    for (int f = 0; f < 6; ++f) EXPECT_EQ(faces.is_inside_solid(f, 1), !inward);
    EXPECT_FALSE(faces.is_inside_solid(0, 0));
  }
}

TEST(Faces, OpenBoxIsNoSolid) {
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f)};
  add_box(scene, {0, 0, 0}, {1, 1, 1}, 0);
  scene.faces.pop_back();
  scene.face_material.pop_back();
  EXPECT_FALSE(make_faces(scene).is_inside_solid(0, 1));
}

TEST(Faces, FarFromTheOriginKeepsItsShape) {
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f)};
  const glm::dvec3 far(1e7, -2e7, 3e6);
  add_box(scene, far, far + glm::dvec3(1, 2, 3), 0);
  const Faces faces = make_faces(scene);
  EXPECT_FLOAT_EQ(faces.extent, 3);
  EXPECT_NEAR(faces.faces[0].area, 2, 1e-6);
}

TEST(Faces, RevealIsCutAtItsPane) {
  // A reveal from y = 0 to y = 1, a pane at y = 0.3 that ends on it.
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f), {glm::vec3(0), glm::vec3(0), false, 0}};
  scene.openings = {{{1.f, 1.f}, 0.f}};
  add_quad(scene, {0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}, 0);
  add_quad(scene, {0.5, 0.3, 0}, {1.5, 0.3, 0}, {1.5, 0.3, 1}, {0.5, 0.3, 1}, 1);
  const Faces faces = make_faces(scene);
  ASSERT_EQ(faces.faces.size(), 3u);
  const float near = std::min(faces.faces[0].area, faces.faces[1].area);
  EXPECT_NEAR(near, 0.6, 1e-5);
  EXPECT_NEAR(faces.faces[0].area + faces.faces[1].area, 2, 1e-5);
  EXPECT_EQ(faces.faces[0].source, 0);
  EXPECT_EQ(faces.faces[1].source, 0);
  EXPECT_GT(glm::dot(faces.faces[0].normal, faces.faces[1].normal), 0.999f);
}

TEST(Faces, PaneThatEndsBeforeAFaceDoesNotCutIt) {
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f), {glm::vec3(0), glm::vec3(0), false, 0}};
  scene.openings = {{{1.f, 1.f}, 0.f}};
  add_quad(scene, {0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}, 0);
  add_quad(scene, {0.5, 0.3, 0.1}, {1.5, 0.3, 0.1}, {1.5, 0.3, 1}, {0.5, 0.3, 1}, 1);
  EXPECT_EQ(make_faces(scene).faces.size(), 2u);
}

// A floor of 6 x 4 m, and faces of a wall across it that stand on it, 1 m high, from and to the given places [m].
SceneGeometry floor_under_wall(const std::vector<glm::dvec2>& faces) {
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f)};
  add_quad(scene, {0, 0, 0}, {6, 0, 0}, {6, 4, 0}, {0, 4, 0}, 0);
  for (const glm::dvec2 x : faces) add_quad(scene, {x.x, 1, -0.1}, {x.y, 1, -0.1}, {x.y, 1, 0.9}, {x.x, 1, 0.9}, 0);
  return scene;
}

// Areas of the pieces of the first face [m²], least first.
std::vector<float> areas_of_floor(const SceneGeometry& scene) {
  std::vector<float> areas;
  for (const Face& face : make_faces(scene).faces)
    if (face.source == 0) areas.push_back(face.area);
  std::sort(areas.begin(), areas.end());
  return areas;
}

TEST(Faces, FloorIsCutUnderAWallOfWhichEachFaceCoversLittle) {
  const std::vector<float> areas = areas_of_floor(floor_under_wall({{0, 1}, {1, 2.5}, {2.5, 4}, {4, 5}, {5, 6}}));
  ASSERT_EQ(areas.size(), 2u);
  EXPECT_NEAR(areas[0], 6, 1e-5);
  EXPECT_NEAR(areas[1], 18, 1e-5);
}

TEST(Faces, FloorIsCutUnderAWallThatStandsOnSills) {
  SceneGeometry scene = floor_under_wall({{0, 1}});
  add_quad(scene, {1, 1, -0.001}, {6, 1, -0.001}, {6, 1, 0.002}, {1, 1, 0.002}, 0);
  EXPECT_EQ(areas_of_floor(scene).size(), 2u);
}

TEST(Faces, FacesThatCoverLessThanHalfOfACutTogetherDoNotCut) {
  EXPECT_EQ(areas_of_floor(floor_under_wall({{0, 1}, {2.5, 4}})).size(), 1u);
}

TEST(Faces, WhatTwoFacesCoverBothCountsOnce) {
  SceneGeometry scene = floor_under_wall({{0, 2}});
  add_quad(scene, {0, 1, -0.8}, {2, 1, -0.8}, {2, 1, 0}, {0, 1, 0}, 0);  // ends on the floor from below
  EXPECT_EQ(areas_of_floor(scene).size(), 1u);
}

TEST(Face, ParametersInvertTheBilinearMapOfAnyConvexQuad) {
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f)};
  add_quad(scene, {0, 0, 0}, {3, 0, 0}, {2.5, 2, 0}, {0.5, 1, 0}, 0);
  const Face face = make_faces(scene).faces[0];
  const SobolSequence points(1);
  for (std::uint32_t i = 0; i < 100; ++i) {
    const glm::vec2 st = points.point2(i);
    const glm::vec3 p = face.position(st);
    // Barycentric coordinates in the triangle that holds the point.
    for (int part = 0; part < 2; ++part) {
      const glm::vec3 a = face.corner[0], e1 = face.corner[1 + part] - a, e2 = face.corner[2 + part] - a, d = p - a;
      const float det = e1.x * e2.y - e1.y * e2.x;
      const glm::vec2 b((d.x * e2.y - d.y * e2.x) / det, (e1.x * d.y - e1.y * d.x) / det);
      if (b.x < 0 || b.y < 0 || b.x + b.y > 1) continue;
      EXPECT_NEAR(glm::length(face.parameters(part, b) - st), 0, 1e-4);
    }
  }
}

TEST(Validate, NamesWhatIsWrong) {
  SceneGeometry scene;
  scene.materials = {diffuse(0.5f)};
  add_box(scene, {0, 0, 0}, {1, 1, 1}, 0);
  SceneGeometry bad = scene;
  bad.vertices[2].x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(make_faces(bad), InputError);
  bad = scene;
  bad.faces[0].x = 99;
  EXPECT_THROW(make_faces(bad), InputError);
  bad = scene;
  bad.faces[0] = {0, 0, 1, -1};
  EXPECT_THROW(make_faces(bad), InputError);
  bad = scene;
  bad.materials[0].reflectance = glm::vec3(1);
  EXPECT_THROW(make_faces(bad), InputError);
  bad = scene;
  bad.point_sources = {{{0.5, 0.5, 0.5}, glm::vec3(-1)}};
  EXPECT_THROW(make_faces(bad), InputError);
  bad.point_sources = {{glm::dvec3(std::numeric_limits<double>::infinity()), glm::vec3(1)}};
  EXPECT_THROW(make_faces(bad), InputError);
}

}  // namespace
}  // namespace transom
