#include "transom/face_clusters.h"

#include <algorithm>
#include <unordered_set>

#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kSmallEdge = 0.5f;    // of the longest edge of patches
constexpr double kBearableFaces = 2;  // for each patch wanted
constexpr float kCubeGrowth = 1.25f;
constexpr std::uint64_t kCubesPerAxis = 1u << 12;  // at most

glm::vec3 normal_of(const Faces& faces, int side) {
  const glm::vec3 n = faces.faces[side / 2].normal;
  return side % 2 == 0 ? n : -n;
}

glm::vec3 middle_of(const Face& face) {
  return face.position(face.is_quad ? glm::vec2(0.5f) : glm::vec2(1.f / 3));
}

float longest_edge(const Face& face) {
  const int count = face.is_quad ? 4 : 3;
  float longest = 0;
  for (int k = 0; k < count; ++k)
    longest = std::max(longest, glm::length(face.corner[(k + 1) % count] - face.corner[k]));
  return longest;
}

// Spreads ten bits so that two zeros follow each.
std::uint64_t spread_bits(std::uint64_t x) {
  x = (x | (x << 16)) & 0x30000ff;
  x = (x | (x << 8)) & 0x300f00f;
  x = (x | (x << 4)) & 0x30c30c3;
  return (x | (x << 2)) & 0x9249249;
}

// Cubes of one size laid over the scene.
struct Cubes {
  const std::vector<char>& is_indoors;
  glm::vec3 low;
  float edge;

  // Which cluster a side belongs to.
  std::uint64_t key(const Faces& faces, int side) const {
    const Face& face = faces.faces[side / 2];
    const glm::vec3 place = (middle_of(face) - low) / edge;
    std::uint64_t key = static_cast<std::uint64_t>(face.material) * 2 + faces.is_inside_solid(side / 2, side % 2);
    key = key * 2 + static_cast<std::uint64_t>(is_indoors[side / 2] >> side % 2 & 1);
    key = key * 6 + static_cast<std::uint64_t>(main_direction(normal_of(faces, side)));
    for (int axis = 0; axis < 3; ++axis)
      key = key * kCubesPerAxis + std::min(kCubesPerAxis - 1, static_cast<std::uint64_t>(std::max(0.f, place[axis])));
    return key;
  }

  // Place within the cube, along Morton's curve.
  std::uint64_t order(const Faces& faces, int side) const {
    const glm::vec3 place = (middle_of(faces.faces[side / 2]) - low) / edge;
    const glm::vec3 local = glm::clamp((place - glm::floor(place)) * 1024.f, 0.f, 1023.f);
    return spread_bits(static_cast<std::uint64_t>(local.x)) | spread_bits(static_cast<std::uint64_t>(local.y)) << 1 |
           spread_bits(static_cast<std::uint64_t>(local.z)) << 2;
  }
};

}  // namespace

FaceClusters::FaceClusters(const Faces& faces, const std::vector<char>& is_small, const std::vector<char>& is_indoors,
                           float cube_m, int largest_count, int elements)
    : per_cluster_(elements) {
  find_clusters(faces, is_small, is_indoors, cube_m, largest_count);
  if (sides_.empty()) return;
  element_of_side_.assign(2 * faces.faces.size(), 0);
  area_.resize(static_cast<std::size_t>(count()));
  elements_.resize(static_cast<std::size_t>(count()) * per_cluster_);
  element_begin_.assign(elements_.size() + 1, sides_.size());
  // Sums begin anew with each cluster, so that they do not depend on the others.
  area_up_to_.resize(sides_.size());
  for (int c = 0; c < count(); ++c)
    for (std::size_t i = begin_[c]; i < begin_[c + 1]; ++i)
      area_up_to_[i] = area_before(i, begin_[c]) + faces.faces[sides_[i] / 2].area;
  parallel_indices(static_cast<std::size_t>(count()), 16,
                   [&](std::size_t c) { find_elements(faces, static_cast<int>(c)); });
}

void FaceClusters::find_clusters(const Faces& faces, const std::vector<char>& is_small,
                                 const std::vector<char>& is_indoors, float cube_m, int largest_count) {
  for (std::size_t f = 0; f < is_small.size(); ++f)
    if (is_small[f]) sides_.insert(sides_.end(), {static_cast<int>(2 * f), static_cast<int>(2 * f + 1)});
  if (sides_.empty()) return;
  const float least = faces.extent / static_cast<float>(kCubesPerAxis);
  Cubes cubes{is_indoors, glm::vec3(-0.5f * faces.extent), std::max(cube_m, least)};
  std::unordered_set<std::uint64_t> keys;
  for (;; cubes.edge *= kCubeGrowth) {
    keys.clear();
    for (const int side : sides_) {
      keys.insert(cubes.key(faces, side));
      if (keys.size() > static_cast<std::size_t>(largest_count)) break;
    }
    if (keys.size() <= static_cast<std::size_t>(largest_count) || cubes.edge > 2 * faces.extent) break;
  }
  struct Place {
    std::uint64_t key, order;
    int side;
    auto operator<=>(const Place&) const = default;
  };
  std::vector<Place> places(sides_.size());
  parallel_indices(places.size(), 1024, [&](std::size_t i) {
    places[i] = {cubes.key(faces, sides_[i]), cubes.order(faces, sides_[i]), sides_[i]};
  });
  std::sort(places.begin(), places.end());
  cluster_of_side_.assign(2 * faces.faces.size(), -1);
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i > 0 && places[i].key != places[i - 1].key) begin_.push_back(i);
    sides_[i] = places[i].side;
    cluster_of_side_[sides_[i]] = static_cast<int>(begin_.size()) - 1;
  }
  begin_.push_back(sides_.size());
}

// Parts of about equal area along the curve. A part's point is the middle of the face nearest to the middle of all.
void FaceClusters::find_elements(const Faces& faces, int cluster) {
  const std::size_t first = begin_[cluster], last = begin_[cluster + 1];
  const double all = area_up_to_[last - 1];
  area_[cluster] = static_cast<float>(all);
  const auto part_of = [&](std::size_t i) {
    const double middle = 0.5 * (area_before(i, first) + area_up_to_[i]);
    return std::clamp(static_cast<int>(middle / all * per_cluster_), 0, per_cluster_ - 1);
  };
  std::size_t end = first;
  for (int part = 0; part < per_cluster_; ++part) {
    const std::size_t begin = end;
    element_begin_[cluster * per_cluster_ + part] = begin;
    ClusterElement& element = elements_[cluster * per_cluster_ + part];
    glm::vec3 centroid(0), normal(0);
    for (; end < last && part_of(end) == part; ++end) {
      const Face& face = faces.faces[sides_[end] / 2];
      centroid += face.area * middle_of(face);
      normal += face.area * normal_of(faces, sides_[end]);
      element.area += face.area;
      element_of_side_[sides_[end]] = static_cast<std::uint8_t>(part);
    }
    if (begin == end) continue;
    centroid /= element.area;
    const auto distance = [&](int side) { return glm::length(middle_of(faces.faces[side / 2]) - centroid); };
    const int nearest = *std::min_element(&sides_[begin], &sides_[begin] + (end - begin),
                                          [&](int a, int b) { return distance(a) < distance(b); });
    element.middle = middle_of(faces.faces[nearest / 2]) + faces.ray_offset() * normal_of(faces, nearest);
    element.normal = glm::length(normal) > 0 ? glm::normalize(normal) : normal_of(faces, nearest);
  }
}

int FaceClusters::sample_between(int cluster, std::size_t first, std::size_t last, float& u) const {
  const std::size_t begin = begin_[cluster];
  const double before = area_before(first, begin), wanted = before + u * (area_up_to_[last - 1] - before);
  const auto sampled = std::upper_bound(area_up_to_.begin() + static_cast<std::ptrdiff_t>(first),
                                        area_up_to_.begin() + static_cast<std::ptrdiff_t>(last) - 1, wanted);
  const auto i = static_cast<std::size_t>(sampled - area_up_to_.begin());
  const double start = area_before(i, begin), own = area_up_to_[i] - start;
  u = static_cast<float>(std::clamp((wanted - start) / own, 0.0, 0.9999999));
  return sides_[i];
}

int FaceClusters::sample_side(int cluster, float& u) const {
  return sample_between(cluster, begin_[cluster], begin_[cluster + 1], u);
}

int FaceClusters::sample_side(int cluster, int element, float& u) const {
  const std::size_t first = element_begin_[cluster * per_cluster_ + element];
  return sample_between(cluster, first, element_begin_[cluster * per_cluster_ + element + 1], u);
}

std::vector<char> find_small_faces(const Faces& faces, const std::vector<Material>& materials,
                                   const std::vector<float>& edges, int target_patch_count) {
  std::vector<char> is_small(faces.faces.size(), 0);
  if (static_cast<double>(faces.faces.size()) <= kBearableFaces * target_patch_count) return is_small;
  for (std::size_t f = 0; f < is_small.size(); ++f)
    is_small[f] =
        materials[faces.faces[f].material].opening < 0 && longest_edge(faces.faces[f]) < kSmallEdge * edges[f];
  return is_small;
}

}  // namespace transom
