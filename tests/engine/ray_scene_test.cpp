// What rays meet where faces meet each other, and rays from one point.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "rooms.h"
#include "transom/ray_scene.h"

namespace transom {
namespace {

using test::add_box;
using test::roof_light_room;

constexpr int kRays = 4000;
constexpr float kRounding = 1e-6f;

struct Traced {
  explicit Traced(const SceneGeometry& geometry)
      : scene(geometry), faces(make_faces(scene)), rays(faces, scene.materials, scene.openings) {}
  SceneGeometry scene;
  Faces faces;
  RayScene rays;
};

// A table that stands on the floor of the room.
SceneGeometry room_with_table() {
  SceneGeometry scene = roof_light_room(0.6f);
  add_box(scene, {1, 1, 0}, {2.2, 1.7, 0.7}, 0);
  return scene;
}

// The same, and enough other things that every tree over its faces is another one.
SceneGeometry furnished(const SceneGeometry& room) {
  SceneGeometry scene = room;
  for (int k = 0; k < 40; ++k) {
    const glm::dvec3 low(0.2 + 0.4 * (k % 8), 2.2 + 0.3 * (k / 8), 1 + 0.05 * (k % 3));
    add_box(scene, low, low + 0.1, 0);
  }
  return scene;
}

// Rays from the near half of the room to places on edges of its faces, as exactly as numbers allow.
std::vector<Ray> rays_to_edges(const Traced& traced) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<Ray> rays;
  for (int k = 0; k < kRays; ++k) {
    const Face& face = traced.faces.faces[static_cast<std::size_t>(k) % traced.faces.faces.size()];
    const int corner = (k / static_cast<int>(traced.faces.faces.size())) % 5;  // the fifth is the diagonal
    const glm::vec3 a = face.corner[corner % 4], b = face.corner[corner == 4 ? 2 : (corner + 1) % 4];
    const glm::vec3 from(3.8f * unit(random) - 1.9f, 1.8f * unit(random) - 1.9f, 1.2f * unit(random) - 0.6f);
    rays.push_back({from, glm::normalize(glm::mix(a, b, unit(random)) - from)});
  }
  return rays;
}

// Whether two hits are of one side, at one place but for rounding.
bool is_same(const Hit& a, const Hit& b) {
  return a.face == b.face && a.side == b.side && std::abs(a.t - b.t) <= kRounding * a.t &&
         glm::length(a.st - b.st) <= kRounding;
}

TEST(RayScene, WhatIsMetAtAnEdgeDoesNotHangOnOtherFaces) {
  const Traced bare(room_with_table()), full(furnished(room_with_table()));
  ASSERT_EQ(bare.faces.origin, full.faces.origin);
  const std::vector<Ray> rays = rays_to_edges(bare);
  std::vector<Hit> there(rays.size()), here(rays.size());
  for (const auto what : {RayScene::What::kOpaque, RayScene::What::kAll}) {
    bare.rays.intersect(what, rays, there, RayScene::Order::kCoherent);
    full.rays.intersect(what, rays, here, RayScene::Order::kCoherent);
    int differ = 0, compared = 0;
    for (std::size_t k = 0; k < rays.size(); ++k) {
      if (here[k].face >= static_cast<int>(bare.faces.faces.size())) continue;  // something else is in the way
      differ += !is_same(there[k], here[k]);
      compared += there[k].face >= 0;
    }
    EXPECT_EQ(differ, 0) << "of " << compared;
    EXPECT_GT(compared, kRays / 2);
  }
}

TEST(RayScene, WhatIsMetAtAnEdgeDoesNotHangOnOtherRays) {
  const Traced traced(room_with_table());
  const std::vector<Ray> rays = rays_to_edges(traced);
  std::vector<Hit> together(rays.size());
  traced.rays.intersect(RayScene::What::kAll, rays, together, RayScene::Order::kCoherent);
  int differ = 0, compared = 0;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    Hit alone;
    traced.rays.intersect(RayScene::What::kAll, {&rays[k], 1}, {&alone, 1});
    differ += !is_same(together[k], alone);
    compared += alone.face >= 0;
  }
  EXPECT_EQ(differ, 0);
  EXPECT_GT(compared, kRays / 2);
}

// The floor goes on below the table, whose sides only begin there.
TEST(RayScene, AnEdgeThatStandsOnAFaceIsThatFace) {
  const Traced traced(room_with_table());
  const auto in_engine = [&](glm::dvec3 place) { return glm::vec3(place - traced.faces.origin); };
  for (int k = 1; k < 40; ++k) {
    const glm::vec3 from = in_engine({3.1, 0.3 + 0.07 * k, 2}), to = in_engine({2.2, 1 + 0.7 * k / 40, 0});
    const Ray ray{from, glm::normalize(to - from)};
    Hit hit;
    traced.rays.intersect(RayScene::What::kAll, {&ray, 1}, {&hit, 1});
    ASSERT_GE(hit.face, 0) << k;
    EXPECT_EQ(traced.faces.faces[static_cast<std::size_t>(hit.face)].source, 0);
  }
}

// Two cabinets stand on the floor, at a wall and at each other.
TEST(RayScene, RaysWithinASolidMeetItAndNotWhatItStandsOn) {
  SceneGeometry scene = roof_light_room(0.6f);
  add_box(scene, {0, 1, 0}, {0.6, 1.7, 1.2}, 0);
  add_box(scene, {0, 1.7, 0}, {0.6, 2.3, 0.8}, 0);
  const Traced traced(furnished(scene));
  const Faces& faces = traced.faces;
  std::mt19937 random(4);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int k = 0; k < kRays; ++k) {
    const bool is_second = k % 2 != 0;
    const glm::dvec3 low(0.01, is_second ? 1.71 : 1.01, 0.01),
        size(0.58, is_second ? 0.58 : 0.68, is_second ? 0.78 : 1);
    const glm::vec3 from(low + size * glm::dvec3(unit(random), unit(random), unit(random)) - faces.origin);
    const glm::vec3 towards(unit(random) - 0.5f, unit(random) - 0.5f, unit(random) - 0.5f);
    const Ray ray{from, glm::normalize(towards)};
    Hit hit;
    traced.rays.intersect(RayScene::What::kAll, {&ray, 1}, {&hit, 1});
    ASSERT_GE(hit.face, 0);
    EXPECT_TRUE(faces.is_inside_solid(hit.face, hit.side)) << "face " << faces.faces[hit.face].source;
  }
}

TEST(RayScene, OfTwoSolidsThatTouchTheSmallerFaceIsSetBack) {
  SceneGeometry scene = roof_light_room(0.6f);
  add_box(scene, {1, 1, 0}, {2, 2, 0.7}, 0);            // faces 10 to 15
  add_box(scene, {1.2, 1.3, 0.7}, {1.4, 1.5, 0.9}, 0);  // 16 to 21: on the first
  const Faces faces = make_faces(scene);
  for (const Face& face : faces.faces)
    EXPECT_EQ(face.is_set_back, face.source == 10 || face.source == 16) << face.source;
}

TEST(RayScene, RaysFromOnePointMeetWhatTheyMeetOneByOne) {
  const Traced traced(roof_light_room(0.5f));
  const glm::vec3 origin = glm::vec3(glm::dvec3(1, 1, 1.5) - traced.faces.origin);
  std::vector<Ray> rays;
  std::vector<float> x, y, z;
  for (int i = 0; i < 37; ++i) {  // not a multiple of a packet
    const float turn = 0.17f * static_cast<float>(i);
    rays.push_back(
        {origin, glm::normalize(glm::vec3(std::cos(turn), std::sin(turn), 0.1f * static_cast<float>(i - 18)))});
    x.push_back(rays.back().direction.x);
    y.push_back(rays.back().direction.y);
    z.push_back(rays.back().direction.z);
  }
  std::vector<Hit> together(rays.size()), one_by_one(rays.size());
  traced.rays.intersect_from(origin, x.data(), y.data(), z.data(), RayScene::What::kAll, together);
  traced.rays.intersect(RayScene::What::kAll, rays, one_by_one);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(together[i].face, one_by_one[i].face);
    EXPECT_EQ(together[i].side, one_by_one[i].side);
    EXPECT_FLOAT_EQ(together[i].t, one_by_one[i].t);
    EXPECT_LT(glm::distance(together[i].st, one_by_one[i].st), 1e-5f);
  }
}

}  // namespace
}  // namespace transom
