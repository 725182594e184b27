// Midpoints: how light bends between nodes.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "transom/node_field.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kSameLine = 3e-6f;  // of the parameters of a face: what rounding makes of one line at most

// Lengths of a border from its end to the next node beyond: of parts half as long, and twice, where one of them is at
// the edge of the face and its nodes stand back from there.
constexpr float kNearest = 0.4f, kFarthest = 2.4f;

constexpr float kAlike = 3;         // ratio of slopes up to which light is smooth
constexpr float kStraight = 0.02f;  // of the light: bends that are none

// Whether light goes on over three nodes as it begins, but for what is not seen.
bool is_smooth(const LightAtNodes& light, std::array<int, 3> node, std::array<float, 3> at) {
  const auto [a, b, c] = std::array{light.irradiance[node[0]], light.irradiance[node[1]], light.irradiance[node[2]]};
  const float slope = (b - a) / (at[1] - at[0]), slope_beyond = (c - b) / (at[2] - at[1]);
  const float bend = std::abs(slope_beyond - slope) * std::abs(at[1] - at[0]);
  if (bend <= kStraight * std::max({a, b, light.dark})) return true;
  const auto [least, most] = std::minmax({std::abs(slope), std::abs(slope_beyond)});
  return slope * slope_beyond > 0 && most < kAlike * least;
}

}  // namespace

// The border of a part between two of its corners, the first of which comes first along the axis.
struct NodeField::Border {
  int first, last;  // nodes
  int axis;         // of the parameters of the face
  float middle;     // parameter

  bool is_point() const { return first == last; }  // of a thin part
  bool operator<(const Border& other) const { return std::pair(first, last) < std::pair(other.first, other.last); }
  bool operator==(const Border& other) const { return first == other.first && last == other.last; }
};

// Nodes in the order in which they follow each other along lines of each axis on their surfaces.
class NodeField::Lines {
 public:
  Lines(const NodeField& field, const std::vector<std::size_t>& nodes)
      : lines_{lines_along(field, nodes, 0), lines_along(field, nodes, 1)} {}

  // The line of a node, and where on it the node is.
  std::span<const int> of(int node, int axis) const {
    const Order& lines = lines_[axis];
    const std::size_t line = lines.line_of_node[node];
    return {&lines.node[lines.begin[line]], lines.begin[line + 1] - lines.begin[line]};
  }
  std::ptrdiff_t position(int node, int axis) const { return lines_[axis].position_of_node[node]; }

 private:
  struct Order {
    std::vector<int> node;
    std::vector<std::size_t> begin;  // by line, in `node`
    std::vector<std::size_t> line_of_node;
    std::vector<std::ptrdiff_t> position_of_node;  // on its line
  };
  static Order lines_along(const NodeField& field, const std::vector<std::size_t>& nodes, int axis);

  Order lines_[2];
};

NodeField::Lines::Order NodeField::Lines::lines_along(const NodeField& field, const std::vector<std::size_t>& nodes,
                                                      int axis) {
  const auto along = [&](int node) { return field.parameters_of_node_[node][axis]; };
  const auto across = [&](int node) { return field.parameters_of_node_[node][1 - axis]; };
  const auto surface = [&](int node) { return field.surface_of_node_[node]; };
  Order lines;
  lines.node.assign(nodes.begin(), nodes.end());
  std::sort(lines.node.begin(), lines.node.end(),
            [&](int a, int b) { return std::pair(surface(a), across(a)) < std::pair(surface(b), across(b)); });
  lines.line_of_node.resize(field.nodes_.size());
  lines.position_of_node.resize(field.nodes_.size());
  for (auto begin = lines.node.begin(); begin != lines.node.end();) {
    auto end = begin + 1;
    while (end != lines.node.end() && surface(*end) == surface(*begin) && across(*end) - across(end[-1]) < kSameLine)
      ++end;
    std::sort(begin, end, [&](int a, int b) { return along(a) < along(b); });
    for (auto node = begin; node != end; ++node) {
      lines.line_of_node[*node] = lines.begin.size();
      lines.position_of_node[*node] = node - begin;
    }
    lines.begin.push_back(static_cast<std::size_t>(begin - lines.node.begin()));
    begin = end;
  }
  lines.begin.push_back(lines.node.size());
  return lines;
}

std::array<NodeField::Border, 4> NodeField::borders(const Part& part) const {
  const auto& corner = part.corner_node;
  const glm::vec2 middle = part.corner + 0.5f * (part.u + part.v);
  return {Border{corner[0], corner[1], 0, middle.x}, Border{corner[1], corner[2], 1, middle.y},
          Border{corner[3], corner[2], 0, middle.x}, Border{corner[0], corner[3], 1, middle.y}};
}

bool NodeField::is_open_between(int a, int b) const {
  const glm::vec3 from = nodes_[a].position;
  const Ray ray{from, nodes_[b].position - from, 0, 1};
  std::uint8_t is_blocked;
  rays_.occluded(RayScene::What::kOpaque, {&ray, 1}, {&is_blocked, 1});
  return !is_blocked;
}

// The middle of a border: a node that is there, or weights of nodes along it.
std::vector<Share> NodeField::midway(const Border& border, const Lines& lines,
                                     std::span<const LightAtNodes> lights) const {
  const std::span<const int> line = lines.of(border.first, border.axis);
  const auto at = [&](std::ptrdiff_t i) { return parameters_of_node_[line[i]][border.axis]; };
  const std::ptrdiff_t first = lines.position(border.first, border.axis),
                       last = lines.position(border.last, border.axis),
                       count = static_cast<std::ptrdiff_t>(line.size());
  for (std::ptrdiff_t i = first + 1; i < last; ++i)
    if (std::abs(at(i) - border.middle) < kSameLine) return {{line[i], 1.f}};
  const float length = at(last) - at(first);
  // Where the next node is beyond an end, seen from the other one; -1: none that light goes on to.
  const auto beyond = [&](std::ptrdiff_t other_end, std::ptrdiff_t end) -> std::ptrdiff_t {
    const std::ptrdiff_t step = end > other_end ? 1 : -1;
    const auto distance = [&](std::ptrdiff_t i) { return std::abs(at(i) - at(end)); };
    std::ptrdiff_t i = end + step;
    while (i >= 0 && i < count && distance(i) < kNearest * length) i += step;
    if (i < 0 || i >= count || distance(i) > kFarthest * length) return -1;
    const bool goes_on = std::all_of(lights.begin(), lights.end(), [&](const LightAtNodes& light) {
      return is_smooth(light, {line[other_end], line[end], line[i]}, {at(other_end), at(end), at(i)});
    });
    return goes_on && is_open_between(line[end], line[i]) ? i : -1;
  };
  std::vector<std::ptrdiff_t> used;
  if (const std::ptrdiff_t before = beyond(last, first); before >= 0) used.push_back(before);
  used.insert(used.end(), {first, last});
  if (const std::ptrdiff_t after = beyond(first, last); after >= 0) used.push_back(after);
  std::vector<Share> row;
  for (const std::ptrdiff_t i : used) {
    float weight = 1;  // of the polynomial through all of them [Lagrange]
    for (const std::ptrdiff_t k : used)
      if (k != i) weight *= (border.middle - at(k)) / (at(i) - at(k));
    row.push_back({line[i], weight});
  }
  return row;
}

// The middle of a part from those of its borders: along each axis between the two that face each other, less what the
// corners have been counted twice.
std::vector<Share> NodeField::blended(const Part& part, const std::array<std::span<const Share>, 4>& borders) const {
  const glm::vec2 span = part.high - part.low;
  glm::vec2 middle(0.5f);  // between the corner nodes
  for (int axis = 0; axis < 2; ++axis)
    if (span[axis] > 0) middle[axis] = (0.5f - part.low[axis]) / span[axis];
  const float across[4]{1 - middle.y, middle.x, middle.y, 1 - middle.x};  // weights of the borders
  std::vector<Share> row;
  for (std::size_t k = 0; k < 4; ++k) {
    for (const Share& share : borders[k]) row.push_back({share.index, across[k] * share.weight});
    row.push_back({part.corner_node[k], -across[k] * across[(k + 3) % 4]});
  }
  merge_shares(row);
  return row;
}

void NodeField::find_midpoints(const std::vector<std::size_t>& shown, std::span<const LightAtNodes> lights) {
  std::vector<int> whole;
  std::vector<Border> borders;
  for (int p = 0; p < part_count(); ++p) {
    const Part& part = parts_[p];
    if (part.first_child >= 0 || part.is_split || !is_quad(part)) continue;
    whole.push_back(p);
    for (const Border& border : this->borders(part))
      if (!border.is_point()) borders.push_back(border);
  }
  std::sort(borders.begin(), borders.end());
  borders.erase(std::unique(borders.begin(), borders.end()), borders.end());
  const Lines lines(*this, shown);
  std::vector<std::vector<Share>> rows(borders.size());
  parallel_indices(borders.size(), 64, [&](std::size_t b) { rows[b] = midway(borders[b], lines, lights); });
  std::vector<std::vector<Share>> midpoints;
  // The number of a midpoint, or of the node that it is.
  const auto add = [&](std::vector<Share> row) {
    if (row.size() == 1) return row[0].index;
    midpoints.push_back(std::move(row));
    return static_cast<int>(nodes_.size() + midpoints.size()) - 1;
  };
  std::vector<int> number_of_border;
  for (const std::vector<Share>& row : rows) number_of_border.push_back(add(row));
  for (const int p : whole) {
    Part& part = parts_[p];
    const std::array<Border, 4> own = this->borders(part);
    std::array<Share, 4> point;  // what the middle of a border without length is
    std::array<std::span<const Share>, 4> row;
    for (std::size_t k = 0; k < 4; ++k) {
      if (own[k].is_point()) {
        point[k] = {own[k].first, 1};
        row[k] = {&point[k], 1};
        part.between[k] = own[k].first;
        continue;
      }
      const auto border = std::lower_bound(borders.begin(), borders.end(), own[k]) - borders.begin();
      row[k] = rows[border];
      part.between[k] = number_of_border[border];
    }
    part.centre = part.middle_node >= 0 ? part.middle_node : add(blended(part, row));
  }
  midpoints_ = ExactRows(SparseRows::of(midpoints));
}

// The corner next to the point, the middles of its two borders and that of the part.
NodeShares NodeField::between_midpoints(const Part& part, glm::vec2 own) const {
  const bool is_right = own.x > 0.5f, is_above = own.y > 0.5f;
  // From the middle, 0, to the corner node, 1.
  const auto outwards = [](float x, float corner) { return corner == 0.5f ? 0.f : (x - 0.5f) / (corner - 0.5f); };
  const float x = outwards(own.x, is_right ? part.high.x : part.low.x),
              y = outwards(own.y, is_above ? part.high.y : part.low.y);
  NodeShares shares;
  shares.count = 4;
  shares.node = {part.centre, part.between[is_right ? 1 : 3],
                 part.corner_node[is_above ? (is_right ? 2 : 3) : (is_right ? 1 : 0)], part.between[is_above ? 2 : 0]};
  shares.weight = {(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y};
  return shares;
}

}  // namespace transom
