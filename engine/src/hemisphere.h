// What rays over a hemisphere have met, counted. Whole numbers do not depend on the order of rays, and single rays can
// be taken back.
#pragma once

#include <cstdint>
#include <vector>

#include "transom/gather.h"

namespace transom {

struct HemisphereTally {
  // One entry a ray: slots reached, near elements of them, elements left by slot reached (GatherRow), bins of the open
  // sky.
  std::vector<int> slots, near, left, bins;
  int buried = 0;                     // rays that have met the inside of a solid
  std::int64_t inverse_distance = 0;  // see GatherRow

  void add_distance(float t, const Faces& faces);

  // The row of a receiver that has cast `count` rays.
  GatherRow row(int count, float extent) &&;
};

// The row of a receiver of which `known` was the row, after some of its rays have met `found` in place of `lost`. Slots
// of `known` that are gone are left out there and in `lost`. False: this cannot be, and `known` is as it was.
bool recount(GatherRow& known, HemisphereTally lost, HemisphereTally found, int count, float extent);

}  // namespace transom
