// How points see far patches: by their middles, and by their elements where something may hide a part of them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "transom/point_links.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::uint8_t kAllSeen = 255;  // as a stored share
constexpr std::size_t kFirstAsked = 4;  // elements; where these are seen as the middle is, so are the others
constexpr float kLeastAsked = 4e-4f;    // share of what a point sees: of a patch that has less, the middle says enough

// What stands between a point and a place of a patch.
enum class Between : std::uint8_t { kSolid, kGlass, kNothing };

Between between(std::uint8_t seen) {
  return seen == 0 ? Between::kSolid : seen == kAllSeen ? Between::kNothing : Between::kGlass;
}

}  // namespace

void PointLinks::see_middle(MiddleView& view, const std::vector<int>& far_points, const KnownPoints& known) const {
  const glm::vec3 middle = view.exposed.middle;
  std::vector<Ray> segments;
  std::vector<int> unknown;
  std::vector<std::uint8_t> may_be_glazed, is_glazed;
  MayBeGlazed may_glaze(*this, {&middle, 1});
  std::size_t entered = block_middle_.size();
  bool is_block_met = false;  // whether what has changed may stand between the patch and some point of the block
  for (const int point : far_points) {
    const auto i = static_cast<std::size_t>(point), block = i / kBlock;
    const int known_point = known.number(point);
    const Ray segment{middle, glm::vec3(x_[i], y_[i], z_[i]) - middle, 0, 1};
    if (known_point >= 0) {
      if (entered != block) {
        entered = block;
        is_block_met = known.change().may_meet(middle, block_middle_[block], block_radius_[block]);
      }
      if (!is_block_met || !known.change().may_meet(segment)) {
        view.seen[i] = known.seen_of_middle(known_point);
        if (known.is_glazed(known_point)) view.glazed_point.push_back(point);
        continue;
      }
    }
    unknown.push_back(point);
    segments.push_back(segment);
    may_be_glazed.push_back(may_glaze(point));
  }
  std::vector<float> shares;
  seen_shares(std::move(segments), may_be_glazed, RayScene::Order::kCoherent, shares, is_glazed);
  for (std::size_t k = 0; k < unknown.size(); ++k) {
    view.seen[static_cast<std::size_t>(unknown[k])] = shares[k] == 1 ? kAllSeen : stored_share(shares[k]);
    if (is_glazed[k]) view.glazed_point.push_back(unknown[k]);
  }
}

/// The far points of one patch that ask for its elements.
class PointLinks::ElementViews {
 public:
  ElementViews(const PointLinks& links, const MiddleView& view, const KnownPoints& known, Link& link)
      : links_(links), view_(view), known_(known), link_(link), is_asked_(view.seen.size(), 0) {}

  void find(const std::vector<const MiddleView*>& beside);
  const std::vector<char>& is_asked() const { return is_asked_; }

 private:
  void find_who_may_ask();
  bool is_at_an_edge(int point, const std::vector<const MiddleView*>& beside) const;
  void ask(const std::vector<int>& points);
  std::vector<int> not_known(const std::vector<int>& points);
  glm::vec3 place(int point) const {
    const auto i = static_cast<std::size_t>(point);
    return {links_.x_[i], links_.y_[i], links_.z_[i]};
  }

  const PointLinks& links_;
  const MiddleView& view_;
  const KnownPoints& known_;
  Link& link_;
  std::vector<char> may_ask_, is_asked_;  // by point
};

// Far points for which the patch is more than very little of what they see.
void PointLinks::ElementViews::find_who_may_ask() {
  const float weight = links_.mesh_.slot_area(view_.slot) / kPi;  // share of what a point sees, per point_weight
  const glm::vec3 middle = view_.exposed.middle, normal = links_.mesh_.normal_of(view_.slot);
  std::vector<float> share(view_.seen.size());
  for (std::size_t i = 0; i < share.size(); ++i) share[i] = weight * links_.point_weight(middle, normal, i);
  may_ask_.resize(share.size());
  for (std::size_t i = 0; i < share.size(); ++i) may_ask_[i] = view_.seen[i] != kNotFar && share[i] >= kLeastAsked;
}

// Whether a point beside this one sees the middle otherwise, or this one the middle of a patch beside.
bool PointLinks::ElementViews::is_at_an_edge(int point, const std::vector<const MiddleView*>& beside) const {
  const auto i = static_cast<std::size_t>(point);
  const auto differs = [own = between(view_.seen[i])](std::uint8_t seen) {
    return seen != kNotFar && between(seen) != own;
  };
  for (const int other : links_.neighbours_.of(i))
    if (differs(view_.seen[static_cast<std::size_t>(other)])) return true;
  for (const MiddleView* other : beside)
    if (!other->exposed.elements.empty() && differs(other->seen[i])) return true;
  return false;
}

// What hides a part of the patch is followed from point to point.
void PointLinks::ElementViews::find(const std::vector<const MiddleView*>& beside) {
  if (view_.exposed.elements.size() < 2 || links_.neighbours_.begin.empty()) return;
  find_who_may_ask();
  std::vector<int> next;
  for (int point = 0; point < static_cast<int>(links_.point_count_); ++point)
    if (may_ask_[static_cast<std::size_t>(point)] && is_at_an_edge(point, beside)) next.push_back(point);
  while (!next.empty()) {
    for (const int point : next) is_asked_[static_cast<std::size_t>(point)] = 1;
    const std::size_t first = link_.partial.size();
    ask(next);
    next.clear();
    for (std::size_t k = first; k < link_.partial.size(); ++k)
      for (const int other : links_.neighbours_.of(static_cast<std::size_t>(link_.partial[k].point))) {
        char& is_asked = is_asked_[static_cast<std::size_t>(other)];
        if (is_asked || !may_ask_[static_cast<std::size_t>(other)]) continue;
        is_asked = 1;
        next.push_back(other);
      }
    std::sort(next.begin(), next.end());
  }
  std::sort(link_.partial.begin(), link_.partial.end(),
            [](const Partial& a, const Partial& b) { return a.point < b.point; });
}

// The points of which another state does not say what they see; what it says of the others is taken over.
std::vector<int> PointLinks::ElementViews::not_known(const std::vector<int>& points) {
  std::vector<int> unknown;
  for (const int point : points) {
    const int known_point = known_.number(point);
    if (known_point < 0 || !known_.is_asked(known_point) ||
        known_.change().may_meet(place(point), view_.exposed.middle, view_.exposed.radius)) {
      unknown.push_back(point);
      continue;
    }
    const Partial* before = known_.partial(known_point);
    if (before) link_.partial.push_back({point, before->groups, before->seen, before->seen_of_middle});
  }
  return unknown;
}

// Finds which elements points see; those that do not see all of them as the middle see a part.
void PointLinks::ElementViews::ask(const std::vector<int>& points) {
  struct Answer {
    int point;
    std::uint16_t groups = 0;
    bool differs = false;  // some element from the middle
    int count = 0;         // of elements that are seen, and the sum of their shares
    float sum = 0;
  };
  std::vector<Answer> answers;
  for (const int point : not_known(points)) answers.push_back({point});
  const std::vector<int>& elements = view_.exposed.elements;
  std::vector<glm::vec3> places;
  places.reserve(elements.size());
  for (const int element : elements) places.emplace_back(link_.element[static_cast<std::size_t>(element)]);
  MayBeGlazed may_glaze(links_, places);
  std::vector<Ray> segments;
  std::vector<float> shares;
  std::vector<std::uint8_t> may_be_glazed, is_glazed;
  for (std::size_t first = 0; first < elements.size();) {
    const std::size_t last = first == 0 ? std::min(kFirstAsked, elements.size()) : elements.size();
    segments.clear();
    may_be_glazed.clear();
    for (const Answer& answer : answers)
      for (std::size_t e = first; e < last; ++e) {
        const glm::vec3 from = place(answer.point);
        segments.push_back({from, places[e] - from, 0, 1});
        may_be_glazed.push_back(may_glaze(answer.point));
      }
    // Rays along an edge that a patch and an object have in common meet it or not by the rays beside them if these are
    // traced as coherent; an edit casts fewer.
    links_.seen_shares(segments, may_be_glazed, RayScene::Order::kScattered, shares, is_glazed);
    std::size_t segment = 0;
    for (Answer& answer : answers) {
      const Between middle = between(view_.seen[static_cast<std::size_t>(answer.point)]);
      for (std::size_t e = first; e < last; ++e, ++segment) {
        if (is_glazed[segment]) link_.glazed_point.push_back(answer.point);
        answer.differs |= between(stored_share(shares[segment])) != middle;
        if (!(shares[segment] > 0)) continue;
        answer.sum += shares[segment];
        ++answer.count;
        answer.groups = static_cast<std::uint16_t>(answer.groups | 1u << links_.group_of(elements[e]));
      }
    }
    std::erase_if(answers, [](const Answer& answer) { return !answer.differs; });
    first = last;
  }
  for (const Answer& answer : answers)
    link_.partial.push_back({answer.point, answer.groups,
                             stored_share(answer.count > 0 ? answer.sum / static_cast<float>(answer.count) : 0.f),
                             view_.seen[static_cast<std::size_t>(answer.point)]});
}

void PointLinks::link_far(Link& link, const MiddleView& view, const std::vector<const MiddleView*>& beside,
                          const KnownPoints& known) const {
  ElementViews elements(*this, view, known, link);
  elements.find(beside);
  const std::vector<char>& is_asked = elements.is_asked();
  auto partial = link.partial.begin();
  for (std::size_t i = 0; i < point_count_; ++i) {
    const bool is_partial = partial != link.partial.end() && static_cast<std::size_t>(partial->point) == i;
    const std::uint8_t seen = is_partial ? partial->seen : view.seen[i];
    if (is_partial) ++partial;
    if (!is_asked[i] && (view.seen[i] == 0 || view.seen[i] == kNotFar)) continue;
    const int block = static_cast<int>(i / kBlock);
    if (link.block.empty() || link.block.back() != block) {
      link.block.push_back(block);
      link.seen.resize(link.seen.size() + kBlock, 0);
      link.asked.push_back(0);
    }
    link.seen[link.seen.size() - kBlock + i % kBlock] = seen;
    if (is_asked[i]) link.asked.back() |= std::uint64_t{1} << i % kBlock;
  }
  if (keeps_weights_) weigh_far(link, view.slot);
}

// Far points take all that they see of an evenly lit patch to be at its centroid.
void PointLinks::weigh_far(Link& link, int slot) const {
  glm::vec3 centroid(0);
  float area = 0, area_of_group[kGroups] = {};
  for (std::size_t e = 0; e < link.element.size(); ++e) {
    const glm::vec4& element = link.element[e];
    centroid += element.w * glm::vec3(element);
    area += element.w;
    area_of_group[group_of(static_cast<int>(e))] += element.w;
  }
  if (!(area > 0)) return;
  centroid /= area;
  const glm::vec3 normal = mesh_.normal_of(slot);
  const auto weight_of = [&](float seen_area, std::uint8_t seen, std::size_t point) {
    return seen_area / kPi * seen_share(seen) * point_weight(centroid, normal, point);
  };
  std::vector<float> weight(link.seen.size());
  for (std::size_t b = 0; b < link.block.size(); ++b) {
    const std::size_t first = static_cast<std::size_t>(link.block[b]) * kBlock;
    for (std::size_t k = 0; k < kBlock; ++k)
      weight[b * kBlock + k] = weight_of(area, link.seen[b * kBlock + k], first + k);
  }
  std::size_t block = 0;
  for (const Partial& partial : link.partial) {
    const auto point = static_cast<std::size_t>(partial.point);
    while (static_cast<std::size_t>(link.block[block]) != point / kBlock) ++block;
    float seen_area = 0;
    for (int group = 0; group < kGroups; ++group)
      if (partial.groups >> group & 1) seen_area += area_of_group[group];
    weight[block * kBlock + point % kBlock] = weight_of(seen_area, partial.seen, point);
  }
  const float most = weight.empty() ? 0.f : *std::max_element(weight.begin(), weight.end());
  if (!(most > 0)) return;
  link.weight_unit = most / std::numeric_limits<std::uint16_t>::max();
  link.weight.resize(weight.size());
  for (std::size_t k = 0; k < weight.size(); ++k)
    link.weight[k] = static_cast<std::uint16_t>(std::floor(weight[k] / link.weight_unit + 0.5f));
}

}  // namespace transom
