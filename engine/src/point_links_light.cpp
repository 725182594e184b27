// The first reflection of beams towards linked points.
#include <xmmintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "transom/parallel.h"
#include "transom/point_links.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kBlocksAtOnce = 8;
constexpr float kEven = 1e-3f;  // relative difference of elements that count as evenly lit

// Sum of weight x value: every fourth product goes to the same of four sums.
inline glm::vec3 weighted_sum(const float* weight, const std::vector<glm::vec4>& value) {
  __m128 sums[4] = {_mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps(), _mm_setzero_ps()};
  const auto term = [&](std::size_t k) { return _mm_mul_ps(_mm_set1_ps(weight[k]), _mm_loadu_ps(&value[k].x)); };
  std::size_t k = 0;
  for (; k + 4 <= value.size(); k += 4)
    for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] = _mm_add_ps(sums[lane], term(k + lane));
  for (std::size_t lane = 0; k < value.size(); ++k, ++lane) sums[lane] = _mm_add_ps(sums[lane], term(k));
  alignas(16) float sum[4];
  _mm_store_ps(sum, _mm_add_ps(_mm_add_ps(sums[0], sums[1]), _mm_add_ps(sums[2], sums[3])));
  return {sum[0], sum[1], sum[2]};
}

}  // namespace

PointLinks::LitPatch PointLinks::lit_patch(std::shared_ptr<const Link> link, std::span<const BrightElement> bright,
                                           std::size_t first, std::size_t last) const {
  const int per_slot = mesh_.elements_per_slot();
  LitPatch patch;
  patch.normal = mesh_.normal_of(bright[first].element / per_slot);
  patch.radiosity = bright[first].radiosity;
  patch.sent.assign(static_cast<std::size_t>(per_slot), glm::vec4(0));
  float sum = 0;
  for (std::size_t k = first; k < last; ++k) {
    const int e = bright[k].element % per_slot;
    const glm::vec4 element = link->element[e];
    const glm::vec3 radiosity = bright[k].radiosity;
    const float weight = element.w * (radiosity.x + radiosity.y + radiosity.z);
    patch.centroid += weight * glm::vec3(element);
    patch.flux += element.w / kPi * radiosity;
    sum += weight;
    patch.sent[e] = glm::vec4(radiosity, 0);
  }
  if (sum > 0) patch.centroid /= sum;
  if (!link->partial.empty()) {
    float of_group[kGroups] = {};
    for (std::size_t k = first; k < last; ++k) {
      const int e = bright[k].element % per_slot;
      const glm::vec3 radiosity = bright[k].radiosity;
      of_group[group_of(e)] += link->element[e].w * (radiosity.x + radiosity.y + radiosity.z) / sum;
    }
    patch.share_of_groups.assign(2 << kGroups / 2, 0.f);
    for (int half = 0; half < 2; ++half)
      for (int groups = 1; groups < 1 << kGroups / 2; ++groups) {
        float* share = &patch.share_of_groups[static_cast<std::size_t>(half) << kGroups / 2];
        const int last_group = std::countr_zero(static_cast<unsigned>(groups));
        share[groups] = share[groups & (groups - 1)] + of_group[half * kGroups / 2 + last_group];
      }
  }
  for (std::size_t e = 0; e < link->element.size() && patch.is_even; ++e)
    for (int channel = 0; channel < 3; ++channel)
      patch.is_even &= link->element[e].w <= 0 ||
                       std::abs(patch.sent[e][channel] - patch.radiosity[channel]) <= kEven * patch.radiosity[channel];
  patch.link = std::move(link);
  return patch;
}

// What lit patches send to the points of a few blocks.
template <bool kIsGrey>
void PointLinks::add_blocks(const std::vector<LitPatch>& lit, std::size_t chunk,
                            std::vector<glm::vec3>& irradiance) const {
  const auto per_slot = static_cast<std::size_t>(mesh_.elements_per_slot());
  const std::size_t block_count = x_.size() / kBlock;
  const std::size_t first_block = chunk * kBlocksAtOnce,
                    last_block = std::min(block_count, first_block + kBlocksAtOnce), base = first_block * kBlock;
  float red[kBlocksAtOnce * kBlock] = {}, green[kBlocksAtOnce * kBlock] = {}, blue[kBlocksAtOnce * kBlock] = {};
  for (const LitPatch& patch : lit) {
    const Link& link = *patch.link;
    const glm::vec3 c = patch.centroid, m = patch.normal, flux = patch.flux;
    auto block = std::lower_bound(link.block.begin(), link.block.end(), static_cast<int>(first_block));
    for (; block != link.block.end() && *block < static_cast<int>(last_block); ++block) {
      const std::size_t from = static_cast<std::size_t>(*block) * kBlock, to = from - base,
                        place = static_cast<std::size_t>(block - link.block.begin()) * kBlock;
      if (patch.is_even) {
        if (link.weight.empty()) break;
        const std::uint16_t* known = &link.weight[place];
        const glm::vec3 scale = link.weight_unit * patch.radiosity;
        for (std::size_t k = 0; k < kBlock; ++k) {
          const float weight = static_cast<float>(static_cast<int>(known[k]));
          red[to + k] += weight * scale.x;
          if constexpr (!kIsGrey) {
            green[to + k] += weight * scale.y;
            blue[to + k] += weight * scale.z;
          }
        }
        continue;
      }
      const std::uint8_t* seen = &link.seen[place];
      for (std::size_t k = 0; k < kBlock; ++k) {
        const float weight = seen_share(seen[k]) * point_weight(c, m, from + k);
        red[to + k] += weight * flux.x;
        if constexpr (!kIsGrey) {
          green[to + k] += weight * flux.y;
          blue[to + k] += weight * flux.z;
        }
      }
    }
    if (!patch.is_even) {
      const auto is_before = [](const Partial& partial, std::size_t point) {
        return static_cast<std::size_t>(partial.point) < point;
      };
      auto partial = std::lower_bound(link.partial.begin(), link.partial.end(), base, is_before);
      for (; partial != link.partial.end() && static_cast<std::size_t>(partial->point) < last_block * kBlock;
           ++partial) {
        const auto point = static_cast<std::size_t>(partial->point);
        const float weight = seen_share(partial->seen) * patch.share_of(partial->groups) * point_weight(c, m, point);
        red[point - base] += weight * flux.x;
        if constexpr (!kIsGrey) {
          green[point - base] += weight * flux.y;
          blue[point - base] += weight * flux.z;
        }
      }
    }
    auto near = std::lower_bound(link.near_point.begin(), link.near_point.end(), static_cast<int>(base));
    for (; near != link.near_point.end() && *near < static_cast<int>(last_block * kBlock); ++near) {
      const auto number = static_cast<std::size_t>(near - link.near_point.begin()),
                 to = static_cast<std::size_t>(*near) - base;
      const glm::vec3 received = patch.is_even ? link.near_sum[number] * patch.radiosity
                                               : weighted_sum(&link.near_weight[number * per_slot], patch.sent);
      red[to] += received.x;
      green[to] += received.y;
      blue[to] += received.z;
    }
  }
  const std::size_t count = std::min(point_count_, last_block * kBlock) - base;
  for (std::size_t k = 0; k < count; ++k)
    irradiance[base + k] += kIsGrey ? glm::vec3(red[k]) : glm::vec3(red[k], green[k], blue[k]);
}

void PointLinks::add_irradiance(std::span<const BrightElement> bright, bool is_grey,
                                std::vector<glm::vec3>& irradiance) const {
  const int per_slot = mesh_.elements_per_slot();
  std::vector<int> slots;
  for (const BrightElement& b : bright)
    if (slots.empty() || slots.back() != b.element / per_slot) slots.push_back(b.element / per_slot);
  const std::vector<std::shared_ptr<const Link>> links = links_of(slots, {});
  std::vector<LitPatch> lit(slots.size());
  std::vector<std::size_t> first{0};
  for (std::size_t k = 1; k <= bright.size(); ++k)
    if (k == bright.size() || bright[k].element / per_slot != bright[k - 1].element / per_slot) first.push_back(k);
  parallel_indices(slots.size(), 16,
                   [&](std::size_t k) { lit[k] = lit_patch(links[k], bright, first[k], first[k + 1]); });

  const std::size_t chunk_count = (x_.size() / kBlock + kBlocksAtOnce - 1) / kBlocksAtOnce;
  parallel_indices(chunk_count, 1, [&](std::size_t chunk) {
    if (is_grey)
      add_blocks<true>(lit, chunk, irradiance);
    else
      add_blocks<false>(lit, chunk, irradiance);
  });
}

}  // namespace transom
