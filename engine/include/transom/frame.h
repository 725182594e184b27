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

/// How beams are tested per pixel.
enum class Visibility { kRays, kVolumes };

/// Settings of a picture.
struct FrameOptions {
  Visibility visibility = Visibility::kRays;
  int edge_samples = 4;    ///< per pixel and axis where an edge is found; 1: pixel centres only
  bool components = true;  ///< the parts of the picture beside their sum
};

/// A picture in cd/m², and its parts by what the light has done last. Their sum is `radiance`.
struct Frame {
  int width = 0, height = 0;
  std::vector<glm::vec3> radiance;
  std::vector<glm::vec3> sun;       ///< beams and point sources, reflected once
  std::vector<glm::vec3> sky;       ///< sky and ground, reflected once
  std::vector<glm::vec3> indirect;  ///< reflected more than once
  std::vector<glm::vec3> emitted;   ///< emitters seen
  std::vector<glm::vec3> exterior;  ///< sky and ground, and emitters seen through openings
  int edge_pixel_count = 0;         ///< pixels that were supersampled
  int pass_count = 0;               ///< kVolumes: passes of the stencil method
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
  /// What bounds a block of beam points.
  struct Box {
    glm::vec3 low{0}, high{0};
  };
  std::vector<Box> boxes_of(const std::vector<BeamPoint>& points) const;
  void find_shares_by_block(const Beam& beam, const std::vector<BeamPoint>& points, const std::vector<Box>& boxes,
                            const std::vector<float>* mask_share, const Masks& masks, std::vector<float>& shares) const;
  struct VolumeGroup {
    int opening;
    glm::vec3 normal;
  };
  void make_volumes();
  int render_mask(const Beam& beam, const View& view, const Masks& masks, std::vector<float>& share);
  int render_shafts(const Beam& lobe, const VolumeCamera& camera, std::vector<float>& share);
  const VolumeCasters& casters_behind(glm::vec4 plane);
  void add_smooth_light(const ViewSamples& samples, const Lighting& lighting, bool components, Frame& frame) const;
  void add_beam(const ViewSamples& samples, const Beam& beam, const std::vector<float>* mask_share, const Masks& masks,
                std::vector<glm::vec3>& picture, std::vector<char>& is_edge) const;
  void find_shares(const Beam& beam, std::span<const BeamPoint> points, const std::vector<float>* mask_share,
                   const Masks& masks, std::span<float> shares) const;

  const Engine& engine_;
  std::unique_ptr<ViewSamples> samples_;  // of the last camera
  std::vector<Box> centre_boxes_, fine_boxes_, pane_boxes_;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<ShadowVolumes> volumes_;
  std::vector<VolumeGroup> volume_groups_;  // openings of one kind and orientation, as the stencil counts them
  std::vector<std::pair<glm::vec4, VolumeCasters>> behind_planes_;  // what stands on the room side of panels
};

}  // namespace transom
