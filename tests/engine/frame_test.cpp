#include "transom/frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "rooms.h"
#include "transom/error.h"
#include "transom/gl_context.h"

namespace transom {
namespace {

using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions few_rays() {
  return test::quick(400, {128, 64}, {128, 64});
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

// Where openings stand is decided in closed form, and rays are cast only where light may fall: the same light as that
// of a ray from every pixel.
TEST(Frame, BeamsArriveWhereRaysFromEveryPixelSay) {
  SceneGeometry scene = roof_light_room(0.5f, 0.7f);
  test::add_box(scene, {1.8, 1.6, 0.1}, {2.3, 2.2, 0.9}, 0);
  test::add_box(scene, {1.2, 1.5, 3.5}, {2.2, 1.6, 3.6}, 0);  // before the roof light
  const Engine engine(scene, tregenza(), few_rays());
  const auto light = engine.relight(sunny(0.3f));
  View from_outdoors = into_the_room();
  from_outdoors.position = {2, -2, 6};
  from_outdoors.target = {2, 2, 2};
  for (const View& view : {into_the_room(), from_outdoors}) {
    FrameOptions centres;
    centres.edge_samples = 1;
    const Frame frame = FrameRenderer(engine).render(view, *light, centres);
    const PrimaryHits hits = trace_primary(scene, view);
    int lit = 0, different = 0;
    for (std::size_t p = 0; p < hits.face.size(); ++p) {
      if (hits.face[p] < 0 || scene.materials[scene.face_material[hits.face[p]]].opening >= 0) continue;
      const glm::ivec4 corner = scene.faces[hits.face[p]];
      const glm::dvec3 a = scene.vertices[corner[0]], b = scene.vertices[corner[1]], c = scene.vertices[corner[2]];
      glm::dvec3 normal = glm::normalize(glm::cross(b - a, c - a));
      if (glm::dot(normal, view.position - hits.position[p]) < 0) normal = -normal;
      const glm::vec3 lifted(hits.position[p] - engine.faces().origin +
                             static_cast<double>(engine.faces().ray_offset()) * normal);
      const float expected = engine.direct_light().illuminance(light->condition.beams, lifted, glm::vec3(normal)).y *
                             0.5f / std::numbers::pi_v<float>;
      lit += expected > 0;
      different += std::abs(frame.sun[p].y - expected) > 1e-3f * expected;
    }
    EXPECT_GT(lit, 100);
    EXPECT_LE(different, 2);  // at the very edge of shade or light
  }
}

double sum_of_sun(const Frame& frame) {
  double sum = 0;
  for (const glm::vec3& value : frame.sun) sum += value.y;
  return sum / static_cast<double>(frame.sun.size());
}

TEST(Frame, RaysFindShadeThinnerThanAPixelWhereverItLies) {
  constexpr int kFinerPicture = 8;
  SceneGeometry barred = roof_light_room(0.5f);  // with a bar before its roof light of 3 cm
  test::add_box(barred, {0.9, 1.95, 2.9}, {3.1, 1.98, 2.92}, 0);
  const Engine engine(barred, tregenza(), few_rays()), open(roof_light_room(0.5f), tregenza(), few_rays());
  const auto light = engine.relight(sunny(0.3f)), without_bar = open.relight(sunny(0.3f));
  for (const double height : {0.0, 0.012, 0.024, 0.036}) {  // along the rows of the picture, half a pixel in all
    View coarse = into_the_room();
    coarse.position = {2, 0.3, 1.5};
    coarse.target = {2, 3, height};
    View fine = coarse;
    fine.width *= kFinerPicture;
    fine.height *= kFinerPicture;
    const double truth = sum_of_sun(FrameRenderer(engine).render(fine, *light, {})),
                 shade = sum_of_sun(FrameRenderer(open).render(fine, *without_bar, {})) - truth;
    ASSERT_GT(shade, 0.01 * truth);
    EXPECT_NEAR(sum_of_sun(FrameRenderer(engine).render(coarse, *light, {})), truth, 0.2 * shade) << height;
  }
}

TEST(Frame, APixelInWhichTheSunEndsShowsWhatPartOfItIsLit) {
  Engine engine(roof_light_room(0.5f), tregenza(), few_rays());
  const auto light = engine.relight(sunny(0.3f));
  constexpr int kParts = 16;
  View parts = into_the_room();
  parts.width *= kParts;
  parts.height *= kParts;
  const Frame frame = FrameRenderer(engine).render(into_the_room(), *light, {}),
              fine = FrameRenderer(engine).render(parts, *light, {Visibility::kRays, 1});
  double error = 0, largest = 0, full = 0;
  int count = 0;
  for (int y = 0; y < frame.height; ++y)
    for (int x = 0; x < frame.width; ++x) {
      double mean = 0, least = 1e30, most = 0;
      for (int j = 0; j < kParts; ++j)
        for (int i = 0; i < kParts; ++i) {
          const double part = fine.sun[(y * kParts + j) * fine.width + x * kParts + i].y;
          mean += part / (kParts * kParts);
          least = std::min(least, part);
          most = std::max(most, part);
        }
      full = std::max(full, most);
      if (least == most) continue;
      const double difference = std::abs(frame.sun[y * frame.width + x].y - mean);
      error += difference;
      largest = std::max(largest, difference);
      ++count;
    }
  ASSERT_GT(count, 40);
  // With sixteen samples a pixel alone it would be 0.030 and 0.086.
  EXPECT_LT(error / count, 0.015 * full);
  EXPECT_LT(largest, 0.06 * full);
}

// Panes beside each other that pass a little more from one to the next, each less wide than a pixel of its light.
TEST(Frame, LightThatFadesWithinAPixelWithoutAnEndIsTheMeanOfItsSamples) {
  SceneGeometry scene = roof_light_room(0.5f);
  const glm::ivec4 pane = scene.faces.back();
  const glm::dvec3 corner = scene.vertices[pane.x], across = scene.vertices[pane.y] - corner,
                   along = scene.vertices[pane.w] - corner;
  scene.faces.pop_back();
  scene.face_material.pop_back();
  scene.openings.clear();
  scene.materials.pop_back();
  constexpr int kPanes = 40;
  constexpr float kFirst = 0.3f, kStep = 0.015f;
  for (int k = 0; k < kPanes; ++k) {
    scene.materials.push_back({glm::vec3(0), glm::vec3(0), false, k});
    scene.openings.push_back({std::vector<float>(2, kFirst + kStep * static_cast<float>(k)), 0.f});
    const glm::dvec3 left = corner + across * (k / double{kPanes}),
                     right = corner + across * ((k + 1) / double{kPanes});
    test::add_quad(scene, left, right, right + along, left + along, k + 1);
  }
  const Engine engine(scene, tregenza(), few_rays());
  const auto light = engine.relight(sunny(0));
  View view;
  view.position = {2, 2, 2};
  view.target = {2, 2, 0};
  view.up = {0, 1, 0};
  view.width = view.height = 12;
  view.vertical_fov_rad = 2 * std::atan(0.5 * 12 * 0.08 / 2);  // pixels of 8 cm, panes of 5 cm
  const Frame frame = FrameRenderer(engine).render(view, *light, {});
  EXPECT_GT(frame.edge_pixel_count, 100);
  const double full = 0.5 / std::numbers::pi * 60000 / std::sqrt(1.01);
  for (int x = 0; x < view.width; ++x) {
    const double place = 2 + (x - 5.5) * 0.08, pane_number = (place - 1) / 2 * kPanes - 0.5;
    EXPECT_NEAR(frame.sun[6 * view.width + x].y / full, kFirst + kStep * pane_number, kStep) << x;
  }
}

// A slit's light on the floor, oblique in the picture: neither the one point of a pixel nor those of its neighbours
// need meet it, but it goes on from where they do.
TEST(Frame, RaysFollowLightNarrowerThanAPixelThatIsObliqueInThePicture) {
  constexpr double kPixel = 0.02, kWidth = 0.4, kSlitHeight = 3.2;  // [m], [pixels], [m]
  SceneGeometry scene = roof_light_room(0.5f);
  const double slit = kPixel * kWidth;
  test::add_quad(scene, {-1, -1, kSlitHeight}, {2, -1, kSlitHeight}, {2, 5, kSlitHeight}, {-1, 5, kSlitHeight}, 0);
  test::add_quad(scene, {2 + slit, -1, kSlitHeight}, {5, -1, kSlitHeight}, {5, 5, kSlitHeight},
                 {2 + slit, 5, kSlitHeight}, 0);
  const Engine engine(scene, tregenza(), few_rays());
  Condition condition = uniform_sky(0);
  condition.beams.push_back({glm::vec3(0, 0, 1), glm::vec3(60000)});
  const auto light = engine.relight(condition);
  const double lit = 60000 * 0.5 / std::numbers::pi;
  View view;
  view.width = view.height = 32;
  view.position = {2, 2, 1.5};
  view.target = {2, 2, 0};
  view.vertical_fov_rad = 2 * std::atan(0.5 * view.height * kPixel / view.position.z);
  for (const double slope : {-0.41, -0.27, -0.13, 0.13, 0.27, 0.41}) {  // against the columns, then against the rows
    const double length = view.height * kWidth * std::sqrt(1 + slope * slope);
    for (const glm::dvec3& up : {glm::dvec3(slope, 1, 0), glm::dvec3(1, slope, 0)}) {
      view.up = up;
      const double found = sum_of_sun(FrameRenderer(engine).render(view, *light, {})) * view.width * view.height / lit;
      EXPECT_NEAR(found, length, 0.06 * length) << slope << ' ' << up.x;
    }
  }
}

// A slit's light on the floor, 0.4 pixels wide, seen from above: where most of it is in one column or row, a tenth of a
// pixel may be in the next, beyond the outermost squares of the stencil.
TEST(Frame, VolumesFindLightBetweenSquaresOfTheStencilWhereverItLies) {
  try {
    const GlContext context;
  } catch (const GlError& error) {
    GTEST_SKIP() << error.what();
  }
  constexpr double kPixel = 0.02, kWidth = 0.4, kSlitHeight = 3.2;  // [m], [pixels], [m]
  constexpr int kPlaces = 20;
  const glm::dvec3 sun(0.1, 0.07, 1);
  SceneGeometry scene = roof_light_room(0.5f);
  const auto cover = [&](double from, double to) {
    test::add_quad(scene, {from, -1, kSlitHeight}, {to, -1, kSlitHeight}, {to, 5, kSlitHeight}, {from, 5, kSlitHeight},
                   0);
  };
  const double slit = 2 + kSlitHeight * sun.x;
  cover(-1, slit);
  cover(slit + kPixel * kWidth, 5);
  const Engine engine(scene, tregenza(), few_rays());
  Condition condition = uniform_sky(0);
  condition.beams.push_back({glm::vec3(glm::normalize(sun)), glm::vec3(60000)});
  const auto light = engine.relight(condition);
  const double lit = 60000 * glm::normalize(sun).z * 0.5 / std::numbers::pi;
  View view;
  view.width = view.height = 32;
  for (const glm::dvec3& up : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0)}) {
    for (int place = 0; place < kPlaces; ++place) {
      view.position = {2 + kPixel * place / kPlaces, 2, 1.5};
      view.target = {view.position.x, 2, 0};
      view.up = up;
      view.vertical_fov_rad = 2 * std::atan(0.5 * view.height * kPixel / view.position.z);
      const Frame frame = FrameRenderer(engine).render(view, *light, {Visibility::kVolumes});
      // Places of the finer grid beside them say where both ends of the light are, to 1/64 of a pixel each.
      EXPECT_NEAR(sum_of_sun(frame) * view.width / lit, kWidth, 1.0 / 32 + 1e-3) << place << ' ' << up.x;
    }
  }
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
