#include "transom/sky_rows.h"

namespace transom {

SkyRows::SkyRows(const SparseRows& rows, int ground) : ground_(ground) {
  SparseRows bins, beyond;
  for (std::size_t i = 0; i < rows.row_count(); ++i) {
    for (std::size_t k = rows.begin[i]; k < rows.begin[i + 1]; ++k) {
      const Share& share = rows.entries[k];
      if (share.index < ground)
        bins.entries.push_back(share);
      else
        beyond.entries.push_back({share.index - ground, share.weight});
    }
    bins.begin.push_back(bins.entries.size());
    beyond.begin.push_back(beyond.entries.size());
  }
  bins_ = ExactRows(bins);
  beyond_ = ExactRows(beyond);
}

std::vector<Share> SkyRows::row(std::size_t i) const {
  std::vector<Share> shares = bins_.row(i);
  for (const Share& share : beyond_.row(i)) shares.push_back({share.index + ground_, share.weight});
  return shares;
}

}  // namespace transom
