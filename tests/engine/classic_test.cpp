#include "transom/classic.h"

#include <gtest/gtest.h>

#include <algorithm>

#include <numbers>

#include "rooms.h"
#include "transom/engine.h"
#include "transom/error.h"

namespace transom {
namespace {

using test::diffuse;
using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

constexpr double kPi = std::numbers::pi;

SolveOptions classic_options() {
  SolveOptions options;
  options.method = Method::kClassic;
  options.target_patch_count = 600;
  options.patch_samples = {256, 64};
  return options;
}

// n patches of equal area that see each other, and themselves, equally: irradiance M + rho E = E / 1, a furnace.
struct Furnace {
  static constexpr int kCount = 8;
  SparseRows form_factors, none;
  std::vector<float> area = std::vector<float>(kCount, 2.f);
  Furnace() {
    for (int p = 0; p < kCount; ++p) {
      std::vector<Share> row;
      for (int q = 0; q < kCount; ++q) row.push_back({q, 1.f / kCount});
      form_factors.append(row);
      none.append({});
    }
  }
  ProgressiveRadiosity make(float reflectance, float emitted) const {
    return {form_factors, none, area, std::vector<glm::vec3>(kCount, glm::vec3(reflectance)),
            std::vector<glm::vec3>(kCount, glm::vec3(emitted))};
  }
};

TEST(ProgressiveRadiosity, FillsAFurnaceToItsClosedForm) {
  const Furnace furnace;
  for (const float rho : {0.f, 0.5f, 0.8f}) {
    const ProgressiveRadiosity shooting = furnace.make(rho, 1);
    ShootingState light = shooting.dark();
    shooting.shoot(light, 1 << 20, 1e-6);
    for (const glm::vec3& e : light.irradiance) EXPECT_NEAR(e.y * (1 - rho), 1, 1e-5) << "rho " << rho;
  }
}

TEST(ProgressiveRadiosity, FluxInFlightFallsWithEveryRound) {
  const ProgressiveRadiosity shooting = Furnace().make(0.8f, 1);
  ShootingState light = shooting.dark();
  double before = shooting.unshot_share(light);
  EXPECT_GT(before, 0.9);
  for (int round = 0; round < 10; ++round) {
    EXPECT_EQ(shooting.shoot(light, Furnace::kCount, 1e-9), Furnace::kCount);
    EXPECT_LT(shooting.unshot_share(light), before);
    before = shooting.unshot_share(light);
  }
}

TEST(ProgressiveRadiosity, ReplacedDirectLightLeavesNothingOfTheOld) {
  const ProgressiveRadiosity shooting = Furnace().make(0.7f, 0);
  ShootingState light = shooting.dark(), fresh = shooting.dark();
  std::vector<glm::vec3> morning(Furnace::kCount, glm::vec3(0)), evening = morning;
  morning[0] = glm::vec3(1000, 900, 800);
  evening[5] = glm::vec3(100, 200, 300);
  shooting.replace_direct(light, morning);
  shooting.shoot(light, 3, 1e-6);  // interrupted
  shooting.replace_direct(light, evening);
  shooting.shoot(light, 1 << 20, 1e-6);
  shooting.replace_direct(fresh, evening);
  shooting.shoot(fresh, 1 << 20, 1e-6);
  for (int p = 0; p < Furnace::kCount; ++p)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(light.irradiance[p][c], fresh.irradiance[p][c], 1e-2) << p << ' ' << c;
}

TEST(Classic, ForwardRaysCarryTheFluxOfTheOpening) {
  // A black room: what enters through 4 m² of pane is what its surfaces receive.
  Engine engine(roof_light_room(0, 0.8f), tregenza(), classic_options());
  const glm::vec3 to_sun = glm::normalize(glm::vec3(0.2f, 0.3f, 1));
  Condition condition = uniform_sky(5000);
  condition.beams.push_back({to_sun, glm::vec3(80000)});
  const auto lighting = engine.relight(condition);
  const Lighting& light = *lighting;
  double sun = 0, sky = 0;
  for (std::size_t p = 0; p < light.patch_sun.size(); ++p) {
    const Slot slot = engine.mesh().slot(engine.patch_slots()[p]);
    if (engine.scene().materials[engine.faces().faces[slot.face].material].opening >= 0) continue;
    sun += engine.patch_areas()[p] * light.patch_sun[p].y;
    sky += engine.patch_areas()[p] * light.patch_sky[p].y;
  }
  EXPECT_NEAR(sun / (4 * 0.8 * 80000 * to_sun.z), 1, 1e-4);
  EXPECT_NEAR(sky / (4 * 0.8 * kPi * 5000), 1, 2e-3);
  EXPECT_NEAR(light.forward_ray_count, 70000 + 5000 * 50, 1);  // the ground is black: no rays for it
}

TEST(Classic, AgreesWithTheGatheringMethodInTheMean) {
  Condition condition = uniform_sky(5000, 800);
  condition.beams.push_back({glm::normalize(glm::vec3(0.2f, 0.3f, 1)), glm::vec3(80000)});
  SolveOptions options = classic_options();
  Engine classic(roof_light_room(0.6f, 0.8f), tregenza(), options);
  options.method = Method::kGather;
  Engine gather(roof_light_room(0.6f, 0.8f), tregenza(), options);
  const auto by_classic = classic.relight(condition), by_gather = gather.relight(condition);
  double ours = 0, theirs = 0;
  for (std::size_t p = 0; p < classic.patch_areas().size(); ++p) {
    ours += classic.patch_areas()[p] * by_classic->patch_irradiance[p].y;
    theirs += gather.patch_areas()[p] * by_gather->patch_irradiance[p].y;
  }
  EXPECT_NEAR(ours / theirs, 1, 5e-3);
  const EnergyAudit audit = classic.audit(*by_classic, 1 << 16);
  EXPECT_NEAR((audit.absorbed + audit.out).y / audit.in().y, 1, 5e-3);
}

TEST(Classic, EachStateHasLessFluxInFlight) {
  struct Shares : RelightFollower {
    std::vector<double> unshot;
    void show(std::shared_ptr<const Lighting> state) override { unshot.push_back(state->unshot_share); }
    bool is_wanted() const override { return true; }
  } shares;
  const Engine engine(roof_light_room(0.6f), tregenza(), classic_options());
  const auto light = engine.relight(uniform_sky(5000), nullptr, &shares);
  EXPECT_GT(shares.unshot.size(), 2u);
  shares.unshot.push_back(light->unshot_share);
  EXPECT_TRUE(std::is_sorted(shares.unshot.rbegin(), shares.unshot.rend()));
  const auto at_once = engine.relight(uniform_sky(5000));
  for (std::size_t p = 0; p < light->patch_irradiance.size(); ++p)
    EXPECT_NEAR(light->patch_irradiance[p].y, at_once->patch_irradiance[p].y, 0.01f * at_once->patch_irradiance[p].y);
}

}  // namespace
}  // namespace transom
