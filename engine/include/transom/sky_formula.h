/// @file Luminance of skies that have a formula, averaged over the bins of the sky.
#pragma once

#include <Eigen/Core>
#include <glm/glm.hpp>
#include <vector>

namespace transom {

/// (1 + a exp(b / sin h)) (k + c exp(d x) + e cos² x) [cd/m²], at least 0, at altitude h and angle x from the sun: the
/// form of the CIE general skies [CIE S 011] and of Perez's [Perez 1993]. The level is in k, c and e.
struct SkyFormula {
  float a = 0, b = -1, c = 0, d = -1, e = 0, k = 1;
  glm::vec3 direction_to_sun{0, 0, 1};  ///< unit
};

/// Places in the bins of a sky, bin by bin, as many in each.
struct SkyNodes {
  Eigen::ArrayXf x, y, z;  ///< unit directions, z up
  Eigen::ArrayXf weight;   ///< with a sum of 1 in each bin

  SkyNodes(const std::vector<glm::vec3>& directions, const std::vector<float>& weights);
};

/// Means over bins. Where the sky is steep, along the horizon and around the sun, more nodes are taken.
class SkyBinMeans {
 public:
  /// middles: of the bins, those along the horizon first, `horizon_count` of them. steep_cosine: of the angle from the
  /// sun within which a bin whose middle lies there is a steep one. Throws InputError for nodes that are not as many in
  /// each bin.
  SkyBinMeans(std::vector<glm::vec3> middles, int horizon_count, float steep_cosine, SkyNodes smooth, SkyNodes steep);

  /// One a bin [cd/m²], in single precision: within 1e-5 of those in double precision.
  std::vector<float> of(const SkyFormula& sky) const;

 private:
  void find(const SkyFormula& sky, const SkyNodes& nodes, Eigen::Index first, Eigen::Index count, float* means) const;

  std::vector<glm::vec3> middles_;
  Eigen::Index horizon_count_;
  float steep_cosine_;
  SkyNodes smooth_, steep_;
};

}  // namespace transom
