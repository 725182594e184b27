// A sweep of many directions is the same as tracing each of them.
#include "transom/product_sweep.h"

#include <gtest/gtest.h>

#include "transom/sampling.h"
#include "transom/section.h"

namespace transom {
namespace {

Section pane() {
  Section section{0.01, -0.001, 0.005, {{1.0, 0.0}, {1.5, 10.0}}, {}};
  section.lines.push_back({{0.0, 0.0}, {0.01, 0.0}, {SurfaceKind::kInterface, 1, 0}});
  section.lines.push_back({{0.0, 0.004}, {0.01, 0.004}, {SurfaceKind::kInterface, 0, 1}});
  return section;
}

TEST(ProductSweep, EachDirectionIsTracedByItselfWithItsOwnSeed) {
  const Section section = pane();
  const std::vector<glm::dvec3> directions{{0, 0, 1}, {0.3, -0.5, 0.8}, {-0.6, 0.2, 0.7}};
  const auto trace = [&](glm::dvec3 d, const TraceOptions& options) { return trace_section(section, d, options); };
  const ProductSweep sweep = sweep_directions(trace, directions, 32, 5);
  ASSERT_EQ(sweep.transmitted.size(), sweep.incidence.size());
  std::size_t at = 0;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    TraceOptions options;
    options.ray_count = 32;
    options.seed = hash_seed(5, i);
    const ProductLight alone = trace_section(section, directions[i], options);
    double sent = 0;
    for (const Exit& exit : alone.transmitted) {
      EXPECT_EQ(sweep.incidence[at], i);
      EXPECT_EQ(sweep.transmitted[at].flux, exit.flux);
      EXPECT_EQ(sweep.transmitted[at].direction, exit.direction);
      sent += exit.flux;
      ++at;
    }
    EXPECT_EQ(sweep.transmitted_shares[i], sent);
    EXPECT_LE(sent + sweep.reflected_shares[i], 1 + 1e-12);
  }
  EXPECT_EQ(at, sweep.transmitted.size());
}

}  // namespace
}  // namespace transom
