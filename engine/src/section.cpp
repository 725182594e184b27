#include "transom/section.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <sstream>

#include "transom/error.h"
#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr double kSameDirection = 1e-9;  // between unit vectors that are one exit
constexpr double kClose = 1e-9;          // of the period: a hit nearer than this is where the path is
constexpr std::size_t kGrain = 16;
constexpr std::size_t kFewExits = 256;

/// Intensity and polarisation against the axis `reference`, which is perpendicular to the direction.
struct Stokes {
  double i = 1, q = 0, u = 0, v = 0;
};

struct Branch {
  glm::dvec2 place;  // (y, z)
  glm::dvec3 direction, reference;
  Stokes light;
  int events = 0;
  std::uint64_t stream = 0;  // of random numbers
  bool is_random = false;    // has met a diffuse surface
};

/// Amplitude coefficients as what Mueller matrices need: |s|², |p|², and s times the conjugate of p.
struct Mueller {
  double s2, p2, real, imaginary;
};

Stokes turned(const Stokes& a, double cosine, double sine) {  // to an axis at that angle
  const double c2 = cosine * cosine - sine * sine, s2 = 2 * cosine * sine;
  return {a.i, c2 * a.q + s2 * a.u, -s2 * a.q + c2 * a.u, a.v};
}

Stokes operator*(const Mueller& m, const Stokes& a) {
  const double sum = 0.5 * (m.s2 + m.p2), difference = 0.5 * (m.s2 - m.p2);
  return {sum * a.i + difference * a.q, difference * a.i + sum * a.q, m.real * a.u + m.imaginary * a.v,
          -m.imaginary * a.u + m.real * a.v};
}

/// Reflection and transmission of flux between two media, for the s and p waves.
struct Fresnel {
  Mueller reflected, transmitted;
  bool is_total = false;
  double cosine_beyond = 0;
};

Fresnel fresnel(double n1, double n2, double cosine) {
  Fresnel f;
  const double ratio = n1 / n2, sine2 = ratio * ratio * (1 - cosine * cosine);
  if (sine2 >= 1) {  // total: magnitudes 1, and a phase between s and p
    f.is_total = true;
    const double root = std::sqrt(sine2 - 1);
    const double phase = 2 * (std::atan2(n1 * root, n2 * cosine) - std::atan2(n2 * root, n1 * cosine));
    f.reflected = {1, 1, std::cos(phase), std::sin(phase)};
    f.transmitted = {0, 0, 0, 0};
    return f;
  }
  const double beyond = std::sqrt(1 - sine2);
  const double rs = (n1 * cosine - n2 * beyond) / (n1 * cosine + n2 * beyond);
  const double rp = (n2 * cosine - n1 * beyond) / (n2 * cosine + n1 * beyond);
  f.cosine_beyond = beyond;
  f.reflected = {rs * rs, rp * rp, rs * rp, 0};
  const double ts2 = 1 - rs * rs, tp2 = 1 - rp * rp;
  f.transmitted = {ts2, tp2, std::sqrt(ts2 * tp2), 0};
  return f;
}

/// Two faces of a thin gap of air, with all reflections between them; not coherent.
Fresnel thin_gap(double index, double cosine) {
  Fresnel f = fresnel(index, 1, cosine);
  if (f.is_total) return f;
  const double s = 2 * f.reflected.s2 / (1 + f.reflected.s2), p = 2 * f.reflected.p2 / (1 + f.reflected.p2);
  const double sign = f.reflected.real < 0 ? -1 : 1;
  f.reflected = {s, p, sign * std::sqrt(s * p), 0};
  f.transmitted = {1 - s, 1 - p, std::sqrt((1 - s) * (1 - p)), 0};
  return f;
}

glm::dvec3 perpendicular(glm::dvec3 direction) {
  const glm::dvec3 axis = std::abs(direction.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  return glm::normalize(glm::cross(direction, axis));
}

// Exits of one direction become one, as long as there are few of them: sections of flat faces have few.
void add_exit(std::vector<Exit>& exits, glm::dvec3 direction, double flux) {
  for (Exit& exit : std::span(exits).first(std::min(exits.size(), kFewExits))) {
    const glm::dvec3 apart = exit.direction - direction;
    if (glm::dot(apart, apart) < kSameDirection * kSameDirection) {
      exit.flux += flux;
      return;
    }
  }
  exits.push_back({direction, flux});
}

/// Follows all branches of the rays that start in one stratum of the period.
class Tracer {
 public:
  Tracer(const Section& section, const SectionOptions& options) : section_(section), options_(options) {}

  void trace(glm::dvec2 place, glm::dvec3 direction, std::uint64_t stream, SectionLight& light) {
    is_inward_ = direction.z > 0;
    branches_.assign(1, {place, direction, perpendicular(direction), {}, 0, stream});
    while (!branches_.empty()) {
      Branch branch = branches_.back();
      branches_.pop_back();
      if (branch.events > options_.maximum_events)
        light.unfinished += branch.light.i;
      else
        follow(branch, light);
    }
  }

 private:
  void follow(Branch& branch, SectionLight& light);
  struct Way {
    glm::dvec3 direction;
    Stokes light;
  };
  void meet(const Branch& branch, const Line& line, SectionLight& light);
  void divide(const Branch& branch, glm::dvec3 reference, const Way& a, const Way& b);
  void scatter(const Branch& branch, glm::dvec3 normal, double flux);
  void push(const Branch& from, glm::dvec3 direction, glm::dvec3 reference, const Stokes& light) {
    if (light.i > 0)
      branches_.push_back(
          {from.place, direction, reference, light, from.events + 1, next_stream(from), from.is_random});
  }
  std::uint64_t next_stream(const Branch& from) {
    ++pushed_;
    return (static_cast<std::uint64_t>(hash_seed(from.stream, pushed_)) << 32) | hash_seed(from.stream + 1, pushed_);
  }

  const Section& section_;
  const SectionOptions& options_;
  std::vector<Branch> branches_;
  double crossed_ = 0;  // along the present path since its last line, in periods gone by
  std::uint64_t pushed_ = 0;
  bool is_inward_ = true;  // the incident light comes from outdoors
};

double cross2(glm::dvec2 a, glm::dvec2 b) {
  return a.x * b.y - a.y * b.x;
}

// To the nearest of: a line, the border of the period (and in again at the other), or the planes, where light leaves.
void Tracer::follow(Branch& branch, SectionLight& light) {
  const glm::dvec2 along(branch.direction.y, branch.direction.z);
  const double in_plane = glm::length(along);
  if (in_plane < 1e-12) {  // along the extrusion: never leaves
    light.unfinished += branch.light.i;
    return;
  }
  double nearest = 1e300;
  const Line* met = nullptr;
  const double close = kClose * section_.period / in_plane;
  for (const Line& line : section_.lines) {
    const glm::dvec2 edge = line.b - line.a;
    const double denominator = cross2(along, edge);
    if (denominator == 0) continue;
    const glm::dvec2 to_start = line.a - branch.place;
    const double t = cross2(to_start, edge) / denominator, s = cross2(to_start, along) / denominator;
    if (t > close && t < nearest && s >= 0 && s <= 1) {
      nearest = t;
      met = &line;
    }
  }
  const double border = along.x > 0   ? (section_.period - branch.place.x) / along.x
                        : along.x < 0 ? -branch.place.x / along.x
                                      : 1e300;
  const double plane = along.y > 0   ? (section_.high_z - branch.place.y) / along.y
                       : along.y < 0 ? (section_.low_z - branch.place.y) / along.y
                                     : 1e300;
  const double step = std::min({nearest, border, plane});
  if (!(step < 1e299)) {
    light.unfinished += branch.light.i;
    return;
  }
  if (met && nearest <= step) {
    // The medium that was crossed is the one on this side of the line.
    const glm::dvec2 edge = met->b - met->a;
    const int medium = cross2(edge, along) < 0 ? met->left : met->right;
    const double absorption = section_.media[static_cast<std::size_t>(medium)].absorption;
    if (absorption > 0) {
      const double share = std::exp(-absorption * (crossed_ + step));
      light.absorbed += (1 - share) * branch.light.i;
      branch.light = Mueller{share, share, share, 0} * branch.light;
    }
    branch.place += step * along;
    crossed_ = 0;
    meet(branch, *met, light);
    return;
  }
  branch.place += step * along;
  if (plane <= border) {
    crossed_ = 0;
    std::vector<Exit>& exits = (branch.direction.z > 0) == is_inward_ ? light.transmitted : light.reflected;
    if (branch.is_random)
      exits.push_back({branch.direction, branch.light.i});
    else
      add_exit(exits, branch.direction, branch.light.i);
    return;
  }
  branch.place.x = along.x > 0 ? 0 : section_.period;
  ++branch.events;
  crossed_ += step;
  if (branch.events > options_.maximum_events) {
    crossed_ = 0;
    light.unfinished += branch.light.i;
    return;
  }
  follow(branch, light);
}

void Tracer::meet(const Branch& branch, const Line& line, SectionLight& light) {
  const glm::dvec2 edge = glm::normalize(line.b - line.a);
  const bool is_left = cross2(edge, {branch.direction.y, branch.direction.z}) < 0;
  const glm::dvec3 normal = (is_left ? 1.0 : -1.0) * glm::dvec3(0, -edge.y, edge.x);
  const double cosine = -glm::dot(branch.direction, normal);

  // To the s and p axes of this meeting.
  glm::dvec3 s = glm::cross(branch.direction, normal);
  const double sine = glm::length(s);
  s = sine > 1e-12 ? s / sine : branch.reference;
  const Stokes incident =
      turned(branch.light, glm::dot(branch.reference, s), glm::dot(glm::cross(branch.direction, branch.reference), s));
  const glm::dvec3 mirrored = branch.direction + 2 * cosine * normal;

  switch (line.kind) {
    case LineKind::kInterface:
    case LineKind::kGap: {
      const double n1 = section_.media[static_cast<std::size_t>(is_left ? line.left : line.right)].index;
      const double n2 = section_.media[static_cast<std::size_t>(is_left ? line.right : line.left)].index;
      const bool is_gap = line.kind == LineKind::kGap;
      const Fresnel f = is_gap ? thin_gap(n1, cosine) : fresnel(n1, n2, cosine);
      const double ratio = n1 / n2;
      const glm::dvec3 passed =
          is_gap || f.is_total ? branch.direction
                               : glm::normalize(ratio * branch.direction + (ratio * cosine - f.cosine_beyond) * normal);
      divide(branch, s, {mirrored, f.reflected * incident}, {passed, f.transmitted * incident});
      break;
    }
    case LineKind::kMirror:
    case LineKind::kDiffuse: {
      const double open = line.openness, closed = 1 - open;
      const double rho = closed * (is_left ? line.reflectance : line.reflectance_right);
      const Way through{branch.direction, Mueller{open, open, open, 0} * incident};
      double used = open + rho;
      if (line.kind == LineKind::kMirror) {
        divide(branch, s, through, {mirrored, Mueller{rho, rho, -rho, 0} * incident});
      } else {
        const double tau = closed * line.transmittance;
        used += tau;
        if (incident.i >= options_.split_share) {
          push(branch, through.direction, s, through.light);
          scatter(branch, normal, rho * incident.i);
          scatter(branch, -normal, tau * incident.i);
        } else if (used > 0) {  // one way by chance, with the flux of all
          const double choice = used * hash_seed(next_stream(branch), 0) / 4294967296.0;
          const double scale = used / std::max(open, 1e-300);
          if (choice < open)
            push(branch, through.direction, s, Mueller{scale, scale, scale, 0} * through.light);
          else
            scatter(branch, choice < open + rho ? normal : -normal, used * incident.i);
        }
      }
      light.absorbed += (1 - used) * incident.i;
      break;
    }
  }
}

// Both ways, or one of them by chance with the flux of both.
void Tracer::divide(const Branch& branch, glm::dvec3 reference, const Way& a, const Way& b) {
  const double sum = a.light.i + b.light.i;
  if (branch.light.i >= options_.split_share || a.light.i <= 0 || b.light.i <= 0) {
    push(branch, a.direction, reference, a.light);
    push(branch, b.direction, reference, b.light);
    return;
  }
  const bool takes_a = hash_seed(next_stream(branch), 0) / 4294967296.0 * sum < a.light.i;
  const Way& way = takes_a ? a : b;
  const double scale = sum / way.light.i;
  push(branch, way.direction, reference, Mueller{scale, scale, scale, 0} * way.light);
}

void Tracer::scatter(const Branch& branch, glm::dvec3 normal, double flux) {
  if (!(flux > 0)) return;
  const std::uint64_t stream = next_stream(branch);
  constexpr double kScale = 1.0 / 4294967296.0;
  const double u = (hash_seed(stream, 1) + 0.5) * kScale, phi = 2 * std::numbers::pi * hash_seed(stream, 2) * kScale;
  const double radius = std::sqrt(u);
  const glm::dvec3 across = perpendicular(normal), up = glm::cross(normal, across);
  const glm::dvec3 direction = glm::normalize(radius * std::cos(phi) * across + radius * std::sin(phi) * up +
                                              std::sqrt(std::max(0.0, 1 - u)) * normal);
  branches_.push_back({branch.place, direction, perpendicular(direction), {flux}, branch.events + 1, stream, true});
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
  if (media.empty()) throw InputError("the section has no medium: the first is the air around it");
  for (const Medium& medium : media)
    if (!(medium.index >= 1) || !(medium.absorption >= 0))
      throw InputError("a medium of the section has an index below 1 or a negative absorption");
  const double slack = 1e-9 * period;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Line& line = lines[k];
    for (const glm::dvec2 p : {line.a, line.b}) {
      if (!(p.x >= -slack && p.x <= period + slack)) fail(k, "leaves the period");
      if (!(p.y > low_z && p.y < high_z)) fail(k, "is not between the planes where light enters and leaves");
    }
    if (line.a == line.b) fail(k, "has no length");
    const int count = static_cast<int>(media.size());
    if (line.left < 0 || line.left >= count || line.right < 0 || line.right >= count) fail(k, "names no medium");
    for (const double rho : {line.reflectance, line.reflectance_right})
      if (!(rho >= 0 && line.transmittance >= 0 && rho + line.transmittance <= 1))
        fail(k, "reflects and transmits more than it receives, or less than nothing");
    if (!(line.openness >= 0 && line.openness <= 1)) fail(k, "has an openness outside 0..1");
  }
}

SectionLight trace_section(const Section& section, glm::dvec3 direction, SectionOptions options) {
  section.validate();
  const double length = glm::length(direction);
  if (!(length > 0) || !std::isfinite(length) || direction.z == 0)
    throw InputError("light must be given a direction that is not along the panel");
  direction /= length;
  const std::size_t count = static_cast<std::size_t>(std::max(options.ray_count, 1));
  const std::size_t blocks = (count + kGrain - 1) / kGrain;
  std::vector<SectionLight> parts(blocks);
  const double start_z = direction.z > 0 ? section.low_z : section.high_z;
  parallel_indices(blocks, 1, [&](std::size_t block) {
    Tracer tracer(section, options);
    for (std::size_t i = block * kGrain; i < std::min(count, (block + 1) * kGrain); ++i) {
      const double jitter = (hash_seed(options.seed, i) + 0.5) / 4294967296.0;
      const double y = section.period * (static_cast<double>(i) + jitter) / static_cast<double>(count);
      const std::uint64_t stream = (static_cast<std::uint64_t>(hash_seed(options.seed + 1, i)) << 32) | i;
      tracer.trace({y, start_z}, direction, stream, parts[block]);
    }
  });
  SectionLight light;
  const double share = 1.0 / static_cast<double>(count);
  bool is_specular = true;
  for (const Line& line : section.lines) is_specular &= line.kind != LineKind::kDiffuse;
  for (const SectionLight& part : parts) {
    for (const auto& [from, to] :
         {std::pair{&part.transmitted, &light.transmitted}, std::pair{&part.reflected, &light.reflected}})
      for (const Exit& exit : *from) {
        if (is_specular)
          add_exit(*to, exit.direction, share * exit.flux);
        else
          to->push_back({exit.direction, share * exit.flux});
      }
    light.absorbed += share * part.absorbed;
    light.unfinished += share * part.unfinished;
  }
  return light;
}

}  // namespace transom
