// Small faces that share patches.
#include <gtest/gtest.h>

#include "rooms.h"
#include "transom/face_clusters.h"

namespace transom {
namespace {

using test::add_box;
using test::roof_light_room;
using test::tregenza;

// Small boxes below the ceiling and others above it, on the roof.
SceneGeometry room_with_crumbs() {
  SceneGeometry scene = roof_light_room(0.6f);
  for (int i = 0; i < 24; ++i) {
    const glm::dvec3 low(0.15 + 0.15 * i, 0.4, 2.85);
    add_box(scene, low, low + 0.08, 0);
    const glm::dvec3 above = low + glm::dvec3(0, 0, 0.2);
    add_box(scene, above, above + 0.08, 0);
  }
  return scene;
}

SolveOptions few_patches() {
  return test::quick(100, {128, 32}, {64, 32});
}

TEST(FaceClusters, SidesIndoorsAndOutdoorsAreNotTakenTogether) {
  const Engine engine(room_with_crumbs(), tregenza(), few_patches());
  const FaceClusters& clusters = engine.mesh().clusters();
  ASSERT_GT(clusters.count(), 0);
  const Faces& faces = engine.faces();
  const auto is_outdoors = [&](int side) { return faces.faces[side / 2].corner[0].z + faces.origin.z > 3; };
  int lit = 0;
  for (int c = 0; c < clusters.count(); ++c) {
    const std::span<const int> sides = clusters.sides(c);
    if (faces.is_inside_solid(sides[0] / 2, sides[0] % 2)) continue;
    for (const int side : sides) EXPECT_EQ(is_outdoors(side), is_outdoors(sides[0]));
    ++lit;
  }
  EXPECT_GT(lit, 4);
}

TEST(FaceClusters, SmallFacesOutdoorsAreNoHoleInTheRoom) {
  const Engine engine(room_with_crumbs(), tregenza(), few_patches());
  EXPECT_LT(engine.facts().leak_share, 1e-4);
}

}  // namespace
}  // namespace transom
