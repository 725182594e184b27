#include "transom/scene_change.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kMostBits = 3;
constexpr int kEdgeSteps = 64;             // at which the border of a cell is looked at
constexpr float kAngleMargin = 0.01f;      // for what lies between [rad]
constexpr double kShaftMargin = 1e-4;      // for the rounding of rays towards an opening close by [rad]
constexpr float kBoxMargin = 1;            // of the lift of ray origins: large against rounding
constexpr float kLeastComponent = 1e-12f;  // of a direction, that can be divided by

std::uint64_t place_hash(const Face& face) {
  std::uint64_t hash = face.is_quad;
  for (const glm::vec3& corner : face.corner)
    for (int axis = 0; axis < 3; ++axis)
      hash = hash * 0x9e3779b97f4a7c15ULL + hash_seed(hash, std::bit_cast<std::uint32_t>(corner[axis]));
  return hash;
}

bool is_same_place(const Face& f, const Face& g) {
  return f.is_quad == g.is_quad && f.is_set_back == g.is_set_back && std::equal(f.corner, f.corner + 4, g.corner) &&
         std::equal(f.corner_normal, f.corner_normal + 4, g.corner_normal);
}

bool is_solid(const Faces& faces, std::size_t face) {
  return faces.component_is_solid[static_cast<std::size_t>(faces.faces[face].component)] != 0;
}

// Most often they are sorted: what stays keeps its order as a rule.
void sort_by_index(std::vector<Share>& shares) {
  const auto is_before = [](const Share& a, const Share& b) { return a.index < b.index; };
  if (!std::is_sorted(shares.begin(), shares.end(), is_before)) std::sort(shares.begin(), shares.end(), is_before);
}

}  // namespace

SceneChange::SceneChange(const LightMesh& before, const LightMesh& after)
    : elements_per_slot_(after.elements_per_slot()),
      face_before_(after.faces().faces.size(), -1),
      face_after_(before.faces().faces.size(), -1),
      slot_before_(static_cast<std::size_t>(after.slot_count()), -1),
      slot_after_(static_cast<std::size_t>(before.slot_count()), -1) {
  const Faces &old_faces = before.faces(), &new_faces = after.faces();
  if (old_faces.origin == new_faces.origin && old_faces.extent == new_faces.extent &&
      before.elements_per_slot() == after.elements_per_slot()) {
    match_faces(before, after);
    match_clusters(before, after);
    match_slots(before, after);
  }
  is_none_ = face_before_.size() == face_after_.size() && slot_before_.size() == slot_after_.size();
  for (std::size_t f = 0; f < face_before_.size() && is_none_; ++f) is_none_ = face_before_[f] == static_cast<int>(f);
  for (std::size_t s = 0; s < slot_before_.size() && is_none_; ++s) is_none_ = slot_before_[s] == static_cast<int>(s);
  std::vector<Box> boxes;
  const auto add_changed = [&](const Faces& faces, const std::vector<int>& counterpart) {
    const float margin = kBoxMargin * faces.ray_offset();
    for (std::size_t f = 0; f < counterpart.size(); ++f) {
      if (counterpart[f] >= 0) continue;
      const Face& face = faces.faces[f];
      Box box{face.corner[0], face.corner[0]};
      for (const glm::vec3& corner : face.corners()) {
        box.low = glm::min(box.low, corner);
        box.high = glm::max(box.high, corner);
      }
      boxes.push_back({box.low - margin, box.high + margin});
    }
  };
  add_changed(old_faces, face_after_);
  add_changed(new_faces, face_before_);
  enclose(std::move(boxes));
}

// Faces in the same place, first to first where there are several. What has been seen through an opening is known to
// be so and can be asked for again when it is closed; what a wall has hidden is not, when it is opened.
void SceneChange::match_faces(const LightMesh& before, const LightMesh& after) {
  const std::vector<Face>&old_faces = before.faces().faces, &new_faces = after.faces().faces;
  std::vector<std::pair<std::uint64_t, int>> by_place;
  for (std::size_t f = 0; f < old_faces.size(); ++f)
    by_place.push_back({place_hash(old_faces[f]), static_cast<int>(f)});
  std::sort(by_place.begin(), by_place.end());
  for (std::size_t f = 0; f < new_faces.size(); ++f) {
    const std::uint64_t hash = place_hash(new_faces[f]);
    for (auto entry = std::lower_bound(by_place.begin(), by_place.end(), std::pair{hash, -1});
         entry != by_place.end() && entry->first == hash; ++entry) {
      const auto other = static_cast<std::size_t>(entry->second);
      if (face_after_[other] >= 0 || !is_same_place(old_faces[other], new_faces[f]) ||
          (!old_faces[other].is_opening && new_faces[f].is_opening) ||
          is_solid(before.faces(), other) != is_solid(after.faces(), f) ||
          before.grid(entry->second) != after.grid(static_cast<int>(f)))
        continue;
      face_before_[f] = entry->second;
      face_after_[other] = static_cast<int>(f);
      break;
    }
  }
}

// A cluster stays if it is of the same sides, in the same order. Else none of its faces does, and then neither do the
// clusters that these are in with their other sides.
void SceneChange::match_clusters(const LightMesh& before, const LightMesh& after) {
  const auto counterpart = [&](const LightMesh& mesh, const std::vector<int>& face_there, const LightMesh& there,
                               int cluster) {
    const std::span<const int> sides = mesh.clusters().sides(cluster);
    const int first = face_there[static_cast<std::size_t>(sides[0] / 2)];
    const int other = first < 0 ? -1 : there.clusters().cluster_of(first, sides[0] % 2);
    if (other < 0) return false;
    return std::equal(sides.begin(), sides.end(), there.clusters().sides(other).begin(),
                      there.clusters().sides(other).end(), [&](int a, int b) {
                        const int face = face_there[static_cast<std::size_t>(a / 2)];
                        return face >= 0 && 2 * face + a % 2 == b;
                      });
  };
  const auto drop_changed = [&](const LightMesh& mesh, std::vector<int>& face_there, const LightMesh& there,
                                std::vector<int>& face_back) {
    bool any = false;
    for (int c = 0; c < mesh.clusters().count(); ++c) {
      if (counterpart(mesh, face_there, there, c)) continue;
      for (const int side : mesh.clusters().sides(c)) {
        int& other = face_there[static_cast<std::size_t>(side / 2)];
        if (other < 0) continue;
        face_back[static_cast<std::size_t>(other)] = -1;
        other = -1;
        any = true;
      }
    }
    return any;
  };
  for (bool any = true; any;) {
    any = drop_changed(before, face_after_, after, face_before_);
    any |= drop_changed(after, face_before_, before, face_after_);
  }
}

void SceneChange::match_slots(const LightMesh& before, const LightMesh& after) {
  for (int slot = 0; slot < after.slot_count(); ++slot) {
    const Slot own = after.slot(slot);
    const int face = face_before(own.face);
    if (face < 0) continue;
    const int other = before.slot_index(face, own.side, own.cell);
    slot_before_[static_cast<std::size_t>(slot)] = other;
    slot_after_[static_cast<std::size_t>(other)] = slot;
  }
}

std::vector<Share> SceneChange::renumbered(std::vector<Share> slots) const {
  std::erase_if(slots, [&](Share& share) { return (share.index = slot_after(share.index)) < 0; });
  sort_by_index(slots);
  return slots;
}

std::vector<Share> SceneChange::renumbered_elements(std::vector<Share> elements) const {
  std::erase_if(elements, [&](Share& share) {
    const int slot = slot_after(share.index / elements_per_slot_);
    share.index = slot * elements_per_slot_ + share.index % elements_per_slot_;
    return slot < 0;
  });
  sort_by_index(elements);
  return elements;
}

// Few boxes around many: the largest is divided at the middle of its longest axis as long as there may be more.
void SceneChange::enclose(std::vector<Box> boxes) {
  for (int axis = 0; axis < 3; ++axis) {
    low_[axis].fill(Ray::kInfinity);
    high_[axis].fill(-Ray::kInfinity);
  }
  if (boxes.empty()) return;
  const auto around = [](std::span<const Box> some) {
    Box all = some[0];
    for (const Box& box : some) {
      all.low = glm::min(all.low, box.low);
      all.high = glm::max(all.high, box.high);
    }
    return all;
  };
  const auto longest_axis = [](const Box& box) {
    const glm::vec3 size = box.high - box.low;
    return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  };
  struct Group {
    std::size_t first, last;
    Box box;
    float area() const {
      const glm::vec3 size = box.high - box.low;
      return last - first < 2 ? 0 : size.x * size.y + size.y * size.z + size.z * size.x;
    }
  };
  all_ = around(boxes);
  std::vector<Group> groups{{0, boxes.size(), all_}};
  while (groups.size() < kBoxes) {
    const auto largest = std::max_element(groups.begin(), groups.end(),
                                          [](const Group& a, const Group& b) { return a.area() < b.area(); });
    if (!(largest->area() > 0)) break;
    const auto [first, last, box] = *largest;
    const int axis = longest_axis(box);
    const auto at = [&](std::size_t k) { return boxes.begin() + static_cast<std::ptrdiff_t>(k); };
    const float half = 0.5f * (box.low[axis] + box.high[axis]);
    auto middle =
        std::partition(at(first), at(last), [&](const Box& b) { return 0.5f * (b.low[axis] + b.high[axis]) < half; });
    if (middle == at(first) || middle == at(last)) middle = at((first + last) / 2);
    const auto between = static_cast<std::size_t>(middle - boxes.begin());
    *largest = {first, between, around({boxes.data() + first, between - first})};
    groups.push_back({between, last, around({boxes.data() + between, last - between})});
  }
  std::vector<Box> parts;
  for (const Group& group : groups) {
    for (int axis = 0; axis < 3; ++axis) {
      low_[axis][parts.size()] = group.box.low[axis];
      high_[axis][parts.size()] = group.box.high[axis];
    }
    parts.push_back(group.box);
  }

  // Spheres around the boxes, the largest of which are halved.
  const auto radius = [](const Box& box) { return 0.5f * glm::length(box.high - box.low); };
  while (parts.size() < kSpheres) {
    const auto largest =
        std::max_element(parts.begin(), parts.end(), [&](const Box& a, const Box& b) { return radius(a) < radius(b); });
    const int axis = longest_axis(*largest);
    Box upper = *largest;
    upper.low[axis] = largest->high[axis] = 0.5f * (largest->low[axis] + largest->high[axis]);
    parts.push_back(upper);
  }
  for (const Box& part : parts) spheres_.push_back({0.5f * (part.low + part.high), radius(part)});
  around_all_ = {0.5f * (all_.low + all_.high), radius(all_)};
}

bool SceneChange::may_meet(const Ray& ray) const {
  glm::vec3 inverse;
  for (int axis = 0; axis < 3; ++axis) {
    const float d = ray.direction[axis];
    inverse[axis] = 1 / (std::abs(d) < kLeastComponent ? std::copysign(kLeastComponent, d) : d);
  }
  const glm::vec3 a = (all_.low - ray.origin) * inverse, b = (all_.high - ray.origin) * inverse;
  const glm::vec3 first = glm::min(a, b), last = glm::max(a, b);
  if (!(std::max({first.x, first.y, first.z, ray.t_near}) <= std::min({last.x, last.y, last.z, ray.t_far})))
    return false;
  std::array<float, kBoxes> from, to;
  from.fill(ray.t_near);
  to.fill(ray.t_far);
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t k = 0; k < kBoxes; ++k) {
      const float at_low = (low_[axis][k] - ray.origin[axis]) * inverse[axis],
                  at_high = (high_[axis][k] - ray.origin[axis]) * inverse[axis];
      from[k] = std::max(from[k], std::min(at_low, at_high));
      to[k] = std::min(to[k], std::max(at_low, at_high));
    }
  bool any = false;
  for (std::size_t k = 0; k < kBoxes; ++k) any |= from[k] <= to[k] && low_[0][k] <= high_[0][k];
  return any;
}

bool SceneChange::may_meet(glm::vec3 from, glm::vec3 to, float radius) const {
  const glm::vec3 along = to - from;
  const float length2 = std::max(glm::dot(along, along), std::numeric_limits<float>::min());
  const auto meets = [&](const Sphere& sphere) {
    const glm::vec3 to_middle = sphere.middle - from;
    const glm::vec3 nearest = std::clamp(glm::dot(to_middle, along) / length2, 0.f, 1.f) * along - to_middle;
    const float reach = sphere.radius + radius;
    return glm::dot(nearest, nearest) <= reach * reach;
  };
  return !spheres_.empty() && meets(around_all_) && std::any_of(spheres_.begin(), spheres_.end(), meets);
}

bool SceneChange::may_meet(const Node& place, float radius, const HemisphereCells& cells,
                           std::vector<char>& of_cell) const {
  of_cell.assign(static_cast<std::size_t>(cells.count()), 0);
  const glm::mat3 to_local = glm::transpose(frame_from_normal(place.normal));
  bool any = false;
  for (const Sphere& sphere : spheres_) {
    const glm::vec3 to_middle = to_local * (sphere.middle - place.position);
    const float reach = sphere.radius + radius, distance = glm::length(to_middle);
    if (to_middle.z < -reach) continue;
    if (distance <= reach || cells.count() == 1) {
      std::fill(of_cell.begin(), of_cell.end(), 1);
      return true;
    }
    const glm::vec3 direction = to_middle / distance;
    const float sine = reach / distance, cosine = std::sqrt(std::max(0.f, 1 - sine * sine));
    for (std::size_t c = 0; c < of_cell.size(); ++c) {
      // Cosine of the sum of both half angles.
      const float limit = cells.cos_angle_[c] * cosine - cells.sin_angle_[c] * sine;
      of_cell[c] |= static_cast<char>(glm::dot(cells.axis_[c], direction) >= limit);
    }
  }
  for (const char met : of_cell) any |= met != 0;
  return any;
}

bool SceneChange::may_meet(glm::vec3 place, float radius, const glm::vec3 (&triangle)[3]) const {
  if (spheres_.empty()) return false;
  const glm::dvec3 a(triangle[0] - place), b(triangle[1] - place), c(triangle[2] - place);
  // Planes through the place and the edges, with the triangle in front of them.
  std::array<glm::dvec3, 3> inward{glm::cross(a, b), glm::cross(b, c), glm::cross(c, a)};
  const double volume = glm::dot(inward[0], c);
  for (glm::dvec3& normal : inward) {
    const double length = glm::length(normal);
    if (!(length > 0) || volume == 0) return true;
    normal *= (volume < 0 ? -1 : 1) / length;
  }
  // Distance to the triangle, or less: that to its plane.
  glm::dvec3 across = glm::normalize(glm::cross(b - a, c - a));
  if (glm::dot(a, across) < 0) across = -across;
  const double nearest = glm::dot(a, across) - radius;
  if (radius > 0 && !(nearest > 0)) return true;
  const auto meets = [&](const Sphere& sphere) {
    const glm::dvec3 to_middle(sphere.middle - place);
    const double distance = glm::length(to_middle);
    double reach = sphere.radius + radius + kShaftMargin * distance;
    // A ray from beside the place is away by the radius at most as far as the triangle, and beyond in proportion.
    if (radius > 0) reach += radius * std::max(0.0, (distance + reach) / nearest - 1);
    return glm::dot(to_middle, across) >= -reach &&
           std::all_of(inward.begin(), inward.end(), [&](glm::dvec3 n) { return glm::dot(to_middle, n) >= -reach; });
  };
  return meets(around_all_) && std::any_of(spheres_.begin(), spheres_.end(), meets);
}

HemisphereCells::HemisphereCells(int bits) : bits_(bits) {
  const float step = 1 / static_cast<float>(per_axis());
  for (int j = 0; j < per_axis(); ++j)
    for (int i = 0; i < per_axis(); ++i) {
      const auto at = [&](float x, float y) {
        const glm::vec2 u = step * (glm::vec2(i, j) + glm::vec2(x, y));
        return sample_cosine_hemisphere(u);
      };
      const glm::vec3 axis = at(0.5f, 0.5f);
      float angle = 0;
      for (int k = 0; k <= kEdgeSteps; ++k) {
        const float along = static_cast<float>(k) / kEdgeSteps;
        for (const glm::vec3 direction : {at(along, 0), at(along, 1), at(0, along), at(1, along)})
          angle = std::max(angle, std::acos(std::clamp(glm::dot(axis, direction), -1.f, 1.f)));
      }
      angle += kAngleMargin;
      axis_.push_back(axis);
      cos_angle_.push_back(std::cos(angle));
      sin_angle_.push_back(std::sin(angle));
    }
}

const HemisphereCells& HemisphereCells::of(int bits) {
  static const std::array<HemisphereCells, kMostBits + 1> cells{HemisphereCells(0), HemisphereCells(1),
                                                                HemisphereCells(2), HemisphereCells(3)};
  return cells[static_cast<std::size_t>(std::clamp(bits, 0, kMostBits))];
}

}  // namespace transom
