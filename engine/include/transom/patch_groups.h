/// @file Patches taken together: light from far away does not tell the patches of a group apart.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "transom/transfer.h"

namespace transom {

/// Where a patch is, and what it is made of: what tells which patches may be taken together.
struct PatchPlace {
  glm::vec3 position{0};
  glm::vec3 normal{0};
  int material = 0;
};

/// A tree of groups of patches of one material that face about the same way: each of two halves, down to single
/// patches. A group stands for its patches by their mean over area. Rows of weights over patches become rows over
/// patches and groups, as coarse as some typical light allows [after hierarchical radiosity, Hanrahan et al. 1991].
class PatchGroups {
 public:
  PatchGroups() = default;
  PatchGroups(const std::vector<PatchPlace>& places, const std::vector<float>& areas);

  int patch_count() const { return static_cast<int>(parent_of_patch_.size()); }
  int group_count() const { return static_cast<int>(groups_.size()); }

  /// Appends to values of all patches the means over groups: patch_count() + g is the number of group g.
  template <typename Value>
  void append_means(std::vector<Value>& values) const {
    values.resize(static_cast<std::size_t>(patch_count() + group_count()));
    for (int g = group_count() - 1; g >= 0; --g) {
      const Group& group = groups_[g];
      values[patch_count() + g] = group.share[0] * values[group.half[0]] + group.share[1] * values[group.half[1]];
    }
  }

  /// A light whose shape is that of the light of many conditions.
  struct TypicalLight {
    std::vector<float> radiosity;  ///< of patches, then of groups
    std::vector<float> deviation;  ///< by group: what its patches differ from their mean by, root mean square

    float received_by(const std::vector<Share>& row) const;
  };
  TypicalLight typical(std::vector<float> radiosity) const;

  /// A row over patches and groups. A group takes the place of its patches where, under each of the lights, its weight
  /// times its deviation is at most `tolerance` times what the row receives. Small errors of many groups add up, so the
  /// row is scaled to receive what it did of the first light. Without lights: the row. Threads may ask at once.
  std::vector<Share> grouped(const std::vector<Share>& row, const std::vector<TypicalLight>& lights,
                             float tolerance) const;

 private:
  struct Group {
    int parent;        // -1: none
    int half[2];       // numbers of patches or, from patch_count() on, of groups
    float share[2];    // of its area
    int first, count;  // of its patches, in `order_`
  };
  int add_group(const std::vector<PatchPlace>& places, const std::vector<float>& areas, int first, int count,
                int parent);
  std::vector<Share> grouped_within(const std::vector<Share>& row, const std::vector<TypicalLight>& lights,
                                    const std::vector<float>& received, float tolerance) const;

  std::vector<int> order_;            // patches; those of a group stand together
  std::vector<int> parent_of_patch_;  // -1: none
  std::vector<Group> groups_;         // each before its halves
};

}  // namespace transom
