#include "transom/frame.h"

#include <gtest/gtest.h>

#include "rooms.h"

namespace transom {
namespace {

using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions few_rays() {
  SolveOptions options;
  options.target_patch_count = 400;
  options.patch_samples = {128, 64};
  options.node_samples = {128, 64};
  return options;
}

View into_the_room() {
  View view;
  view.position = {0.3, 0.3, 1.5};
  view.target = {3, 3, 1};
  view.width = 64;
  view.height = 48;
  return view;
}

Condition sunny(float east) {
  Condition condition = uniform_sky(3000, 500);
  condition.beams.push_back({glm::normalize(glm::vec3(east, 0.1f, 1)), glm::vec3(60000)});
  return condition;
}

TEST(Frame, AKeptViewShowsANewHourAsAFreshOneDoes) {
  Engine engine(roof_light_room(0.5f), tregenza(), few_rays());
  FrameRenderer kept(engine);
  const Frame before = kept.render(into_the_room(), *engine.relight(sunny(0.3f)), {});
  const auto light = engine.relight(sunny(-0.2f));
  const Frame after = kept.render(into_the_room(), *light, {}),
              fresh = FrameRenderer(engine).render(into_the_room(), *light, {});
  EXPECT_NE(before.sun, after.sun);
  EXPECT_EQ(after.radiance, fresh.radiance);
  EXPECT_EQ(after.edge_pixel_count, fresh.edge_pixel_count);
}

TEST(Frame, AnotherViewIsNotMistakenForTheKeptOne) {
  Engine engine(roof_light_room(0.5f), tregenza(), few_rays());
  const auto light = engine.relight(sunny(0.3f));
  FrameRenderer kept(engine);
  View turned = into_the_room();
  turned.target = {3, 3, 2.5};
  kept.render(into_the_room(), *light, {});
  EXPECT_EQ(kept.render(turned, *light, {}).radiance, FrameRenderer(engine).render(turned, *light, {}).radiance);
  EXPECT_EQ(kept.render(turned, *light, {Visibility::kRays, 1}).radiance,
            FrameRenderer(engine).render(turned, *light, {Visibility::kRays, 1}).radiance);
}

TEST(Frame, ThePictureIsTheSameWithoutItsParts) {
  Engine engine(roof_light_room(0.5f), tregenza(), few_rays());
  const auto light = engine.relight(sunny(0.3f));
  FrameRenderer renderer(engine);
  const Frame all = renderer.render(into_the_room(), *light, {}),
              sum = renderer.render(into_the_room(), *light, {.components = false});
  EXPECT_TRUE(sum.sun.empty());
  for (std::size_t p = 0; p < all.radiance.size(); ++p)
    EXPECT_NEAR(sum.radiance[p].y, all.radiance[p].y, 1e-4f * all.radiance[p].y);
}

TEST(Engine, SensorsAskedAgainUnderAnotherHourAreThoseOfAFreshEngine) {
  Engine engine(roof_light_room(0.5f), tregenza(), few_rays()), fresh(roof_light_room(0.5f), tregenza(), few_rays());
  const std::vector<glm::dvec3> points{{1, 2, 0.8}, {3, 1, 0.8}};
  const std::vector<glm::vec3> up(2, {0, 0, 1});
  const auto light = engine.relight(sunny(0.3f));
  const Sensors sensors = engine.sensors(points, up, {512, 256});
  engine.illuminance(*light, sensors);
  const auto again = engine.illuminance(*engine.relight(sunny(-0.2f)), sensors),
             first = test::illuminance(fresh, *fresh.relight(sunny(-0.2f)), points, up, {512, 256});
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(again[i].direct, first[i].direct);
    EXPECT_EQ(again[i].sky, first[i].sky);
    EXPECT_EQ(again[i].indirect, first[i].indirect);
  }
}

}  // namespace
}  // namespace transom
