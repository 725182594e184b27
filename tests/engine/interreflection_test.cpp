#include "transom/interreflection.h"

#include <gtest/gtest.h>

#include <cmath>

namespace transom {
namespace {

// Patches on a line that exchange light with all others, more with their neighbours; rows sum to 1.
struct Chain {
  SparseRows form_factors, through;
  std::vector<glm::vec3> reflectance, emitted, direct;
  std::vector<float> areas;
  std::vector<PatchPlace> places;

  explicit Chain(int count) {
    for (int i = 0; i < count; ++i) {
      std::vector<Share> row;
      float sum = 0;
      for (int j = 0; j < count; ++j)
        if (j != i) sum += 1 / (1.f + static_cast<float>((i - j) * (i - j)));
      for (int j = 0; j < count; ++j)
        if (j != i) row.push_back({j, 1 / (1.f + static_cast<float>((i - j) * (i - j))) / sum});
      form_factors.append(row);
      through.append({});
      reflectance.push_back({0.8f, 0.5f, 0.2f + 0.6f * static_cast<float>(i % 3) / 2});
      emitted.push_back(glm::vec3(i == 0 ? 100.f : 0.f));
      direct.push_back(glm::vec3(static_cast<float>(i % 5), 1, 0));
      areas.push_back(1);
      places.push_back({{0.1f * static_cast<float>(i), 0, 0}, {0, 0, i % 2 ? 1.f : -1.f}});
    }
  }
};

// Irradiance by Gauss and Seidel's sweeps over the patches alone.
std::vector<glm::vec3> swept(const Chain& chain, int sweeps) {
  std::vector<glm::vec3> e = chain.direct, radiosity(e.size());
  for (std::size_t i = 0; i < e.size(); ++i) radiosity[i] = chain.emitted[i] + chain.reflectance[i] * e[i];
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (std::size_t i = 0; i < e.size(); ++i) {
      e[i] = chain.direct[i] + chain.form_factors.dot(i, radiosity);
      radiosity[i] = chain.emitted[i] + chain.reflectance[i] * e[i];
    }
  return e;
}

TEST(Interreflection, TwoLevelsFindWhatSweepsFind) {
  const Chain chain(600);
  const Interreflection prepared(chain.form_factors, chain.through, chain.reflectance, chain.areas, chain.places);
  EXPECT_LT(prepared.cluster_count(), 600);
  std::vector<glm::vec3> e;
  prepared.solve({chain.emitted, chain.direct}, 1e-7, 1000, e);
  const std::vector<glm::vec3> expected = swept(chain, 400);
  for (std::size_t i = 0; i < e.size(); ++i)
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(e[i][channel], expected[i][channel], 1e-4 * expected[i][channel]) << i;
}

TEST(Interreflection, CarriesAnExchangeThatIsNotReciprocal) {
  Chain chain(300);
  for (std::size_t i = 0; i < chain.areas.size(); ++i) chain.areas[i] = 1 + 0.5f * static_cast<float>(i % 3);
  Interreflection prepared(chain.form_factors, chain.through, chain.reflectance, chain.areas, chain.places);
  // Each sends twice as much to those of odd number as to the others.
  SparseRows sent = chain.form_factors, received;
  for (Share& share : sent.entries) share.weight *= share.index % 2 ? 4 / 3.f : 2 / 3.f;
  prepared.send(sent);
  for (std::size_t i = 0; i < chain.areas.size(); ++i) {
    std::vector<Share> row;
    for (std::size_t j = 0; j < chain.areas.size(); ++j)
      for (const Share& share : sent.row(j))
        if (share.index == static_cast<int>(i))
          row.push_back({static_cast<int>(j), share.weight * chain.areas[j] / chain.areas[i]});
    received.append(row);
  }
  chain.form_factors = received;
  const std::vector<glm::vec3> expected = swept(chain, 400);
  const std::vector<int> bright{3, 50, 51};
  for (const bool has_bright : {false, true}) {
    std::vector<glm::vec3> e;
    const std::span<const int> some = has_bright ? std::span<const int>(bright) : std::span<const int>();
    prepared.solve({chain.emitted, chain.direct, false, some}, 1e-7, 1000, e);
    for (std::size_t i = 0; i < e.size(); ++i)
      for (int channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(e[i][channel], expected[i][channel], 1e-4 * expected[i][channel]) << i;
  }
}

TEST(Interreflection, ConvergesWhereOneColourIsAlmostLossless) {
  Chain chain(400);
  for (glm::vec3& rho : chain.reflectance) rho = {0.99f, 0.98f, 0.6f};
  const Interreflection prepared(chain.form_factors, chain.through, chain.reflectance, chain.areas, chain.places);
  std::vector<glm::vec3> e;
  const std::vector<glm::vec3> emitted(400, glm::vec3(1)), direct(400, glm::vec3(0));
  EXPECT_LT(prepared.solve({emitted, direct}, 1e-6, 20000, e), 2000);
  EXPECT_NEAR(e[7].x, 1 / (1 - 0.99), 0.1);
  EXPECT_NEAR(e[7].z, 1 / (1 - 0.6), 0.01);
}

TEST(Interreflection, ReflectanceActsBeforeTheOperatorAndNotAfter) {
  // Two facing surfaces that see only each other: B1 = M1 + r1 E1, E1 = B2; B2 = r2 E2, E2 = B1.
  SparseRows f, none;
  f.append({{1, 1.f}});
  f.append({{0, 1.f}});
  none.append({});
  none.append({});
  const Interreflection prepared(f, none, {glm::vec3(0.2f), glm::vec3(0.8f)}, {1, 1},
                                 {{{0, 0, 0}, {0, 0, 1}}, {{0, 0, 1}, {0, 0, -1}}});
  std::vector<glm::vec3> e;
  const std::vector<glm::vec3> emitted{glm::vec3(100), glm::vec3(0)}, direct(2, glm::vec3(0));
  prepared.solve({emitted, direct}, 1e-7, 100, e);
  const double b1 = 100 / (1 - 0.2 * 0.8);
  EXPECT_NEAR(e[1].x, b1, 1e-3);
  EXPECT_NEAR(e[0].x, 0.8 * b1, 1e-3);
}

TEST(Interreflection, BrighterPatchesAreForetoldAnew) {
  Chain dark(600), bright(600);
  dark.reflectance.assign(600, glm::vec3(0.1f));
  bright.reflectance.assign(600, glm::vec3(0.95f));
  constexpr double kTolerance = 1e-3;  // of all flux
  const auto flux = [](const std::vector<glm::vec3>& irradiance) {
    double sum = 0;
    for (const glm::vec3& e : irradiance) sum += static_cast<double>(e.x + e.y + e.z);
    return sum;
  };
  std::vector<glm::vec3> expected;
  Interreflection(bright.form_factors, bright.through, bright.reflectance, bright.areas, bright.places)
      .solve({bright.emitted, bright.direct}, 1e-7, 1000, expected);
  const auto error = [&](bool is_foretold) {
    Interreflection changed(dark.form_factors, dark.through, dark.reflectance, dark.areas, dark.places);
    changed.foretell();
    for (std::size_t patch = 0; patch < 600; ++patch) changed.set_reflectance(patch, bright.reflectance[patch]);
    if (is_foretold) changed.foretell();
    std::vector<glm::vec3> found;
    changed.solve({bright.emitted, bright.direct}, kTolerance, 1000, found);
    return std::abs(flux(found) / flux(expected) - 1);
  };
  EXPECT_GT(error(false), 0.3);  // it stops after one cycle
  EXPECT_LT(error(true), 0.03);
}

TEST(Interreflection, ARoomThatLosesNothingIsRefused) {
  SparseRows f, none;
  f.append({{1, 1.f}});
  f.append({{0, 1.f}});
  none.append({});
  none.append({});
  const Interreflection prepared(f, none, std::vector<glm::vec3>(2, glm::vec3(1)), {1, 1},
                                 {{{0, 0, 0}, {0, 0, 1}}, {{0, 0, 1}, {0, 0, -1}}});
  std::vector<glm::vec3> e;
  const std::vector<glm::vec3> emitted(2, glm::vec3(1)), direct(2, glm::vec3(0));
  EXPECT_THROW(prepared.solve({emitted, direct}, 1e-9, 50, e), std::runtime_error);
}

}  // namespace
}  // namespace transom
