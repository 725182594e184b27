#include "transom/frame.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "frame_masks.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kBlock = 256;  // pixels or points at once
constexpr float kSameShare = 0.02f;  // of a beam, between neighbouring pixels without an edge
constexpr float kSameCurve = 0.9f;   // cosine between normals of neighbouring pixels on one surface

// Whether a point is on the surface of another one, flat or curved.
bool is_continued(const BeamPoint& a, const BeamPoint& b) {
  if (b.surface < 0 || glm::dot(a.normal, b.normal) < kSameCurve) return false;
  const glm::vec3 between = b.position - a.position;
  return std::abs(glm::dot(between, a.normal)) < (1 - kSameCurve) * glm::length(between);
}

}  // namespace

FrameRenderer::FrameRenderer(const Engine& engine) : engine_(engine) {}
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
    if (mask_share && points[k].sample != BeamPoint::kNotInMasks) {
      shares[k] = (*mask_share)[masks.index(points[k].pixel, points[k].sample)];
      continue;
    }
    facing.push_back(k);
    facing_points.push_back(points[k].position);
  }
  if (facing.empty()) return;
  found.resize(facing.size());
  engine_.direct_light().beam_transmission(beam, facing_points, found);
  for (std::size_t k = 0; k < facing.size(); ++k) shares[facing[k]] = found[k];
}

std::vector<FrameRenderer::Box> FrameRenderer::boxes_of(const std::vector<BeamPoint>& points) const {
  std::vector<Box> boxes((points.size() + kBlock - 1) / kBlock);
  parallel_indices(boxes.size(), 16, [&](std::size_t b) {
    Box box{glm::vec3(Ray::kInfinity), glm::vec3(-Ray::kInfinity)};
    for (std::size_t k = b * kBlock; k < std::min(points.size(), (b + 1) * kBlock); ++k) {
      if (points[k].surface < 0) continue;
      box.low = glm::min(box.low, points[k].position);
      box.high = glm::max(box.high, points[k].position);
    }
    boxes[b] = box;
  });
  return boxes;
}

// Shares of all points; blocks that no shaft of a lobe can meet are passed over.
void FrameRenderer::find_shares_by_block(const Beam& beam, const std::vector<BeamPoint>& points,
                                         const std::vector<Box>& boxes, const std::vector<float>* mask_share,
                                         const Masks& masks, std::vector<float>& shares) const {
  shares.resize(points.size());
  parallel_indices(boxes.size(), 1, [&](std::size_t b) {
    const std::size_t begin = b * kBlock, size = std::min(kBlock, points.size() - begin);
    const bool may_be_lit =
        beam.opening < 0 || std::any_of(beam.shafts->begin(), beam.shafts->end(),
                                        [&](const auto& s) { return s.may_meet(boxes[b].low, boxes[b].high); });
    if (may_be_lit)
      find_shares(beam, {&points[begin], size}, mask_share, masks, {&shares[begin], size});
    else
      std::fill(&shares[begin], &shares[begin] + size, 0.f);
  });
}

void FrameRenderer::add_beam(const ViewSamples& samples, const Beam& beam, const std::vector<float>* mask_share,
                             const Masks& masks, std::vector<glm::vec3>& picture, std::vector<char>& is_edge) const {
  const int width = samples.view.width, height = samples.view.height, s = samples.edge_samples;
  std::vector<float> share;
  find_shares_by_block(beam, samples.centre, centre_boxes_, mask_share, masks, share);
  const auto reflected = [&](const BeamPoint& point, float of_beam) {
    return of_beam * point.weight * glm::dot(point.normal, beam.direction_to_source) / kPi *
           engine_.reflectance(point.surface / 2, point.surface % 2) * beam.normal_illuminance;
  };

  // Pixels on one surface: one point speaks for them, unless neighbours are lit otherwise. Then all samples are tested
  // on its plane.
  const CameraRays camera(samples.view);
  const glm::vec3 eye(samples.view.position - engine_.faces().origin);
  const auto on_plane = [&](BeamPoint point, int sample, int samples_per_axis) {
    const glm::vec2 corner(point.pixel % width, point.pixel / width);
    point.position = place_on_plane(camera, eye, corner + sample_place(sample, samples_per_axis), point.position,
                                    engine_.faces().faces[point.surface / 2].normal);
    point.sample = sample;
    return point;
  };
  const auto for_neighbours = [&](int pixel, const auto& visit) {
    const int x = pixel % width, y = pixel / width;
    for (int j = std::max(y - 1, 0); j <= std::min(y + 1, height - 1); ++j)
      for (int i = std::max(x - 1, 0); i <= std::min(x + 1, width - 1); ++i) visit(j * width + i);
  };
  parallel_indices(static_cast<std::size_t>(height), 1, [&](std::size_t row) {
    std::vector<BeamPoint> points;
    std::vector<float> shares;
    const int y = static_cast<int>(row);
    // By rays nothing happens where neither the row nor its neighbours are lit.
    const auto first = share.begin() + std::max(y - 1, 0) * width,
               last = share.begin() + std::min(y + 2, height) * width;
    if (!mask_share && std::all_of(first, last, [](float of_beam) { return of_beam == 0; })) return;
    for (int x = 0; x < width; ++x) {
      const int pixel = y * width + x;
      const BeamPoint& centre = samples.centre[pixel];
      if (samples.has_edge[pixel] || centre.surface < 0) continue;
      bool edge = false;
      if (s > 1) {
        for_neighbours(pixel, [&](int other) { edge |= std::abs(share[pixel] - share[other]) > kSameShare; });
        if (mask_share && !edge)
          for (int k = 0; k < s * s; ++k)
            edge |= (*mask_share)[masks.index(pixel, k)] != (*mask_share)[masks.index(pixel, -1)];
      }
      if (!edge) {
        if (share[pixel] > 0) picture[pixel] += reflected(centre, share[pixel]);
        continue;
      }
      is_edge[pixel] = 1;
      for (int k = 0; k < s * s; ++k) points.push_back(on_plane(centre, k, s));
    }
    shares.resize(points.size());
    find_shares(beam, points, nullptr, masks, shares);
    for (std::size_t k = 0; k < points.size(); ++k)
      if (shares[k] > 0) picture[points[k].pixel] += reflected(points[k], shares[k] / static_cast<float>(s * s));
  });

  // Pixels with an edge of a surface: every sample for itself, unless a beam ends within what is seen of a surface.
  const std::vector<float> centre_share = share;
  find_shares_by_block(beam, samples.fine, fine_boxes_, mask_share, masks, share);
  const int finer = kFiner * s;
  parallel_ranges(samples.parts.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<BeamPoint> points;
    std::vector<float> shares;
    for (std::size_t i = begin; i < end; ++i) {
      const ViewSamples::Part& part = samples.parts[i];
      const BeamPoint& first = samples.fine[part.first_point];
      const float of_first = share[part.first_point];
      const auto is_other = [&](float other) { return std::abs(other - of_first) > kSameShare; };
      bool ends = std::any_of(&share[part.first_point], &share[part.last_point - 1] + 1, is_other);
      for_neighbours(first.pixel, [&](int other) {
        ends |= is_other(centre_share[other]) && is_continued(first, samples.centre[other]);
      });
      if (!ends) continue;
      points.clear();
      for (std::size_t k = part.first_place; k < part.last_place; ++k)
        points.push_back(on_plane(first, samples.places[k], finer));
      shares.resize(points.size());
      find_shares(beam, points, nullptr, masks, shares);
      std::fill(&share[part.first_point], &share[part.last_point - 1] + 1,
                std::accumulate(shares.begin(), shares.end(), 0.f) / static_cast<float>(shares.size()));
    }
  });
  const auto add = [&](const std::vector<BeamPoint>& points) {
    for (std::size_t k = 0; k < points.size(); ++k)
      if (share[k] > 0) picture[points[k].pixel] += reflected(points[k], share[k]);
  };
  add(samples.fine);
  find_shares_by_block(beam, samples.on_panes, pane_boxes_, nullptr, masks, share);
  add(samples.on_panes);
}

// Light of sky and of surfaces, between nodes. Extrapolation beyond the outermost nodes never makes it or a part of it
// negative.
void FrameRenderer::add_smooth_light(const ViewSamples& samples, const Lighting& lighting, bool components,
                                     Frame& frame) const {
  const std::size_t pixel_count = samples.centre.size();
  std::vector<glm::vec4> sky, indirect;
  engine_.shown_radiance(lighting, sky, indirect);
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

Frame FrameRenderer::render(const View& view, const Lighting& lighting, FrameOptions options) {
  const TracePhase phase(engine_.trace(), "frame");
  view.validate();
  options.edge_samples = std::max(1, options.edge_samples);
  if (!samples_ || samples_->view != view || samples_->edge_samples != options.edge_samples) {
    const TracePhase samples_phase(engine_.trace(), "view");
    samples_.reset();
    samples_ = std::make_unique<ViewSamples>(engine_, view, options.edge_samples);
    centre_boxes_ = boxes_of(samples_->centre);
    fine_boxes_ = boxes_of(samples_->fine);
    pane_boxes_ = boxes_of(samples_->on_panes);
  }
  const ViewSamples& samples = *samples_;
  const Condition& condition = lighting.condition;
  const Masks masks(view, options.edge_samples);
  const bool use_volumes = options.visibility == Visibility::kVolumes;

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
    add_smooth_light(samples, lighting, options.components, frame);
  }
  // Without components everything goes into the picture at once.
  std::vector<glm::vec3>&sun = options.components ? frame.sun : frame.radiance,
  &emitted = options.components ? frame.emitted : frame.radiance,
  &exterior = options.components ? frame.exterior : frame.radiance;
  std::vector<char> is_edge = samples.has_edge;
  {
    const TracePhase beam_phase(engine_.trace(), "beams of the picture");
    std::vector<float> mask_share;
    for (const Beam& beam : condition.beams_at_points()) {
      if (beam.normal_illuminance == glm::vec3(0) || (beam.opening >= 0 && beam.shafts->empty())) continue;
      if (use_volumes) {
        const TracePhase volume_phase(engine_.trace(), "volumes");
        frame.pass_count += render_mask(beam, view, masks, mask_share);
      }
      add_beam(samples, beam, use_volumes ? &mask_share : nullptr, masks, sun, is_edge);
    }
  }
  for (const ViewSamples::Constant& c : samples.constant) {
    sun[c.pixel] += c.lamps;
    emitted[c.pixel] += c.emitted;
    exterior[c.pixel] += c.emitted_outdoors;
  }
  for (const ViewSamples::Outlook& o : samples.outlooks)
    exterior[o.pixel] += o.weight * condition.seen(o.direction, engine_.sky_index());
  for (const ViewSamples::SeenPanel& p : samples.panels) exterior[p.pixel] += p.weight * lighting.panel_radiance[p.bin];
  if (options.components)
    parallel_indices(pixel_count, kBlock, [&](std::size_t p) {
      frame.radiance[p] = frame.sun[p] + frame.sky[p] + frame.indirect[p] + frame.emitted[p] + frame.exterior[p];
    });
  frame.edge_pixel_count = static_cast<int>(std::count(is_edge.begin(), is_edge.end(), 1));
  return frame;
}

}  // namespace transom
