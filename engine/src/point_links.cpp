#include "transom/point_links.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kFar = 4;  // diameters from which a patch counts as a point: then it errs by about 1 % of its share
constexpr std::size_t kMemory = 512u << 20;  // for links [bytes]

// What people build is aligned, and so are the places on it: many segments run along a face, or through its very edge,
// and whether they meet it would hang on what else is traced. Moved aside by this much of the lift, they pass or do
// not.
constexpr glm::vec3 kAside{0.11f, 0.15f, 0.23f};

// Shares of light that arrive at the end of segments: 0 behind something opaque, else the transmittance on the way.
// is_glazed: whether there are openings on the way.
void seen_shares(const RayScene& rays, std::vector<Ray> segments, float lift, std::vector<float>& shares,
                 std::vector<std::uint8_t>& is_glazed) {
  for (Ray& segment : segments) segment.origin += lift * kAside;
  std::vector<std::uint8_t> is_stopped(segments.size());
  rays.occluded(RayScene::What::kOpaque, segments, is_stopped, RayScene::Order::kCoherent);
  shares.resize(segments.size());
  for (std::size_t k = 0; k < segments.size(); ++k) shares[k] = is_stopped[k] ? 0.f : 1.f;
  is_glazed.assign(segments.size(), 0);
  if (!rays.has_openings()) return;
  rays.occluded(RayScene::What::kOpenings, segments, is_glazed, RayScene::Order::kCoherent);
  std::vector<Ray> through;
  std::vector<std::size_t> index;
  for (std::size_t k = 0; k < segments.size(); ++k)
    if ((is_glazed[k] &= shares[k] > 0)) {
      through.push_back(segments[k]);
      index.push_back(k);
    }
  std::vector<float> transmitted(through.size());
  rays.transmittance(through, transmitted);
  for (std::size_t k = 0; k < through.size(); ++k) shares[index[k]] = transmitted[k];
}

}  // namespace

PointLinks::PointLinks(const LightMesh& mesh, const RayScene& rays, const std::vector<Node>& points)
    : mesh_(mesh), rays_(rays), point_count_(points.size()), links_(static_cast<std::size_t>(mesh.slot_count())) {
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

// The middle of the elements of a patch that do not lie inside a solid, moved to the nearest of their own middles.
glm::vec3 PointLinks::exposed_middle(int slot_index) const {
  const int element_count = mesh_.elements_per_slot();
  std::vector<Ray> outwards;
  for (int e = 0; e < element_count; ++e) {
    const int element = slot_index * element_count + e;
    if (!(mesh_.element_area(element) > 0)) continue;
    const Node middle = mesh_.middle_of_element(element);
    outwards.push_back({middle.position, middle.normal});
  }
  std::vector<Hit> hits(outwards.size());
  rays_.intersect(RayScene::What::kOpaque, outwards, hits, RayScene::Order::kCoherent);
  glm::vec3 sum(0), all(0);
  int count = 0;
  for (std::size_t e = 0; e < outwards.size(); ++e) {
    all += outwards[e].origin;
    if (hits[e].face >= 0 && mesh_.faces().is_inside_solid(hits[e].face, hits[e].side)) continue;
    sum += outwards[e].origin;
    outwards[static_cast<std::size_t>(count++)] = outwards[e];
  }
  const bool is_planar = !mesh_.is_cluster(slot_index);
  if (count == 0 || (is_planar && count == element_count)) return all / static_cast<float>(outwards.size());
  sum /= static_cast<float>(count);
  return std::min_element(
             outwards.begin(), outwards.begin() + count,
             [&](const Ray& a, const Ray& b) { return glm::length(a.origin - sum) < glm::length(b.origin - sum); })
      ->origin;
}

const float* PointLinks::Link::near_weight_of(int point, std::size_t element_count) const {
  const auto found = std::lower_bound(near_point.begin(), near_point.end(), point);
  if (found == near_point.end() || *found != point) return nullptr;
  return &near_weight[static_cast<std::size_t>(found - near_point.begin()) * element_count];
}

PointLinks::KnownPoints::KnownPoints(const Known& all_known, const Link* known_link)
    : known(all_known), link(known_link) {
  if (!link) return;
  seen.assign(known.links->x_.size(), 0);
  for (std::size_t k = 0; k < link->block.size(); ++k)
    std::copy_n(link->seen.begin() + static_cast<std::ptrdiff_t>(k * kBlock), kBlock,
                seen.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(link->block[k]) * kBlock));
  is_glazed.assign(seen.size(), 0);
  for (const int point : link->glazed_point) is_glazed[static_cast<std::size_t>(point)] = 1;
}

int PointLinks::KnownPoints::number(int point) const {
  const int known_point = link ? known.point[static_cast<std::size_t>(point)] : -1;
  return known_point < 0 || known.has_same_glazing || !is_glazed[static_cast<std::size_t>(known_point)] ? known_point
                                                                                                        : -1;
}

// The link of a patch in the other state, if the same part of the patch was exposed there.
std::shared_ptr<const PointLinks::Link> PointLinks::known_link(int slot, glm::vec3 middle, const Known& known) const {
  const int slot_before = known.links ? known.change->slot_before(slot) : -1;
  if (slot_before < 0 || (!known.change->is_none() && known.links->exposed_middle(slot_before) != middle))
    return nullptr;
  const std::lock_guard lock(known.links->mutex_);
  return known.links->links_[static_cast<std::size_t>(slot_before)];
}

std::shared_ptr<const PointLinks::Link> PointLinks::link(int slot_index, const Known& known) const {
  const glm::vec3 middle = exposed_middle(slot_index);
  const std::shared_ptr<const Link> before = known_link(slot_index, middle, known);
  if (before && known.has_same_points && (known.has_same_glazing || before->glazed_point.empty())) return before;
  const glm::vec3 normal = mesh_.normal_of(slot_index);
  const float size2 = 2 * mesh_.slot_area(slot_index), size = std::sqrt(size2);
  auto link = std::make_shared<Link>();
  for (int e = slot_index * mesh_.elements_per_slot(); e < (slot_index + 1) * mesh_.elements_per_slot(); ++e)
    link->element.emplace_back(mesh_.middle_of_element(e).position, mesh_.element_area(e));
  std::vector<int> far_points;
  std::vector<float> height(kBlock), distance2(kBlock), cosine(kBlock);
  for (std::size_t begin = 0; begin < x_.size(); begin += kBlock) {
    bool any = false;
    for (std::size_t k = 0; k < kBlock; ++k) {
      const float dx = middle.x - x_[begin + k], dy = middle.y - y_[begin + k], dz = middle.z - z_[begin + k];
      height[k] = -(dx * normal.x + dy * normal.y + dz * normal.z);
      cosine[k] = dx * nx_[begin + k] + dy * ny_[begin + k] + dz * nz_[begin + k];
      distance2[k] = dx * dx + dy * dy + dz * dz;
      any |= height[k] > 0 && cosine[k] > -size;
    }
    if (!any) continue;
    for (std::size_t k = 0; k < kBlock && begin + k < point_count_; ++k)
      if (height[k] > 0 && cosine[k] > -size)
        (distance2[k] > kFar * kFar * size2 ? far_points : link->near_point).push_back(static_cast<int>(begin + k));
  }
  const KnownPoints known_points(known, before.get());
  link_far(*link, middle, far_points, known_points);
  weigh_far(*link, slot_index);
  link_near(*link, slot_index, known_points);
  std::sort(link->glazed_point.begin(), link->glazed_point.end());
  link->glazed_point.erase(std::unique(link->glazed_point.begin(), link->glazed_point.end()), link->glazed_point.end());
  return link;
}

void PointLinks::link_far(Link& link, glm::vec3 middle, const std::vector<int>& far_points,
                          const KnownPoints& known) const {
  std::vector<Ray> segments;
  std::vector<std::uint8_t> seen(far_points.size());
  std::vector<std::size_t> unknown;
  std::size_t entered = block_middle_.size();
  bool is_block_met = false;  // whether what has changed may stand between the patch and some point of the block
  for (std::size_t k = 0; k < far_points.size(); ++k) {
    const int i = far_points[k], known_point = known.number(i);
    const Ray segment{middle, glm::vec3(x_[i], y_[i], z_[i]) - middle, 0, 1};
    if (known_point >= 0) {
      if (entered != static_cast<std::size_t>(i) / kBlock) {
        entered = static_cast<std::size_t>(i) / kBlock;
        is_block_met = known.known.change->may_meet(middle, block_middle_[entered], block_radius_[entered]);
      }
      if (!is_block_met || !known.known.change->may_meet(segment)) {
        seen[k] = known.seen[static_cast<std::size_t>(known_point)];
        if (known.is_glazed[static_cast<std::size_t>(known_point)]) link.glazed_point.push_back(i);
        continue;
      }
    }
    unknown.push_back(k);
    segments.push_back(segment);
  }
  std::vector<float> shares;
  std::vector<std::uint8_t> is_glazed;
  seen_shares(rays_, std::move(segments), mesh_.faces().ray_offset(), shares, is_glazed);
  for (std::size_t k = 0; k < unknown.size(); ++k) {
    if (is_glazed[k]) link.glazed_point.push_back(far_points[unknown[k]]);
    if (shares[k] > 0) seen[unknown[k]] = static_cast<std::uint8_t>(std::lround(255 * std::sqrt(shares[k])));
  }
  for (std::size_t k = 0; k < far_points.size(); ++k) {
    if (seen[k] == 0) continue;
    const int block = far_points[k] / static_cast<int>(kBlock);
    if (link.block.empty() || link.block.back() != block) {
      link.block.push_back(block);
      link.seen.resize(link.seen.size() + kBlock, 0);
    }
    link.seen[link.seen.size() - kBlock + far_points[k] % static_cast<int>(kBlock)] = seen[k];
  }
}

// Far points take all of an evenly lit patch to be at its centroid.
void PointLinks::weigh_far(Link& link, int slot) const {
  glm::vec3 centroid(0);
  float area = 0;
  for (const glm::vec4& element : link.element) {
    centroid += element.w * glm::vec3(element);
    area += element.w;
  }
  if (!(area > 0)) return;
  centroid /= area;
  const glm::vec3 normal = mesh_.normal_of(slot);
  std::vector<float> weight(link.seen.size());
  for (std::size_t k = 0; k < weight.size(); ++k)
    if (link.seen[k] > 0)
      weight[k] =
          area / kPi * seen_share(link.seen[k]) *
          point_weight(centroid, normal, static_cast<std::size_t>(link.block[k / kBlock]) * kBlock + k % kBlock);
  const float most = weight.empty() ? 0.f : *std::max_element(weight.begin(), weight.end());
  if (!(most > 0)) return;
  link.weight_unit = most / std::numeric_limits<std::uint16_t>::max();
  for (const float value : weight)
    link.weight.push_back(static_cast<std::uint16_t>(std::lround(value / link.weight_unit)));
}

void PointLinks::link_near(Link& link, int slot, const KnownPoints& known) const {
  const auto element_count = static_cast<std::size_t>(mesh_.elements_per_slot());
  std::vector<ElementShape> shapes;
  for (std::size_t e = 0; e < element_count; ++e)
    shapes.push_back(element_shape(mesh_, slot * mesh_.elements_per_slot() + static_cast<int>(e)));
  std::vector<Ray> segments;
  std::vector<float> weights, shares;
  std::vector<std::size_t> unknown;  // places in `weights` that a segment each speaks for
  std::vector<int> kept;
  const glm::vec3 middle = mesh_.middle_of(slot).position;
  float radius = 0;
  for (const ElementShape& shape : shapes) radius = std::max(radius, glm::length(shape.middle - middle));
  for (const int i : link.near_point) {
    const int known_point = known.number(i);
    const float* before = known_point >= 0 ? known.link->near_weight_of(known_point, element_count) : nullptr;
    if (before && !known.known.change->may_meet({x_[i], y_[i], z_[i]}, middle, radius)) {
      kept.push_back(i);
      if (known.is_glazed[static_cast<std::size_t>(known_point)]) link.glazed_point.push_back(i);
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
    }
  }
  std::vector<std::uint8_t> is_glazed;
  seen_shares(rays_, std::move(segments), mesh_.faces().ray_offset(), shares, is_glazed);
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
         sizeof(std::uint16_t) * link.weight.size() + sizeof(float) * (link.near_weight.size() + link.near_sum.size()) +
         sizeof(glm::vec4) * link.element.size();
}

void PointLinks::prepare(const std::vector<int>& slots, const Known& known) const {
  constexpr std::size_t kBatch = 256;  // of patches, after which the memory is looked at
  for (std::size_t begin = 0; begin < slots.size() && byte_count() < kMemory; begin += kBatch)
    links_of({slots.begin() + static_cast<std::ptrdiff_t>(begin),
              slots.begin() + static_cast<std::ptrdiff_t>(std::min(slots.size(), begin + kBatch))},
             known);
}

std::size_t PointLinks::byte_count() const {
  const std::lock_guard lock(mutex_);
  return byte_count_;
}

// The links of some patches, found now if need be. Without room for more, what other conditions needed is given up.
std::vector<std::shared_ptr<const PointLinks::Link>> PointLinks::links_of(const std::vector<int>& slots,
                                                                          const Known& known) const {
  std::vector<std::shared_ptr<const Link>> found(slots.size());
  std::vector<std::size_t> missing;
  {
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < slots.size(); ++k) {
      found[k] = links_[slots[k]];
      if (!found[k]) missing.push_back(k);
    }
  }
  if (missing.empty()) return found;
  parallel_indices(missing.size(), 1, [&](std::size_t k) { found[missing[k]] = link(slots[missing[k]], known); });
  const std::lock_guard lock(mutex_);
  for (const std::size_t k : missing) {
    const Link& made = *found[k];
    if (links_[slots[k]]) continue;
    if (byte_count_ >= kMemory) {
      std::fill(links_.begin(), links_.end(), nullptr);
      byte_count_ = 0;
    }
    byte_count_ += bytes_of(made);
    links_[slots[k]] = found[k];
  }
  return found;
}

}  // namespace transom
