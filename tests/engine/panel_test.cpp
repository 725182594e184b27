// Panels of glazing products against closed forms, clear glass and another visibility method.
#include <gtest/gtest.h>

#include <oneapi/tbb/global_control.h>
#include <cmath>
#include <numbers>

#include "rooms.h"
#include "transom/angle_bins.h"
#include "transom/closed_form.h"
#include "transom/error.h"
#include "transom/frame.h"
#include "transom/sampling.h"
#include "transom/sunlit_polygon.h"

namespace transom {
namespace {

using test::add_box;
using test::add_quad;
using test::diffuse;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr double kWidth = 4, kDepth = 6, kHeight = 3;                // of the room, x, y, z
constexpr double kLeft = 1, kRight = 3, kSill = 1, kHead = 2;        // of the panel, in the wall y = 0
const glm::vec3 kSun = glm::normalize(glm::vec3(0.3f, -1.f, 0.8f));  // towards it
const glm::vec3 kInto(0, 1, 0);

AngleBins klems() {
  std::vector<float> edges;
  for (const float degrees : {0.f, 5.f, 15.f, 25.f, 35.f, 45.f, 55.f, 65.f, 75.f, 90.f})
    edges.push_back(degrees * kPi / 180);
  return AngleBins(edges, {1, 8, 16, 20, 24, 24, 24, 16, 12});
}

/// Seen from the room, +x is to the left in a window that looks south (-y).
PanelFrame south_frame() {
  return {{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}, klems()};
}

/// Materials of a room whose opening 0 is a panel, or clear if `transmittance` says so: walls, and the window.
SceneGeometry south_glazing(float reflectance, std::optional<float> transmittance = std::nullopt) {
  SceneGeometry scene;
  scene.materials = {diffuse(reflectance), {glm::vec3(0), glm::vec3(0), false, 0}};
  scene.openings.push_back({std::vector<float>(2, transmittance.value_or(0.f)), 0.f});
  if (!transmittance) scene.openings[0].panel = south_frame();
  return scene;
}

/// Adds a closed room from y = f to y whose south wall has one window.
void add_south_room(SceneGeometry& scene, double f, double y, double z) {
  const double x = kWidth, l = kLeft, r = kRight, s = kSill, h = kHead;
  add_quad(scene, {0, f, 0}, {x, f, 0}, {x, y, 0}, {0, y, 0}, 0);
  add_quad(scene, {0, f, z}, {0, y, z}, {x, y, z}, {x, f, z}, 0);
  add_quad(scene, {0, y, 0}, {x, y, 0}, {x, y, z}, {0, y, z}, 0);
  add_quad(scene, {0, f, 0}, {0, y, 0}, {0, y, z}, {0, f, z}, 0);
  add_quad(scene, {x, f, 0}, {x, f, z}, {x, y, z}, {x, y, 0}, 0);
  add_quad(scene, {0, f, 0}, {0, f, z}, {l, f, z}, {l, f, 0}, 0);
  add_quad(scene, {r, f, 0}, {r, f, z}, {x, f, z}, {x, f, 0}, 0);
  add_quad(scene, {l, f, 0}, {l, f, s}, {r, f, s}, {r, f, 0}, 0);
  add_quad(scene, {l, f, h}, {l, f, z}, {r, f, z}, {r, f, h}, 0);
  add_quad(scene, {l, f, s}, {r, f, s}, {r, f, h}, {l, f, h}, 1);  // its front looks to -y
}

SceneGeometry south_room(float reflectance, std::optional<float> transmittance = std::nullopt) {
  SceneGeometry scene = south_glazing(reflectance, transmittance);
  add_south_room(scene, 0, kDepth, kHeight);
  return scene;
}

SolveOptions quick_options(int patches = 800) {
  SolveOptions options;
  options.target_patch_count = patches;
  options.patch_samples = {256, 256};
  options.node_samples = {256, 256};
  return options;
}

Condition dark() {
  return test::uniform_sky(0);
}

/// A lobe of normal illuminance 1000 lx that goes up into the room.
Beam lobe(glm::vec3 propagation, glm::vec3 sun = kSun) {
  Beam beam;
  beam.direction_to_source = -glm::normalize(propagation);
  beam.normal_illuminance = glm::vec3(1000);
  beam.opening = 0;
  beam.direction_to_sun = sun;
  return beam;
}

/// The same light straight through: diagonal transmission.
Product straight(float share) {
  const AngleBins bins = klems();
  const auto n = static_cast<std::size_t>(bins.count());
  Product product{std::vector<float>(n * n, 0.f), 0.f};
  for (std::size_t b = 0; b < n; ++b)
    product.transmission[b * n + b] = share / bins.projected_solid_angle(static_cast<int>(b));
  return product;
}

Product lambertian(float transmittance, float room_reflectance = 0) {
  const auto n = static_cast<std::size_t>(klems().count());
  return {std::vector<float>(n * n, transmittance / kPi), room_reflectance};
}

TEST(AngleBins, SamplesStayInTheirBinAndProjectedSolidAnglesSumToPi) {
  const AngleBins bins = klems();
  const SobolSequence points(7);
  float sum = 0;
  for (int b = 0; b < bins.count(); ++b) {
    sum += bins.projected_solid_angle(b);
    for (std::uint32_t i = 0; i < 64; ++i) {
      const glm::vec2 u = points.point2(i);
      if (std::min({u.x, u.y, 1 - u.x, 1 - u.y}) < 1e-3f) continue;
      const glm::vec3 direction = bins.sample(b, u);
      EXPECT_EQ(bins.bin_of(direction), b);
      EXPECT_EQ(bins.bin_of(glm::vec3(direction.x, direction.y, -direction.z)), b);
    }
  }
  EXPECT_NEAR(sum, kPi, 1e-5f);
}

TEST(AngleBins, AreCentredAtAzimuthZero) {
  const AngleBins bins = klems();
  const float theta = 10 * kPi / 180;
  EXPECT_EQ(bins.bin_of({0, 0, 1}), 0);
  EXPECT_EQ(bins.bin_of({std::sin(theta), 0, std::cos(theta)}), 1);
  EXPECT_EQ(bins.bin_of({0, std::sin(theta), std::cos(theta)}), 3);
}

TEST(SunlitPolygon, OverhangTakesItsShadowAway) {
  SceneGeometry scene = south_room(0.5f);
  const double depth = 0.4, sun_rise = kSun.z / -kSun.y;  // height per depth towards the sun
  add_quad(scene, {-9, -depth, kHead}, {9, -depth, kHead}, {9, 0, kHead}, {-9, 0, kHead}, 0);
  const Faces faces = make_faces(scene);
  int panel = -1;
  for (std::size_t f = 0; f < faces.faces.size(); ++f)
    if (faces.faces[f].material == 1) panel = static_cast<int>(f);
  const auto pieces = SunlitFaces(faces, scene.materials, scene.openings, glm::dvec3(kSun)).pieces(panel);
  EXPECT_NEAR(sunlit_share(faces.faces[static_cast<std::size_t>(panel)], pieces), 1 - depth * sun_rise, 1e-4);
  EXPECT_TRUE(SunlitFaces(faces, scene.materials, scene.openings, glm::dvec3(0, 1, 0)).pieces(panel).empty());
}

TEST(SunlitPolygon, AgreesWithRaysBehindManyObstructions) {
  SceneGeometry scene = south_room(0.5f);
  scene.openings.push_back({std::vector<float>(2, 0.5f), 0.f});
  scene.materials.push_back({glm::vec3(0), glm::vec3(0), false, 1});
  for (int i = 0; i < 12; ++i) {
    const double x = 0.9 + 0.35 * i, z = 0.7 + 0.31 * (i * 5 % 12), y = -0.3 - 0.1 * i;
    add_box(scene, {x, y - 0.05, z}, {x + 0.13, y, z + 0.2}, 0);
  }
  add_quad(scene, {1.1, -0.2, 1.2}, {2.1, -0.25, 1.3}, {2.2, -0.25, 2.3}, {1.2, -0.2, 2.2}, 2);  // a pane of one half
  const Faces faces = make_faces(scene);
  const RayScene rays(faces, scene.materials, scene.openings);
  int panel = -1;
  for (std::size_t f = 0; f < faces.faces.size(); ++f)
    if (faces.faces[f].material == 1) panel = static_cast<int>(f);
  const Face& face = faces.faces[static_cast<std::size_t>(panel)];
  const SobolSequence points(3);
  const int count = 1 << 16;
  for (const glm::vec3 sun :
       {kSun, glm::normalize(glm::vec3(-0.6f, -1, 0.1f)), glm::normalize(glm::vec3(0, -0.5f, 1))}) {
    const auto pieces = SunlitFaces(faces, scene.materials, scene.openings, glm::dvec3(sun)).pieces(panel);
    double sum = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const Ray ray{face.position(points.point2(i)) + faces.ray_offset() * face.normal, sun};
      std::uint8_t blocked = 0;
      rays.occluded(RayScene::What::kOpaque, {&ray, 1}, {&blocked, 1});
      if (!blocked) sum += rays.transmittance(ray);
    }
    const double share = sunlit_share(face, pieces);
    EXPECT_GT(share, 0.2);
    EXPECT_LT(share, 0.9);
    EXPECT_NEAR(share, sum / count, 5e-4);
  }
}

TEST(Panel, LobeStraightThroughIsSunThroughClearGlass) {
  const float transmittance = 0.8f;
  Engine glass(south_room(0.5f, transmittance), test::tregenza(), quick_options());
  const Engine panel(south_room(0.5f), test::tregenza(), quick_options());
  Condition sun = dark(), through = dark();
  sun.beams.push_back({kSun, glm::vec3(1000)});
  through.beams.push_back({kSun, glm::vec3(0)});  // the sun itself: it does not pass
  through.beams.push_back(lobe(-kSun));
  through.beams[1].normal_illuminance *= transmittance;
  const auto a = glass.relight(sun), b = panel.relight(through);
  const std::vector<glm::dvec3> points{{1.6, 1.8, 0}, {2, 3, 0}, {3.2, 5, 0}, {2, 3, 1.5}};
  const std::vector<glm::vec3> up(points.size(), glm::vec3(0, 0, 1));
  const auto e = test::illuminance(glass, *a, points, up, {4096, 1024});
  const auto f = test::illuminance(panel, *b, points, up, {4096, 1024});
  EXPECT_GT(e[0].direct.y, 100);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(f[i].direct.y, e[i].direct.y, 1e-4f * e[0].direct.y) << i;
    EXPECT_NEAR(f[i].indirect.y, e[i].indirect.y, 0.01f * e[i].indirect.y) << i;
  }
}

TEST(Panel, SkyStraightThroughIsSkyThroughAnOpenWindow) {
  const Engine window(south_room(0.5f, 1.f), test::tregenza(), quick_options());
  Engine panel(south_room(0.5f), test::tregenza(), quick_options());
  panel.set_product(0, straight(1));
  const Condition sky = test::uniform_sky(5000, 5000);  // the same from everywhere: bins do not blur it
  const auto a = window.relight(sky), b = panel.relight(sky);
  const std::vector<glm::dvec3> points{{2, 0.5, 0.8}, {2, 2, 0.8}, {2, 5, 0.8}};
  const std::vector<glm::vec3> up(points.size(), glm::vec3(0, 0, 1));
  const auto e = test::illuminance(window, *a, points, up, {4096, 4096});
  const auto f = test::illuminance(panel, *b, points, up, {4096, 4096});
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(f[i].sky.y, e[i].sky.y, 1e-3f * e[i].sky.y) << i;
    EXPECT_NEAR(f[i].indirect.y, e[i].indirect.y, 0.01f * e[i].indirect.y) << i;
  }
}

TEST(Panel, LambertianOneIsADiffuseEmitter) {
  Engine engine(south_room(0.f), test::tregenza(), quick_options());
  engine.set_product(0, lambertian(0.4f));
  const auto lighting = engine.relight(test::uniform_sky(5000, 1000));
  const float outside = kPi * 3000;  // half sky, half ground on a vertical plane
  const std::vector<glm::dvec3> points{{2, 0.5, 0}, {2, 2, 0}, {0.5, 4, 1.2}};
  const std::vector<glm::vec3> normals{{0, 0, 1}, {0, 0, 1}, {0, -1, 0}};
  const auto e = test::illuminance(engine, *lighting, points, normals, {256, 8192});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::vector<glm::vec3> outline{glm::vec3(kLeft, 0, kSill), glm::vec3(kLeft, 0, kHead),
                                         glm::vec3(kRight, 0, kHead), glm::vec3(kRight, 0, kSill)};
    const float expected = 0.4f * outside * point_to_polygon(glm::vec3(points[i]), normals[i], outline);
    EXPECT_NEAR(e[i].sky.y, expected, 2e-3f * expected) << i;
  }
}

/// Flux, and its centroid, of what lies on the ceiling.
void measure_ceiling(const Engine& engine, const Lighting& lighting, double& flux, glm::dvec3& centroid) {
  flux = 0;
  centroid = glm::dvec3(0);
  const int per_slot = engine.mesh().elements_per_slot();
  for (const LitElement& lit : lighting.lit_elements) {
    const ElementShape shape = element_shape(engine.mesh(), lit.element);
    const glm::dvec3 place = glm::dvec3(shape.middle) + engine.faces().origin;
    const Slot slot = engine.mesh().slot(lit.element / per_slot);
    ASSERT_NEAR(place.z, kHeight, 1e-3) << "light on face " << slot.face;
    const double part = static_cast<double>(lit.illuminance.y * shape.area);
    flux += part;
    centroid += part * place;
  }
  centroid /= std::max(flux, 1e-30);
}

TEST(Panel, LobeTurnedUpLightsTheTranslatedPanelOnTheCeiling) {
  const Engine engine(south_room(0.5f), test::tregenza(), quick_options());
  const glm::vec3 up = glm::normalize(glm::vec3(0.1f, 1, 0.6f));
  Condition condition = dark();
  condition.beams.push_back(lobe(up));
  const auto lighting = engine.relight(condition);
  double flux;
  glm::dvec3 centroid;
  measure_ceiling(engine, *lighting, flux, centroid);
  const double panel_area = (kRight - kLeft) * (kHead - kSill);
  EXPECT_NEAR(flux, 1000 * panel_area * static_cast<double>(up.y), 0.1);
  // A height z of the panel goes to depth (ceiling - z) * up.y / up.z; the middle one speaks for all.
  const double rise = kHeight - 0.5 * (kSill + kHead);
  EXPECT_NEAR(centroid.x, 0.5 * (kLeft + kRight) + rise * static_cast<double>(up.x / up.z), 0.02);
  EXPECT_NEAR(centroid.y, rise * static_cast<double>(up.y / up.z), 0.02);
}

TEST(Panel, LobeIsCutWhereAnOverhangKeepsTheSunOff) {
  SceneGeometry scene = south_room(0.5f);
  add_quad(scene, {-9, -0.4, kHead}, {9, -0.4, kHead}, {9, 0, kHead}, {-9, 0, kHead}, 0);
  const Engine engine(scene, test::tregenza(), quick_options());
  const glm::vec3 up = glm::normalize(glm::vec3(0, 1, 0.6f));
  Condition condition = dark();
  condition.beams.push_back(lobe(up));
  const auto lighting = engine.relight(condition);
  double flux;
  glm::dvec3 centroid;
  measure_ceiling(engine, *lighting, flux, centroid);
  const double lit_height = (kHead - kSill) - 0.4 * static_cast<double>(kSun.z / -kSun.y);
  EXPECT_NEAR(flux, 1000 * (kRight - kLeft) * lit_height * static_cast<double>(up.y), 0.1);
  EXPECT_NEAR(centroid.y, (kHeight - kSill - 0.5 * lit_height) * static_cast<double>(up.y / up.z), 0.02);
}

// A low room stands before the other, so that the shaft of its panel, which has no end, holds the other's back wall.
TEST(Panel, LightOfTheNearestPanelDoesNotDependOnTheOrderOfPanels) {
  for (const bool is_farther_first : {false, true}) {
    SceneGeometry scene = south_glazing(0.5f);
    const auto add_low_room = [&] { add_south_room(scene, -4, -2, 2.2); };
    if (is_farther_first) add_low_room();
    add_south_room(scene, 0, kDepth, kHeight);
    if (!is_farther_first) add_low_room();
    const Engine engine(scene, test::tregenza(), quick_options());
    Condition condition = dark();
    condition.beams.push_back(lobe(kInto));
    const auto lighting = engine.relight(condition);
    const auto e = test::illuminance(engine, *lighting, {{2, kDepth, 1.5}}, {-kInto}, {64, 64});
    EXPECT_NEAR(e[0].direct.y, 1000, 0.1f) << is_farther_first;
    const View view{{2, 3, 1.5}, {2, kDepth, 1.5}, {0, 0, 1}, 0.1, 4, 4};
    const Frame frame = FrameRenderer(engine).render(view, *lighting, {});
    for (const glm::vec3 radiance : frame.sun) EXPECT_NEAR(radiance.y, 1000 * 0.5f / kPi, 0.1f) << is_farther_first;
  }
}

TEST(Panel, GroundBelowTheFalseSunCastsNoShadow) {
  SceneGeometry scene = south_room(0.5f);
  add_quad(scene, {-20, -20, -0.01}, {20, -20, -0.01}, {20, 20, -0.01}, {-20, 20, -0.01}, 0);
  const Engine engine(scene, test::tregenza(), quick_options());
  Condition condition = dark();
  condition.beams.push_back(lobe({0, 1, 0.6f}));  // seen from the ceiling it comes from below the horizon
  const auto lighting = engine.relight(condition);
  const auto e = test::illuminance(engine, *lighting, {{2, 2.5, kHeight}}, {{0, 0, -1}}, {64, 64});
  EXPECT_NEAR(e[0].direct.y, 1000 * 0.6f / std::sqrt(1.36f), 0.5f);
}

TEST(Panel, RightIsRightAndUpIsUpAsSeenFromTheRoom) {
  const Engine engine(south_room(0.f), test::tregenza(), quick_options());
  const AngleBins bins = klems();
  const float theta = 60 * kPi / 180;
  const auto light_into = [&](glm::vec3 direction) {
    Condition condition = dark();
    condition.residuals.push_back({0, kSun, std::vector<glm::vec3>(145, glm::vec3(0))});
    condition.residuals[0].radiance[static_cast<std::size_t>(bins.bin_of(direction))] = glm::vec3(1000);
    const auto e = test::illuminance(engine, *engine.relight(condition),
                                     {{0, 1, 1.5}, {kWidth, 1, 1.5}, {2, 1, kHeight}, {2, 1, 0}},
                                     {{1, 0, 0}, {-1, 0, 0}, {0, 0, -1}, {0, 0, 1}}, {64, 4096});
    return std::vector<float>{e[0].sky.y, e[1].sky.y, e[2].sky.y, e[3].sky.y};
  };
  const float s = std::sin(theta), c = std::cos(theta);
  const std::vector<glm::vec3> ways{{s, 0, c}, {-s, 0, c}, {0, s, c}, {0, -s, c}};  // right, left, up, down
  for (std::size_t way = 0; way < ways.size(); ++way) {
    const std::vector<float> walls = light_into(ways[way]);  // west, east, ceiling, floor
    for (std::size_t wall = 0; wall < walls.size(); ++wall) {
      if (wall == way)
        EXPECT_GT(walls[wall], 1) << way;
      else
        EXPECT_LT(walls[wall], 0.2f * walls[way]) << way << " " << wall;
    }
  }
}

TEST(Panel, NothingPassesBeforeAProductIsSetNorFromTheRoomSide) {
  const Engine engine(south_room(0.5f), test::tregenza(), quick_options());
  Condition condition = test::uniform_sky(5000, 1000);
  condition.beams.push_back({kSun, glm::vec3(1000)});
  condition.beams.push_back(lobe({0, -1, 0.2f}));  // turns away from the room
  const auto lighting = engine.relight(condition);
  const auto e = test::illuminance(engine, *lighting, {{2, 1.5, 0}}, {{0, 0, 1}}, {64, 64});
  EXPECT_EQ(e[0].direct.y + e[0].sky.y + e[0].indirect.y, 0);
}

TEST(Panel, FluxInIsFluxAbsorbed) {
  SceneGeometry scene = south_room(0.6f);
  add_box(scene, {-5, -8, 0}, {9, -7, 4}, 0);  // an obstruction, which the panel sees
  Engine engine(scene, test::tregenza(), quick_options(2000));
  engine.set_product(0, lambertian(0.5f, 0.3f));
  Condition condition = test::uniform_sky(5000, 1000);
  condition.beams.push_back({kSun, glm::vec3(20000)});
  condition.beams.push_back(lobe({0.2f, 1, 0.6f}));
  condition.residuals.push_back({0, kSun, std::vector<glm::vec3>(145, glm::vec3(200))});
  const EnergyAudit audit = engine.audit(*engine.relight(condition), 1 << 16);
  EXPECT_GT(audit.in_sky.y, 100);
  EXPECT_GT(audit.in_beams.y, 100);
  EXPECT_NEAR((audit.absorbed.y + audit.out.y) / audit.in().y, 1, 2e-3);
}

TEST(Panel, OtherProductIsTheLightOfANewSolve) {
  SceneGeometry scene = south_room(0.6f);
  Engine engine(scene, test::tregenza(), quick_options());
  engine.set_product(0, straight(0.9f));
  engine.relight(test::uniform_sky(1000, 100));
  engine.set_product(0, lambertian(0.5f, 0.4f));
  scene.openings[0].diffuse_reflectance = 0.4f;
  Engine fresh(scene, test::tregenza(), quick_options());
  fresh.set_product(0, lambertian(0.5f, 0.4f));
  Condition condition = test::uniform_sky(5000, 1000);
  condition.beams.push_back(lobe({0.2f, 1, 0.6f}));
  const auto a = engine.relight(condition), b = fresh.relight(condition);
  ASSERT_EQ(a->patch_irradiance.size(), b->patch_irradiance.size());
  for (std::size_t p = 0; p < a->patch_irradiance.size(); ++p)
    EXPECT_NEAR(a->patch_irradiance[p].y, b->patch_irradiance[p].y, 1e-3f * b->patch_irradiance[p].y + 1e-3f);
}

TEST(Panel, LightDoesNotDependOnThreads) {
  Condition condition = test::uniform_sky(5000, 1000);
  condition.beams.push_back(lobe({0.2f, 1, 0.6f}));
  const auto light = [&](std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Engine engine(south_room(0.6f), test::tregenza(), quick_options());
    engine.set_product(0, lambertian(0.5f, 0.4f));
    return engine.relight(condition)->patch_irradiance;
  };
  EXPECT_EQ(light(1), light(2));
}

TEST(Panel, RaysAndStencilVolumesShowTheSameLobes) {
  SceneGeometry scene = south_room(0.5f);
  add_quad(scene, {-20, -20, -0.01}, {20, -20, -0.01}, {20, 20, -0.01}, {-20, 20, -0.01}, 0);
  add_quad(scene, {-9, -0.3, kHead}, {9, -0.3, kHead}, {9, 0, kHead}, {-9, 0, kHead}, 0);  // an overhang
  add_box(scene, {1.8, 1.5, 0}, {2.2, 1.9, 2.2}, 0);                                       // a pillar in the light
  const Engine engine(scene, test::tregenza(), quick_options());
  Condition condition = dark();
  for (const glm::vec3 direction : {glm::vec3(0, 1, 0.6f), glm::vec3(0.3f, 1, -0.5f), glm::vec3(0, -1, 0.6f)})
    condition.beams.push_back(lobe(direction));
  const auto lighting = engine.relight(condition);
  FrameRenderer renderer(engine);
  const View view{{0.4, 5.6, 1.2}, {2.2, 1, 1.6}, {0, 0, 1}, 1.4, 160, 120};
  FrameOptions options;
  options.edge_samples = 1;
  const Frame rays = renderer.render(view, *lighting, options);
  options.visibility = Visibility::kVolumes;
  const Frame volumes = renderer.render(view, *lighting, options);
  EXPECT_EQ(volumes.pass_count, 1 + 2 * 2);  // of the lobe that turns away: none
  int lit = 0, different = 0;
  for (std::size_t p = 0; p < rays.sun.size(); ++p) {
    lit += rays.sun[p].y > 0;
    different += std::abs(rays.sun[p].y - volumes.sun[p].y) > 1e-3f * rays.sun[p].y;
  }
  EXPECT_GT(lit, 800);
  EXPECT_LE(different, 20);  // on edges
}

TEST(Panel, WrongProductsAreRefused) {
  Engine engine(south_room(0.5f), test::tregenza(), quick_options());
  EXPECT_THROW(engine.set_product(1, lambertian(0.5f)), InputError);
  EXPECT_THROW(engine.set_product(0, {std::vector<float>(7, 0.f), 0.f}), InputError);
  EXPECT_THROW(engine.set_product(0, lambertian(-0.5f)), InputError);
  EXPECT_THROW(engine.set_product(0, lambertian(0.5f, 1.5f)), InputError);
  Condition condition = dark();
  condition.residuals.push_back({0, kSun, std::vector<glm::vec3>(3, glm::vec3(1))});
  EXPECT_THROW(engine.relight(condition), InputError);
}

TEST(Panel, ClassicMethodAgreesWithGathering) {
  SolveOptions classic = quick_options();
  classic.method = Method::kClassic;
  Condition condition = test::uniform_sky(5000, 1000);
  condition.beams.push_back(lobe({0.2f, 1, 0.6f}));
  condition.residuals.push_back({0, kSun, std::vector<glm::vec3>(145, glm::vec3(100))});
  std::vector<double> flux;
  for (const SolveOptions& options : {quick_options(), classic}) {
    Engine engine(south_room(0.5f), test::tregenza(), options);
    engine.set_product(0, lambertian(0.5f, 0.3f));
    const EnergyAudit audit = engine.audit(*engine.relight(condition), 1 << 14);
    flux.push_back(audit.absorbed.y + audit.out.y);
  }
  EXPECT_NEAR(flux[1], flux[0], 0.01 * flux[0]);
}

}  // namespace
}  // namespace transom
