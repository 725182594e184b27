#include "transom/section.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <numbers>

#include "transom/error.h"

namespace transom {
namespace {

constexpr double kPi = std::numbers::pi;

/// Every branch followed to its end: no chance in it.
TraceOptions exact(int ray_count) {
  TraceOptions options;
  options.ray_count = ray_count;
  options.split_share = 1e-9;
  return options;
}

double total(const std::vector<Exit>& exits) {
  double sum = 0;
  for (const Exit& exit : exits) sum += exit.flux;
  return sum;
}

double balance(const ProductLight& light) {
  return total(light.transmitted) + total(light.reflected) + light.absorbed + light.unfinished;
}

/// A pane of thickness 4 mm.
Section slab(double index, double absorption = 0) {
  Section section;
  section.period = 0.01;
  section.low_z = -0.001;
  section.high_z = 0.005;
  section.media = {{1, 0}, {index, absorption}};
  section.lines.push_back({{0, 0}, {0.01, 0}, {SurfaceKind::kInterface, 1, 0}});
  section.lines.push_back({{0, 0.004}, {0.01, 0.004}, {SurfaceKind::kInterface, 0, 1}});
  return section;
}

glm::dvec3 incident(double theta_deg, double phi_deg) {
  const double t = theta_deg * kPi / 180, p = phi_deg * kPi / 180;
  return {std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)};
}

// Both polarisations apart, all reflections between the faces: T = 1/2 sum (1 - r) / (1 + r).
double slab_transmittance(double index, double theta_deg) {
  const double c = std::cos(theta_deg * kPi / 180), s = std::sin(theta_deg * kPi / 180);
  const double beyond = std::sqrt(1 - s * s / (index * index));
  const double rs = std::pow((c - index * beyond) / (c + index * beyond), 2);
  const double rp = std::pow((index * c - beyond) / (index * c + beyond), 2);
  return 0.5 * ((1 - rs) / (1 + rs) + (1 - rp) / (1 + rp));
}

TEST(Section, SlabTransmitsAsItsClosedFormFromEveryAzimuth) {
  const Section section = slab(1.52);
  EXPECT_NEAR(slab_transmittance(1.52, 60), 0.8435, 1e-4);
  for (const double theta : {0.0, 30.0, 60.0, 80.0})
    for (const double phi : {0.0, 37.0, 90.0, 200.0}) {
      const ProductLight light = trace_section(section, incident(theta, phi), exact(16));
      EXPECT_NEAR(total(light.transmitted), slab_transmittance(1.52, theta), 1e-6) << theta << ' ' << phi;
      EXPECT_NEAR(balance(light), 1, 1e-9);
      ASSERT_EQ(light.transmitted.size(), 1u);
      EXPECT_NEAR(glm::length(light.transmitted[0].direction - incident(theta, phi)), 0, 1e-9);
    }
}

TEST(Section, AbsorptionFollowsTheSlantedPath) {
  const double absorption = 50, thickness = 0.004, theta = 60, index = 1.5;
  const double inside = thickness / std::sqrt(1 - std::pow(std::sin(theta * kPi / 180) / index, 2));
  const double a = std::exp(-absorption * inside);
  double expected = 0;  // T = (1 - r)^2 a / (1 - r^2 a^2) for each polarisation
  const double c = std::cos(theta * kPi / 180), beyond = thickness / inside;
  for (const double r : {std::pow((c - index * beyond) / (c + index * beyond), 2),
                         std::pow((index * c - beyond) / (index * c + beyond), 2)})
    expected += 0.5 * (1 - r) * (1 - r) * a / (1 - r * r * a * a);
  for (const double phi : {0.0, 60.0, 90.0}) {
    const ProductLight light = trace_section(slab(index, absorption), incident(theta, phi), exact(16));
    EXPECT_NEAR(total(light.transmitted), expected, 1e-6) << phi;
    EXPECT_NEAR(balance(light), 1, 1e-9);
    EXPECT_GT(light.absorbed, 0.1);
  }
}

/// A prism of the given facet angle under a flat outdoor face: light that enters straight meets the facet once.
TEST(Section, SingleFacetRefractsBySnell) {
  const double angle = 20 * kPi / 180, index = 1.49, pitch = 0.001;
  Section section;
  section.period = pitch;
  section.low_z = -0.001;
  section.high_z = 0.003;
  section.media = {{1, 0}, {index, 0}};
  section.lines.push_back({{0, 0}, {pitch, 0}, {SurfaceKind::kInterface, 1, 0}});
  // The facet rises with y; the riser back is an ideal absorber, so that nothing but the facet sends light on.
  const double top = 0.001 + pitch * std::tan(angle);
  section.lines.push_back({{0, 0.001}, {pitch, top}, {SurfaceKind::kInterface, 0, 1}});
  const ProductLight light = trace_section(section, {0, 0, 1}, exact(64));
  const double beyond = std::asin(index * std::sin(angle));
  double strongest = 0;
  glm::dvec3 direction(0);
  for (const Exit& exit : light.transmitted)
    if (exit.flux > strongest) {
      strongest = exit.flux;
      direction = exit.direction;
    }
  // The facet's normal leans to -y: light that leaves it into air turns towards +y... away from the normal.
  EXPECT_NEAR(std::asin(direction.y), beyond - angle, 1e-9);
  EXPECT_NEAR(balance(light), 1, 1e-9);
}

/// Horizontal cuts of air through a panel [Edmonds 1993]: what fraction meets a cut is geometry alone, and past the
/// critical angle all of that is mirrored up.
TEST(Section, LaserCutPanelFollowsEdmonds) {
  const double index = 1.5, spacing = 0.004, depth = 0.006;
  Section section;
  section.period = spacing;
  section.low_z = -0.001;
  section.high_z = depth + 0.001;
  section.media = {{1, 0}, {index, 0}};
  section.lines.push_back({{0, 0}, {spacing, 0}, {SurfaceKind::kInterface, 1, 0}});
  section.lines.push_back({{0, depth}, {spacing, depth}, {SurfaceKind::kInterface, 0, 1}});
  section.lines.push_back({{0.5 * spacing, 1e-9}, {0.5 * spacing, depth - 1e-9}, {SurfaceKind::kGap, 1, 1}});
  for (const double elevation : {10.0, 25.0, 40.0, 60.0}) {
    const glm::dvec3 down = incident(elevation, -90);  // from a sun at that height
    const ProductLight light = trace_section(section, down, {4096});
    double up = 0, straight = 0;
    for (const Exit& exit : light.transmitted) (exit.direction.y > 0 ? up : straight) += exit.flux;
    const double inside = std::asin(std::sin(elevation * kPi / 180) / index);
    double share = depth * std::tan(inside) / spacing;
    share = share <= 1 ? share : 2 - share;
    EXPECT_NEAR(up / (up + straight), share, 2e-3) << elevation;
    EXPECT_NEAR(total(light.transmitted), slab_transmittance(index, elevation), 2e-3);
    EXPECT_NEAR(balance(light), 1, 1e-9);
  }
}

TEST(Section, DiffuseSheetSplitsItsLight) {
  Section section;
  section.period = 0.01;
  section.low_z = -0.001;
  section.high_z = 0.001;
  section.media = {{1, 0}};
  Line sheet{{0, 0}, {0.01, 0}, {SurfaceKind::kDiffuse, 0, 0, 0.5, 0.5, 0.3, 0.1}};
  section.lines.push_back(sheet);
  const ProductLight light = trace_section(section, incident(30, 90), {4096});
  double straight = 0, cosine = 0, spread = 0;
  for (const Exit& exit : light.transmitted) {
    if (glm::length(exit.direction - incident(30, 90)) < 1e-9) {
      straight += exit.flux;
      continue;
    }
    cosine += exit.flux * exit.direction.z;
    spread += exit.flux;
  }
  EXPECT_NEAR(straight, 0.1, 1e-9);
  EXPECT_NEAR(spread, 0.9 * 0.3, 1e-9);
  EXPECT_NEAR(cosine / spread, 2.0 / 3, 0.01);  // mean cosine of Lambertian flux
  EXPECT_NEAR(total(light.reflected), 0.9 * 0.5, 1e-9);
  EXPECT_NEAR(light.absorbed, 0.9 * 0.2, 1e-9);
}

TEST(Section, LightTurnedRoundTakesTheSameWay) {
  // A prism with two facets: its straightest beam, sent back, arrives where it came from with the same share.
  const double pitch = 0.001, index = 1.49;
  Section section;
  section.period = pitch;
  section.low_z = -0.001;
  section.high_z = 0.003;
  section.media = {{1, 0}, {index, 0}};
  section.lines.push_back({{0, 0}, {pitch, 0}, {SurfaceKind::kInterface, 1, 0}});
  section.lines.push_back({{0, 0.001}, {0.6 * pitch, 0.0015}, {SurfaceKind::kInterface, 0, 1}});
  section.lines.push_back({{0.6 * pitch, 0.0015}, {pitch, 0.001}, {SurfaceKind::kInterface, 0, 1}});
  const glm::dvec3 into = incident(35, -60);
  // Helmholtz asks it of the BTDF. For beams cos(theta) d(omega) = dx dy of the direction, and x stays, so that
  // shares go as the change of the leaving y with the incident y: a prism makes beams wider or narrower.
  const double step = 1e-6;
  glm::dvec3 beside = into;
  beside.y += step;
  beside.z = std::sqrt(1 - beside.x * beside.x - beside.y * beside.y);
  const ProductLight light = trace_section(section, into, {8192}), shifted = trace_section(section, beside, {8192});
  int compared = 0;
  for (const Exit& exit : light.transmitted) {
    if (exit.flux < 0.05) continue;
    double stretch = 0;
    for (const Exit& other : shifted.transmitted)
      if (glm::length(other.direction - exit.direction) < 100 * step && std::abs(other.flux - exit.flux) < 1e-2)
        stretch = (other.direction.y - exit.direction.y) / step;
    ASSERT_NE(stretch, 0);
    const ProductLight back = trace_section(section, -exit.direction, {8192});
    double returned = 0;
    for (const Exit& b : back.transmitted)
      if (glm::length(b.direction + into) < 1e-6) returned += b.flux;
    EXPECT_NEAR(returned * std::abs(stretch), exit.flux, 2e-3 * exit.flux + 2e-4);
    EXPECT_GT(std::abs(std::abs(stretch) - 1), 1e-3);
    ++compared;
  }
  EXPECT_GE(compared, 2);
}

/// Prisms of two unequal facets, moved along y.
Section prisms(double shift) {
  const double pitch = 0.001;
  Section section;
  section.period = pitch;
  section.low_z = -0.001;
  section.high_z = 0.003;
  section.media = {{1, 0}, {1.49, 20}};
  section.lines.push_back({{shift, 0}, {shift + pitch, 0}, {SurfaceKind::kInterface, 1, 0}});
  section.lines.push_back({{shift, 0.001}, {shift + 0.7 * pitch, 0.0015}, {SurfaceKind::kInterface, 0, 1}});
  section.lines.push_back({{shift + 0.7 * pitch, 0.0015}, {shift + pitch, 0.001}, {SurfaceKind::kInterface, 0, 1}});
  return section;
}

TEST(Section, BeamsBetweenStraightLinesNeedNoSampling) {
  // Only what is weaker than split_share of a ray is left to chance: the shares hardly depend on rays or seed.
  for (const double theta : {0.0, 20.0, 55.0, 75.0}) {
    TraceOptions few{256}, many{65536};
    many.seed = 9;
    const ProductLight a = trace_section(prisms(0), incident(theta, -70), few);
    const ProductLight b = trace_section(prisms(0), incident(theta, -70), many);
    EXPECT_NEAR(total(a.transmitted), total(b.transmitted), 5e-4) << theta;
    EXPECT_NEAR(balance(a), 1, 1e-12);
    EXPECT_NEAR(balance(b), 1, 1e-12);
    for (const Exit& strong : b.transmitted) {
      if (strong.flux < 0.02) continue;
      double found = 0;
      for (const Exit& exit : a.transmitted)
        if (glm::length(exit.direction - strong.direction) < 1e-8) found += exit.flux;
      EXPECT_NEAR(found, strong.flux, 5e-4) << theta;
    }
  }
}

TEST(Section, WhereAPeriodBeginsDoesNotMatter) {
  const ProductLight here = trace_section(prisms(0), incident(50, 250), {16384});
  for (const double shift : {-0.00033, 0.00051, 0.0127}) {
    const ProductLight there = trace_section(prisms(shift), incident(50, 250), {16384});
    EXPECT_NEAR(total(here.transmitted), total(there.transmitted), 1e-4);
    EXPECT_NEAR(total(here.reflected), total(there.reflected), 1e-4);
  }
}

TEST(Section, HollowMirrorSpreadsAsItsCircleSays) {
  // Straight onto an arc whose slope has sine u, light goes back at twice the slope, and u is even over the aperture:
  // the mean of the cosine is 1 - 2 <u²> = 1 - 2 s² / 3, with s at the edge.
  for (const double sign : {1.0, -1.0}) {
    const double aperture = 0.02, radius = 0.05, s = 0.5 * aperture / radius;
    Section section;
    section.period = aperture;
    section.low_z = -0.01;
    section.high_z = 0.01;
    section.media = {{1, 0}};
    const double bow = radius * (1 - std::sqrt(1 - s * s));
    section.lines.push_back({{0, 0}, {aperture, 0}, {SurfaceKind::kMirror, 0, 0, 0.9, 0.8}, sign * bow});
    const ProductLight light = trace_section(section, {0, 0, 1}, {4096});
    double cosine = 0, across = 0;
    for (const Exit& exit : light.reflected) {
      cosine -= exit.flux * exit.direction.z;
      across = std::max(across, std::abs(exit.direction.y));
    }
    EXPECT_NEAR(total(light.reflected), 0.8, 1e-12);  // from outdoors it meets the right side of a -> b
    EXPECT_NEAR(cosine / 0.8, 1 - 2 * s * s / 3, 1e-5);
    EXPECT_NEAR(across, 2 * s * std::sqrt(1 - s * s), 1e-3);
    EXPECT_NEAR(balance(light), 1, 1e-12);
  }
}

TEST(Section, ArcRefractsAsManyStraightLines) {
  // Shallow cylindrical lenses on a sheet, and the same as 400 lines. At the onset of total reflection one line, with
  // 1/400 of the light, may go either way.
  const double pitch = 0.001, bow = 0.00004, half = 2 * std::atan2(2 * bow, pitch),
               radius = 0.5 * pitch / std::sin(half);
  Section arcs;
  arcs.period = pitch;
  arcs.low_z = -0.001;
  arcs.high_z = 0.003;
  arcs.media = {{1, 0}, {1.5, 0}};
  arcs.lines.push_back({{0, 0}, {pitch, 0}, {SurfaceKind::kInterface, 1, 0}});
  Section lines = arcs;
  arcs.lines.push_back({{0, 0.001}, {pitch, 0.001}, {SurfaceKind::kInterface, 0, 1}, bow});
  const auto place = [&](int k) {
    const double turn = half * (2.0 * k / 400 - 1);
    return glm::dvec2(0.5 * pitch + radius * std::sin(turn), 0.001 + radius * (std::cos(turn) - std::cos(half)));
  };
  for (int k = 0; k < 400; ++k) lines.lines.push_back({place(k), place(k + 1), {SurfaceKind::kInterface, 0, 1}});
  for (const double theta : {0.0, 30.0, 60.0}) {
    const ProductLight a = trace_section(arcs, incident(theta, 70), {2048});
    const ProductLight b = trace_section(lines, incident(theta, 70), {2048});
    EXPECT_NEAR(total(a.transmitted), total(b.transmitted), 1.0 / 400) << theta;
    double mean_a = 0, mean_b = 0;
    for (const Exit& exit : a.transmitted) mean_a += exit.flux * exit.direction.y;
    for (const Exit& exit : b.transmitted) mean_b += exit.flux * exit.direction.y;
    EXPECT_NEAR(mean_a, mean_b, 1.0 / 400) << theta;
  }
}

TEST(Section, ThreadsDoNotChangeTheAnswer) {
  Section section = prisms(0);  // with a diffuse, curved sheet behind: rays of every kind
  section.high_z = 0.006;
  section.lines.push_back({{0, 0.004}, {0.0007, 0.0045}, {SurfaceKind::kDiffuse, 0, 0, 0.5, 0.4, 0.3, 0.1}, 0.0001});
  std::vector<ProductLight> lights;
  for (const std::size_t threads : {1u, 2u}) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    lights.push_back(trace_section(section, incident(40, -60), {1024}));
  }
  ASSERT_EQ(lights[0].transmitted.size(), lights[1].transmitted.size());
  for (std::size_t k = 0; k < lights[0].transmitted.size(); ++k) {
    EXPECT_EQ(lights[0].transmitted[k].flux, lights[1].transmitted[k].flux);
    EXPECT_EQ(lights[0].transmitted[k].direction, lights[1].transmitted[k].direction);
  }
  EXPECT_EQ(lights[0].absorbed, lights[1].absorbed);
}

TEST(Section, SecondScatteringIsLambertianToo) {
  // Two diffuse sheets: light that leaves the second has been scattered twice. Its mean cosine is 2/3, and its azimuth
  // is even: the mean of the cosine of four times the azimuth is 0.
  Section section;
  section.period = 0.01;
  section.low_z = -0.001;
  section.high_z = 0.003;
  section.media = {{1, 0}};
  for (const double z : {0.0, 0.002})
    section.lines.push_back({{0, z}, {0.01, z}, {SurfaceKind::kDiffuse, 0, 0, 0.3, 0.3, 0.7, 0}});
  const ProductLight light = trace_section(section, incident(30, 50), {16384});
  double cosine = 0, fourfold = 0;
  for (const Exit& exit : light.transmitted) {
    cosine += exit.flux * exit.direction.z;
    fourfold += exit.flux * std::cos(4 * std::atan2(exit.direction.y, exit.direction.x));
  }
  const double passed = total(light.transmitted);
  EXPECT_NEAR(passed, 0.7 * 0.7 / (1 - 0.3 * 0.3), 2e-3);
  EXPECT_NEAR(cosine / passed, 2.0 / 3, 5e-3);
  EXPECT_NEAR(fourfold / passed, 0, 1e-2);
}

TEST(Section, RefusesWhatCannotBe) {
  Section section = slab(1.5);
  section.lines[0].bow = 0.006;
  EXPECT_THROW(trace_section(section, {0, 0, 1}, {}), InputError);
  section = slab(1.5);
  section.lines[0].b.y = 1;
  EXPECT_THROW(trace_section(section, {0, 0, 1}, {}), InputError);
  section = slab(1.5);
  section.lines[0].surface.back = 7;
  EXPECT_THROW(trace_section(section, {0, 0, 1}, {}), InputError);
  EXPECT_THROW(trace_section(slab(1.5), {0, 1, 0}, {}), InputError);
}

}  // namespace
}  // namespace transom
