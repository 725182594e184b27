#include "transom/sky_formula.h"

#include <numbers>
#include <utility>

#include "transom/error.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kLeastSine = 1e-6f;  // exp(b / sine) has reached its limit at the horizon, 0, long before

Eigen::ArrayXf column(const std::vector<glm::vec3>& directions, int axis) {
  Eigen::ArrayXf values(static_cast<Eigen::Index>(directions.size()));
  for (std::size_t i = 0; i < directions.size(); ++i) values[static_cast<Eigen::Index>(i)] = directions[i][axis];
  return values;
}

// Arc cosine of several values at once, to 2e-8 [Abramowitz & Stegun, 4.4.46].
Eigen::ArrayXf arc_cosine(const Eigen::ArrayXf& cosine) {
  constexpr float kCoefficients[]{-0.0012624911f, 0.0066700901f, -0.0170881256f, 0.0308918810f,
                                  -0.0501743046f, 0.0889789874f, -0.2145988016f, 1.5707963050f};
  const Eigen::ArrayXf x = cosine.abs().min(1.f);
  Eigen::ArrayXf sum = Eigen::ArrayXf::Zero(x.size());
  for (const float coefficient : kCoefficients) sum = sum * x + coefficient;
  sum *= (1 - x).sqrt();
  return (cosine >= 0).select(sum, kPi - sum);
}

}  // namespace

SkyNodes::SkyNodes(const std::vector<glm::vec3>& directions, const std::vector<float>& weights)
    : x(column(directions, 0)),
      y(column(directions, 1)),
      z(column(directions, 2)),
      weight(Eigen::Map<const Eigen::ArrayXf>(weights.data(), static_cast<Eigen::Index>(weights.size()))) {
  if (directions.size() != weights.size()) throw InputError("sky bins: each node needs a direction and a weight");
}

SkyBinMeans::SkyBinMeans(std::vector<glm::vec3> middles, int horizon_count, float steep_cosine, SkyNodes smooth,
                         SkyNodes steep)
    : middles_(std::move(middles)),
      horizon_count_(horizon_count),
      steep_cosine_(steep_cosine),
      smooth_(std::move(smooth)),
      steep_(std::move(steep)) {
  const auto bins = static_cast<Eigen::Index>(middles_.size());
  if (bins == 0 || horizon_count < 0 || horizon_count > bins)
    throw InputError("sky bins: those along the horizon must be among the bins, and there must be some");
  for (const SkyNodes* nodes : {&smooth_, &steep_})
    if (nodes->weight.size() == 0 || nodes->weight.size() % bins != 0)
      throw InputError("sky bins: each must have as many nodes as the others");
}

std::vector<float> SkyBinMeans::of(const SkyFormula& sky) const {
  const auto bins = static_cast<Eigen::Index>(middles_.size());
  std::vector<float> means(middles_.size());
  find(sky, steep_, 0, horizon_count_, means.data());
  find(sky, smooth_, horizon_count_, bins - horizon_count_, means.data());
  for (Eigen::Index bin = horizon_count_; bin < bins; ++bin)
    if (glm::dot(middles_[static_cast<std::size_t>(bin)], sky.direction_to_sun) > steep_cosine_)
      find(sky, steep_, bin, 1, means.data());
  return means;
}

void SkyBinMeans::find(const SkyFormula& sky, const SkyNodes& nodes, Eigen::Index first, Eigen::Index count,
                       float* means) const {
  const Eigen::Index in_each = nodes.weight.size() / static_cast<Eigen::Index>(middles_.size());
  const auto of_bins = [&](const Eigen::ArrayXf& values) { return values.segment(first * in_each, count * in_each); };
  const Eigen::ArrayXf gradation = 1 + sky.a * (sky.b / of_bins(nodes.z).max(kLeastSine)).exp();
  Eigen::ArrayXf around_sun = Eigen::ArrayXf::Constant(gradation.size(), sky.k);
  if (sky.c != 0 || sky.e != 0) {
    const glm::vec3 sun = sky.direction_to_sun;
    const Eigen::ArrayXf cosine = sun.x * of_bins(nodes.x) + sun.y * of_bins(nodes.y) + sun.z * of_bins(nodes.z);
    around_sun += sky.c * (sky.d * arc_cosine(cosine)).exp() + sky.e * cosine.square();
  }
  const Eigen::ArrayXf weighted = of_bins(nodes.weight) * (gradation * around_sun).max(0.f);
  for (Eigen::Index bin = 0; bin < count; ++bin) means[first + bin] = weighted.segment(bin * in_each, in_each).sum();
}

}  // namespace transom
