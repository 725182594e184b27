#include "transom/section.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "section_profile.h"
#include "transom/error.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr double kThin = 1e-12;       // of a beam: a part so narrow is left to its neighbour
constexpr double kAlongAxis = 1e-12;  // of a direction, across the extrusion: light that never leaves
constexpr int kEvenDecisions = 4;     // of a path; further ones are independent of other rays
constexpr std::size_t kFewBlocks = 2;
constexpr std::size_t kGrain = 64;  // rays of a parallel task

/// Parallel light from the points of start -> end, or one ray where these are one.
struct Path {
  glm::dvec2 start, end;  // (y, z)
  glm::dvec3 direction, reference;
  Stokes light;
  int from = -1;  // line that it starts on
  int events = 0;
  bool is_spread = false;     // has met an arc
  bool is_scattered = false;  // has met a diffuse surface
  std::uint32_t number = 0;   // of a ray, for its point of a sequence
  std::uint64_t stream = 0;   // of random numbers

  bool is_wide() const { return start != end; }
  glm::dvec2 at(double share) const { return start + share * (end - start); }
  glm::dvec2 along() const { return {direction.y, direction.z}; }
  int decisions = 0;          // taken by chance
  std::uint32_t history = 0;  // of ways taken: rays of one history decide evenly

  double chance() {
    if (++decisions <= kEvenDecisions)
      return scrambled_coordinate(number, hash_seed(history, static_cast<std::uint64_t>(decisions)));
    stream = stream * 6364136223846793005ULL + 1442695040888963407ULL;
    return hash_seed(stream, 0) / 4294967296.0;
  }
};

// Mean of exp(-absorption t) over a beam whose edges go the lengths `near` and `far`.
double mean_absorption(double absorption, double near, double far) {
  const double spread = 0.5 * absorption * (far - near);
  return std::exp(-0.5 * absorption * (near + far)) * (std::abs(spread) < 1e-4 ? 1 : std::sinh(spread) / spread);
}

class Tracer {
 public:
  Tracer(const Section& section, const TraceOptions& options, bool is_inward)
      : section_(section),
        profile_(section),
        options_(options),
        sobol_(options.seed),
        weak_(options.split_share / std::max(options.ray_count, 1)),
        exits(is_inward) {}

  /// Follows wide beams to where they leave or become rays.
  std::vector<Path> beams(const Path& first);
  /// Follows rays; may be called for several at once with a sorter for each.
  void ray(const Path& first, ExitSorter& sorter) const;

 private:
  struct Part {
    double begin, end;
    SectionProfile::Hit hit;
  };
  void divide(const Path& beam);
  std::vector<Part> parts(const Path& beam, const std::vector<double>& cuts) const;
  void spread(const Path& beam, double begin, double end);
  void go_on(const Path& path, const SectionProfile::Hit& hit, std::vector<Path>& onward, ExitSorter& sorter) const;

  const Section& section_;
  const SectionProfile profile_;
  const TraceOptions& options_;
  const SobolSequence sobol_;
  const double weak_;
  std::vector<Path> stack_, rays_;

 public:
  ExitSorter exits;
};

std::vector<Path> Tracer::beams(const Path& first) {
  stack_.assign(1, first);
  while (!stack_.empty()) {
    const Path path = stack_.back();
    stack_.pop_back();
    if (path.is_wide())
      divide(path);
    else
      rays_.push_back(path);
  }
  for (std::size_t k = 0; k < rays_.size(); ++k) rays_[k].number = static_cast<std::uint32_t>(k);
  return std::move(rays_);
}

void Tracer::divide(const Path& beam) {
  if (beam.light.i < weak_) {  // one ray of it, by chance
    Path ray = beam;
    ray.start = ray.end = beam.at(ray.chance());
    rays_.push_back(ray);
    return;
  }
  std::vector<double> cuts{0, 1};
  if (beam.events > options_.maximum_events || glm::length(beam.along()) < kAlongAxis) {
    exits.unfinished += beam.light.i;
    return;
  }
  if (!profile_.cuts(beam.start, beam.end, beam.along(), cuts)) {
    spread(beam, 0, 1);
    return;
  }
  for (const Part& part : parts(beam, cuts)) {
    const int line = part.hit.line;
    if (line >= 0 && (profile_.is_arc(line) ||
                      section_.lines[static_cast<std::size_t>(line)].surface.kind == SurfaceKind::kDiffuse)) {
      spread(beam, part.begin, part.end);
      continue;
    }
    Path piece = beam;
    piece.start = beam.at(part.begin);
    piece.end = beam.at(part.end);
    piece.light = (part.end - part.begin) * beam.light;
    piece.stream ^= static_cast<std::uint64_t>(hash_seed(beam.stream, static_cast<std::uint64_t>(part.begin * 1e15)));
    go_on(piece, part.hit, stack_, exits);
  }
}

// Neighbouring parts that meet the same line are one.
std::vector<Tracer::Part> Tracer::parts(const Path& beam, const std::vector<double>& cuts) const {
  std::vector<double> ordered;
  for (const double cut : cuts)
    if (cut >= 0 && cut <= 1) ordered.push_back(cut);
  std::sort(ordered.begin(), ordered.end());
  std::vector<Part> result;
  double begin = 0;
  for (const double end : ordered) {
    if (end - begin < kThin && end < 1) continue;
    const auto hit = profile_.nearest(beam.at(0.5 * (begin + end)), beam.along(), beam.from);
    if (!result.empty() && result.back().hit.line == hit.line && result.back().hit.shift == hit.shift)
      result.back().end = end;
    else if (end > begin)
      result.push_back({begin, end, hit});
    begin = end;
  }
  return result;
}

void Tracer::spread(const Path& beam, double begin, double end) {
  const double flux = (end - begin) * beam.light.i;
  const int count = std::max(1, static_cast<int>(std::ceil(flux * options_.ray_count)));
  for (int k = 0; k < count; ++k) {
    Path ray = beam;
    const std::uint64_t number = rays_.size();
    const double jitter = (hash_seed(options_.seed, number) + 0.5) / 4294967296.0;
    ray.start = ray.end = beam.at(begin + (end - begin) * (k + jitter) / count);
    ray.light = ((end - begin) / count) * beam.light;
    ray.stream = (static_cast<std::uint64_t>(hash_seed(options_.seed + 1, number)) << 32) | number;
    rays_.push_back(ray);
  }
}

void Tracer::go_on(const Path& path, const SectionProfile::Hit& hit, std::vector<Path>& onward,
                   ExitSorter& sorter) const {
  if (hit.line == SectionProfile::kNothing) {
    sorter.unfinished += path.light.i;
    return;
  }
  if (hit.line == SectionProfile::kLeaves) {
    sorter.add(path.direction, path.light.i, path.is_spread || path.is_scattered);
    return;
  }
  const Line& line = section_.lines[static_cast<std::size_t>(hit.line)];
  const glm::dvec2 along = path.along(), shift(hit.shift, 0);
  const double near = path.is_wide() ? profile_.distance_to(hit, path.start, along) : hit.t;
  const double far = path.is_wide() ? profile_.distance_to(hit, path.end, along) : hit.t;
  Path next = path;
  next.start = path.start + near * along - shift;
  next.end = path.is_wide() ? path.end + far * along - shift : next.start;
  next.from = hit.line;
  ++next.events;
  next.is_spread |= profile_.is_arc(hit.line);

  const glm::dvec2 front = profile_.front_normal(hit.line, next.start);
  const bool is_front = glm::dot(front, along) < 0;
  const int medium = is_front ? line.surface.front : line.surface.back;
  const double absorption = section_.media[static_cast<std::size_t>(medium)].absorption;
  if (absorption > 0) {
    const double share = mean_absorption(absorption, near, far);
    sorter.absorbed += (1 - share) * next.light.i;
    next.light = share * next.light;
  }
  const glm::dvec3 normal = (is_front ? 1.0 : -1.0) * glm::dvec3(0, front.x, front.y);
  Meeting meeting = meet(line.surface, section_.media, path.direction, path.reference, next.light, normal, is_front);
  sorter.absorbed += meeting.absorbed;
  if (meeting.count > 1 && next.light.i < weak_) meeting.leave_one(next.chance());
  for (int k = 0; k < meeting.count; ++k) {
    const Way& way = meeting.ways[static_cast<std::size_t>(k)];
    Path branch = next;
    branch.direction = way.direction;
    branch.history = hash_seed(next.history, static_cast<std::uint64_t>(k) +
                                                 (static_cast<std::uint64_t>(hit.line) << 3) + (meeting.count << 20));
    branch.reference = way.reference;
    branch.light = way.light;
    if (k > 0) branch.stream ^= static_cast<std::uint64_t>(hash_seed(next.stream, static_cast<std::uint64_t>(k))) << 20;
    if (way.is_diffuse) {
      const glm::dvec2 first = sobol_.point2(path.number);
      const double u = path.is_scattered ? branch.chance() : static_cast<double>(first.x);
      const double v = path.is_scattered ? branch.chance() : static_cast<double>(first.y);
      branch.direction = lambertian_direction(way.direction, u, v);
      branch.reference = perpendicular(branch.direction);
      branch.is_scattered = true;
    }
    onward.push_back(branch);
  }
}

void Tracer::ray(const Path& first, ExitSorter& sorter) const {
  std::vector<Path> stack{first};
  while (!stack.empty()) {
    const Path path = stack.back();
    stack.pop_back();
    if (path.events > options_.maximum_events || glm::length(path.along()) < kAlongAxis)
      sorter.unfinished += path.light.i;
    else
      go_on(path, profile_.nearest(path.start, path.along(), path.from), stack, sorter);
  }
}

}  // namespace

void Section::validate() const {
  const auto fail = [](std::size_t line, const char* what) {
    std::ostringstream text;
    text << "line " << line << " of the section " << what;
    throw InputError(text.str());
  };
  if (!(period > 0) || !(high_z > low_z))
    throw InputError("the section has no extent: period and thickness must be > 0");
  transom::validate(media);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Line& line = lines[k];
    for (const glm::dvec2 p : {line.a, line.b})
      if (!(p.y > low_z && p.y < high_z && std::isfinite(p.x)))
        fail(k, "is not between the planes where light enters and leaves");
    const double chord = glm::length(line.b - line.a);
    if (!(chord > 0)) fail(k, "has no length");
    if (!(std::abs(line.bow) < 0.5 * chord)) fail(k, "bows by half of its chord or more");
    const double middle = 0.5 * (line.a.y + line.b.y) + line.bow * (line.b.x - line.a.x) / chord;
    if (!(middle > low_z && middle < high_z)) fail(k, "bows beyond the planes where light enters and leaves");
    if (const char* fault = line.surface.fault(media.size())) fail(k, fault);
  }
}

ProductLight trace_section(const Section& section, glm::dvec3 direction, TraceOptions options) {
  section.validate();
  const double length = glm::length(direction);
  if (!(length > 0) || !std::isfinite(length) || direction.z == 0)
    throw InputError("light must be given a direction that is not along the panel");
  direction /= length;
  const double start_z = direction.z > 0 ? section.low_z : section.high_z;
  Tracer tracer(section, options, direction.z > 0);
  const std::vector<Path> rays =
      tracer.beams({{0, start_z}, {section.period, start_z}, direction, perpendicular(direction), {}});
  const std::size_t blocks = (rays.size() + kGrain - 1) / kGrain;
  std::vector<ExitSorter> sorters(blocks, ExitSorter(direction.z > 0));
  const auto follow = [&](std::size_t block) {
    for (std::size_t k = block * kGrain; k < std::min(rays.size(), (block + 1) * kGrain); ++k)
      tracer.ray(rays[k], sorters[block]);
  };
  if (blocks > kFewBlocks)
    parallel_indices(blocks, 1, follow);
  else  // not worth waking other threads
    for (std::size_t block = 0; block < blocks; ++block) follow(block);
  for (const ExitSorter& sorter : sorters) tracer.exits.append(sorter);
  return tracer.exits.light();
}

}  // namespace transom
