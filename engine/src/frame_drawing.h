/// @file What the drawing of one picture knows, and what the drawing of a row needs.
#pragma once

#include <vector>

#include "frame_beams.h"
#include "frame_masks.h"
#include "transom/frame.h"

namespace transom {

/// What one picture is made of.
struct FrameRenderer::Drawing {
  const Lighting& lighting;
  CameraRays camera;
  glm::vec3 eye;
  bool has_components;
  const SkyPicture* sky;
  Frame& frame;
  std::vector<SeenBeam> beams{};
  const Masks* masks = nullptr;  ///< of stencil volumes; null: by rays
  std::vector<float> mask_share{};
  bool is_begun = false, is_complete = true;  ///< beams have been drawn before; none will be later
  std::vector<glm::vec4> shown{};             ///< what the samples' shares are of
};

/// Memory that is kept from row to row.
struct FrameRenderer::Scratch {
  ShadowRays rays;
  std::vector<BeamPoint> points;
  std::vector<float> shares, highest, lowest;
  std::vector<std::size_t> chosen;
  std::vector<EndingPixel> ending;
  std::vector<PixelShare> pixel_shares;
  std::vector<glm::vec2> places;
  std::vector<glm::vec3> positions;
};

}  // namespace transom
