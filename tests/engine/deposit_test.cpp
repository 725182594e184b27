// Light that falls on elements, against what enters.
#include "transom/deposit.h"

#include <gtest/gtest.h>

#include "rooms.h"

namespace transom {
namespace {

using test::add_box;
using test::add_quad;
using test::tregenza;

constexpr int kPanes = 10;  // of the roof light, along each edge

// A room whose roof light is of many panes, each smaller than an element, over boxes that share patches.
SceneGeometry room_with_small_panes() {
  SceneGeometry scene = test::roof_light_room(0.5f);
  scene.faces.pop_back();
  scene.face_material.pop_back();
  const double edge = 2.0 / kPanes;
  for (int i = 0; i < kPanes * kPanes; ++i) {
    const double x = 1 + edge * (i % kPanes), y = 1 + edge * (i / kPanes);
    add_quad(scene, {x, y, 3}, {x + edge, y, 3}, {x + edge, y + edge, 3}, {x, y + edge, 3}, 1);
  }
  for (int i = 0; i < 256; ++i) {
    const glm::dvec3 low(1.05 + 0.12 * (i % 16), 1.05 + 0.12 * (i / 16), 0.3);
    add_box(scene, low, low + 0.09, 0);
  }
  return scene;
}

TEST(Deposit, WhatSmallOpeningsSendIsAllThatPatchesOfManyFacesReceive) {
  SolveOptions options = test::quick(150, {64, 64}, {64, 16});
  options.maximum_edge_m = 1;
  const Engine engine(room_with_small_panes(), tregenza(), options);
  ASSERT_GT(engine.mesh().clusters().count(), 0);
  Condition sun = test::uniform_sky(0);
  sun.beams.push_back({glm::normalize(glm::vec3(0.02f, 0.01f, 1)), glm::vec3(1000)});
  double flux = 0, on_clusters = 0;
  const auto lighting = engine.relight(sun);
  for (const LitElement& lit : lighting->lit_elements) {
    const double part = static_cast<double>(lit.illuminance.y * engine.mesh().element_area(lit.element));
    flux += part;
    if (engine.mesh().is_cluster(lit.element / engine.mesh().elements_per_slot())) on_clusters += part;
  }
  const double entering = 1000 * 2 * 2 * static_cast<double>(sun.beams[0].direction_to_source.z);
  EXPECT_NEAR(flux, entering, 1e-3 * entering);
  EXPECT_GT(on_clusters, 0.2 * entering);
}

}  // namespace
}  // namespace transom
