#include "transom/unit_cell.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "transom/error.h"
#include "transom/section.h"

namespace transom {
namespace {

constexpr double kPi = std::numbers::pi;

glm::dvec3 incident(double theta_deg, double phi_deg) {
  const double t = theta_deg * kPi / 180, p = phi_deg * kPi / 180;
  return {std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)};
}

double total(const std::vector<Exit>& exits) {
  double sum = 0;
  for (const Exit& exit : exits) sum += exit.flux;
  return sum;
}

double along(const std::vector<Exit>& exits, glm::dvec3 direction) {
  double sum = 0;
  for (const Exit& exit : exits)
    if (glm::length(exit.direction - direction) < 1e-6) sum += exit.flux;
  return sum;
}

double balance(const ProductLight& light) {
  return total(light.transmitted) + total(light.reflected) + light.absorbed + light.unfinished;
}

/// A section drawn out along x. Seen from +x, y runs to the right and z up: the front is to the left of a -> b.
UnitCell extruded(const Section& section, double length) {
  UnitCell cell{length, section.period, section.low_z, section.high_z, section.media, {}, {}, {}};
  for (const Line& line : section.lines) {
    const int first = static_cast<int>(cell.corners.size()), surface = static_cast<int>(cell.surfaces.size());
    cell.surfaces.push_back(line.surface);
    for (const double x : {0.0, length})
      for (const glm::dvec2 p : {line.a, line.b}) cell.corners.emplace_back(x, p.x, p.y);
    // Corners: a and b at x = 0, then at x = length; (b - a) x (0, 0, ..) looks to the left.
    cell.facets.push_back({{first, first + 2, first + 1}, surface});
    cell.facets.push_back({{first + 1, first + 2, first + 3}, surface});
  }
  return cell;
}

Section prisms() {
  const double pitch = 0.001;
  Section section;
  section.period = pitch;
  section.low_z = -0.001;
  section.high_z = 0.003;
  section.media = {{1, 0}, {1.49, 20}};
  section.lines.push_back({{0, 0}, {pitch, 0}, {SurfaceKind::kInterface, 1, 0}});
  section.lines.push_back({{0.0001, 0.001}, {0.0008, 0.0015}, {SurfaceKind::kInterface, 0, 1}});
  section.lines.push_back({{0.0008, 0.0015}, {0.0011, 0.001}, {SurfaceKind::kInterface, 0, 1}});
  return section;
}

TEST(UnitCell, ExtrudedSectionIsTheSection) {
  const UnitCellTracer cell(extruded(prisms(), 0.0023));
  const int rays = 16384;
  for (const double theta : {5.0, 40.0, 70.0})
    for (const double phi : {-90.0, 30.0, 200.0})
      for (const double sign : {1.0, -1.0}) {
        const glm::dvec3 into = incident(theta, phi) * glm::dvec3(1, 1, sign);
        const ProductLight solid = cell.trace(into, {rays}), flat = trace_section(prisms(), into, {rays});
        EXPECT_NEAR(balance(solid), 1, 1e-9);
        EXPECT_LT(solid.unfinished, 1e-5) << theta << ' ' << phi;
        // Even points of the cell: a share's error is a few cells of the square root of their number.
        EXPECT_NEAR(total(solid.transmitted), total(flat.transmitted), 2e-3) << theta << ' ' << phi;
        EXPECT_NEAR(solid.absorbed, flat.absorbed, 2e-3);
        for (const Exit& exit : flat.transmitted) {
          if (exit.flux < 0.01) continue;
          EXPECT_NEAR(along(solid.transmitted, exit.direction), exit.flux, 3e-3) << theta << ' ' << phi;
        }
      }
}

/// A sheet with a square hole of the given share, so thin that its edges do not count.
UnitCell perforated(double hole_share) {
  const double period = 0.01, half = 0.5 * period * std::sqrt(hole_share), c = 0.5 * period;
  UnitCell cell{period, period, -0.001, 0.001, {{1, 0}}, {{SurfaceKind::kDiffuse, 0, 0, 0.5, 0.2, 0.1, 0}}, {}, {}};
  for (const double size : {c, half})
    for (const glm::dvec2 corner : {glm::dvec2(-1, -1), glm::dvec2(1, -1), glm::dvec2(1, 1), glm::dvec2(-1, 1)})
      cell.corners.emplace_back(c + size * corner.x, c + size * corner.y, 0);
  for (int k = 0; k < 4; ++k) {
    const int next = (k + 1) % 4;
    cell.facets.push_back({{k, next, 4 + k}, 0});
    cell.facets.push_back({{next, 4 + next, 4 + k}, 0});
  }
  return cell;
}

TEST(UnitCell, HolesPassTheirShareAndTheSheetScattersTheRest) {
  const UnitCellTracer cell(perforated(0.25));
  for (const double sign : {1.0, -1.0}) {
    const glm::dvec3 into = incident(35, 20) * glm::dvec3(1, 1, sign);
    const ProductLight light = cell.trace(into, {16384});
    EXPECT_NEAR(along(light.transmitted, into), 0.25, 1e-3);
    EXPECT_NEAR(total(light.transmitted), 0.25 + 0.75 * 0.1, 1e-3);
    // Its front looks to the room.
    EXPECT_NEAR(total(light.reflected), 0.75 * (sign > 0 ? 0.2 : 0.5), 1e-3);
    EXPECT_NEAR(balance(light), 1, 1e-9);
  }
}

TEST(UnitCell, RoofOfMirrorsSendsLightBack) {
  const double side = 0.001, root = std::sqrt(0.5);
  UnitCell cell{side, side, -0.002, 0.002, {{1, 0}}, {{SurfaceKind::kMirror, 0, 0, 1, 1, 0, 0}}, {}, {}};
  // Two mirrors that make a right angle along x: light turns round in y and z, and keeps going in x.
  cell.corners = {{0, 0, 0},    {side, 0, 0},   {0, 0.5 * side, 0.5 * side}, {side, 0.5 * side, 0.5 * side},
                  {0, side, 0}, {side, side, 0}};
  cell.facets = {{{0, 1, 2}, 0}, {{1, 3, 2}, 0}, {{2, 3, 4}, 0}, {{3, 5, 4}, 0}};
  const UnitCellTracer roof(cell);
  const glm::dvec3 into = glm::normalize(glm::dvec3(0.3, 0, root));
  const ProductLight light = roof.trace(into, {1024});
  EXPECT_NEAR(along(light.reflected, {into.x, -into.y, -into.z}), 1, 1e-6);
}

TEST(UnitCell, RefusesWhatCannotBe) {
  const auto refused = [](auto change) {
    UnitCell cell = perforated(0.25);
    change(cell);
    EXPECT_THROW(UnitCellTracer{cell}, InputError);
  };
  refused([](UnitCell& cell) { cell.facets[0].corners[1] = 99; });
  refused([](UnitCell& cell) { cell.facets[0].surface = 1; });
  refused([](UnitCell& cell) { cell.facets[0].corners[1] = cell.facets[0].corners[0]; });
  refused([](UnitCell& cell) { cell.corners[0].z = 1; });
  refused([](UnitCell& cell) { cell.surfaces[0].reflectance = 1.2; });
  refused([](UnitCell& cell) { cell.facets.clear(); });
  refused([](UnitCell& cell) { cell.period_x = 0; });
  EXPECT_THROW(UnitCellTracer(perforated(0.25)).trace({1, 0, 0}, {}), InputError);
}

}  // namespace
}  // namespace transom
