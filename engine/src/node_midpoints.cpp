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
constexpr float kNearest = 0.4f, kFarthest = 2.1f;  // lengths of a border beyond its ends at which a node goes with it
constexpr float kAlike = 3;                         // ratio of slopes up to which light is smooth
constexpr float kStraight = 0.02f;                  // of the light: bends that are none

}  // namespace

// The border of a part between two of its corners, the first of which comes first along the axis.
struct NodeField::Border {
  int first, last;  // nodes
  int axis;         // of the parameters of the face
  float middle;     // parameter

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
  std::ptrdiff_t place(int node, int axis) const {
    const Order& lines = lines_[axis];
    return lines.place_of_node[node] - static_cast<std::ptrdiff_t>(lines.begin[lines.line_of_node[node]]);
  }

 private:
  struct Order {
    std::vector<int> node;
    std::vector<std::size_t> begin;  // by line, in `node`
    std::vector<std::size_t> line_of_node;
    std::vector<std::ptrdiff_t> place_of_node;  // in `node`
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
  lines.place_of_node.resize(field.nodes_.size());
  for (auto begin = lines.node.begin(); begin != lines.node.end();) {
    auto end = begin + 1;
    while (end != lines.node.end() && surface(*end) == surface(*begin) && across(*end) - across(end[-1]) < kSameLine)
      ++end;
    std::sort(begin, end, [&](int a, int b) { return along(a) < along(b); });
    for (auto node = begin; node != end; ++node) {
      lines.line_of_node[*node] = lines.begin.size();
      lines.place_of_node[*node] = node - lines.node.begin();
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
                                     const std::vector<std::vector<float>>& lights) const {
  const std::span<const int> line = lines.of(border.first, border.axis);
  const auto at = [&](std::ptrdiff_t place) { return parameters_of_node_[line[place]][border.axis]; };
  const std::ptrdiff_t first = lines.place(border.first, border.axis), last = lines.place(border.last, border.axis),
                       count = static_cast<std::ptrdiff_t>(line.size());
  for (std::ptrdiff_t place = first + 1; place < last; ++place)
    if (std::abs(at(place) - border.middle) < kSameLine) return {{line[place], 1.f}};
  const float length = at(last) - at(first);
  // The next node beyond an end, unless light bends sharply there under one of the lights.
  const auto beyond = [&](std::ptrdiff_t end, std::ptrdiff_t step) -> std::ptrdiff_t {
    std::ptrdiff_t place = end + step;
    const auto distance = [&] { return std::abs(at(place) - at(end)); };
    while (place >= 0 && place < count && distance() < kNearest * length) place += step;
    if (place < 0 || place >= count || distance() > kFarthest * length || !is_open_between(line[end], line[place]))
      return -1;
    const bool is_smooth = std::all_of(lights.begin(), lights.end(), [&](const std::vector<float>& light) {
      const float a = light[line[first]], b = light[line[last]];
      const float slope = (b - a) / length,
                  slope_beyond = (light[line[place]] - light[line[end]]) / (at(place) - at(end));
      const float least = std::min(std::abs(slope), std::abs(slope_beyond)),
                  most = std::max(std::abs(slope), std::abs(slope_beyond));
      return std::abs(slope - slope_beyond) * length < kStraight * std::max(a, b) ||
             (slope * slope_beyond > 0 && most < kAlike * least);
    });
    return is_smooth ? place : -1;
  };
  std::ptrdiff_t places[4];
  int used = 0;
  if (const std::ptrdiff_t before = beyond(first, -1); before >= 0) places[used++] = before;
  places[used++] = first;
  places[used++] = last;
  if (const std::ptrdiff_t after = beyond(last, 1); after >= 0) places[used++] = after;
  std::vector<Share> row;
  for (int i = 0; i < used; ++i) {
    float weight = 1;  // of the polynomial through all of them [Lagrange]
    for (int j = 0; j < used; ++j)
      if (j != i) weight *= (border.middle - at(places[j])) / (at(places[i]) - at(places[j]));
    row.push_back({line[places[i]], weight});
  }
  return row;
}

// The middle of a part from those of its borders: along each axis between the two that face each other, less what the
// corners have been counted twice.
std::vector<Share> NodeField::blended(const Part& part, const std::array<std::vector<Share>, 4>& borders) const {
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

void NodeField::find_midpoints(const std::vector<std::vector<float>>& lights) {
  std::vector<int> whole;
  std::vector<Border> borders;
  for (int p = 0; p < part_count(); ++p) {
    const Part& part = parts_[p];
    if (part.first_child >= 0 || part.is_split || !is_quad(part)) continue;
    whole.push_back(p);
    for (const Border& border : this->borders(part))
      if (border.first != border.last) borders.push_back(border);
  }
  std::sort(borders.begin(), borders.end());
  borders.erase(std::unique(borders.begin(), borders.end()), borders.end());
  const Lines lines(*this, shown_nodes());
  std::vector<std::vector<Share>> rows(borders.size());
  parallel_indices(borders.size(), 64, [&](std::size_t b) { rows[b] = midway(borders[b], lines, lights); });
  std::vector<std::vector<Share>> midpoints;
  const auto number = [&](std::vector<Share> row) {
    if (row.size() == 1) return row[0].index;
    midpoints.push_back(std::move(row));
    return static_cast<int>(nodes_.size() + midpoints.size()) - 1;
  };
  std::vector<int> number_of_border;
  for (const std::vector<Share>& row : rows) number_of_border.push_back(number(row));
  for (const int p : whole) {
    Part& part = parts_[p];
    const std::array<Border, 4> own = this->borders(part);
    std::array<std::vector<Share>, 4> row_of;
    for (std::size_t k = 0; k < 4; ++k) {
      if (own[k].first == own[k].last) {  // of a thin part
        part.between[k] = own[k].first;
        row_of[k] = {{own[k].first, 1.f}};
        continue;
      }
      const auto border = std::lower_bound(borders.begin(), borders.end(), own[k]) - borders.begin();
      part.between[k] = number_of_border[border];
      row_of[k] = rows[border];
    }
    const bool has_middle = part.middle_node >= 0 && node_is_exposed_[part.middle_node];
    part.centre = has_middle ? part.middle_node : number(blended(part, row_of));
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
