// Small scenes that tests light.
#pragma once

#include <cmath>
#include <vector>

#include "transom/engine.h"
#include "transom/view.h"

namespace transom::test {

/// Adds an axis-aligned box with outward faces (or inward ones), material `material`.
inline void add_box(SceneGeometry& scene, glm::dvec3 low, glm::dvec3 high, int material, bool inward = false) {
  const int base = static_cast<int>(scene.vertices.size());
  for (int k = 0; k < 8; ++k)
    scene.vertices.push_back({k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z});
  const int quads[6][4]{{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    if (inward)
      scene.faces.push_back({base + q[3], base + q[2], base + q[1], base + q[0]});
    else
      scene.faces.push_back({base + q[0], base + q[1], base + q[2], base + q[3]});
    scene.face_material.push_back(material);
  }
}

inline void add_quad(SceneGeometry& scene, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c, glm::dvec3 d, int material) {
  const int base = static_cast<int>(scene.vertices.size());
  scene.vertices.insert(scene.vertices.end(), {a, b, c, d});
  scene.faces.push_back({base, base + 1, base + 2, base + 3});
  scene.face_material.push_back(material);
}

inline Material diffuse(float reflectance) {
  return {glm::vec3(reflectance), glm::vec3(0), false, -1};
}

/// Tregenza's 145 bins.
inline SkyBins tregenza() {
  SkyBins bins;
  bins.row_counts = {30, 30, 24, 24, 18, 12, 6, 1};
  const float edges_deg[]{0, 12, 24, 36, 48, 60, 72, 84, 90};
  for (const float e : edges_deg) bins.row_altitude_edges.push_back(e * 3.14159265f / 180);
  return bins;
}

inline Condition uniform_sky(float luminance, float ground = 0) {
  Condition condition;
  condition.sky_luminance.assign(145, luminance);
  condition.ground_luminance = glm::vec3(ground);
  return condition;
}

/// A solve of few patches and rays.
inline SolveOptions quick(int patch_count, GatherSamples patch_samples, GatherSamples node_samples) {
  SolveOptions options;
  options.target_patch_count = patch_count;
  options.patch_samples = patch_samples;
  options.node_samples = node_samples;
  return options;
}

/// A 4 x 4 x 3 m room with an unglazed hole, of 2 x 2 m in the middle of its roof, and walls of the given reflectance.
inline SceneGeometry roof_light_room(float reflectance, float transmittance = 1) {
  SceneGeometry scene;
  scene.materials = {diffuse(reflectance), {glm::vec3(0), glm::vec3(0), false, 0}};
  scene.openings = {{std::vector<float>(2, transmittance), 0.f}};
  const double x = 4, y = 4, z = 3;
  add_quad(scene, {0, 0, 0}, {x, 0, 0}, {x, y, 0}, {0, y, 0}, 0);
  add_quad(scene, {0, 0, 0}, {0, 0, z}, {x, 0, z}, {x, 0, 0}, 0);
  add_quad(scene, {x, y, 0}, {x, y, z}, {0, y, z}, {0, y, 0}, 0);
  add_quad(scene, {0, y, 0}, {0, y, z}, {0, 0, z}, {0, 0, 0}, 0);
  add_quad(scene, {x, 0, 0}, {x, 0, z}, {x, y, z}, {x, y, 0}, 0);
  const double a = 1, b = 3;
  add_quad(scene, {0, 0, z}, {x, 0, z}, {b, a, z}, {a, a, z}, 0);
  add_quad(scene, {x, 0, z}, {x, y, z}, {b, b, z}, {b, a, z}, 0);
  add_quad(scene, {x, y, z}, {0, y, z}, {a, b, z}, {b, b, z}, 0);
  add_quad(scene, {0, y, z}, {0, 0, z}, {a, a, z}, {a, b, z}, 0);
  add_quad(scene, {a, a, z}, {b, a, z}, {b, b, z}, {a, b, z}, 1);
  return scene;
}

/// A small picture from one corner of that room, of its floor and what stands on it.
inline View into_the_room() {
  View view;
  view.position = {0.5, 0.5, 1.5};
  view.target = {3, 3, 0};
  view.width = 24;
  view.height = 18;
  return view;
}

/// Irradiance of points, found in one go.
inline std::vector<Irradiance> illuminance(const Engine& engine, const Lighting& lighting,
                                           const std::vector<glm::dvec3>& points, const std::vector<glm::vec3>& normals,
                                           GatherSamples samples) {
  return engine.illuminance(lighting, engine.sensors(points, normals, samples));
}

}  // namespace transom::test
