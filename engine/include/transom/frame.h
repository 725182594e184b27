/// @file Pictures: primary rays, light between nodes, beams per pixel, edges averaged over the pixel.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "transom/engine.h"
#include "transom/shadow_volumes.h"
#include "transom/view.h"
#include "transom/view_samples.h"

namespace transom {

class SeenBeam;

/// How beams are tested per pixel.
enum class Visibility { kRays, kVolumes };

/// Settings of a picture.
struct FrameOptions {
  Visibility visibility = Visibility::kRays;
  int edge_samples = 4;    ///< per pixel and axis at an edge; twice as many say how much each side has. 1: centres only
  bool components = true;  ///< the parts of the picture beside their sum
  const SkyPicture* sky = nullptr;  ///< what is seen of the condition's sky; null: its bins are
};

/// Gives memory that nobody has cleared: what is made in it is written once.
template <typename Value>
struct Unset : std::allocator<Value> {
  template <typename Other>
  struct rebind {
    using other = Unset<Other>;
  };
  template <typename Made, typename... Arguments>
  void construct(Made* place, Arguments&&... arguments) {
    if constexpr (sizeof...(Arguments) == 0)
      ::new (static_cast<void*>(place)) Made;
    else
      ::new (static_cast<void*>(place)) Made(std::forward<Arguments>(arguments)...);
  }
};

/// Pixels, rows from the top.
using Picture = std::vector<glm::vec3, Unset<glm::vec3>>;

/// A picture in cd/m², and its parts by what the light has done last. Their sum is `radiance`.
struct Frame {
  int width = 0, height = 0;
  Picture radiance;
  Picture sun;               ///< beams and point sources, reflected once
  Picture sky;               ///< sky and ground, reflected once
  Picture indirect;          ///< reflected more than once
  Picture emitted;           ///< emitters seen
  Picture exterior;          ///< sky and ground, and emitters seen through openings
  int edge_pixel_count = 0;  ///< pixels that were supersampled
  int pass_count = 0;        ///< kVolumes: passes of the stencil method
};

/// What pixel centres look at.
struct PrimaryHits {
  std::vector<int> face;             ///< first face, openings included; -1: nothing
  std::vector<glm::dvec3> position;  ///< world [m]
};

/// Traces a ray through every pixel centre. Needs no solve.
PrimaryHits trace_primary(const SceneGeometry& scene, const View& view);

/// Renders what an engine has lit. What the last camera saw is kept: further pictures of it, under any
/// light, cost beams and sums. Holds the GL context of the stencil method, made on first use; one thread.
class FrameRenderer {
 public:
  explicit FrameRenderer(const Engine& engine);
  ~FrameRenderer();

  Frame render(const View& view, const Lighting& lighting, FrameOptions options);

 private:
  class Masks;
  struct Drawing;
  struct Scratch;
  struct VolumeGroup {
    int opening;
    glm::vec3 normal;
  };
  void see(const View& view, int edge_samples);
  VolumeRange lit_range(const SeenBeam& seen) const;
  void make_volumes();
  int render_mask(const Beam& beam, const View& view, const Masks& masks, std::vector<float>& share);
  int render_shafts(const Beam& lobe, const VolumeCamera& camera, const Masks& masks, std::vector<float>& share);
  const VolumeCasters& casters_behind(glm::vec4 plane);
  void draw(Drawing& drawing);
  void find_centre_shares(const Drawing& drawing, std::size_t beam, int row);
  void add_beam(const Drawing& drawing, std::size_t beam, int row, glm::vec3* sun);
  void add_to_pixels(const Drawing& drawing, std::size_t beam, int row, Scratch& scratch, glm::vec3* sun);
  /// Mean share of a beam over a pixel, and whether its light ends among the samples.
  struct PixelShare {
    float mean;
    bool has_end;
  };
  struct EndingPixel {
    std::size_t number;        // among those that are tested
    std::size_t first, count;  // places of the finer grid that are tested
    float known;               // sum of what the other places of the finer grid receive
  };
  void test_samples(const Drawing& drawing, std::size_t beam, std::span<const std::size_t> pixels, Scratch& scratch);
  static void find_shares_of_pixel(const SeenBeam& seen, std::size_t first, std::size_t count, Scratch& scratch);
  float choose_beside_end(std::span<const float> shares, Scratch& scratch) const;
  void follow_ends(const Drawing& drawing, std::size_t beam, Picture& sun);
  void add_to_parts(const Drawing& drawing, std::size_t beam, int row, Scratch& scratch, glm::vec3* sun);
  void put_on_plane(const Drawing& drawing, BeamPoint point, std::span<const glm::vec2> places, Scratch& scratch) const;
  void add_to_panes(const Drawing& drawing, std::size_t beam, int row, Scratch& scratch, glm::vec3* sun) const;
  void finish(const Drawing& drawing, int row) const;
  const float* centre_shares(std::size_t beam, int row) const;

  const Engine& engine_;
  std::vector<char> is_enclosed_;         // by surface: beams reach it through openings alone
  std::unique_ptr<ViewSamples> samples_;  // of the last camera
  std::vector<glm::vec2> places_, finer_places_;
  std::vector<std::vector<float, Unset<float>>> centre_share_;  // by beam and pixel, in rows that are lit
  std::vector<char> is_lit_row_;                                // by beam and row
  std::vector<float> dark_row_;
  std::vector<char> is_edge_;
  std::vector<std::vector<char>> is_tested_;    // by beam and pixel, without stencils: at all its samples
  std::vector<std::vector<std::size_t>> ends_;  // by beam and row: pixels in which its light ends
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<ShadowVolumes> volumes_;
  std::vector<VolumeGroup> volume_groups_;  // openings of one kind and orientation, as the stencil counts them
  std::vector<std::pair<glm::vec4, VolumeCasters>> behind_planes_;  // what stands on the room side of panels
};

}  // namespace transom
