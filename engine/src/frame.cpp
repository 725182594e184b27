#include "transom/frame.h"

#include <xmmintrin.h>

#include <algorithm>

#include "frame_drawing.h"
#include "transom/parallel.h"

namespace transom {
namespace {

constexpr std::size_t kBlock = 256;   // pixels at once
constexpr std::size_t kGrain = 2048;  // nodes, midpoints and patches

// By face * 2 + side: whether beams are known to reach all of it that takes part through openings alone.
std::vector<char> enclosed_surfaces(const Engine& engine) {
  std::vector<char> is_enclosed(2 * engine.faces().faces.size());
  parallel_indices(is_enclosed.size(), 16, [&](std::size_t surface) {
    const int face = static_cast<int>(surface / 2), side = static_cast<int>(surface % 2);
    bool takes_part = false, is_open = false;
    for (int cell = 0; cell < engine.mesh().grid(face).cell_count(); ++cell) {
      const int slot = engine.mesh().slot_index(face, side, cell);
      takes_part |= engine.is_patch(slot);
      is_open |= engine.is_patch(slot) && !engine.is_behind_openings(slot);
    }
    is_enclosed[surface] = takes_part && !is_open;
  });
  return is_enclosed;
}

// What the samples' shares are of: the light of the sky and, after each, that of surfaces; or their sums.
std::vector<glm::vec4> shown_radiance(const Engine& engine, const Lighting& lighting, bool has_components) {
  std::vector<glm::vec4> sky, indirect;
  engine.shown_radiance(lighting, sky, indirect);
  if (!has_components) {
    parallel_indices(sky.size(), kGrain, [&](std::size_t i) { sky[i] += indirect[i]; });
    return sky;
  }
  std::vector<glm::vec4> both(2 * sky.size());
  parallel_indices(sky.size(), kGrain, [&](std::size_t i) {
    both[2 * i] = sky[i];
    both[2 * i + 1] = indirect[i];
  });
  return both;
}

}  // namespace

FrameRenderer::FrameRenderer(const Engine& engine) : engine_(engine), is_enclosed_(enclosed_surfaces(engine)) {}
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

// All but beams, and the sum: light of sky and of surfaces, between nodes, and what is seen itself. Extrapolation
// beyond the outermost nodes never makes light or a part of it negative.
void FrameRenderer::finish(const Drawing& drawing, int row) const {
  const ViewSamples::Row& samples = samples_->rows[row];
  const auto width = static_cast<std::size_t>(samples_->view.width), first = static_cast<std::size_t>(row) * width;
  Frame& frame = drawing.frame;
  const bool has_components = drawing.has_components;
  if (has_components)
    for (Picture* part : {&frame.emitted, &frame.exterior})
      std::fill(&(*part)[first], &(*part)[first] + width, glm::vec3(0));
  // Without components everything goes into the picture at once.
  Picture &sun = has_components ? frame.sun : frame.radiance,
          &emitted = has_components ? frame.emitted : frame.radiance,
          &exterior = has_components ? frame.exterior : frame.radiance;
  for (const ViewSamples::Constant& c : samples.constant) {
    sun[c.pixel] += c.lamps;
    emitted[c.pixel] += c.emitted;
    exterior[c.pixel] += c.emitted_outdoors;
  }
  for (const ViewSamples::Outlook& o : samples.outlooks)
    exterior[o.pixel] +=
        o.weight * drawing.lighting.condition.seen(o.direction, o.place, engine_.sky_index(), drawing.sky);
  for (const ViewSamples::SeenPanel& p : samples.panels)
    exterior[p.pixel] += p.weight * drawing.lighting.panel_radiance[p.bin];
  if (!has_components) {
    for (std::size_t x = 0; x < width; ++x)
      frame.radiance[first + x] += glm::vec3(glm::max(samples.smooth.dot(x, drawing.shown), glm::vec4(0)));
    return;
  }
  for (std::size_t x = 0; x < width; ++x) {
    // The sky's part and that of surfaces stand together, so that both come with one line of the cache.
    __m128 of_sky = _mm_setzero_ps(), of_surfaces = _mm_setzero_ps();
    for (std::size_t k = samples.smooth.begin[x]; k < samples.smooth.begin[x + 1]; ++k) {
      const Share& share = samples.smooth.entries[k];
      const float* const shown = &drawing.shown[2 * static_cast<std::size_t>(share.index)].x;
      const __m128 weight = _mm_set1_ps(share.weight);
      of_sky = _mm_add_ps(of_sky, _mm_mul_ps(weight, _mm_loadu_ps(shown)));
      of_surfaces = _mm_add_ps(of_surfaces, _mm_mul_ps(weight, _mm_loadu_ps(shown + 4)));
    }
    const __m128 sum = _mm_max_ps(_mm_add_ps(of_sky, of_surfaces), _mm_setzero_ps());
    of_sky = _mm_min_ps(_mm_max_ps(of_sky, _mm_setzero_ps()), sum);
    glm::vec4 sky, indirect;
    _mm_storeu_ps(&sky.x, of_sky);
    _mm_storeu_ps(&indirect.x, _mm_sub_ps(sum, of_sky));
    frame.sky[first + x] = glm::vec3(sky);
    frame.indirect[first + x] = glm::vec3(indirect);
  }
  // As one list of numbers, of which the compiler takes several at once.
  const std::size_t count = 3 * width;
  float* const radiance = &frame.radiance[first].x;
  const float *const from_sun = &frame.sun[first].x, *const from_sky = &frame.sky[first].x,
                     *const from_surfaces = &frame.indirect[first].x, *const from_emitters = &frame.emitted[first].x,
                     *const from_outdoors = &frame.exterior[first].x;
  for (std::size_t i = 0; i < count; ++i)
    radiance[i] = from_sun[i] + from_sky[i] + from_surfaces[i] + from_emitters[i] + from_outdoors[i];
}

// Draws the beams of a drawing: first what arrives at the point of each pixel, then what neighbours tell about it.
void FrameRenderer::draw(Drawing& drawing) {
  const auto height = static_cast<std::size_t>(samples_->view.height),
             width = static_cast<std::size_t>(samples_->view.width);
  const std::size_t beam_count = drawing.beams.size();
  centre_share_.resize(std::max(centre_share_.size(), beam_count));
  for (std::size_t b = 0; b < beam_count; ++b) centre_share_[b].resize(height * width);
  is_lit_row_.resize(beam_count * height);
  is_tested_.resize(std::max(is_tested_.size(), beam_count));
  for (std::size_t b = 0; b < beam_count; ++b) is_tested_[b].resize(height * width);
  ends_.assign(beam_count * height, {});
  parallel_indices(height, 1, [&](std::size_t row) {
    for (std::size_t b = 0; b < beam_count; ++b) {
      if (!drawing.masks) std::fill_n(&is_tested_[b][row * width], width, char{0});
      find_centre_shares(drawing, b, static_cast<int>(row));
    }
  });
  Picture& into = drawing.has_components ? drawing.frame.sun : drawing.frame.radiance;
  parallel_indices(height, 1, [&](std::size_t row) {
    glm::vec3* const sun = &into[row * width];
    if (!drawing.is_begun) std::fill(sun, sun + width, glm::vec3(0));
    for (std::size_t b = 0; b < beam_count; ++b) add_beam(drawing, b, static_cast<int>(row), sun);
  });
  if (!drawing.masks)  // stencils have looked at all samples
    for (std::size_t b = 0; b < beam_count; ++b) follow_ends(drawing, b, into);
  if (drawing.is_complete)
    parallel_indices(height, 1, [&](std::size_t row) { finish(drawing, static_cast<int>(row)); });
  drawing.is_begun = true;
}

// Finds what a camera sees, unless it is the last one.
void FrameRenderer::see(const View& view, int edge_samples) {
  if (samples_ && samples_->view == view && samples_->edge_samples == edge_samples) return;
  const TracePhase phase(engine_.trace(), "view");
  samples_.reset();
  samples_ = std::make_unique<ViewSamples>(engine_, view, edge_samples);
  places_ = all_places(edge_samples);
  finer_places_ = all_places(kFiner * edge_samples);
  dark_row_.assign(static_cast<std::size_t>(view.width), 0.f);
}

Frame FrameRenderer::render(const View& view, const Lighting& lighting, FrameOptions options) {
  const TracePhase phase(engine_.trace(), "frame");
  view.validate();
  if (options.sky) options.sky->validate();
  see(view, std::max(1, options.edge_samples));
  Frame frame;
  frame.width = view.width;
  frame.height = view.height;
  frame.radiance.resize(samples_->centre.size());
  if (options.components)
    for (Picture* part : {&frame.sun, &frame.sky, &frame.indirect, &frame.emitted, &frame.exterior})
      part->resize(samples_->centre.size());
  Drawing drawing{lighting,           CameraRays(view), glm::vec3(view.position - engine_.faces().origin),
                  options.components, options.sky,      frame};
  drawing.shown = shown_radiance(engine_, lighting, options.components);
  is_edge_ = samples_->has_edge;

  const std::vector<Beam> at_points = lighting.condition.beams_at_points();
  std::vector<const Beam*> beams;
  for (const Beam& beam : at_points)
    if (beam.normal_illuminance != glm::vec3(0) && (beam.opening < 0 || !beam.shafts->empty())) beams.push_back(&beam);
  if (options.visibility == Visibility::kVolumes) {
    for (std::size_t b = 0; b < beams.size(); ++b) {
      drawing.beams.clear();
      drawing.beams.emplace_back(engine_, *beams[b], *samples_, is_enclosed_);
      const Masks masks(view, samples_->edge_samples, lit_range(drawing.beams[0]));
      {
        const TracePhase volume_phase(engine_.trace(), "volumes");
        frame.pass_count += render_mask(*beams[b], view, masks, drawing.mask_share);
      }
      drawing.masks = &masks;
      drawing.is_complete = b + 1 == beams.size();
      draw(drawing);
      drawing.masks = nullptr;
    }
    if (beams.empty()) draw(drawing);
  } else {
    const TracePhase pixel_phase(engine_.trace(), "light of the picture");
    for (const Beam* beam : beams) drawing.beams.emplace_back(engine_, *beam, *samples_, is_enclosed_);
    draw(drawing);
  }
  frame.edge_pixel_count = static_cast<int>(std::count(is_edge_.begin(), is_edge_.end(), 1));
  return frame;
}

}  // namespace transom
