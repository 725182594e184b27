/// @file Stencil shadow volumes against rays: every triangle tried for every pixel, on the processor, in double
/// precision.
#include "transom/shadow_volumes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "shadow_scene.h"
#include "transom/error.h"

#if defined(__SANITIZE_ADDRESS__)
/// OSMesa keeps a framebuffer for each context until the process ends.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libOSMesa\n";
}
#endif

namespace transom {
namespace {

using test::TestScene;

/// A room of single sheets, 6 x 5 x 3 m, a south facade with two windows of two panes each and one behind the other in
/// part; closed boxes (one of them turned inside out, two of them interpenetrating), open sheets of both orientations.
TestScene furnished_room() {
  TestScene scene;
  scene.add_quad({0, 0, 0}, {6, 0, 0}, {0, 5, 0});  // floor
  scene.add_quad({0, 0, 3}, {0, 5, 0}, {6, 0, 0});  // ceiling
  scene.add_quad({0, 0, 0}, {0, 5, 0}, {0, 0, 3});  // west
  scene.add_quad({6, 0, 0}, {0, 0, 3}, {0, 5, 0});  // east
  scene.add_quad({0, 5, 0}, {6, 0, 0}, {0, 0, 3});  // north
  scene.add_facade(0, 6, 3, {{1, 0.9F, 2.5F, 2.6F}, {3.5F, 0.9F, 5, 2.6F}});
  for (const float x : {1.0F, 3.5F}) {
    scene.add_quad({x, 0, 0.9F}, {1.5F, 0, 0}, {0, 0, 1.0F}, 0);
    scene.add_quad({x, 0, 1.9F}, {1.5F, 0, 0}, {0, 0, 0.7F}, 1);
  }
  scene.add_quad({1.2F, 0.15F, 1.0F}, {1, 0, 0}, {0, 0, 0.6F}, 0);  // a second pane behind the first
  scene.add_box({1.5F, 1.2F, 0.7F}, {3.0F, 2.0F, 0.75F});           // desk top
  scene.add_box({1.55F, 1.25F, 0}, {1.6F, 1.3F, 0.7F});
  scene.add_box({2.9F, 1.9F, 0}, {2.95F, 1.95F, 0.7F}, true);
  scene.add_box({4.0F, 1.0F, 0}, {4.6F, 1.6F, 0.9F});
  scene.add_box({4.3F, 1.3F, 0.5F}, {4.9F, 1.9F, 1.2F});                 // interpenetrates the one before
  scene.add_quad({3.2F, 0.8F, 0.2F}, {0.4F, 0.1F, 0}, {0, 0.2F, 1.0F});  // leaning sheets
  scene.add_quad({0.4F, 2.0F, 0.5F}, {0, 0.2F, 1.2F}, {0.8F, 0, 0.1F});
  for (int i = 0; i < 5; ++i) {
    const auto height = static_cast<float>(1.0 + 0.25 * i);
    scene.add_quad({3.6F, 0.3F, height}, {1.2F, 0, 0}, {0, 0.15F, 0.05F});  // louvre
  }
  return scene;
}

/// What a ray through a point of the picture meets. state -2: nothing; -1: a side that faces away from the sun.
struct RayAnswer {
  int state = -2;
  std::vector<int> crossings;
  bool operator==(const RayAnswer&) const = default;
};

std::optional<double> intersect(const TestScene& scene, glm::uvec3 triangle, glm::dvec3 origin, glm::dvec3 direction) {
  const glm::dvec3 a(scene.vertices[triangle.x]), b(scene.vertices[triangle.y]), c(scene.vertices[triangle.z]);
  const glm::dvec3 p = glm::cross(direction, c - a);
  const double determinant = glm::dot(b - a, p);
  if (determinant == 0) return {};
  const double u = glm::dot(origin - a, p) / determinant;
  const glm::dvec3 q = glm::cross(origin - a, b - a);
  const double v = glm::dot(direction, q) / determinant;
  if (u < 0 || v < 0 || u + v > 1) return {};
  return glm::dot(c - a, q) / determinant;
}

RayAnswer trace(const TestScene& scene, const VolumeCamera& camera, glm::dvec3 sun, double pixel_x, double pixel_y) {
  const glm::dvec3 forward = glm::normalize(camera.target - camera.position);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.up));
  const double pixel = 2 * std::tan(camera.vertical_fov_rad / 2) / camera.height;
  const glm::dvec3 direction = glm::normalize(forward + right * (pixel * (pixel_x - 0.5 * camera.width)) -
                                              glm::cross(right, forward) * (pixel * (pixel_y - 0.5 * camera.height)));
  double nearest = std::numeric_limits<double>::infinity();
  const glm::uvec3* seen = nullptr;
  for (const glm::uvec3& triangle : scene.opaque) {
    const auto distance = intersect(scene, triangle, camera.position, direction);
    if (distance && *distance > 0 && *distance < nearest) nearest = *distance, seen = &triangle;
  }
  if (!seen) return {};
  const glm::dvec3 a(scene.vertices[seen->x]), b(scene.vertices[seen->y]), c(scene.vertices[seen->z]);
  const glm::dvec3 normal = glm::normalize(glm::cross(b - a, c - a));
  if (glm::dot(normal, sun) * -glm::dot(normal, direction) <= 1e-6) return {-1, {}};
  const glm::dvec3 point = camera.position + nearest * direction;
  const double offset = 1e-6 * nearest;
  const auto count = [&](const std::vector<glm::uvec3>& triangles) {
    return static_cast<int>(std::count_if(triangles.begin(), triangles.end(), [&](const glm::uvec3& triangle) {
      return &triangle != seen && intersect(scene, triangle, point, sun).value_or(-1) > offset;
    }));
  };
  RayAnswer answer{count(scene.opaque) > 0 ? 1 : 0, {}};
  for (const auto& group : scene.openings) answer.crossings.push_back(count(group));
  return answer;
}

/// Whether the point seen through a pixel's centre lies in a box.
bool is_seen_in(const TestScene& scene, const VolumeCamera& camera, const std::pair<glm::vec3, glm::vec3>& box, int x,
                int y) {
  const glm::dvec3 forward = glm::normalize(camera.target - camera.position),
                   right = glm::normalize(glm::cross(forward, camera.up));
  const double pixel = 2 * std::tan(camera.vertical_fov_rad / 2) / camera.height;
  const glm::dvec3 direction = forward + right * (pixel * (x + 0.5 - 0.5 * camera.width)) -
                               glm::cross(right, forward) * (pixel * (y + 0.5 - 0.5 * camera.height));
  double nearest = std::numeric_limits<double>::infinity();
  for (const glm::uvec3& triangle : scene.opaque) {
    const double distance = intersect(scene, triangle, camera.position, direction).value_or(-1);
    if (distance > 0) nearest = std::min(nearest, distance);
  }
  const glm::dvec3 point = camera.position + nearest * direction;
  return glm::all(glm::greaterThanEqual(point, glm::dvec3(box.first))) &&
         glm::all(glm::lessThanEqual(point, glm::dvec3(box.second)));
}

/// Whether the rays' answer changes within one pixel of the pixel's centre.
bool is_edge(const TestScene& scene, const VolumeCamera& camera, glm::dvec3 sun, int x, int y) {
  const RayAnswer centre = trace(scene, camera, sun, x + 0.5, y + 0.5);
  constexpr int kSteps = 8;
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int j = -kSteps; j <= kSteps; ++j) {
      const double dx = static_cast<double>(i) / kSteps, dy = static_cast<double>(j) / kSteps;
      if (trace(scene, camera, sun, x + 0.5 + dx, y + 0.5 + dy) != centre) return true;
    }
  }
  return false;
}

class ShadowVolumesTest : public ::testing::TestWithParam<GlBackend> {
 protected:
  void SetUp() override {
    try {
      context_ = std::make_unique<GlContext>(GetParam());
    } catch (const GlError& error) {
      GTEST_SKIP() << error.what();
    }
  }

  BeamMask render(const TestScene& scene, const VolumeCamera& camera, glm::dvec3 sun) {
    return ShadowVolumes(*context_, scene.vertices, scene.opaque, scene.openings).render(camera, sun);
  }

  /// Volumes and rays agree on every pixel that is more than one pixel away from an edge, and nearly always on the
  /// others. Fails when this is not so, but for one pixel in all the pictures of a test.
  void expect_agreement(const TestScene& scene, const VolumeCamera& camera, glm::dvec3 sun) {
    sun = glm::normalize(sun);
    const BeamMask mask = render(scene, camera, sun);
    ASSERT_EQ(mask.shadowed.size(), static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    ASSERT_EQ(mask.crossings.size(), scene.openings.size());
    int compared = 0, lit = 0, edge_differences = 0;
    std::string differences;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const RayAnswer ray = trace(scene, camera, sun, x + 0.5, y + 0.5);
        if (ray.state < 0) continue;
        const auto i =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
        RayAnswer volume{mask.shadowed[i], {}};
        for (const auto& group : mask.crossings) volume.crossings.push_back(group[i]);
        ++compared;
        lit += ray.state == 0;
        if (volume == ray) continue;
        if (is_edge(scene, camera, sun, x, y)) {
          ++edge_differences;
        } else {
          ++isolated_differences_;
          differences += " (" + std::to_string(x) + ", " + std::to_string(y) + ")";
        }
      }
    }
    // About one pixel in a million stands where a side seen edge-on has no sound depth, and which one depends on the
    // driver.
    EXPECT_LE(isolated_differences_, 1) << differences << " on " << context_->name();
    EXPECT_LE(edge_differences, 2 + compared / 1000) << "of " << compared;
    compared_ += compared;
    lit_ += lit;
  }

  std::unique_ptr<GlContext> context_;
  int compared_ = 0, lit_ = 0, isolated_differences_ = 0;
};

constexpr double kDegree = std::numbers::pi / 180;
constexpr glm::dvec3 kMorningSun(-0.35, -0.8, 0.6);

VolumeCamera room_camera() {
  return {{3, 4.8, 1.6}, {3, 0, 1.0}, {0, 0, 1}, 70 * kDegree, 160, 120};
}

TEST_P(ShadowVolumesTest, AgreesWithRaysInAFurnishedRoom) {
  const TestScene scene = furnished_room();
  expect_agreement(scene, room_camera(), kMorningSun);
  expect_agreement(scene, {{5.7, 4.7, 2.5}, {2, 1, 0.4}, {0, 0, 1}, 60 * kDegree, 161, 119}, {0.4, -0.7, 0.9});
  EXPECT_GT(compared_, 10000);
  EXPECT_GT(lit_, 500);
}

TEST_P(ShadowVolumesTest, AgreesWithRaysWhereverTheCameraStands) {
  const TestScene scene = furnished_room();
  const glm::dvec3 below_the_desk(2.2, 1.6, 0.4), in_the_beam(1.8, 0.4, 1.2), in_the_pier_s_shadow(3.0, 0.5, 1.5);
  for (const glm::dvec3& position : {below_the_desk, in_the_beam, in_the_pier_s_shadow, glm::dvec3(3, -4, 4)}) {
    expect_agreement(scene, {position, {3.1, 2.5, 0.3}, {0, 0, 1}, 90 * kDegree, 96, 72}, kMorningSun);
    expect_agreement(scene, {position, {2.0, 0.1, 2.0}, {0.2, 0, 1}, 90 * kDegree, 96, 72}, kMorningSun);
  }
}

TEST_P(ShadowVolumesTest, AgreesWithRaysWithTheSunBehindAndBeforeTheCamera) {
  const TestScene scene = furnished_room();
  const glm::dvec3 towards(0, -1, 0.5);
  expect_agreement(scene, {{3, 4.9, 1.6}, glm::dvec3(3, 4.9, 1.6) + towards, {0, 0, 1}, 1.2, 96, 72}, towards);
  expect_agreement(scene, {{3, 0.3, 2.6}, glm::dvec3(3, 0.3, 2.6) - towards, {0, 0, 1}, 1.2, 96, 72}, towards);
  expect_agreement(scene, {{3, 2, 2.9}, {3, 2, 0}, {0, 1, 0}, 1.8, 96, 72}, kMorningSun);
}

TEST_P(ShadowVolumesTest, AgreesWithRaysWhenTheSunGrazesAPlane) {
  for (const double elevation_deg : {5.0, 1.0, 0.2, 0.05}) {
    const double elevation = elevation_deg * kDegree;
    TestScene scene;
    scene.add_quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0});
    scene.add_box({-0.5F, -0.5F, 0}, {0.5F, 0.5F, 0.01F});
    scene.add_quad({1, -2, 0}, {1, 0, 0}, {0, 0, 0.02F}, 0);
    for (const double azimuth : {0.0, 1.0}) {
      const glm::dvec3 sun(std::sin(azimuth) * std::cos(elevation), -std::cos(azimuth) * std::cos(elevation),
                           std::sin(elevation));
      expect_agreement(scene, {{1, 4, 1.5}, {0, 0, 0}, {0, 0, 1}, 1.0, 96, 72}, sun);
      expect_agreement(scene, {{1, -4, 0.3}, {0, 0, 0}, {0, 0, 1}, 1.0, 96, 72}, sun);
    }
  }
}

TEST_P(ShadowVolumesTest, AgreesWithRaysWhenTheSunShinesAlongAWall) {
  const TestScene scene = furnished_room();
  expect_agreement(scene, room_camera(), {0, -1, 0.8});
  expect_agreement(scene, room_camera(), {1e-3, -1, 0.8});
  expect_agreement(scene, room_camera(), {-1e-5, -1, 0.8});
  expect_agreement(scene, room_camera(), {0, -1, 0});
}

TEST_P(ShadowVolumesTest, AgreesWithRaysAtPixelScaleInALargeScene) {
  TestScene scene;
  scene.add_quad({-60, -60, 0}, {120, 0, 0}, {0, 120, 0});
  for (int i = 0; i < 12; ++i) {
    const int column = i % 4, row = i / 4;
    const auto x = static_cast<float>(9 * column - 12), y = static_cast<float>(11 * row - 10);
    scene.add_box({x, y, 0}, {x + 4, y + 3, static_cast<float>(2 + i)});
  }
  expect_agreement(scene, {{-40, -45, 20}, {0, 0, 3}, {0, 0, 1}, 0.7, 200, 150}, {0.6, -0.3, 0.4});
}

TEST_P(ShadowVolumesTest, CountsOpeningsOneBehindAnother) {
  TestScene scene;
  scene.add_quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0});
  for (int i = 0; i < 7; ++i) {
    const auto height = static_cast<float>(0.5 + 0.2 * i);
    i % 2 ? scene.add_quad({-1, -1, height}, {2, 0, 0}, {0, 2, 0}, 0)  // alternating orientation
          : scene.add_quad({-1, -1, height}, {0, 2, 0}, {2, 0, 0}, 0);
  }
  const BeamMask mask = render(scene, {{0, -4, 3}, {0, 0, 0}, {0, 0, 1}, 1.0, 33, 33}, {0, 0, 1});
  EXPECT_EQ(mask.crossings.at(0).at(16 * 33 + 16), 7);
  EXPECT_EQ(mask.crossings.at(0).at(32 * 33), 0);
  EXPECT_EQ(mask.shadowed.at(16 * 33 + 16), 0);
}

TEST_P(ShadowVolumesTest, AClosedBoxIsDarkWhicheverWayItsNormalsLook) {
  for (const bool inwards : {false, true}) {
    TestScene scene;
    scene.add_box({-1, -1, 0}, {1, 1, 2}, inwards);
    const BeamMask mask = render(scene, {{0, 0.9, 1.9}, {0, 0, 0}, {0, 0, 1}, 1.0, 32, 32}, {0.1, 0.2, 0.9});
    EXPECT_EQ(mask.shadowed.at(16 * 32 + 16), 1) << "inwards: " << inwards;
    expect_agreement(scene, {{0, 0.9, 1.9}, {0, 0, 0}, {0, 0, 1}, 1.5, 64, 64}, {0.1, 0.2, 0.9});
    expect_agreement(scene, {{0, -4, 4}, {0, 0, 0}, {0, 0, 1}, 1.0, 64, 64}, {0.1, -0.2, 0.9});
  }
}

TEST_P(ShadowVolumesTest, ARangeIsThatPartOfTheWholePicture) {
  const TestScene scene = furnished_room();
  const VolumeCamera camera = room_camera();
  ShadowVolumes volumes(*context_, scene.vertices, scene.opaque, scene.openings);
  const BeamMask whole = volumes.render(camera, kMorningSun);
  VolumeRange range{20, 31, 117, 88, {}};
  const std::pair<glm::vec3, glm::vec3> box{{1, 0.5F, -0.1F}, {5, 3, 0.1F}};  // of the floor
  for (const bool is_boxed : {false, true}) {
    if (is_boxed) range.boxes.push_back(box);
    const BeamMask part = volumes.render(camera, kMorningSun, range);
    ASSERT_EQ(part.width, range.right - range.left);
    ASSERT_EQ(part.height, range.bottom - range.top);
    int compared = 0, shadowed = 0;
    for (int y = 0; y < part.height; ++y)
      for (int x = 0; x < part.width; ++x) {
        if (is_boxed && !is_seen_in(scene, camera, box, x + range.left, y + range.top)) continue;
        const auto own = static_cast<std::size_t>(y * part.width + x),
                   of_whole = static_cast<std::size_t>((y + range.top) * camera.width + x + range.left);
        ASSERT_EQ(part.shadowed[own], whole.shadowed[of_whole]) << x << ' ' << y;
        for (std::size_t group = 0; group < part.crossings.size(); ++group)
          ASSERT_EQ(part.crossings[group][own], whole.crossings[group][of_whole]);
        ++compared;
        shadowed += part.shadowed[own];
      }
    EXPECT_GT(compared, 400);
    EXPECT_GT(shadowed, 0);
    EXPECT_LT(shadowed, compared);
  }
}

TEST_P(ShadowVolumesTest, SkipsWhatContributesNothing) {
  TestScene scene = furnished_room();
  scene.openings.resize(4);                                  // two empty groups
  scene.add_quad({0, 5, 4}, {6, 0, 0}, {0, 1, 0}, 4);        // all surfaces on the sun's side of it
  scene.add_quad({1, 2, 1}, {0, 0.5F, 0}, {0, 0, 0.5F}, 5);  // edge-on
  ShadowVolumes volumes(*context_, scene.vertices, scene.opaque, scene.openings);
  const BeamMask mask = volumes.render(room_camera(), {0, -1, 0});
  EXPECT_EQ(volumes.pass_count(), 4);  // visible depth, opaque casters, two groups
  for (const std::size_t group : {2U, 3U, 4U, 5U}) {
    EXPECT_EQ(std::count(mask.crossings.at(group).begin(), mask.crossings.at(group).end(), 0), 160 * 120);
  }
  const BeamMask again = volumes.render(room_camera(), {0, -1, 0});
  EXPECT_EQ(volumes.pass_count(), 3);  // the camera has not moved
  EXPECT_EQ(again.shadowed, mask.shadowed);
  EXPECT_EQ(again.crossings, mask.crossings);
}

TEST_P(ShadowVolumesTest, DrawsAnEmptySceneAndALargePicture) {
  const TestScene nothing;
  EXPECT_EQ(render(nothing, room_camera(), kMorningSun).shadowed, std::vector<std::uint8_t>(160 * 120, 0));
  VolumeCamera camera = room_camera();
  camera.width = 4096, camera.height = 16;
  EXPECT_EQ(render(furnished_room(), camera, kMorningSun).shadowed.size(), 4096U * 16U);
}

TEST_P(ShadowVolumesTest, RefusesImpossibleInput) {
  TestScene scene = furnished_room();
  VolumeCamera camera = room_camera();
  camera.width = 5000;
  EXPECT_THROW(render(scene, camera, kMorningSun), InputError);
  camera = room_camera();
  camera.target = camera.position;
  EXPECT_THROW(render(scene, camera, kMorningSun), InputError);
  EXPECT_THROW(render(scene, room_camera(), {0, 0, 0}), InputError);
  scene.opaque.emplace_back(0U, 1U, 100000U);
  EXPECT_THROW(render(scene, room_camera(), kMorningSun), InputError);
  scene.opaque.pop_back();
  scene.vertices[3].x = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(render(scene, room_camera(), kMorningSun), InputError);
}

TEST_P(ShadowVolumesTest, TwoContextsAndTwoScenesDoNotDisturbEachOther) {
  const TestScene room = furnished_room();
  TestScene plane;
  plane.add_quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0});
  GlContext second(GetParam());
  ShadowVolumes first_volumes(*context_, room.vertices, room.opaque, room.openings);
  const BeamMask before = first_volumes.render(room_camera(), kMorningSun);
  ShadowVolumes(*context_, plane.vertices, plane.opaque, {}).render(room_camera(), kMorningSun);
  const BeamMask other =
      ShadowVolumes(second, room.vertices, room.opaque, room.openings).render(room_camera(), kMorningSun);
  const BeamMask after = first_volumes.render(room_camera(), kMorningSun);
  EXPECT_EQ(before.shadowed, after.shadowed);
  EXPECT_EQ(before.shadowed, other.shadowed);
  EXPECT_EQ(before.crossings, other.crossings);
}

INSTANTIATE_TEST_SUITE_P(Backends, ShadowVolumesTest, ::testing::Values(GlBackend::kOsmesa, GlBackend::kEgl),
                         [](const auto& test) { return test.param == GlBackend::kOsmesa ? "Osmesa" : "Egl"; });

TEST(GlContextTest, SaysWhatItIs) {
  try {
    const GlContext context;
    EXPECT_NE(context.backend(), GlBackend::kAuto);
    EXPECT_NE(context.name().find("OpenGL"), std::string::npos);
  } catch (const GlError& error) {
    GTEST_SKIP() << error.what();
  }
}

}  // namespace
}  // namespace transom
