/// @file Interreflection prepared for many conditions: the solution of E = direct + (F + K) B, B = emitted + rho E.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <vector>

#include "transom/transfer.h"

namespace transom {

/// Where a patch is: what tells which patches may be taken together.
struct PatchPlace {
  glm::vec3 position{0};
  glm::vec3 normal{0};
};

/// A solver on two levels. Each cycle reflects once between patches, exactly, and lets clusters of patches (a few
/// hundred, by place and orientation) carry what is left through all further reflections, by a matrix found
/// beforehand. What clusters get wrong is the next cycle's remainder: the answer is that of the patches.
/// [after Hackbusch 1985, multigrid of the second kind]
class Interreflection {
 public:
  Interreflection(const SparseRows& form_factors, const SparseRows& through, std::vector<glm::vec3> reflectance,
                  std::vector<float> areas, const std::vector<PatchPlace>& places);

  /// Sees the irradiance after each cycle but the last; false ends the solution.
  using AfterCycle = std::function<bool(int cycle, const std::vector<glm::vec3>& irradiance)>;

  /// Irradiance of each patch. Returns the number of cycles until the change of reflected flux is below `tolerance` of
  /// all flux, or 0 where `after_cycle` has ended it; throws std::runtime_error when `maximum_cycles` do not suffice.
  int solve(const std::vector<glm::vec3>& emitted, const std::vector<glm::vec3>& direct, double tolerance,
            int maximum_cycles, std::vector<glm::vec3>& irradiance, const AfterCycle& after_cycle = {}) const;

  /// Replaces the reflectance of one patch. What clusters carry stays as it was prepared: it costs cycles, not
  /// accuracy.
  void set_reflectance(std::size_t patch, glm::vec3 reflectance) { reflectance_[patch] = reflectance; }

  int cluster_count() const { return cluster_count_; }

 private:
  void find_clusters(const std::vector<PatchPlace>& places);
  void find_operators();

  SparseRows exchange_;  // F + K
  std::vector<glm::vec3> reflectance_;
  std::vector<float> areas_;
  int cluster_count_ = 0;
  std::vector<int> cluster_of_;
  std::vector<float> cluster_area_;
  std::vector<float> operator_;  // row by row: irradiance of clusters from what they have not yet reflected
};

}  // namespace transom
