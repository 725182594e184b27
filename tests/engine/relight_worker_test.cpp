#include "transom/relight_worker.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <thread>

#include "rooms.h"
#include "transom/error.h"
#include "transom/frame.h"

namespace transom {
namespace {

using test::into_the_room;
using test::roof_light_room;
using test::tregenza;
using test::uniform_sky;

SolveOptions small_options(Method method = Method::kGather) {
  SolveOptions options;
  options.method = method;
  options.target_patch_count = method == Method::kClassic ? 150 : 600;
  options.patch_samples = {128, 64};
  options.node_samples = {64, 64};
  return options;
}

// So exact that interreflection takes more than one cycle.
SolveOptions exact_options() {
  SolveOptions options = small_options();
  options.tolerance = 1e-6;
  return options;
}

Condition hour(int number) {
  Condition condition = uniform_sky(1000.f + 100.f * static_cast<float>(number), 300);
  if (number % 4 != 0)
    condition.beams.push_back({glm::normalize(glm::vec3(0.1f * static_cast<float>(number % 7) - 0.3f, 0.1f, 1)),
                               glm::vec3(60000, 58000, 50000)});
  return condition;
}

void expect_same(const Lighting& a, const Lighting& b) {
  EXPECT_EQ(a.node_sky, b.node_sky);
  EXPECT_EQ(a.node_indirect, b.node_indirect);
  EXPECT_EQ(a.patch_irradiance, b.patch_irradiance);
  EXPECT_EQ(a.patch_smooth_radiosity, b.patch_smooth_radiosity);
  EXPECT_EQ(a.is_final, b.is_final);
}

TEST(RelightWorker, CompleteStatesOfHoursInAnyOrderAreThoseOfAFreshRelighting) {
  const Engine engine(roof_light_room(0.6f, 0.8f), tregenza(), small_options());
  FrameRenderer renderer(engine);
  std::map<std::uint64_t, int> hour_of;
  std::vector<RelightWorker::State> complete;
  std::mt19937 random(7);
  {
    RelightWorker worker(engine);
    for (int round = 0; round < 40; ++round) {
      const int number = static_cast<int>(random() % 12);
      hour_of[worker.submit(hour(number))] = number;
      for (std::uint32_t frames = random() % 3; frames > 0; --frames) {
        const RelightWorker::State state = worker.latest();
        if (!state.lighting) continue;
        const Frame frame = renderer.render(into_the_room(), *state.lighting, {.edge_samples = 1});
        for (const glm::vec3& pixel : frame.radiance) ASSERT_TRUE(std::isfinite(pixel.x + pixel.y + pixel.z));
        if (state.lighting->is_final) complete.push_back(state);
      }
      if (round % 8 == 7) complete.push_back(worker.finished());
    }
  }
  EXPECT_GE(complete.size(), 5u);
  for (const RelightWorker::State& state : complete)
    expect_same(*state.lighting, *engine.relight(hour(hour_of.at(state.number))));
}

bool is_finite(glm::vec3 light) {
  return std::isfinite(light.x) && std::isfinite(light.y) && std::isfinite(light.z);
}

TEST(RelightWorker, DrawsAndMeasuresWhileConditionsComeAsFastAsTheyCan) {
  constexpr int kHours = 6, kBursts = 6, kConditionsPerBurst = 60;
  const Engine engine(roof_light_room(0.6f, 0.8f), tregenza(), small_options());
  std::vector<std::shared_ptr<const Lighting>> fresh;
  for (int number = 0; number < kHours; ++number) fresh.push_back(engine.relight(hour(number)));
  const Sensors sensors = engine.sensors({{1, 1, 0}, {2, 2, 0.8}, {3, 1, 0}}, {3, glm::vec3(0, 0, 1)}, {64, 64});
  std::vector<RelightWorker::State> complete;
  std::vector<int> wanted;
  std::atomic<bool> is_over = false;
  std::atomic<int> drawn = 0;
  {
    RelightWorker worker(engine, fresh[0]);
    std::thread drawing([&] {
      FrameRenderer renderer(engine);
      std::uint64_t shown = 0;
      while (!is_over) {
        const RelightWorker::State state = worker.latest();
        EXPECT_GE(state.number, shown);
        shown = state.number;
        for (const glm::vec3& pixel : renderer.render(into_the_room(), *state.lighting, {.edge_samples = 1}).radiance)
          EXPECT_TRUE(is_finite(pixel));
        for (const Irradiance& e : engine.illuminance(*state.lighting, sensors))
          EXPECT_TRUE(is_finite(e.direct + e.sky + e.indirect));
        ++drawn;
      }
    });
    for (int burst = 0; burst < kBursts; ++burst) {
      for (int i = 0; i < kConditionsPerBurst; ++i) worker.submit(hour(i % kHours));
      wanted.push_back((burst + 1) % kHours);
      worker.submit(hour(wanted.back()));
      complete.push_back(worker.finished());
      const int before = drawn;
      while (drawn == before) std::this_thread::yield();
    }
    is_over = true;
    drawing.join();
  }
  for (std::size_t burst = 0; burst < complete.size(); ++burst) {
    EXPECT_EQ(complete[burst].number, (burst + 1) * (kConditionsPerBurst + 1));
    expect_same(*complete[burst].lighting, *fresh[wanted[burst]]);
  }
}

TEST(Relight, ThreadsThatAskOneEngineAtOnceGetTheAnswersOfOneAfterTheOther) {
  for (const Method method : {Method::kGather, Method::kClassic}) {
    const Engine engine(roof_light_room(0.6f), tregenza(), small_options(method)),
        alone(roof_light_room(0.6f), tregenza(), small_options(method));
    std::array<std::shared_ptr<const Lighting>, 3> answers;
    std::vector<std::thread> threads;
    for (int number = 1; number <= 3; ++number)
      threads.emplace_back([&, number] { answers[number - 1] = engine.relight(hour(number)); });
    std::optional<Engine> edited;
    threads.emplace_back([&] { edited.emplace(engine, roof_light_room(0.5f)); });
    for (std::thread& thread : threads) thread.join();
    for (int number = 1; number <= 3; ++number) expect_same(*answers[number - 1], *alone.relight(hour(number)));
    expect_same(*edited->relight(hour(1)), *Engine(alone, roof_light_room(0.5f)).relight(hour(1)));
  }
}

// Keeps all states, and abandons the relighting after so many of them.
struct Recorder : RelightFollower {
  std::vector<std::shared_ptr<const Lighting>> states;
  std::size_t limit = std::numeric_limits<std::size_t>::max();
  void show(std::shared_ptr<const Lighting> state) override { states.push_back(std::move(state)); }
  bool is_wanted() const override { return states.size() < limit; }
};

TEST(Relight, FirstStateHasTheNewBeamsAndSkyWithTheOldIndirectLight) {
  const Engine engine(roof_light_room(0.6f), tregenza(), exact_options());
  const auto before = engine.relight(hour(1));
  Recorder recorder;
  const auto after = engine.relight(hour(2), before.get(), &recorder);
  ASSERT_EQ(recorder.states.size(), 2u);
  const Lighting& first = *recorder.states[0];
  EXPECT_FALSE(first.is_final);
  EXPECT_EQ(first.condition.beams[0].direction_to_source, hour(2).beams[0].direction_to_source);
  EXPECT_EQ(first.node_sky, after->node_sky);
  EXPECT_EQ(first.patch_sun, after->patch_sun);
  EXPECT_EQ(first.node_indirect, before->node_indirect);
  EXPECT_FALSE(recorder.states[1]->is_final);
  EXPECT_TRUE(after->is_final);
  expect_same(*after, *engine.relight(hour(2)));
}

TEST(Relight, StatesComeNearerToTheCompleteLight) {
  const Engine engine(roof_light_room(0.7f), tregenza(), exact_options());
  Recorder recorder;
  const auto after = engine.relight(hour(3), nullptr, &recorder);
  std::vector<double> missing;
  for (const auto& state : recorder.states) {
    double sum = 0, all = 0;
    for (std::size_t i = 0; i < after->node_indirect.size(); ++i) {
      sum += std::abs(after->node_indirect[i].y - state->node_indirect[i].y);
      all += after->node_indirect[i].y;
    }
    missing.push_back(sum / all);
  }
  ASSERT_GE(missing.size(), 2u);
  EXPECT_GT(missing[0], 0.5);
  EXPECT_LT(missing[1], 0.05);
}

TEST(Relight, AbandonedItGivesNothing) {
  const Engine engine(roof_light_room(0.6f), tregenza(), exact_options()),
      classic(roof_light_room(0.6f), tregenza(), small_options(Method::kClassic));
  for (const Engine* each : {&engine, &classic})
    for (const std::size_t limit : {0u, 1u, 2u}) {
      Recorder recorder;
      recorder.limit = limit;
      EXPECT_EQ(each->relight(hour(1), nullptr, &recorder), nullptr);
      EXPECT_EQ(recorder.states.size(), limit);
    }
}

TEST(RelightWorker, RefusesAConditionThatCannotBeAndGoesOn) {
  const Engine engine(roof_light_room(0.6f), tregenza(), small_options());
  RelightWorker worker(engine);
  EXPECT_EQ(worker.finished().lighting, nullptr);
  const std::uint64_t number = worker.submit(hour(1));
  Condition bad = hour(2);
  bad.sky_luminance[3] = -1;
  EXPECT_THROW(worker.submit(bad), InputError);
  const RelightWorker::State state = worker.finished();
  EXPECT_EQ(state.number, number);
  expect_same(*state.lighting, *engine.relight(hour(1)));
}

TEST(RelightWorker, ClassicReplacesTheOldLightUntilNothingOfItIsLeft) {
  const Engine engine(roof_light_room(0.6f), tregenza(), small_options(Method::kClassic));
  RelightWorker worker(engine, engine.relight(hour(5)));
  worker.submit(hour(1));  // perhaps abandoned
  worker.submit(hour(2));
  const auto replaced = worker.finished().lighting, fresh = engine.relight(hour(2));
  EXPECT_TRUE(replaced->is_final);
  double ours = 0, theirs = 0;
  for (std::size_t p = 0; p < fresh->patch_irradiance.size(); ++p) {
    ours += engine.patch_areas()[p] * replaced->patch_irradiance[p].y;
    theirs += engine.patch_areas()[p] * fresh->patch_irradiance[p].y;
  }
  EXPECT_NEAR(ours / theirs, 1, 5e-3);  // each is what shooting to 1e-3 of flux in flight leaves
}

}  // namespace
}  // namespace transom
