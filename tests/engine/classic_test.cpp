#include "transom/classic.h"

#include <gtest/gtest.h>

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
    ProgressiveRadiosity light = furnace.make(rho, 1);
    light.shoot(1 << 20, 1e-6);
    for (const glm::vec3& e : light.irradiance()) EXPECT_NEAR(e.y * (1 - rho), 1, 1e-5) << "rho " << rho;
  }
}

TEST(ProgressiveRadiosity, FluxInFlightFallsWithEveryRound) {
  ProgressiveRadiosity light = Furnace().make(0.8f, 1);
  double before = light.unshot_share();
  EXPECT_GT(before, 0.9);
  for (int round = 0; round < 10; ++round) {
    EXPECT_EQ(light.shoot(Furnace::kCount, 1e-9), Furnace::kCount);
    EXPECT_LT(light.unshot_share(), before);
    before = light.unshot_share();
  }
}

TEST(ProgressiveRadiosity, ReplacedDirectLightLeavesNothingOfTheOld) {
  ProgressiveRadiosity light = Furnace().make(0.7f, 0), fresh = Furnace().make(0.7f, 0);
  std::vector<glm::vec3> morning(Furnace::kCount, glm::vec3(0)), evening = morning;
  morning[0] = glm::vec3(1000, 900, 800);
  evening[5] = glm::vec3(100, 200, 300);
  light.replace_direct(morning);
  light.shoot(3, 1e-6);  // interrupted
  light.replace_direct(evening);
  light.shoot(1 << 20, 1e-6);
  fresh.replace_direct(evening);
  fresh.shoot(1 << 20, 1e-6);
  for (int p = 0; p < Furnace::kCount; ++p)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(light.irradiance()[p][c], fresh.irradiance()[p][c], 1e-2) << p << ' ' << c;
}

TEST(Classic, ForwardRaysCarryTheFluxOfTheOpening) {
  // A black room: what enters through 4 m² of pane is what its surfaces receive.
  Engine engine(roof_light_room(0, 0.8f), tregenza(), classic_options());
  const glm::vec3 to_sun = glm::normalize(glm::vec3(0.2f, 0.3f, 1));
  Condition condition = uniform_sky(5000);
  condition.beams.push_back({to_sun, glm::vec3(80000)});
  engine.relight(condition);
  const Lighting& light = engine.lighting();
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
  classic.relight(condition);
  gather.relight(condition);
  double ours = 0, theirs = 0;
  for (std::size_t p = 0; p < classic.patch_areas().size(); ++p) {
    ours += classic.patch_areas()[p] * classic.lighting().patch_irradiance[p].y;
    theirs += gather.patch_areas()[p] * gather.lighting().patch_irradiance[p].y;
  }
  EXPECT_NEAR(ours / theirs, 1, 5e-3);
  const EnergyAudit audit = classic.audit(1 << 16);
  EXPECT_NEAR((audit.absorbed + audit.out).y / audit.in().y, 1, 5e-3);
}

TEST(Classic, StepsLeadToTheAnswerOfOneRelighting) {
  Condition condition = uniform_sky(5000);
  Engine whole(roof_light_room(0.6f), tregenza(), classic_options()),
      stepped(roof_light_room(0.6f), tregenza(), classic_options());
  whole.relight(condition);
  stepped.begin_relight(uniform_sky(100));
  stepped.continue_relight(5);  // interrupted by a newer condition
  stepped.begin_relight(condition);
  double before = stepped.lighting().unshot_share;
  int steps = 0;
  while (stepped.continue_relight(50)) {
    EXPECT_LT(stepped.lighting().unshot_share, before);
    before = stepped.lighting().unshot_share;
    ++steps;
  }
  EXPECT_GT(steps, 2);
  for (std::size_t p = 0; p < whole.lighting().patch_irradiance.size(); ++p) {
    const float truth = whole.lighting().patch_irradiance[p].y;
    EXPECT_NEAR(stepped.lighting().patch_irradiance[p].y, truth, 0.01f * truth + 1);
  }
}

TEST(Classic, OtherMethodsDoNotRelightInSteps) {
  SolveOptions options = classic_options();
  options.method = Method::kGather;
  options.target_patch_count = 100;
  Engine engine(roof_light_room(0.5f), tregenza(), options);
  EXPECT_THROW(engine.begin_relight(uniform_sky(1)), InputError);
  EXPECT_THROW(engine.continue_relight(1), InputError);
}

}  // namespace
}  // namespace transom
