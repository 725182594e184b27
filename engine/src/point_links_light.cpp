// The first reflection of beams towards linked points.
#include <algorithm>
#include <bit>
#include <numbers>

#include "transom/parallel.h"
#include "transom/point_links.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kBlocksAtOnce = 20;
constexpr float kEven = 1e-3f;             // relative difference of elements that count as evenly lit
constexpr float kSameHue = 1e-6f;          // of the strongest channel
constexpr std::size_t kHuesCompared = 16;  // the last ones: patches of one face follow each other

// Sum of weight x value: every eighth product goes to the same of eight sums.
inline float weighted_sum(const float* weight, const float* value, std::size_t count) {
  float sums[8] = {};
  std::size_t k = 0;
  for (; k + 8 <= count; k += 8)
    for (std::size_t lane = 0; lane < 8; ++lane) sums[lane] += weight[k + lane] * value[k + lane];
  for (std::size_t lane = 0; k < count; ++k, ++lane) sums[lane] += weight[k] * value[k];
  return ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]));
}

float strongest_channel(glm::vec3 colour) {
  return std::max({colour.x, colour.y, colour.z});
}

}  // namespace

PointLinks::LitPatch PointLinks::lit_patch(std::shared_ptr<const Link> link, std::span<const BrightElement> bright,
                                           std::size_t first, std::size_t last) const {
  const auto per_slot = static_cast<std::size_t>(mesh_.elements_per_slot());
  LitPatch patch;
  patch.normal = mesh_.normal_of(bright[first].element / mesh_.elements_per_slot());
  std::vector<glm::vec3> sent(per_slot, glm::vec3(0));  // by element: radiosity
  glm::vec3 flux(0);
  float sum = 0;
  for (std::size_t k = first; k < last; ++k) {
    const int e = bright[k].element % mesh_.elements_per_slot();
    const glm::vec4 element = link->element[e];
    const glm::vec3 radiosity = bright[k].radiosity;
    const float weight = element.w * (radiosity.x + radiosity.y + radiosity.z);
    patch.centroid += weight * glm::vec3(element);
    flux += element.w / kPi * radiosity;
    sum += weight;
    sent[e] = radiosity;
  }
  if (sum > 0) patch.centroid /= sum;
  patch.flux = strongest_channel(flux);
  if (patch.flux > 0) patch.hue = flux / patch.flux;
  const auto is_alike = [&](std::size_t e, glm::vec3 radiosity, float tolerance) {
    const glm::vec3 difference = glm::abs(sent[e] - radiosity);
    return link->element[e].w <= 0 ||
           (difference.x <= tolerance * radiosity.x && difference.y <= tolerance * radiosity.y &&
            difference.z <= tolerance * radiosity.z);
  };
  bool is_of_one_hue = true;
  for (std::size_t e = 0; e < per_slot; ++e) {
    patch.is_even &= is_alike(e, bright[first].radiosity, kEven);
    is_of_one_hue &= is_alike(e, strongest_channel(sent[e]) * patch.hue, kSameHue);
  }
  if (!link->partial.empty()) patch.share_of_groups = shares_of_groups(*link, bright.subspan(first, last - first), sum);
  patch.radiosity = strongest_channel(bright[first].radiosity);
  for (int channel = 0; channel < (is_of_one_hue ? 1 : 3); ++channel)
    for (const glm::vec3& element : sent)
      patch.sent.push_back(is_of_one_hue ? strongest_channel(element) : element[channel]);
  patch.link = std::move(link);
  return patch;
}

// Shares of the light of a patch: sum of element areas x radiosity. Of all sets of the first half of the groups, then
// of the second half.
std::vector<float> PointLinks::shares_of_groups(const Link& link, std::span<const BrightElement> bright,
                                                float sum) const {
  constexpr int kHalf = kGroups / 2;
  float of_group[kGroups] = {};
  for (const BrightElement& b : bright) {
    const int e = b.element % mesh_.elements_per_slot();
    if (sum > 0) of_group[group_of(e)] += link.element[e].w * (b.radiosity.x + b.radiosity.y + b.radiosity.z) / sum;
  }
  std::vector<float> shares(2 << kHalf, 0.f);
  for (int half = 0; half < 2; ++half)
    for (int groups = 1; groups < 1 << kHalf; ++groups) {
      float* share = &shares[static_cast<std::size_t>(half) << kHalf];
      const int first_group = std::countr_zero(static_cast<unsigned>(groups));
      share[groups] = share[groups & (groups - 1)] + of_group[half * kHalf + first_group];
    }
  return shares;
}

// Lit patches by hue: within one, a single channel is summed.
std::vector<PointLinks::Hue> PointLinks::hues_of(const std::vector<LitPatch>& lit) {
  std::vector<Hue> hues;
  for (const LitPatch& patch : lit) {
    const auto is_same = [&](const Hue& hue) {
      return strongest_channel(glm::abs(hue.colour - patch.hue)) <= kSameHue;
    };
    const std::size_t compared = std::min(hues.size(), kHuesCompared);
    auto hue = std::find_if(hues.end() - static_cast<std::ptrdiff_t>(compared), hues.end(), is_same);
    if (hue == hues.end()) hue = hues.insert(hues.end(), {patch.hue, {}});
    hue->patches.push_back(&patch);
  }
  return hues;
}

// What lit patches of one hue send to the far points of some blocks: in its strongest channel, from the point `base`
// on.
void PointLinks::add_far(const Hue& hue, std::size_t first_block, std::size_t last_block, float* received) const {
  const std::size_t base = first_block * kBlock;
  for (const LitPatch* patch : hue.patches) {
    const Link& link = *patch->link;
    const bool is_weighed = patch->is_even && !link.weight.empty();
    const float scale = link.weight_unit * patch->radiosity;
    auto block = std::lower_bound(link.block.begin(), link.block.end(), static_cast<int>(first_block));
    auto partial = std::lower_bound(
        link.partial.begin(), is_weighed ? link.partial.begin() : link.partial.end(), base,
        [](const Partial& before, std::size_t point) { return static_cast<std::size_t>(before.point) < point; });
    for (; block != link.block.end() && *block < static_cast<int>(last_block); ++block) {
      const std::size_t from = static_cast<std::size_t>(*block) * kBlock,
                        place = static_cast<std::size_t>(block - link.block.begin()) * kBlock;
      float* to = received + (from - base);
      if (is_weighed) {
        const std::uint16_t* known = &link.weight[place];
        for (std::size_t k = 0; k < kBlock; ++k) to[k] += scale * static_cast<float>(static_cast<int>(known[k]));
      } else {
        add_block(*patch, place, from, partial, to);
      }
    }
  }
}

// What a patch, unevenly lit or not weighed beforehand, sends to the far points of a block; place: of the block in the
// link. partial: the first of the link that may be of the block; the first after it when this returns.
void PointLinks::add_block(const LitPatch& patch, std::size_t place, std::size_t from,
                           std::vector<Partial>::const_iterator& partial, float* received) const {
  const Link& link = *patch.link;
  const glm::vec3 c = patch.centroid, m = patch.normal;
  const float flux = patch.flux;
  const std::uint8_t* seen = &link.seen[place];
  float share[kBlock];
  for (std::size_t k = 0; k < kBlock; ++k) share[k] = flux * seen_share(seen[k]);
  while (partial != link.partial.end() && static_cast<std::size_t>(partial->point) < from) ++partial;
  for (; partial != link.partial.end() && static_cast<std::size_t>(partial->point) < from + kBlock; ++partial)
    share[static_cast<std::size_t>(partial->point) - from] *= patch.share_of(partial->groups);
  for (std::size_t k = 0; k < kBlock; ++k) received[k] += share[k] * point_weight(c, m, from + k);
}

// What lit patches send to the points of a few blocks.
void PointLinks::add_blocks(const std::vector<LitPatch>& lit, const std::vector<Hue>& hues, std::size_t chunk,
                            std::vector<glm::vec3>& irradiance) const {
  const auto per_slot = static_cast<std::size_t>(mesh_.elements_per_slot());
  const std::size_t first_block = chunk * kBlocksAtOnce,
                    last_block = std::min(x_.size() / kBlock, first_block + kBlocksAtOnce), base = first_block * kBlock,
                    count = std::min(point_count_, last_block * kBlock) - base;
  for (const Hue& hue : hues) {
    float received[kBlocksAtOnce * kBlock] = {};
    add_far(hue, first_block, last_block, received);
    for (std::size_t k = 0; k < count; ++k) irradiance[base + k] += received[k] * hue.colour;
  }
  for (const LitPatch& patch : lit) {
    const Link& link = *patch.link;
    auto near = std::lower_bound(link.near_point.begin(), link.near_point.end(), static_cast<int>(base));
    for (; near != link.near_point.end() && *near < static_cast<int>(last_block * kBlock); ++near) {
      const auto number = static_cast<std::size_t>(near - link.near_point.begin());
      glm::vec3& received = irradiance[static_cast<std::size_t>(*near)];
      const float* weight = &link.near_weight[number * per_slot];
      if (patch.is_even)
        received += link.near_sum[number] * patch.radiosity * patch.hue;
      else if (patch.sent.size() == per_slot)
        received += weighted_sum(weight, patch.sent.data(), per_slot) * patch.hue;
      else
        for (std::size_t channel = 0; channel < 3; ++channel)
          received[static_cast<int>(channel)] += weighted_sum(weight, &patch.sent[channel * per_slot], per_slot);
    }
  }
}

void PointLinks::add_irradiance(std::span<const BrightElement> bright, std::vector<glm::vec3>& irradiance) const {
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
  const std::vector<Hue> hues = hues_of(lit);
  const std::size_t chunk_count = (x_.size() / kBlock + kBlocksAtOnce - 1) / kBlocksAtOnce;
  parallel_indices(chunk_count, 1, [&](std::size_t chunk) { add_blocks(lit, hues, chunk, irradiance); });
}

}  // namespace transom
