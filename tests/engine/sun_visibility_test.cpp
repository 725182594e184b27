// What places see of the sun's disc, and sub-suns in its place where light is measured.
#include "transom/sun_visibility.h"

#include <gtest/gtest.h>

#include <numeric>

#include "rooms.h"
#include "transom/error.h"

namespace transom {
namespace {

using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions few_rays() {
  return test::quick(200, {64, 16}, {64, 16});
}

TEST(SunVisibility, WeightsOfPlacesAreTheFluxThatSurfacesWouldReceive) {
  const Engine engine(roof_light_room(0.5f), tregenza(), few_rays());
  const glm::vec3 up(0, 0, 1);
  const Places places = places_facing(engine, up);
  const float sum = std::accumulate(places.weights.begin(), places.weights.end(), 0.f);
  EXPECT_NEAR(sum, 16.f, 1e-3f);  // the floor; walls stand along the beam, the ceiling turns away
  ASSERT_EQ(places.points.size(), places.weights.size());
}

TEST(SunVisibility, APatchThatABoxStandsOnCountsByWhatIsLeftOfIt) {
  SceneGeometry scene = roof_light_room(0.5f);
  test::add_box(scene, {1.31, 1.27, 0}, {2.46, 2.55, 0.5}, 0);
  const Engine engine(scene, tregenza(), test::quick(1500, {64, 16}, {64, 16}));
  const glm::vec3 up(0, 0, 1);
  const Places places = places_facing(engine, up);
  const std::vector<float> shares = shares_from(engine, places.points, {&up, 1});
  const double flux = std::inner_product(shares.begin(), shares.end(), places.weights.begin(), 0.0);
  EXPECT_NEAR(flux, 4, 0.03 * 4);  // through the roof light, on the box or beside it
}

TEST(SunVisibility, SharesAreWhatOpeningsLeaveOfEachDirection) {
  const float transmittance = 0.6f;
  const Engine engine(roof_light_room(0.5f, transmittance), tregenza(), few_rays());
  const glm::vec3 up(0, 0, 1), aslant = glm::normalize(glm::vec3(1, 0, 3));
  const Places places = places_facing(engine, up);
  const std::vector<glm::vec3> directions{up, aslant};
  const std::vector<float> shares = shares_from(engine, places.points, directions);
  ASSERT_EQ(shares.size(), 2 * places.points.size());
  int lit = 0, lit_aslant = 0;
  for (std::size_t i = 0; i < places.points.size(); ++i) {
    const glm::dvec3 p = glm::dvec3(places.points[i]) + engine.faces().origin;
    const auto is_below = [&](double x) { return x > 1 && x < 3 && p.y > 1 && p.y < 3; };
    EXPECT_NEAR(shares[2 * i], is_below(p.x) ? transmittance : 0.f, 1e-6f);
    EXPECT_NEAR(shares[2 * i + 1], is_below(p.x + (3 - p.z) / 3) ? transmittance : 0.f, 1e-6f);
    lit += shares[2 * i] > 0;
    lit_aslant += shares[2 * i + 1] > 0;
  }
  EXPECT_GT(lit, 10);
  EXPECT_GT(lit_aslant, 0);
}

TEST(SunVisibility, SubSunsStandForTheSunAtSensorsAndLeaveElementsThePoint) {
  const Engine engine(roof_light_room(0.5f), tregenza(), few_rays());
  Condition point = uniform_sky(100);
  point.beams = {{{0, 0, 1}, glm::vec3(8)}};
  Condition parted = point;
  const glm::vec3 left = glm::normalize(glm::vec3(-1, 0, 9)), right = glm::normalize(glm::vec3(1, 0, 9));
  parted.sub_suns = {{left, glm::vec3(4)}, {right, glm::vec3(4)}};
  const auto with_point = engine.relight(point), with_parts = engine.relight(parted);
  ASSERT_EQ(with_point->patch_irradiance.size(), with_parts->patch_irradiance.size());
  for (std::size_t p = 0; p < with_point->patch_irradiance.size(); ++p)
    EXPECT_EQ(with_point->patch_irradiance[p], with_parts->patch_irradiance[p]);
  // On the floor 1/3 m within the hole's edge as each part of the sun sees it: one of them is hidden.
  const std::vector<glm::dvec3> points{{2, 2, 0.001}, {1.2, 2, 0.001}};
  const std::vector<glm::vec3> normals(2, glm::vec3(0, 0, 1));
  const auto direct = [&](const Lighting& lighting, std::size_t i) {
    return test::illuminance(engine, lighting, points, normals, {16, 16})[i].direct.x;
  };
  EXPECT_FLOAT_EQ(direct(*with_point, 0), 8.f);
  EXPECT_FLOAT_EQ(direct(*with_parts, 0), 8 * right.z);
  EXPECT_FLOAT_EQ(direct(*with_point, 1), 8.f);
  EXPECT_FLOAT_EQ(direct(*with_parts, 1), 4 * right.z);
}

TEST(SunVisibility, ASubSunThatIsNoLightIsRefused) {
  Condition condition = uniform_sky(100);
  condition.sub_suns = {{{0, 0, 2}, glm::vec3(1)}};
  EXPECT_THROW(condition.validate(145), InputError);
  condition.sub_suns = {{{0, 0, 1}, glm::vec3(-1)}};
  EXPECT_THROW(condition.validate(145), InputError);
  condition.sub_suns = {{{0, 0, 1}, glm::vec3(1)}};
  EXPECT_NO_THROW(condition.validate(145));
}

}  // namespace
}  // namespace transom
