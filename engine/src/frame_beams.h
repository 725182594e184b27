/// @file One beam and the points of a picture: which of them may be lit, through which openings, and rays for those.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "transom/beam_outlines.h"
#include "transom/engine.h"
#include "transom/view_samples.h"

namespace transom {

/// Rays towards a source, collected so that they are traced sixteen at a time.
class ShadowRays {
 public:
  /// arriving: at the start of the ray if nothing is in its way. share: 0 until then.
  void add(const Ray& ray, float arriving, float* share) {
    rays_.push_back(ray);
    arriving_.push_back(arriving);
    shares_.push_back(share);
  }
  /// Sets every share to what arrives along the first of its rays that meets nothing, and forgets them all.
  void trace(const RayScene& scene, RayScene::What what);

 private:
  std::vector<Ray> rays_;
  std::vector<float> arriving_;
  std::vector<float*> shares_;
  std::vector<std::uint8_t> blocked_;
};

/// A beam as the surfaces of a picture see it. What openings do to the sun is known in closed form, as in deposits:
/// rays look only for what is opaque, and only from points that openings let light to.
class SeenBeam {
 public:
  /// Will be asked about surfaces of the samples alone. is_enclosed: by face * 2 + side, whether beams reach it through
  /// openings alone.
  SeenBeam(const Engine& engine, const Beam& beam, const ViewSamples& samples, const std::vector<char>& is_enclosed);

  /// Whether a surface faces the beam, and something of it may be lit.
  bool may_light(int surface) const { return may_light_[place(surface)] != 0; }
  /// Whether points of a group may be lit.
  bool may_light(const BeamGroup& group) const;

  /// Share of the beam that arrives at points of one surface, once `rays` have been traced: 0 until then, and shares
  /// must stay where they are.
  void find_shares(int surface, std::span<const BeamPoint> points, std::span<float> shares, ShadowRays& rays) const;
  void trace(ShadowRays& rays) const;

  bool faces(const BeamPoint& point) const { return glm::dot(point.normal, beam_->direction_to_source) > 0; }

  /// What a point that a share of the beam reaches adds to its pixel [cd/m²].
  glm::vec3 reflected(const BeamPoint& point, float share) const;

 private:
  void find_shares_of_sun(int surface, std::span<const BeamPoint> points, std::span<float> shares,
                          ShadowRays& rays) const;
  void find_shares_of_lobe(std::span<const BeamPoint> points, std::span<float> shares, ShadowRays& rays) const;

  std::size_t place(int surface) const {
    return static_cast<std::size_t>(samples_->place_of_surface[static_cast<std::size_t>(surface)]);
  }

  const Engine* engine_;
  const Beam* beam_;
  const ViewSamples* samples_;
  const std::vector<char>* is_enclosed_;
  std::vector<char> may_light_;           // by place of a surface
  std::optional<BeamOutlines> outlines_;  // of openings before the sun
  std::vector<float> transmittance_;      // of each of them
  std::vector<std::vector<int>> over_;    // by place of a surface: those that may cover it
};

}  // namespace transom
