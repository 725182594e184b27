#include "transom/unit_cell.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <sstream>

#include "embree_device.h"
#include "transom/error.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr float kStep = 1e-6f;   // of the largest extent: past a hit that is not to be met again
constexpr double kClose = 1e-5;  // of the largest extent: a surface seen from the wrong side here is the one just left
constexpr std::size_t kFewBlocks = 8;
constexpr std::size_t kGrain = 16;
constexpr int kEvenDecisions = 4;  // of a path, as in sections

struct Path {
  glm::dvec3 place, direction, reference;
  Stokes light;
  int medium = 0;
  int from = -1;  // triangle that it starts on
  int events = 0;
  int decisions = 0;
  bool is_scattered = false;
  std::uint32_t number = 0, history = 0;

  double chance() {
    ++decisions;
    const std::uint32_t seed = hash_seed(history, static_cast<std::uint64_t>(decisions));
    return decisions <= kEvenDecisions ? scrambled_coordinate(number, seed) : hash_seed(number, seed) / 4294967296.0;
  }
};

}  // namespace

/// Triangles of the cell and of those repetitions that reach into it.
struct UnitCellTracer::Tree {
  RTCScene scene = nullptr;
  double scale = 1;  // from metres to the coordinates of the scene
  struct Triangle {
    int facet;
    glm::dvec3 corner, normal;
  };
  std::vector<Triangle> triangles;
  ~Tree() {
    if (scene) rtcReleaseScene(scene);
  }

  struct Hit {
    int triangle = -1;
    double t = 1e300;
  };
  Hit nearest(const Path& path, double near, double limit) const;
};

UnitCellTracer::Tree::Hit UnitCellTracer::Tree::nearest(const Path& path, double near, double limit) const {
  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(path.place.x * scale);
  query.ray.org_y = static_cast<float>(path.place.y * scale);
  query.ray.org_z = static_cast<float>(path.place.z * scale);
  query.ray.dir_x = static_cast<float>(path.direction.x);
  query.ray.dir_y = static_cast<float>(path.direction.y);
  query.ray.dir_z = static_cast<float>(path.direction.z);
  query.ray.tnear = static_cast<float>(near * scale);
  query.ray.mask = 0xffffffffu;
  for (;;) {
    query.ray.tfar = static_cast<float>(limit * scale) + 2 * kStep;
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
#if TRANSOM_EMBREE_MAJOR >= 4
    rtcIntersect1(scene, &query, nullptr);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &query);
#endif
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    const int found = static_cast<int>(query.hit.primID);
    if (found != path.from) {
      const Triangle& triangle = triangles[static_cast<std::size_t>(found)];
      const double along = glm::dot(triangle.normal, path.direction);
      const double t = glm::dot(triangle.normal, triangle.corner - path.place) / along;
      if (t >= 0) return {found, t};
    }
    query.ray.tnear = std::nextafter(query.ray.tfar, 1e30f) + kStep;
  }
}

UnitCellTracer::UnitCellTracer(UnitCell cell) : cell_(std::move(cell)), tree_(std::make_unique<Tree>()) {
  cell_.validate();
  tree_->scale = 1 / std::max({cell_.period_x, cell_.period_y, cell_.high_z - cell_.low_z});
  const double slack = kClose / tree_->scale;
  std::vector<glm::dvec3> corners;
  for (std::size_t k = 0; k < cell_.facets.size(); ++k) {
    std::array<glm::dvec3, 3> c;
    for (std::size_t i = 0; i < 3; ++i) c[i] = cell_.corners[static_cast<std::size_t>(cell_.facets[k].corners[i])];
    const glm::dvec3 low = glm::min(c[0], glm::min(c[1], c[2])), high = glm::max(c[0], glm::max(c[1], c[2]));
    const glm::dvec3 normal = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
    const auto first = [&](double upper, double period) {
      return static_cast<std::int64_t>(std::ceil((-slack - upper) / period));
    };
    const auto last = [&](double lower, double period) {
      return static_cast<std::int64_t>(std::floor((period + slack - lower) / period));
    };
    for (std::int64_t i = first(high.x, cell_.period_x); i <= last(low.x, cell_.period_x); ++i)
      for (std::int64_t j = first(high.y, cell_.period_y); j <= last(low.y, cell_.period_y); ++j) {
        const glm::dvec3 shift(i * cell_.period_x, j * cell_.period_y, 0);
        tree_->triangles.push_back({static_cast<int>(k), c[0] + shift, normal});
        for (const glm::dvec3 corner : c) corners.push_back((corner + shift) * tree_->scale);
      }
  }
  tree_->scene = rtcNewScene(shared_device());
  rtcSetSceneFlags(tree_->scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(shared_device(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                             3 * sizeof(float), corners.size()));
  auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                               3 * sizeof(unsigned), corners.size() / 3));
  for (std::size_t i = 0; i < corners.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis)
      vertex[3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(corners[i][axis]);
    index[i] = static_cast<unsigned>(i);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(tree_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(tree_->scene);
}

UnitCellTracer::~UnitCellTracer() = default;

/// Follows the rays of one direction.
class UnitCellTracer::Run {
 public:
  Run(const UnitCellTracer& tracer, const TraceOptions& options)
      : cell_(tracer.cell_),
        tree_(*tracer.tree_),
        options_(options),
        sobol_(options.seed),
        weak_(options.split_share / std::max(options.ray_count, 1)) {}

  void ray(std::uint32_t number, glm::dvec3 direction, ExitSorter& sorter) const {
    const glm::vec2 start = sobol_.point2(number);
    Path first;
    first.place = {start.x * cell_.period_x, start.y * cell_.period_y, direction.z > 0 ? cell_.low_z : cell_.high_z};
    first.direction = direction;
    first.reference = perpendicular(direction);
    first.light = {1.0 / options_.ray_count};
    first.number = number;
    std::vector<Path> stack{first};
    while (!stack.empty()) {
      Path path = stack.back();
      stack.pop_back();
      go_on(path, stack, sorter);
    }
  }

 private:
  void go_on(Path& path, std::vector<Path>& stack, ExitSorter& sorter) const;
  void meet_facet(const Path& path, int triangle, std::vector<Path>& stack, ExitSorter& sorter) const;
  bool is_from_wrong_side(const Path& path, int triangle) const {
    const Surface& surface = surface_of(triangle);
    const bool is_front = glm::dot(tree_.triangles[static_cast<std::size_t>(triangle)].normal, path.direction) < 0;
    return (is_front ? surface.front : surface.back) != path.medium;
  }
  const Surface& surface_of(int triangle) const {
    const int facet = tree_.triangles[static_cast<std::size_t>(triangle)].facet;
    return cell_.surfaces[static_cast<std::size_t>(cell_.facets[static_cast<std::size_t>(facet)].surface)];
  }

  const UnitCell& cell_;
  const Tree& tree_;
  const TraceOptions& options_;
  const SobolSequence sobol_;
  const double weak_;
};

// To the nearest of: a facet, a wall of the cell (and in again at the other), or the planes, where light leaves.
void UnitCellTracer::Run::go_on(Path& path, std::vector<Path>& stack, ExitSorter& sorter) const {
  double near = 0;
  for (;;) {
    if (++path.events > options_.maximum_events) {
      sorter.unfinished += path.light.i;
      return;
    }
    double limit = 1e300;
    int wall = -1;
    const glm::dvec3 high(cell_.period_x, cell_.period_y, cell_.high_z), low(0, 0, cell_.low_z);
    for (int axis = 0; axis < 3; ++axis) {
      if (path.direction[axis] == 0) continue;
      const double t = ((path.direction[axis] > 0 ? high[axis] : low[axis]) - path.place[axis]) / path.direction[axis];
      if (t < limit) {
        limit = std::max(t, 0.0);
        wall = axis;
      }
    }
    const Tree::Hit hit = tree_.nearest(path, near, limit);
    if (hit.triangle >= 0 && is_from_wrong_side(path, hit.triangle)) {
      if (hit.t * tree_.scale > kClose) {
        sorter.unfinished += path.light.i;
        return;
      }
      near = hit.t + kStep / tree_.scale;  // a neighbour of the facet just left, seen past their edge
      continue;
    }
    const double step = std::min(hit.t, limit);
    const double absorption = cell_.media[static_cast<std::size_t>(path.medium)].absorption;
    if (absorption > 0) {
      const double share = std::exp(-absorption * step);
      sorter.absorbed += (1 - share) * path.light.i;
      path.light = share * path.light;
    }
    path.place += step * path.direction;
    if (hit.triangle >= 0 && hit.t <= limit) {
      meet_facet(path, hit.triangle, stack, sorter);
      return;
    }
    if (wall == 2) {
      if (path.medium == 0)
        sorter.add(path.direction, path.light.i, path.is_scattered);
      else
        sorter.unfinished += path.light.i;
      return;
    }
    path.place[wall] = path.direction[wall] > 0 ? low[wall] : high[wall];
    path.from = -1;
    near = 0;
  }
}

void UnitCellTracer::Run::meet_facet(const Path& path, int triangle, std::vector<Path>& stack,
                                     ExitSorter& sorter) const {
  const Surface& surface = surface_of(triangle);
  const glm::dvec3 front = tree_.triangles[static_cast<std::size_t>(triangle)].normal;
  const bool is_front = glm::dot(front, path.direction) < 0;
  const glm::dvec3 normal = is_front ? front : -front;
  Path next = path;
  next.from = triangle;
  Meeting meeting = meet(surface, cell_.media, path.direction, path.reference, path.light, normal, is_front);
  sorter.absorbed += meeting.absorbed;
  if (meeting.count > 1 && path.light.i < weak_) meeting.leave_one(next.chance());
  for (int k = 0; k < meeting.count; ++k) {
    const Way& way = meeting.ways[static_cast<std::size_t>(k)];
    Path branch = next;
    branch.direction = way.direction;
    branch.reference = way.reference;
    branch.light = way.light;
    branch.history = hash_seed(next.history, static_cast<std::uint64_t>(k) + 4 * static_cast<std::uint64_t>(triangle));
    if (way.is_diffuse) {
      const glm::vec4 first = sobol_.point4(path.number);
      const double u = path.is_scattered ? branch.chance() : static_cast<double>(first.z);
      const double v = path.is_scattered ? branch.chance() : static_cast<double>(first.w);
      branch.direction = lambertian_direction(way.direction, u, v);
      branch.reference = perpendicular(branch.direction);
      branch.is_scattered = true;
    }
    if (glm::dot(branch.direction, normal) < 0) branch.medium = is_front ? surface.back : surface.front;
    stack.push_back(branch);
  }
}

ProductLight UnitCellTracer::trace(glm::dvec3 direction, TraceOptions options) const {
  const double length = glm::length(direction);
  if (!(length > 0) || !std::isfinite(length) || direction.z == 0)
    throw InputError("light must be given a direction that is not along the panel");
  direction /= length;
  options.ray_count = std::max(options.ray_count, 1);
  const Run run(*this, options);
  const std::size_t count = static_cast<std::size_t>(options.ray_count), blocks = (count + kGrain - 1) / kGrain;
  std::vector<ExitSorter> sorters(blocks, ExitSorter(direction.z > 0));
  const auto follow = [&](std::size_t block) {
    for (std::size_t k = block * kGrain; k < std::min(count, (block + 1) * kGrain); ++k)
      run.ray(static_cast<std::uint32_t>(k), direction, sorters[block]);
  };
  if (blocks > kFewBlocks)
    parallel_indices(blocks, 1, follow);
  else  // not worth waking other threads
    for (std::size_t block = 0; block < blocks; ++block) follow(block);
  ExitSorter all(direction.z > 0);
  for (const ExitSorter& sorter : sorters) all.append(sorter);
  return all.light();
}

void UnitCell::validate() const {
  const auto fail = [](std::size_t facet, const char* what) {
    std::ostringstream text;
    text << "facet " << facet << " of the unit cell " << what;
    throw InputError(text.str());
  };
  if (!(period_x > 0) || !(period_y > 0) || !(high_z > low_z))
    throw InputError("the unit cell has no extent: periods and thickness must be > 0");
  transom::validate(media);
  for (const Surface& surface : surfaces)
    if (const char* fault = surface.fault(media.size()))
      throw InputError(std::string("a surface of the unit cell ") + fault);
  if (facets.empty()) throw InputError("the unit cell has no facet");
  for (std::size_t k = 0; k < facets.size(); ++k) {
    const Facet& facet = facets[k];
    if (facet.surface < 0 || facet.surface >= static_cast<int>(surfaces.size())) fail(k, "names no surface");
    std::array<glm::dvec3, 3> c;
    for (std::size_t i = 0; i < 3; ++i) {
      if (facet.corners[i] < 0 || facet.corners[i] >= static_cast<int>(corners.size())) fail(k, "names no corner");
      c[i] = corners[static_cast<std::size_t>(facet.corners[i])];
      if (!(c[i].z > low_z && c[i].z < high_z && std::isfinite(c[i].x + c[i].y)))
        fail(k, "is not between the planes where light enters and leaves");
    }
    const double area = glm::length(glm::cross(c[1] - c[0], c[2] - c[0]));
    if (!(area > 1e-12 * period_x * period_y)) fail(k, "has no area");
  }
}

}  // namespace transom
