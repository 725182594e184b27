#include "transom/point_links.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr std::size_t kBatch = 512;  // of patches that are linked together

// What people build is aligned, and so are the places on it: many segments run along a face, or through its very edge,
// and whether they meet it would hang on what else is traced. Moved aside by this much of the lift, they pass or do
// not.
constexpr glm::vec3 kAside{0.11f, 0.15f, 0.23f};

}  // namespace

PointLinks::PointLinks(const LightMesh& mesh, const RayScene& rays, const std::vector<Node>& points,
                       NodeNeighbours neighbours, std::size_t memory)
    : mesh_(mesh),
      rays_(rays),
      point_count_(points.size()),
      neighbours_(std::move(neighbours)),
      memory_(memory),
      openings_(mesh.faces(), rays.faces_of(RayScene::What::kOpenings), points, kBlock),
      links_(static_cast<std::size_t>(mesh.slot_count())) {
  const std::size_t padded = (points.size() + kBlock - 1) / kBlock * kBlock;
  for (std::vector<float>* list : {&x_, &y_, &z_, &nx_, &ny_, &nz_}) list->assign(padded, 0.f);
  for (std::size_t i = 0; i < points.size(); ++i) {
    x_[i] = points[i].position.x;
    y_[i] = points[i].position.y;
    z_[i] = points[i].position.z;
    nx_[i] = points[i].normal.x;
    ny_[i] = points[i].normal.y;
    nz_[i] = points[i].normal.z;
  }
  for (std::size_t begin = 0; begin < points.size(); begin += kBlock) {
    const std::span<const Node> block(points.data() + begin, std::min(kBlock, points.size() - begin));
    glm::vec3 low = block[0].position, high = low;
    for (const Node& point : block) {
      low = glm::min(low, point.position);
      high = glm::max(high, point.position);
    }
    block_middle_.push_back(0.5f * (low + high));
    block_radius_.push_back(0.5f * glm::length(high - low));
  }
}

// The middle is that of the exposed elements; where it may lie off the patch or inside a solid, the nearest of theirs.
PointLinks::Exposed PointLinks::exposed_part(int slot_index) const {
  const int element_count = mesh_.elements_per_slot();
  std::vector<Ray> outwards;
  std::vector<int> element;
  for (int e = 0; e < element_count; ++e) {
    if (!(mesh_.element_area(slot_index * element_count + e) > 0)) continue;
    const Node middle = mesh_.middle_of_element(slot_index * element_count + e);
    outwards.push_back({middle.position, middle.normal});
    element.push_back(e);
  }
  std::vector<Hit> hits(outwards.size());
  rays_.intersect(RayScene::What::kOpaque, outwards, hits, RayScene::Order::kCoherent);
  glm::vec3 sum(0), all(0);
  std::size_t count = 0;
  for (std::size_t e = 0; e < outwards.size(); ++e) {
    all += outwards[e].origin;
    if (hits[e].face >= 0 && mesh_.faces().is_inside_solid(hits[e].face, hits[e].side)) continue;
    sum += outwards[e].origin;
    outwards[count] = outwards[e];
    element[count++] = element[e];
  }
  Exposed exposed;
  const bool is_planar = !mesh_.is_cluster(slot_index);
  if (count == 0 || (is_planar && count == static_cast<std::size_t>(element_count))) {
    exposed.middle = all / static_cast<float>(outwards.size());
  } else {
    sum /= static_cast<float>(count);
    const auto offset = [&](const Ray& ray) { return glm::length(ray.origin - sum); };
    exposed.middle = std::min_element(outwards.begin(), outwards.begin() + static_cast<std::ptrdiff_t>(count),
                                      [&](const Ray& a, const Ray& b) { return offset(a) < offset(b); })
                         ->origin;
  }
  // Those farthest from what has been taken come first: an edge between any two of them lies between the first.
  std::vector<std::size_t> left;  // one of each group
  std::vector<float> distance;
  for (std::size_t e = 0; e < count; ++e) {
    if (!left.empty() && group_of(element[left.back()]) == group_of(element[e])) continue;
    left.push_back(e);
    distance.push_back(glm::length(outwards[e].origin - exposed.middle));
    exposed.radius = std::max(exposed.radius, distance.back());
  }
  for (std::size_t taken = 0; taken < left.size(); ++taken) {
    const auto next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    exposed.elements.push_back(element[left[next]]);
    for (std::size_t k = 0; k < left.size(); ++k)
      distance[k] = std::min(distance[k], glm::length(outwards[left[k]].origin - outwards[left[next]].origin));
    distance[next] = -1;
  }
  return exposed;
}

PointLinks::KnownPoints::KnownPoints(const Known& known, const Link* link) : known_(known), link_(link) {
  if (!link_) return;
  place_.assign(known_.links->block_middle_.size(), -1);
  for (std::size_t k = 0; k < link_->block.size(); ++k)
    place_[static_cast<std::size_t>(link_->block[k])] = static_cast<int>(k);
  is_glazed_.assign(known_.links->point_count_, 0);
  for (const int point : link_->glazed_point) is_glazed_[static_cast<std::size_t>(point)] = 1;
}

int PointLinks::KnownPoints::number(int point) const {
  const int known_point = link_ ? known_.point[static_cast<std::size_t>(point)] : -1;
  if (known_point < 0) return -1;
  return known_.has_same_glazing || !is_glazed(known_point) ? known_point : -1;
}

bool PointLinks::KnownPoints::is_asked(int known_point) const {
  const auto point = static_cast<std::size_t>(known_point);
  const int place = place_[point / kBlock];
  return place >= 0 && (link_->asked[static_cast<std::size_t>(place)] >> point % kBlock & 1) != 0;
}

std::uint8_t PointLinks::KnownPoints::seen_of_middle(int known_point) const {
  const auto point = static_cast<std::size_t>(known_point);
  const int place = place_[point / kBlock];
  if (place < 0) return 0;
  if (const Partial* seen_in_part = is_asked(known_point) ? partial(known_point) : nullptr)
    return seen_in_part->seen_of_middle;
  return link_->seen[static_cast<std::size_t>(place) * kBlock + point % kBlock];
}

const PointLinks::Partial* PointLinks::KnownPoints::partial(int known_point) const {
  const auto found = std::lower_bound(link_->partial.begin(), link_->partial.end(), known_point,
                                      [](const Partial& partial, int point) { return partial.point < point; });
  return found != link_->partial.end() && found->point == known_point ? &*found : nullptr;
}

const float* PointLinks::KnownPoints::near_weight_of(int known_point) const {
  const auto found = std::lower_bound(link_->near_point.begin(), link_->near_point.end(), known_point);
  if (found == link_->near_point.end() || *found != known_point) return nullptr;
  return &link_->near_weight[static_cast<std::size_t>(found - link_->near_point.begin()) * link_->element.size()];
}

// The link of a patch in the other state, if the same part of the patch was exposed there.
std::shared_ptr<const PointLinks::Link> PointLinks::known_link(int slot, const Exposed& exposed,
                                                               const Known& known) const {
  const int slot_before = known.links ? known.change->slot_before(slot) : -1;
  if (slot_before < 0 || (!known.change->is_none() && !(known.links->exposed_part(slot_before) == exposed)))
    return nullptr;
  const std::lock_guard lock(known.links->mutex_);
  return known.links->links_[static_cast<std::size_t>(slot_before)];
}

// Shares of light that arrive at the end of segments: 0 behind something opaque, else the transmittance on the way.
// may_be_glazed: whether openings may be on the way; is_glazed: whether they are, and nothing opaque.
void PointLinks::seen_shares(std::vector<Ray> segments, const std::vector<std::uint8_t>& may_be_glazed,
                             RayScene::Order order, std::vector<float>& shares,
                             std::vector<std::uint8_t>& is_glazed) const {
  for (Ray& segment : segments) segment.origin += mesh_.faces().ray_offset() * kAside;
  std::vector<std::uint8_t> is_stopped(segments.size());
  rays_.occluded(RayScene::What::kOpaque, segments, is_stopped, order);
  shares.resize(segments.size());
  is_glazed.assign(segments.size(), 0);
  std::vector<Ray> open;
  std::vector<std::size_t> index;
  for (std::size_t k = 0; k < segments.size(); ++k) {
    shares[k] = is_stopped[k] ? 0.f : 1.f;
    if (is_stopped[k] || !may_be_glazed[k]) continue;
    open.push_back(segments[k]);
    index.push_back(k);
  }
  if (open.empty()) return;
  std::vector<std::uint8_t> meets_opening(open.size());
  rays_.occluded(RayScene::What::kOpenings, open, meets_opening, order);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < open.size(); ++k)
    if (meets_opening[k]) {
      is_glazed[index[k]] = 1;
      open[kept] = open[k];
      index[kept++] = index[k];
    }
  open.resize(kept);
  std::vector<float> transmitted(kept);
  rays_.transmittance(open, transmitted);
  for (std::size_t k = 0; k < kept; ++k) shares[index[k]] = transmitted[k];
}

// Which points are in front of a patch, and how the far ones see its middle.
PointLinks::MiddleView PointLinks::middle_view(int slot, Exposed exposed, const Known& known) const {
  MiddleView view{slot, std::move(exposed), nullptr, std::vector<std::uint8_t>(x_.size(), kNotFar), {}, {}};
  view.before = known_link(slot, view.exposed, known);
  const glm::vec3 middle = view.exposed.middle, normal = mesh_.normal_of(slot);
  const float size2 = 2 * mesh_.slot_area(slot), size = std::sqrt(size2);
  std::vector<int> far_points;
  enum Place : std::uint8_t { kBehind, kNear, kFar };
  std::uint8_t place[kBlock];
  for (std::size_t begin = 0; begin < x_.size(); begin += kBlock) {
    std::uint8_t any = kBehind;
    for (std::size_t k = 0; k < kBlock; ++k) {
      const float dx = middle.x - x_[begin + k], dy = middle.y - y_[begin + k], dz = middle.z - z_[begin + k];
      const float height = -(dx * normal.x + dy * normal.y + dz * normal.z);
      const float cosine = dx * nx_[begin + k] + dy * ny_[begin + k] + dz * nz_[begin + k];
      const float distance2 = dx * dx + dy * dy + dz * dz;
      const bool is_in_front = (height > 0) & (cosine > -size), is_far = distance2 > kFarPatch * kFarPatch * size2;
      place[k] = is_in_front ? (is_far ? kFar : kNear) : kBehind;
      any |= place[k];
    }
    if (any == kBehind) continue;
    for (std::size_t k = 0; k < kBlock && begin + k < point_count_; ++k) {
      const int point = static_cast<int>(begin + k);
      if (place[k] != kBehind) (place[k] == kFar ? far_points : view.near_point).push_back(point);
    }
  }
  see_middle(view, far_points, KnownPoints(known, view.before.get()));
  return view;
}

// beside: the middles of the patches beside this one.
std::shared_ptr<const PointLinks::Link> PointLinks::link(const MiddleView& view,
                                                         const std::vector<const MiddleView*>& beside,
                                                         const Known& known) const {
  auto link = std::make_shared<Link>();
  for (int e = view.slot * mesh_.elements_per_slot(); e < (view.slot + 1) * mesh_.elements_per_slot(); ++e)
    link->element.emplace_back(mesh_.middle_of_element(e).position, mesh_.element_area(e));
  link->near_point = view.near_point;
  link->glazed_point = view.glazed_point;
  const KnownPoints known_points(known, view.before.get());
  link_far(*link, view, beside, known_points);
  link_near(*link, view.slot, known_points);
  std::sort(link->glazed_point.begin(), link->glazed_point.end());
  link->glazed_point.erase(std::unique(link->glazed_point.begin(), link->glazed_point.end()), link->glazed_point.end());
  return link;
}

void PointLinks::link_near(Link& link, int slot, const KnownPoints& known) const {
  const auto element_count = static_cast<std::size_t>(mesh_.elements_per_slot());
  std::vector<ElementShape> shapes;
  for (std::size_t e = 0; e < element_count; ++e)
    shapes.push_back(element_shape(mesh_, slot * mesh_.elements_per_slot() + static_cast<int>(e)));
  std::vector<Ray> segments;
  std::vector<std::uint8_t> may_be_glazed, is_glazed;
  std::vector<float> weights, shares;
  std::vector<std::size_t> unknown;  // places in `weights` that a segment each speaks for
  std::vector<int> kept;
  const glm::vec3 middle = mesh_.middle_of(slot).position;
  float radius = 0;
  std::vector<glm::vec3> middles;
  for (const ElementShape& shape : shapes) {
    radius = std::max(radius, glm::length(shape.middle - middle));
    middles.push_back(shape.middle);
  }
  MayBeGlazed may_glaze(*this, middles);
  for (const int i : link.near_point) {
    const int known_point = known.number(i);
    const float* before = known_point >= 0 ? known.near_weight_of(known_point) : nullptr;
    if (before && !known.change().may_meet({x_[i], y_[i], z_[i]}, middle, radius)) {
      kept.push_back(i);
      if (known.is_glazed(known_point)) link.glazed_point.push_back(i);
      weights.insert(weights.end(), before, before + element_count);
      continue;
    }
    const glm::vec3 point(x_[i], y_[i], z_[i]), point_normal(nx_[i], ny_[i], nz_[i]);
    bool any = false;
    for (const ElementShape& shape : shapes) {
      weights.push_back(element_share(point, point_normal, shape));
      any |= weights.back() > 0;
    }
    if (!any) {
      weights.resize(weights.size() - shapes.size());
      continue;
    }
    kept.push_back(i);
    for (std::size_t e = 0; e < element_count; ++e) {
      unknown.push_back(weights.size() - element_count + e);
      segments.push_back({point, shapes[e].middle - point, 0, 1});
      may_be_glazed.push_back(may_glaze(i));
    }
  }
  seen_shares(std::move(segments), may_be_glazed, RayScene::Order::kCoherent, shares, is_glazed);
  for (std::size_t k = 0; k < unknown.size(); ++k) {
    weights[unknown[k]] *= shares[k];
    if (is_glazed[k]) link.glazed_point.push_back(kept[unknown[k] / element_count]);
  }
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const auto first = weights.begin() + static_cast<std::ptrdiff_t>(k * element_count);
    link.near_sum.push_back(std::accumulate(first, first + static_cast<std::ptrdiff_t>(element_count), 0.f));
  }
  link.near_point = std::move(kept);
  link.near_weight = std::move(weights);
}

std::size_t PointLinks::bytes_of(const Link& link) const {
  return sizeof(int) * (link.block.size() + link.near_point.size() + link.glazed_point.size()) + link.seen.size() +
         sizeof(std::uint64_t) * link.asked.size() + sizeof(Partial) * link.partial.size() +
         sizeof(std::uint16_t) * link.weight.size() + sizeof(float) * (link.near_weight.size() + link.near_sum.size()) +
         sizeof(glm::vec4) * link.element.size();
}

// In the order of slots, so that patches that are beside each other come together.
void PointLinks::prepare(const std::vector<int>& slots, const Known& known) const {
  std::vector<int> in_order = slots;
  std::sort(in_order.begin(), in_order.end());
  for (std::size_t begin = 0; begin < in_order.size() && byte_count() < memory_; begin += kBatch) {
    const std::size_t end = std::min(in_order.size(), begin + kBatch);
    links_of(
        {in_order.begin() + static_cast<std::ptrdiff_t>(begin), in_order.begin() + static_cast<std::ptrdiff_t>(end)},
        known);
    if (static_cast<double>(byte_count()) * static_cast<double>(in_order.size()) >
        static_cast<double>(memory_) * static_cast<double>(end))
      forget_weights();
  }
}

// Two thirds of what far points take. What they hold can be found again without rays.
void PointLinks::forget_weights() const {
  const std::lock_guard lock(mutex_);
  if (!keeps_weights_) return;
  keeps_weights_ = false;
  byte_count_ = 0;
  for (std::shared_ptr<const Link>& kept : links_) {
    if (!kept) continue;
    auto link = std::make_shared<Link>(*kept);
    link->weight = {};
    byte_count_ += bytes_of(*link);
    kept = std::move(link);
  }
}

std::size_t PointLinks::byte_count() const {
  const std::lock_guard lock(mutex_);
  return byte_count_;
}

// The links of some patches, found now if need be, and kept while there is room.
std::vector<std::shared_ptr<const PointLinks::Link>> PointLinks::links_of(const std::vector<int>& slots,
                                                                          const Known& known) const {
  std::vector<std::shared_ptr<const Link>> found(slots.size());
  std::vector<std::size_t> missing;
  std::vector<int> missing_slots;
  {
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < slots.size(); ++k) {
      found[k] = links_[slots[k]];
      if (found[k]) continue;
      missing.push_back(k);
      missing_slots.push_back(slots[k]);
    }
  }
  for (std::size_t begin = 0; begin < missing.size(); begin += kBatch) {
    const std::size_t end = std::min(missing.size(), begin + kBatch);
    const std::vector<std::shared_ptr<const Link>> made =
        found_links({missing_slots.begin() + static_cast<std::ptrdiff_t>(begin),
                     missing_slots.begin() + static_cast<std::ptrdiff_t>(end)},
                    known);
    const std::lock_guard lock(mutex_);
    for (std::size_t k = begin; k < end; ++k) {
      found[missing[k]] = made[k - begin];
      const std::size_t bytes = bytes_of(*made[k - begin]);
      if (links_[missing_slots[k]] || byte_count_ + bytes > memory_) continue;
      byte_count_ += bytes;
      links_[missing_slots[k]] = made[k - begin];
    }
  }
  return found;
}

// Middles first, also of the patches beside these: how they are seen says where elements need to be asked for.
std::vector<std::shared_ptr<const PointLinks::Link>> PointLinks::found_links(const std::vector<int>& slots,
                                                                             const Known& known) const {
  std::vector<std::shared_ptr<const Link>> links(slots.size());
  if (known.links && known.has_same_points && known.links->neighbours_ == neighbours_)
    parallel_indices(slots.size(), 1, [&](std::size_t k) {
      const std::shared_ptr<const Link> before = known_link(slots[k], exposed_part(slots[k]), known);
      if (before && (known.has_same_glazing || before->glazed_point.empty())) links[k] = before;
    });
  std::vector<int> seen_slots;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    if (links[k]) continue;
    seen_slots.push_back(slots[k]);
    if (neighbours_.begin.empty()) continue;
    const std::vector<int> beside = slots_beside(slots[k]);
    seen_slots.insert(seen_slots.end(), beside.begin(), beside.end());
  }
  std::sort(seen_slots.begin(), seen_slots.end());
  seen_slots.erase(std::unique(seen_slots.begin(), seen_slots.end()), seen_slots.end());
  std::vector<MiddleView> views(seen_slots.size());
  parallel_indices(views.size(), 1,
                   [&](std::size_t k) { views[k] = middle_view(seen_slots[k], exposed_part(seen_slots[k]), known); });
  const auto view_of = [&](int slot) {
    return &views[static_cast<std::size_t>(std::lower_bound(seen_slots.begin(), seen_slots.end(), slot) -
                                           seen_slots.begin())];
  };
  parallel_indices(slots.size(), 1, [&](std::size_t k) {
    if (links[k]) return;
    std::vector<const MiddleView*> beside;
    if (!neighbours_.begin.empty())
      for (const int slot : slots_beside(slots[k])) beside.push_back(view_of(slot));
    links[k] = link(*view_of(slots[k]), beside, known);
  });
  return links;
}

// Patches of the same side of a face that have an edge in common with this one.
std::vector<int> PointLinks::slots_beside(int index) const {
  if (mesh_.is_cluster(index)) return {};
  const Slot slot = mesh_.slot(index);
  const Grid& grid = mesh_.grid(slot.face);
  // Where the middles of cells beside lie in the coordinates of this one.
  constexpr float kThird = 1.f / 3;
  const glm::vec2 of_quad[]{{1.5f, 0.5f}, {-0.5f, 0.5f}, {0.5f, 1.5f}, {0.5f, -0.5f}},
      of_triangle[]{{2 * kThird, 2 * kThird}, {-kThird, 2 * kThird}, {2 * kThird, -kThird}};
  std::vector<int> beside;
  for (const glm::vec2 middle : grid.is_quad ? std::span<const glm::vec2>(of_quad) : std::span(of_triangle)) {
    const glm::vec2 st = grid.parameters({slot.cell, middle});
    if (st.x < 0 || st.y < 0 || st.x > 1 || st.y > 1 || (!grid.is_quad && st.x + st.y > 1)) continue;
    beside.push_back(mesh_.slot_index(slot.face, slot.side, grid.locate(st).cell));
  }
  return beside;
}

}  // namespace transom
