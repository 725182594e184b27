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
constexpr std::size_t kBlock = 256;  // pixels or points at once
constexpr int kLargestMask = 4096;   // pixels a side of a stencil mask
constexpr float kSameShare = 0.02f;  // of a beam, between neighbouring pixels without an edge

}  // namespace

/// Share of each beam at each pixel of the stencil masks, which are as fine as the samples of edges, or as OpenGL's
/// largest picture allows.
class FrameRenderer::Masks {
 public:
  Masks(const View& view, int edge_samples)
      : width_(view.width),
        samples_(edge_samples),
        scale_(std::clamp(kLargestMask / std::max(view.width, view.height), 1, edge_samples)) {}

  int scale() const { return scale_; }
  /// Of a sample of a pixel; -1: its centre.
  std::size_t index(int pixel, int sample) const {
    const int i = sample < 0 ? samples_ / 2 : sample % samples_, j = sample < 0 ? samples_ / 2 : sample / samples_;
    const int column = pixel % width_ * scale_ + (2 * i + 1) * scale_ / (2 * samples_),
              row = pixel / width_ * scale_ + (2 * j + 1) * scale_ / (2 * samples_);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_ * scale_) + static_cast<std::size_t>(column);
  }
  std::vector<std::vector<float>> share;  // by beam, by pixel of the mask

 private:
  int width_, samples_, scale_;
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

// Share of a beam that arrives at each point: by shadow rays, or by what the stencil said. 0 where the beam comes from
// behind.
void FrameRenderer::find_shares(const Beam& beam, std::span<const BeamPoint> points,
                                const std::vector<float>* mask_share, const Masks& masks,
                                std::span<float> shares) const {
  thread_local std::vector<glm::vec3> facing_points;
  thread_local std::vector<std::size_t> facing;
  thread_local std::vector<float> found;
  facing.clear();
  facing_points.clear();
  for (std::size_t k = 0; k < points.size(); ++k) {
    shares[k] = 0;
    if (points[k].surface < 0 || glm::dot(points[k].normal, beam.direction_to_source) <= 0) continue;
    const glm::vec3 normal = engine_.faces().faces[points[k].surface / 2].normal;
    if ((glm::dot(normal, beam.direction_to_source) > 0) != (points[k].surface % 2 == 0)) continue;
    if (mask_share) {
      shares[k] = (*mask_share)[masks.index(points[k].pixel, points[k].sample)];
      continue;
    }
    facing.push_back(k);
    facing_points.push_back(points[k].position);
  }
  if (mask_share) return;
  found.resize(facing.size());
  engine_.direct_light().beam_transmission(beam.direction_to_source, facing_points, found);
  for (std::size_t k = 0; k < facing.size(); ++k) shares[facing[k]] = found[k];
}

void FrameRenderer::add_beam(const ViewSamples& samples, const Beam& beam, const std::vector<float>* mask_share,
                             const Masks& masks, std::vector<glm::vec3>& picture, std::vector<char>& is_edge) const {
  const int width = samples.view.width, height = samples.view.height, s = samples.edge_samples;
  const std::size_t pixel_count = samples.centre.size();
  std::vector<float> share(pixel_count);
  parallel_ranges(pixel_count, kBlock, [&](std::size_t begin, std::size_t end) {
    find_shares(beam, {&samples.centre[begin], end - begin}, mask_share, masks, {&share[begin], end - begin});
  });
  const auto reflected = [&](const BeamPoint& point, float of_beam) {
    return of_beam * point.weight * glm::dot(point.normal, beam.direction_to_source) / kPi *
           engine_.reflectance(point.surface / 2, point.surface % 2) * beam.normal_illuminance;
  };

  // Pixels on one surface: the centre speaks for them, unless neighbours are lit otherwise. Then all samples are tested
  // on the plane of the centre.
  const CameraRays camera(samples.view);
  const glm::vec3 eye(samples.view.position - engine_.faces().origin);
  parallel_indices(static_cast<std::size_t>(height), 1, [&](std::size_t row) {
    std::vector<BeamPoint> points;
    std::vector<float> shares;
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x) {
      const int pixel = y * width + x;
      const BeamPoint& centre = samples.centre[pixel];
      if (samples.has_edge[pixel] || centre.surface < 0) continue;
      bool edge = false;
      if (s > 1) {
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            if (x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height)
              edge |= std::abs(share[pixel] - share[pixel + dy * width + dx]) > kSameShare;
        if (mask_share && !edge)
          for (int k = 0; k < s * s; ++k)
            edge |= (*mask_share)[masks.index(pixel, k)] != (*mask_share)[masks.index(pixel, -1)];
      }
      if (!edge) {
        if (share[pixel] > 0) picture[pixel] += reflected(centre, share[pixel]);
        continue;
      }
      is_edge[pixel] = 1;
      const glm::vec3 normal = engine_.faces().faces[centre.surface / 2].normal;
      const float height_of_plane = glm::dot(centre.position - eye, normal);
      for (int k = 0; k < s * s; ++k) {
        const glm::vec3 direction = camera.direction(glm::vec2(x, y) + sample_place(k, s));
        BeamPoint& point = points.emplace_back(centre);
        point.position = eye + direction * (height_of_plane / glm::dot(direction, normal));
        point.sample = k;
      }
    }
    shares.resize(points.size());
    find_shares(beam, points, mask_share, masks, shares);
    for (std::size_t k = 0; k < points.size(); ++k)
      if (shares[k] > 0) picture[points[k].pixel] += reflected(points[k], shares[k] / static_cast<float>(s * s));
  });

  // Pixels with an edge of a surface, and panes: every sample for itself. Neither depends on the other's order.
  for (const std::vector<BeamPoint>* points : {&samples.fine, &samples.on_panes}) {
    const std::vector<float>* shares_by_mask = points == &samples.fine ? mask_share : nullptr;
    share.resize(points->size());
    parallel_ranges(points->size(), kBlock, [&](std::size_t begin, std::size_t end) {
      find_shares(beam, {&(*points)[begin], end - begin}, shares_by_mask, masks, {&share[begin], end - begin});
    });
    for (std::size_t k = 0; k < points->size(); ++k)
      if (share[k] > 0) picture[(*points)[k].pixel] += reflected((*points)[k], share[k]);
  }
}

// Light of sky and of surfaces, between nodes. Extrapolation beyond the outermost nodes never makes it or a part of it
// negative.
void FrameRenderer::add_smooth_light(const ViewSamples& samples, bool components, Frame& frame) const {
  const std::size_t pixel_count = samples.centre.size();
  std::vector<glm::vec4> sky, indirect;
  engine_.shown_radiance(sky, indirect);
  if (!components)
    for (std::size_t i = 0; i < sky.size(); ++i) sky[i] += indirect[i];
  parallel_indices(pixel_count, kBlock, [&](std::size_t p) {
    glm::vec4 of_sky(0), of_surfaces(0);
    for (std::size_t k = samples.smooth.begin[p]; k < samples.smooth.begin[p + 1]; ++k) {
      const Share& share = samples.smooth.entries[k];
      of_sky += share.weight * sky[share.index];
      if (components) of_surfaces += share.weight * indirect[share.index];
    }
    const glm::vec4 sum = glm::max(of_sky + of_surfaces, glm::vec4(0));
    if (!components) {
      frame.radiance[p] = glm::vec3(sum);
      return;
    }
    of_sky = glm::clamp(of_sky, glm::vec4(0), sum);
    frame.sky[p] = glm::vec3(of_sky);
    frame.indirect[p] = glm::vec3(sum - of_sky);
  });
}

Frame FrameRenderer::render(const View& view, FrameOptions options) {
  const TracePhase phase(engine_.trace(), "frame");
  view.validate();
  options.edge_samples = std::max(1, options.edge_samples);
  if (!samples_ || samples_->view != view || samples_->edge_samples != options.edge_samples) {
    const TracePhase samples_phase(engine_.trace(), "view");
    samples_.reset();
    samples_ = std::make_unique<ViewSamples>(engine_, view, options.edge_samples);
  }
  const ViewSamples& samples = *samples_;
  const Condition& condition = engine_.lighting().condition;
  Masks masks(view, options.edge_samples);
  const bool use_volumes = options.visibility == Visibility::kVolumes;
  if (use_volumes) {
    const TracePhase volume_phase(engine_.trace(), "volumes");
    render_masks(view, masks);
  }

  const std::size_t pixel_count = samples.centre.size();
  Frame frame;
  frame.width = view.width;
  frame.height = view.height;
  frame.radiance.resize(pixel_count);
  if (options.components)
    for (std::vector<glm::vec3>* part : {&frame.sun, &frame.sky, &frame.indirect, &frame.emitted, &frame.exterior})
      part->resize(pixel_count, glm::vec3(0));
  {
    const TracePhase smooth_phase(engine_.trace(), "smooth light");
    add_smooth_light(samples, options.components, frame);
  }
  // Without components everything goes into the picture at once.
  std::vector<glm::vec3>&sun = options.components ? frame.sun : frame.radiance,
  &emitted = options.components ? frame.emitted : frame.radiance,
  &exterior = options.components ? frame.exterior : frame.radiance;
  std::vector<char> is_edge = samples.has_edge;
  {
    const TracePhase beam_phase(engine_.trace(), "beams of the picture");
    for (std::size_t b = 0; b < condition.beams.size(); ++b)
      add_beam(samples, condition.beams[b], use_volumes ? &masks.share[b] : nullptr, masks, sun, is_edge);
  }
  for (const ViewSamples::Constant& c : samples.constant) {
    sun[c.pixel] += c.lamps;
    emitted[c.pixel] += c.emitted;
    exterior[c.pixel] += c.emitted_outdoors;
  }
  for (const ViewSamples::Outlook& o : samples.outlooks)
    exterior[o.pixel] += o.weight * condition.seen(o.direction, engine_.sky_index());
  if (options.components)
    parallel_indices(pixel_count, kBlock, [&](std::size_t p) {
      frame.radiance[p] = frame.sun[p] + frame.sky[p] + frame.indirect[p] + frame.emitted[p] + frame.exterior[p];
    });
  frame.edge_pixel_count = static_cast<int>(std::count(is_edge.begin(), is_edge.end(), 1));
  return frame;
}

// Share of each beam at each sample: lit or not by the stencil, times the transmittance of the openings that it
// counted.
void FrameRenderer::render_masks(const View& view, Masks& masks) {
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
  const VolumeCamera camera{view.position - origin, view.target - origin,       view.up,
                            view.vertical_fov_rad,  view.width * masks.scale(), view.height * masks.scale()};
  for (const Beam& beam : engine_.lighting().condition.beams) {
    const BeamMask mask = volumes_->render(camera, glm::dvec3(beam.direction_to_source));
    std::vector<float> transmittance;
    for (const VolumeGroup& group : volume_groups_)
      transmittance.push_back(
          engine_.scene().openings[group.opening].transmittance_at(glm::dot(group.normal, beam.direction_to_source)));
    std::vector<float>& share = masks.share.emplace_back(mask.shadowed.size());
    parallel_indices(share.size(), 4096, [&](std::size_t i) {
      share[i] = mask.shadowed[i] ? 0.f : 1.f;
      for (std::size_t g = 0; g < transmittance.size() && share[i] > 0; ++g)
        for (int n = 0; n < mask.crossings[g][i]; ++n) share[i] *= transmittance[g];
    });
  }
}

}  // namespace transom
