#include "transom/geometry.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <sstream>

#include "transom/error.h"
#include "transom/face_pieces.h"
#include "transom/overlap.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kMaximumReflectance = 0.999f;

template <typename... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  throw InputError(text.str());
}

bool all_finite(glm::dvec3 v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Vertices at the same place are one, so that a mesh is closed even where a file repeats its vertices.
std::vector<int> weld_vertices(const std::vector<glm::dvec3>& vertices, double tolerance) {
  struct Place {
    long long x, y, z;
    int vertex;
    auto operator<=>(const Place&) const = default;
    bool is_near(const Place& other) const { return x == other.x && y == other.y && z == other.z; }
  };
  std::vector<Place> places(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const glm::dvec3 cell = glm::round(vertices[i] / tolerance);
    places[i] = {static_cast<long long>(cell.x), static_cast<long long>(cell.y), static_cast<long long>(cell.z),
                 static_cast<int>(i)};
  }
  parallel_sort(places);
  std::vector<int> welded(vertices.size());
  for (std::size_t i = 0, first = 0; i < places.size(); ++i) {
    if (!places[i].is_near(places[first])) first = i;
    welded[places[i].vertex] = places[first].vertex;
  }
  return welded;
}

int find_root(std::vector<int>& parent, int i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

// An edge of a face, from the smaller vertex to the larger.
struct Edge {
  int low, high;
  int face;
  int direction;  // 1 or -1: the way in which the face passes it
  auto operator<=>(const Edge&) const = default;
};

// All edges of all faces, equal ones together.
std::vector<Edge> sorted_edges(const SceneGeometry& scene, const std::vector<int>& welded) {
  std::vector<Edge> edges;
  edges.reserve(4 * scene.faces.size());
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    const glm::ivec4& face = scene.faces[f];
    const int count = face.w >= 0 ? 4 : 3;
    for (int k = 0; k < count; ++k) {
      const int a = welded[face[k]], b = welded[face[(k + 1) % count]];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b), static_cast<int>(f), a < b ? 1 : -1});
    }
  }
  parallel_sort(edges);
  return edges;
}

// Faces of closed, outward-looking shells: every directed edge is met once by its reverse, and the volume is positive.
// Shells hold together through edges of two faces: a box whose corner, or edge, touches another surface is its own.
void mark_solids(const SceneGeometry& scene, Faces& result) {
  const std::size_t face_count = scene.faces.size();
  const std::vector<Edge> edges = sorted_edges(scene, weld_vertices(scene.vertices, 1e-7 * result.extent));
  const auto each_edge = [&](const auto& body) {  // body(first, last) for the faces at each edge
    for (std::size_t first = 0, last = 0; first < edges.size(); first = last) {
      while (last < edges.size() && edges[last].low == edges[first].low && edges[last].high == edges[first].high)
        ++last;
      body(first, last);
    }
  };
  std::vector<int> parent(face_count);
  std::iota(parent.begin(), parent.end(), 0);
  each_edge([&](std::size_t first, std::size_t last) {
    if (last - first == 2) parent[find_root(parent, edges[first].face)] = find_root(parent, edges[first + 1].face);
  });
  std::vector<double> volume(face_count, 0.0);
  std::vector<char> closed(face_count, 1);
  each_edge([&](std::size_t first, std::size_t last) {
    for (std::size_t k = first; k < last; ++k) {
      const int root = find_root(parent, edges[k].face);
      int balance = 0;  // of the shell's directions along the edge
      for (std::size_t other = first; other < last; ++other)
        if (find_root(parent, edges[other].face) == root) balance += edges[other].direction;
      if (balance != 0) closed[root] = 0;
    }
  });
  for (std::size_t f = 0; f < face_count; ++f) {
    const glm::ivec4& face = scene.faces[f];
    const int count = face.w >= 0 ? 4 : 3;
    const int root = find_root(parent, static_cast<int>(f));
    if (scene.materials[scene.face_material[f]].opening >= 0) closed[root] = 0;
    const glm::dvec3 a = scene.vertices[face[0]] - result.origin;
    for (int k = 2; k < count; ++k)
      volume[root] +=
          glm::dot(a, glm::cross(scene.vertices[face[k - 1]] - result.origin, scene.vertices[face[k]] - result.origin));
  }
  std::map<int, int> component_of_root;
  for (Face& face : result.faces) {
    const int root = find_root(parent, face.source);
    const auto [entry, is_new] = component_of_root.try_emplace(root, static_cast<int>(component_of_root.size()));
    if (is_new) result.component_is_solid.push_back(closed[root] && volume[root] > 0);
    face.component = entry->second;
  }
}

}  // namespace

float OpeningGroup::transmittance_at(float cos_theta) const {
  const float last = static_cast<float>(transmittance.size() - 1);
  const float place = std::clamp(std::abs(cos_theta), 0.f, 1.f) * last;
  const int i = std::min(static_cast<int>(place), static_cast<int>(last) - 1);
  const float fraction = place - static_cast<float>(i);
  return (1 - fraction) * transmittance[i] + fraction * transmittance[i + 1];
}

void SceneGeometry::validate() const {
  if (faces.empty()) fail("the scene has no faces");
  if (face_material.size() != faces.size())
    fail("face_material has ", face_material.size(), " rows for ", faces.size(), " faces");
  if (!corner_normals.empty() && corner_normals.size() != 4 * faces.size())
    fail("corner_normals must have four rows a face");
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (!all_finite(vertices[i])) fail("vertex ", i, " is not finite");
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 4; ++k)
      if ((k < 3 || faces[f].w >= 0) && (faces[f][k] < 0 || faces[f][k] >= static_cast<int>(vertices.size())))
        fail("face ", f, " names vertex ", faces[f][k], ", which is outside 0..", vertices.size() - 1);
    if (face_material[f] < 0 || face_material[f] >= static_cast<int>(materials.size()))
      fail("face ", f, " names material ", face_material[f], ", which is outside 0..", materials.size() - 1);
  }
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const Material& material = materials[m];
    for (int c = 0; c < 3; ++c) {
      if (!(material.reflectance[c] >= 0 && material.reflectance[c] <= kMaximumReflectance))
        fail("material ", m, ": reflectance ", material.reflectance[c], " is outside 0..", kMaximumReflectance);
      if (!(material.luminance[c] >= 0 && std::isfinite(material.luminance[c])))
        fail("material ", m, ": luminance ", material.luminance[c], " is not a finite number of at least 0");
    }
    if (material.opening >= static_cast<int>(openings.size()))
      fail("material ", m, " names opening ", material.opening);
  }
  for (std::size_t s = 0; s < point_sources.size(); ++s) {
    if (!all_finite(point_sources[s].position)) fail("point source ", s, ": its position is not finite");
    for (int c = 0; c < 3; ++c)
      if (const float intensity = point_sources[s].intensity[c]; !(intensity >= 0 && std::isfinite(intensity)))
        fail("point source ", s, ": intensity ", intensity, " is not a finite number of at least 0");
  }
  for (std::size_t g = 0; g < openings.size(); ++g) {
    if (openings[g].transmittance.size() < 2)
      fail("opening ", g, ": the transmittance table needs two entries or more");
    for (const float t : openings[g].transmittance)
      if (!(t >= 0 && t <= 1)) fail("opening ", g, ": transmittance ", t, " is outside 0..1");
    if (!(openings[g].diffuse_reflectance >= 0 && openings[g].diffuse_reflectance < 1))
      fail("opening ", g, ": diffuse reflectance ", openings[g].diffuse_reflectance, " is outside 0..1");
  }
}

int main_direction(glm::vec3 n) {
  const glm::vec3 a = glm::abs(n);
  const int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
  return 2 * axis + (n[axis] < 0);
}

glm::vec3 Face::position(glm::vec2 st) const {
  if (!is_quad) return corner[0] + st.x * (corner[1] - corner[0]) + st.y * (corner[2] - corner[0]);
  return (1 - st.y) * ((1 - st.x) * corner[0] + st.x * corner[1]) + st.y * ((1 - st.x) * corner[3] + st.x * corner[2]);
}

glm::vec3 Face::shading_normal(glm::vec2 st) const {
  const glm::vec3* n = corner_normal;
  if (!is_quad) return glm::normalize((1 - st.x - st.y) * n[0] + st.x * n[1] + st.y * n[2]);
  return glm::normalize((1 - st.y) * ((1 - st.x) * n[0] + st.x * n[1]) + st.y * ((1 - st.x) * n[3] + st.x * n[2]));
}

glm::vec2 Face::parameters(int triangle, glm::vec2 b) const {
  if (!is_quad) return b;
  if (is_parallelogram) return triangle == 0 ? glm::vec2(b.x + b.y, b.y) : glm::vec2(b.x, b.x + b.y);
  // Inverse of the bilinear map, in the plane's own axes: p = e + s f + t g + s t h.
  const glm::vec3 p3 = triangle == 0 ? corner[0] + b.x * (corner[1] - corner[0]) + b.y * (corner[2] - corner[0])
                                     : corner[0] + b.x * (corner[2] - corner[0]) + b.y * (corner[3] - corner[0]);
  const glm::dvec3 x = glm::normalize(glm::dvec3(corner[1] - corner[0])), y = glm::cross(glm::dvec3(normal), x);
  const auto flat = [&](glm::vec3 v) { return glm::dvec2(glm::dot(glm::dvec3(v), x), glm::dot(glm::dvec3(v), y)); };
  const glm::dvec2 e = flat(p3 - corner[0]), f = flat(corner[1] - corner[0]), g = flat(corner[3] - corner[0]);
  const glm::dvec2 h = flat(corner[0] - corner[1] + corner[2] - corner[3]);
  const auto cross = [](glm::dvec2 a, glm::dvec2 c) { return a.x * c.y - a.y * c.x; };
  const double qa = -cross(g, h), qb = cross(e, h) - cross(g, f), qc = cross(e, f);
  // qa t^2 + qb t + qc = 0, from crossing e = s f + t g + s t h with f + t h.
  double t;
  if (std::abs(qa) < 1e-12 * (std::abs(qb) + std::abs(qc))) {
    t = -qc / qb;
  } else {
    const double root = std::sqrt(std::max(0.0, qb * qb - 4 * qa * qc));
    const double m = -0.5 * (qb + std::copysign(root, qb));
    const double t1 = m / qa, t2 = m == 0 ? t1 : qc / m;
    const auto outside = [](double v) { return std::max({0.0, -v, v - 1}); };
    t = outside(t1) <= outside(t2) ? t1 : t2;
  }
  t = std::clamp(t, 0.0, 1.0);
  const glm::dvec2 along = f + t * h;
  const double s = glm::dot(e - t * g, along) / glm::dot(along, along);
  return {static_cast<float>(std::clamp(s, 0.0, 1.0)), static_cast<float>(t)};
}

Faces make_faces(const SceneGeometry& scene) {
  scene.validate();
  glm::dvec3 low = scene.vertices[scene.faces[0].x], high = low;
  for (const glm::ivec4& face : scene.faces)
    for (int k = 0; k < (face.w >= 0 ? 4 : 3); ++k) {
      low = glm::min(low, scene.vertices[face[k]]);
      high = glm::max(high, scene.vertices[face[k]]);
    }
  Faces result;
  result.origin = 0.5 * (low + high);
  const glm::dvec3 size = high - low;
  result.extent = static_cast<float>(std::max({size.x, size.y, size.z}));
  if (!(result.extent > 0)) fail("the scene has no extent");

  const double extent = result.extent;
  for (const FacePiece& piece : cut_faces(scene, result.origin, extent)) {
    Face& face = result.faces.emplace_back();
    face.source = piece.source;
    face.is_quad = piece.is_quad;
    face.material = scene.face_material[piece.source];
    face.is_opening = scene.materials[face.material].opening >= 0;
    const glm::dvec3* corner = piece.corner;
    const glm::dvec3 twice_area = face.is_quad ? glm::cross(corner[2] - corner[0], corner[3] - corner[1])
                                               : glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
    const double area = 0.5 * glm::length(twice_area);
    if (!(area > 1e-14 * extent * extent)) fail("face ", piece.source, " has no area (", area, " m²)");
    face.area = static_cast<float>(area);
    face.normal = glm::vec3(glm::normalize(twice_area));
    const glm::dvec3 skew = corner[0] - corner[1] + corner[2] - corner[3];
    face.is_parallelogram = face.is_quad && glm::dot(skew, skew) < 1e-10 * area;
    for (int k = 0; k < 4; ++k) {
      face.corner[k] = glm::vec3(corner[k]);
      const bool is_smooth =
          scene.materials[face.material].smooth && glm::dot(piece.corner_normal[k], face.normal) > 0.1f;
      face.corner_normal[k] = is_smooth ? glm::normalize(piece.corner_normal[k]) : face.normal;
    }
  }
  mark_solids(scene, result);
  set_back_contacts(result);
  return result;
}

}  // namespace transom
