#include "transom/optical_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "transom/error.h"

namespace transom {
namespace {

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
  if (sine2 >= 1) {  // total: magnitudes 1; s and p are (a - ib)/(a + ib), whose squares need no angles
    f.is_total = true;
    const double root = std::sqrt(sine2 - 1);
    const double sa = n1 * cosine, sb = n2 * root, pa = n2 * cosine, pb = n1 * root;
    const double scale = 1 / ((sa * sa + sb * sb) * (pa * pa + pb * pb));
    const double sr = sa * sa - sb * sb, si = -2 * sa * sb, pr = pa * pa - pb * pb, pi = -2 * pa * pb;
    f.reflected = {1, 1, scale * (sr * pr + si * pi), scale * (si * pr - sr * pi)};
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

}  // namespace

const char* Surface::fault(std::size_t media_count) const {
  const int count = static_cast<int>(media_count);
  if (front < 0 || front >= count || back < 0 || back >= count) return "names no medium";
  for (const double rho : {reflectance, reflectance_back})
    if (!(rho >= 0 && transmittance >= 0 && rho + transmittance <= 1))
      return "reflects and transmits more than it receives, or less than nothing";
  if (!(openness >= 0 && openness <= 1)) return "has an openness outside 0..1";
  return nullptr;
}

void validate(const std::vector<Medium>& media) {
  if (media.empty()) throw InputError("the product has no medium: the first is the air around it");
  for (const Medium& medium : media)
    if (!(medium.index >= 1) || !(medium.absorption >= 0) || !std::isfinite(medium.index + medium.absorption))
      throw InputError("a medium of the product has an index below 1 or a negative absorption");
}

glm::dvec3 perpendicular(glm::dvec3 direction) {
  const glm::dvec3 axis = std::abs(direction.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  return glm::normalize(glm::cross(direction, axis));
}

glm::dvec3 lambertian_direction(glm::dvec3 axis, double u, double v) {
  const double radius = std::sqrt(u), phi = 2 * std::numbers::pi * v;
  const glm::dvec3 across = perpendicular(axis), up = glm::cross(axis, across);
  return glm::normalize(radius * std::cos(phi) * across + radius * std::sin(phi) * up +
                        std::sqrt(std::max(1e-12, 1 - u)) * axis);
}

void Meeting::leave_one(double chance) {
  double sum = 0;
  for (int k = 0; k < count; ++k) sum += ways[static_cast<std::size_t>(k)].light.i;
  double left = chance * sum;
  int chosen = 0;
  while (chosen + 1 < count && left >= ways[static_cast<std::size_t>(chosen)].light.i)
    left -= ways[static_cast<std::size_t>(chosen++)].light.i;
  Way way = ways[static_cast<std::size_t>(chosen)];
  way.light = (sum / way.light.i) * way.light;
  ways[0] = way;
  count = std::min(count, 1);
}

Meeting meet(const Surface& surface, const std::vector<Medium>& media, glm::dvec3 direction, glm::dvec3 reference,
             const Stokes& light, glm::dvec3 normal, bool is_front) {
  const double cosine = std::min(-glm::dot(direction, normal), 1.0);
  // To the s and p axes of this meeting.
  glm::dvec3 s = glm::cross(direction, normal);
  const double sine = glm::length(s);
  s = sine > 1e-12 ? s / sine : reference;
  const Stokes incident = turned(light, glm::dot(reference, s), glm::dot(glm::cross(direction, reference), s));
  const glm::dvec3 mirrored = direction + 2 * cosine * normal;

  Meeting result;
  const auto add = [&](glm::dvec3 way, const Stokes& a, bool is_diffuse = false) {
    if (a.i > 0)
      result.ways[static_cast<std::size_t>(result.count++)] = {way, is_diffuse ? perpendicular(way) : s, a, is_diffuse};
  };
  if (surface.kind == SurfaceKind::kInterface || surface.kind == SurfaceKind::kGap) {
    const double n1 = media[static_cast<std::size_t>(is_front ? surface.front : surface.back)].index;
    const double n2 = media[static_cast<std::size_t>(is_front ? surface.back : surface.front)].index;
    const bool is_gap = surface.kind == SurfaceKind::kGap;
    const Fresnel f = is_gap ? thin_gap(n1, cosine) : fresnel(n1, n2, cosine);
    const double ratio = n1 / n2;
    if (!f.is_total)
      add(is_gap ? direction : ratio * direction + (ratio * cosine - f.cosine_beyond) * normal,
          f.transmitted * incident);
    add(mirrored, f.reflected * incident);
    return result;
  }
  const double open = surface.openness, closed = 1 - open;
  const double rho = closed * (is_front ? surface.reflectance : surface.reflectance_back);
  const double tau = surface.kind == SurfaceKind::kDiffuse ? closed * surface.transmittance : 0;
  add(direction, open * incident);
  if (surface.kind == SurfaceKind::kMirror) {
    add(mirrored, Mueller{rho, rho, -rho, 0} * incident);
  } else {
    add(normal, {rho * incident.i}, true);
    add(-normal, {tau * incident.i}, true);
  }
  result.absorbed = (1 - open - rho - tau) * incident.i;
  return result;
}

}  // namespace transom
