/// @file Interreflection prepared for many conditions: the solution of E = direct + (F + K) B, B = emitted + rho E.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/compact_rows.h"
#include "transom/patch_groups.h"
#include "transom/transfer.h"

namespace transom {

/// What patches send out and receive of their own.
struct PatchLight {
  const std::vector<glm::vec3>& emitted;  ///< [lm/m²]
  const std::vector<glm::vec3>& direct;   ///< [lx]
  bool is_grey = false;                   ///< all of it is grey, and so are the reflectances: one channel is computed
  std::span<const int> bright{};          ///< patches that stand out from those around them; once each
};

/// A solver in three steps of precision. Each cycle reflects once between patches, exactly. What is left over after it
/// is carried through all further reflections by a likeness of the exchange, in which groups of patches stand for those
/// that no smooth light tells apart. The likeness is solved in turn with the help of clusters (a few hundred, by place
/// and orientation), among which all reflections are a matrix found beforehand. What likeness and clusters get wrong is
/// the next cycle's remainder; the last is given to the clusters. The answer is that of the patches. [after Hackbusch
/// 1985, multigrid of the second kind]
///
/// Light is smooth once it has been reflected. Where it falls from a beam it is not: bright patches send theirs for
/// themselves, by the columns of the exchange.
class Interreflection {
 public:
  /// form_factors F: reciprocal. through K: light through openings.
  Interreflection(const SparseRows& form_factors, const SparseRows& through, std::vector<glm::vec3> reflectance,
                  std::vector<float> areas, const std::vector<PatchPlace>& places);

  /// Replaces F by an exchange that is not reciprocal. sent: by sender, the share of what it sends that each patch
  /// receives. To be prepared anew.
  void send(SparseRows sent);

  /// Makes the likeness coarse where smooth lights, such as these radiosities of patches, allow it. Until then it is
  /// the exchange itself.
  void prepare(std::span<const std::vector<float>> smooth_lights);

  /// Sees the irradiance after each cycle but the last; false ends the solution.
  using AfterCycle = std::function<bool(int cycle, const std::vector<glm::vec3>& irradiance)>;

  /// Irradiance of each patch. Returns the number of cycles until the flux that is still to come, as the shrinking of
  /// remainders foretells it, is below `tolerance` of all flux, or 0 where `after_cycle` has ended it; throws
  /// std::runtime_error when `maximum_cycles` do not suffice.
  int solve(const PatchLight& light, double tolerance, int maximum_cycles, std::vector<glm::vec3>& irradiance,
            const AfterCycle& after_cycle = {}) const;

  /// Replaces the reflectance of one patch. What clusters carry stays as it was prepared: it costs cycles, not
  /// accuracy, once that has been foretold.
  void set_reflectance(std::size_t patch, glm::vec3 reflectance) {
    reflectance_[patch] = reflectance;
    is_foretold_ &= glm::all(glm::lessThanEqual(reflectance, foretold_reflectance_[patch]));
  }

  /// Measures how fast light converges, by which `solve` knows when to stop, unless that is known of reflectances that
  /// are nowhere less than these. To be called when they have been replaced.
  void foretell();

  int cluster_count() const { return cluster_count_; }
  const PatchGroups& groups() const { return groups_; }

 private:
  void find_clusters(const std::vector<PatchPlace>& places);
  void receive(const SparseRows& received);
  void find_operators(const SparseRows& received);
  template <typename Value>
  int solve_as(const PatchLight& light, double tolerance, int maximum_cycles, std::vector<glm::vec3>& irradiance,
               const AfterCycle& after_cycle) const;
  template <typename Value>
  void begin(const PatchLight& light, std::vector<Value>& left, std::vector<Value>& radiosity) const;
  template <typename Value>
  std::vector<Value> received_from(std::span<const int> senders, const std::vector<Value>& radiosity) const;
  template <typename Value>
  double cycle(const PatchLight& light, std::vector<Value>& left, std::vector<Value>& radiosity,
               std::vector<glm::vec3>& irradiance) const;
  template <typename Value>
  void add_rest(const std::vector<Value>& left, std::vector<glm::vec3>& irradiance) const;
  template <typename Value>
  void apply_operator(const std::vector<Value>& mean, std::vector<Value>& received) const;
  double measured_shrinking() const;
  template <typename Value>
  void carry_on(const std::vector<Value>& left, std::vector<Value>& radiosity) const;
  template <typename Value>
  void cluster_means(const std::vector<Value>& values, std::vector<Value>& means) const;

  SparseRows sent_;          // by sender: the share of what it sends that reaches others
  SparseRows through_;       // K,
  SparseRows sent_through_;  // and by columns
  std::vector<glm::vec3> reflectance_;
  std::vector<float> areas_;
  PatchGroups groups_;
  ExactRows exchange_;             // by receiver, with K
  CompactRows likeness_;           // of it, over patches and groups; none until it is prepared
  int inner_cycles_ = 3;           // with the likeness, in each cycle
  double foretold_shrinking_ = 1;  // of what is left over, by a cycle after the first
  bool is_foretold_ = false;       // with these reflectances, or larger ones:
  std::vector<glm::vec3> foretold_reflectance_;
  int cluster_count_ = 0;
  std::vector<int> cluster_of_;
  std::vector<float> cluster_area_;
  std::vector<glm::vec3> cluster_reflectance_;
  ExactRows operator_;  // irradiance of clusters from what they have not yet reflected
};

}  // namespace transom
