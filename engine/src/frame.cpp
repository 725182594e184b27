#include "transom/frame.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "transom/parallel.h"
#include "transom/shadow_volumes.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kMaximumCrossings = 16;   // openings looked through, one behind another
constexpr std::size_t kBlock = 64;      // samples traced together
constexpr float kSameNormal = 0.9995f;  // cosine between normals of one smooth or flat surface
constexpr int kLargestMask = 4096;      // pixels a side of a stencil mask
constexpr float kSameShare = 0.02f;     // of a beam, between neighbouring pixels without an edge

}  // namespace

/// One sample of the picture: where it is, then what it saw.
struct FrameRenderer::Sample {
  glm::vec2 pixel{0};
  int mask_index = -1;  // into the stencil masks, where they are used
  int face = -1;        // first opaque face
  Side side = 0;
  int crossings = 0;
  float beam_signature = 0;  // changes where the share of any beam changes
  glm::vec3 normal{0};
  float plane = 0;  // distance of the face's plane from the origin
  glm::vec3 sun{0}, sky{0}, indirect{0}, emitted{0}, exterior{0};
};

/// Share of each beam at each pixel of the stencil masks.
class FrameRenderer::BeamShare {
 public:
  std::vector<std::vector<float>> share;  // by beam, by pixel of the mask
};

FrameRenderer::FrameRenderer(Engine& engine) : engine_(engine) {}
FrameRenderer::~FrameRenderer() = default;

PrimaryHits trace_primary(const SceneGeometry& scene, const View& view) {
  const CameraRays camera(view);
  const Faces faces = make_faces(scene);
  const RayScene ray_scene(faces, scene.materials, scene.openings);
  PrimaryHits result;
  const std::size_t count = static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
  result.face.resize(count);
  result.position.resize(count);
  const glm::vec3 origin(view.position - faces.origin);
  parallel_ranges(count, kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<Ray> rays(end - begin);
    std::vector<Hit> hits(end - begin);
    for (std::size_t i = begin; i < end; ++i)
      rays[i - begin] = {origin, camera.direction(glm::vec2(i % view.width, i / view.width) + 0.5f)};
    ray_scene.intersect(RayScene::What::kAll, rays, hits);
    for (std::size_t i = begin; i < end; ++i) {
      const Hit& hit = hits[i - begin];
      result.face[i] = hit.face < 0 ? -1 : faces.faces[hit.face].source;
      if (hit.face >= 0)
        result.position[i] = view.position + static_cast<double>(hit.t) * glm::dvec3(rays[i - begin].direction);
    }
  });
  return result;
}

void FrameRenderer::trace_and_shade(const View& view, std::span<Sample> samples, const BeamShare* volumes) const {
  const CameraRays camera(view);
  const glm::vec3 origin(view.position - engine_.faces().origin);
  const Condition& condition = engine_.lighting().condition;
  const float offset = engine_.faces().ray_offset();

  parallel_ranges(samples.size(), kBlock, [&](std::size_t first, std::size_t last) {
    const std::size_t size = last - first;
    std::vector<Ray> rays(size);
    std::vector<Hit> hits(size);
    std::vector<float> through(size, 1.f);
    std::vector<std::size_t> active(size);
    for (std::size_t i = 0; i < size; ++i) {
      rays[i] = {origin, camera.direction(samples[first + i].pixel)};
      active[i] = i;
    }

    // Step 1: from the camera to the first opaque surface, through any number of openings.
    std::vector<Ray> active_rays;
    std::vector<Hit> active_hits;
    for (int crossing = 0; crossing <= kMaximumCrossings && !active.empty(); ++crossing) {
      active_rays.clear();
      for (const std::size_t i : active) active_rays.push_back(rays[i]);
      active_hits.resize(active.size());
      engine_.rays().intersect(RayScene::What::kAll, active_rays, active_hits);
      std::size_t kept = 0;
      for (std::size_t k = 0; k < active.size(); ++k) {
        const std::size_t i = active[k];
        const Hit& hit = active_hits[k];
        Sample& sample = samples[first + i];
        hits[i] = hit;
        if (hit.face < 0) {
          sample.exterior += through[i] * condition.seen(rays[i].direction, engine_.sky_index());
          continue;
        }
        const Face& face = engine_.faces().faces[hit.face];
        const int opening = engine_.scene().materials[face.material].opening;
        if (opening < 0) continue;
        const glm::vec3 rho = engine_.reflectance(hit.face, hit.side);
        if (rho != glm::vec3(0)) {
          const glm::vec3 point = engine_.mesh().lifted_position(hit.face, hit.side, hit.st);
          const glm::vec3 normal = hit.side == 0 ? face.normal : -face.normal;
          const Irradiance e = engine_.interpolate(hit.face, hit.side, hit.st, point);
          const glm::vec3 scale = through[i] / kPi * rho;
          (crossing == 0 ? sample.sky : sample.exterior) += scale * e.sky;
          (crossing == 0 ? sample.indirect : sample.exterior) += scale * e.indirect;
          (crossing == 0 ? sample.sun : sample.exterior) +=
              scale * engine_.direct_light().illuminance(condition.beams, point, normal);
        }
        through[i] *= engine_.scene().openings[opening].transmittance_at(glm::dot(face.normal, rays[i].direction));
        ++sample.crossings;
        rays[i].t_near = hit.t + offset;
        active[kept++] = i;
      }
      active.resize(kept);
    }

    // Step 2: sky and indirect light between the nodes of the surface seen.
    std::vector<glm::vec3> points(size), normals(size);
    for (std::size_t i = 0; i < size; ++i) {
      Sample& sample = samples[first + i];
      const Hit& hit = hits[i];
      if (hit.face < 0 || engine_.scene().materials[engine_.faces().faces[hit.face].material].opening >= 0) continue;
      const Face& face = engine_.faces().faces[hit.face];
      sample.face = hit.face;
      sample.side = hit.side;
      sample.plane = glm::dot(face.normal, face.corner[0]);
      sample.normal = hit.side == 0 ? face.normal : -face.normal;
      points[i] = engine_.mesh().lifted_position(hit.face, hit.side, hit.st);
      const glm::vec3 shading = face.shading_normal(hit.st);
      normals[i] = hit.side == 0 ? shading : -shading;
      const Irradiance e = engine_.interpolate(hit.face, hit.side, hit.st, points[i]);
      const glm::vec3 scale = engine_.reflectance(hit.face, hit.side) / kPi;
      sample.sky += through[i] * scale * e.sky;
      sample.indirect += through[i] * scale * e.indirect;
      sample.emitted += through[i] * engine_.scene().materials[face.material].luminance;
      sample.sun += through[i] * scale * engine_.direct_light().point_source_illuminance(points[i], normals[i]);
    }

    // Step 3: beams, by shadow rays or by what the stencil said.
    std::vector<glm::vec3> facing_points;
    std::vector<std::size_t> facing;
    std::vector<float> share;
    for (std::size_t b = 0; b < condition.beams.size(); ++b) {
      const Beam& beam = condition.beams[b];
      facing.clear();
      facing_points.clear();
      for (std::size_t i = 0; i < size; ++i) {
        const Sample& sample = samples[first + i];
        if (sample.face < 0 || glm::dot(sample.normal, beam.direction_to_source) <= 0 ||
            glm::dot(normals[i], beam.direction_to_source) <= 0)
          continue;
        facing.push_back(i);
        facing_points.push_back(points[i]);
      }
      share.assign(facing.size(), 0.f);
      if (volumes)
        for (std::size_t k = 0; k < facing.size(); ++k)
          share[k] = volumes->share[b][samples[first + facing[k]].mask_index];
      else
        engine_.direct_light().beam_transmission(beam.direction_to_source, facing_points, share);
      for (std::size_t k = 0; k < facing.size(); ++k) {
        const std::size_t i = facing[k];
        Sample& sample = samples[first + i];
        const float cosine = glm::dot(normals[i], beam.direction_to_source);
        sample.beam_signature += share[k] * (1 + 0.61803f * static_cast<float>(b));
        sample.sun += through[i] * share[k] * cosine / kPi * engine_.reflectance(sample.face, sample.side) *
                      beam.normal_illuminance;
      }
    }
    // What is seen through openings counts as exterior, whatever lit it.
    for (std::size_t i = 0; i < size; ++i) {
      Sample& sample = samples[first + i];
      if (sample.crossings == 0 || sample.face < 0) continue;
      sample.exterior += sample.emitted;
      sample.emitted = glm::vec3(0);
    }
  });
}

Frame FrameRenderer::render(const View& view, FrameOptions options) {
  const TracePhase phase(engine_.trace(), "frame");
  view.validate();
  const int width = view.width, height = view.height, s = std::max(1, options.edge_samples);
  const std::size_t pixel_count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);

  // Stencil masks at the resolution of the edge samples, or as fine as OpenGL's largest picture allows.
  BeamShare volumes;
  const bool use_volumes = options.visibility == Visibility::kVolumes;
  const int mask_scale = std::clamp(kLargestMask / std::max(width, height), 1, s);
  if (use_volumes) {
    const TracePhase volume_phase(engine_.trace(), "volumes");
    render_volumes(view, mask_scale, volumes.share);
  }
  const BeamShare* shares = use_volumes ? &volumes : nullptr;
  const auto mask_index = [&](int x, int y, int i, int j) {
    const int column = x * mask_scale + (2 * i + 1) * mask_scale / (2 * s),
              row = y * mask_scale + (2 * j + 1) * mask_scale / (2 * s);
    return row * width * mask_scale + column;
  };

  std::vector<Sample> centres(pixel_count);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      Sample& sample = centres[y * width + x];
      sample.pixel = glm::vec2(x, y) + 0.5f;
      sample.mask_index = mask_index(x, y, s / 2, s / 2);
    }
  trace_and_shade(view, centres, shares);

  // Edges: where neighbours see different surfaces or different shares of a beam.
  std::vector<char> is_edge(pixel_count, 0);
  const float same_plane = 1e-4f * engine_.faces().extent;
  const auto differ = [same_plane](const Sample& a, const Sample& b) {
    if (a.crossings != b.crossings || (a.face < 0) != (b.face < 0)) return true;
    if (std::abs(a.beam_signature - b.beam_signature) > kSameShare) return true;
    if (a.face == b.face) return a.side != b.side;
    return glm::dot(a.normal, b.normal) < kSameNormal || std::abs(a.plane - b.plane) > same_plane;
  };
  if (s > 1) {
    parallel_indices(static_cast<std::size_t>(height), 4, [&](std::size_t row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < width; ++x) {
        const Sample& sample = centres[y * width + x];
        bool edge = false;
        for (int dy = -1; dy <= 1 && !edge; ++dy)
          for (int dx = -1; dx <= 1 && !edge; ++dx)
            if (x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height)
              edge = differ(sample, centres[(y + dy) * width + x + dx]);
        for (const std::vector<float>& share : volumes.share)
          for (int k = 0; k < s * s && !edge; ++k)
            edge = share[mask_index(x, y, k % s, k / s)] != share[sample.mask_index];
        is_edge[y * width + x] = edge;
      }
    });
  }
  std::vector<int> edges;
  for (std::size_t p = 0; p < pixel_count; ++p)
    if (is_edge[p]) edges.push_back(static_cast<int>(p));
  std::vector<Sample> subsamples(edges.size() * static_cast<std::size_t>(s * s));
  for (std::size_t e = 0; e < edges.size(); ++e)
    for (int k = 0; k < s * s; ++k) {
      const int x = edges[e] % width, y = edges[e] / width;
      Sample& sample = subsamples[e * static_cast<std::size_t>(s * s) + static_cast<std::size_t>(k)];
      sample.pixel = glm::vec2(x, y) + (glm::vec2(k % s, k / s) + 0.5f) / static_cast<float>(s);
      sample.mask_index = mask_index(x, y, k % s, k / s);
    }
  trace_and_shade(view, subsamples, shares);

  Frame frame;
  frame.width = width;
  frame.height = height;
  frame.edge_pixel_count = static_cast<int>(edges.size());
  const auto average_into = [&](std::vector<glm::vec3>& picture, glm::vec3 Sample::*component) {
    picture.resize(pixel_count);
    for (std::size_t p = 0; p < pixel_count; ++p) picture[p] = centres[p].*component;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      glm::vec3 sum(0);
      for (int k = 0; k < s * s; ++k)
        sum += subsamples[e * static_cast<std::size_t>(s * s) + static_cast<std::size_t>(k)].*component;
      picture[edges[e]] = sum / static_cast<float>(s * s);
    }
  };
  average_into(frame.sun, &Sample::sun);
  average_into(frame.sky, &Sample::sky);
  average_into(frame.indirect, &Sample::indirect);
  average_into(frame.emitted, &Sample::emitted);
  average_into(frame.exterior, &Sample::exterior);
  frame.radiance.resize(pixel_count);
  for (std::size_t p = 0; p < pixel_count; ++p)
    frame.radiance[p] = frame.sun[p] + frame.sky[p] + frame.indirect[p] + frame.emitted[p] + frame.exterior[p];
  return frame;
}

// Share of each beam at each sample: lit or not by the stencil, times the transmittance of the openings that it
// counted.
void FrameRenderer::render_volumes(const View& view, int samples_per_axis, std::vector<std::vector<float>>& shares) {
  if (!volumes_) {
    std::vector<glm::vec3> vertices;
    std::vector<glm::uvec3> opaque;
    std::vector<std::vector<glm::uvec3>> openings;
    std::map<std::tuple<int, int, int, int>, std::size_t> group_of;
    for (const Face& face : engine_.faces().faces) {
      const int opening = engine_.scene().materials[face.material].opening;
      std::vector<glm::uvec3>* list = &opaque;
      if (opening >= 0) {
        const glm::ivec3 n(glm::round(1e3f * face.normal));
        const auto [entry, is_new] = group_of.try_emplace({opening, n.x, n.y, n.z}, openings.size());
        if (is_new) {
          openings.emplace_back();
          volume_groups_.push_back({opening, face.normal});
        }
        list = &openings[entry->second];
      }
      const unsigned base = static_cast<unsigned>(vertices.size());
      vertices.insert(vertices.end(), face.corner, face.corner + (face.is_quad ? 4 : 3));
      list->push_back({base, base + 1, base + 2});
      if (face.is_quad) list->push_back({base, base + 2, base + 3});
    }
    context_ = std::make_unique<GlContext>();
    volumes_ = std::make_unique<ShadowVolumes>(*context_, vertices, opaque, openings);
  }
  const glm::dvec3 origin = engine_.faces().origin;
  const VolumeCamera camera{view.position - origin, view.target - origin,          view.up,
                            view.vertical_fov_rad,  view.width * samples_per_axis, view.height * samples_per_axis};
  for (const Beam& beam : engine_.lighting().condition.beams) {
    const BeamMask mask = volumes_->render(camera, glm::dvec3(beam.direction_to_source));
    std::vector<float> transmittance;
    for (const VolumeGroup& group : volume_groups_)
      transmittance.push_back(
          engine_.scene().openings[group.opening].transmittance_at(glm::dot(group.normal, beam.direction_to_source)));
    std::vector<float>& share = shares.emplace_back(mask.shadowed.size());
    parallel_indices(share.size(), 4096, [&](std::size_t i) {
      share[i] = mask.shadowed[i] ? 0.f : 1.f;
      for (std::size_t g = 0; g < transmittance.size() && share[i] > 0; ++g)
        for (int n = 0; n < mask.crossings[g][i]; ++n) share[i] *= transmittance[g];
    });
  }
}

}  // namespace transom
