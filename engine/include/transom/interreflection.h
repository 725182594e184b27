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

/// What patches send out and receive of their own. is_grey: all of it is grey, and so are the reflectances.
struct PatchLight {
  const std::vector<glm::vec3>& emitted;  ///< [lm/m²]
  const std::vector<glm::vec3>& direct;   ///< [lx]
  bool is_grey = false;
};

/// A solver in three steps of precision. Each cycle reflects once between patches, exactly. What is left over after it
/// is carried through all further reflections by a likeness of the exchange: its large form factors as they are, and
/// all others with the patches of a cluster taken together, as dense rows. The likeness is solved in turn with the help
/// of the clusters (a few hundred, by place and orientation), among which all reflections are a matrix found
/// beforehand. What likeness and clusters get wrong is the next cycle's remainder: the answer is that of the patches.
/// [after Hackbusch 1985, multigrid of the second kind]
class Interreflection {
 public:
  Interreflection(const SparseRows& form_factors, const SparseRows& through, std::vector<glm::vec3> reflectance,
                  std::vector<float> areas, const std::vector<PatchPlace>& places);

  /// Sees the irradiance after each cycle but the last; false ends the solution.
  using AfterCycle = std::function<bool(int cycle, const std::vector<glm::vec3>& irradiance)>;

  /// Irradiance of each patch. Returns the number of cycles until the flux that is still to come, as the shrinking of
  /// remainders foretells it, is below `tolerance` of all flux, or 0 where `after_cycle` has ended it; throws
  /// std::runtime_error when `maximum_cycles` do not suffice.
  int solve(const PatchLight& light, double tolerance, int maximum_cycles, std::vector<glm::vec3>& irradiance,
            const AfterCycle& after_cycle = {}) const;

  /// Replaces the reflectance of one patch. What clusters carry stays as it was prepared: it costs cycles, not
  /// accuracy.
  void set_reflectance(std::size_t patch, glm::vec3 reflectance) { reflectance_[patch] = reflectance; }

  int cluster_count() const { return cluster_count_; }

 private:
  void find_clusters(const std::vector<PatchPlace>& places);
  void find_operators();
  void find_likeness();
  template <bool kIsGrey>
  void reflect_likeness(const std::vector<glm::vec4>& radiosity, const std::vector<glm::vec4>& mean,
                        std::vector<glm::vec4>& irradiance) const;
  void carry_on(const std::vector<glm::vec4>& left, bool is_grey, std::vector<glm::vec4>& radiosity) const;
  void cluster_means(const std::vector<glm::vec4>& values, std::vector<glm::vec4>& means) const;

  SparseRows exchange_;  // F + K
  std::vector<glm::vec3> reflectance_;
  std::vector<float> areas_;
  int cluster_count_ = 0;
  std::vector<int> cluster_of_;
  std::vector<float> cluster_area_;
  std::vector<glm::vec3> cluster_reflectance_;
  SparseRows near_;                 // entries of the exchange that are large
  std::size_t far_stride_ = 0;      // clusters, rounded up
  std::vector<std::uint16_t> far_;  // all others, summed over clusters of senders; row by row
  std::vector<float> far_scale_;    // what 1 of it stands for
  std::vector<float> operator_;     // row by row: irradiance of clusters from what they have not yet reflected
};

}  // namespace transom
