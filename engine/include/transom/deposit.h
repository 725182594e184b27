/// @file Direct light of beams and point sources on the elements of patches, by area.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "transom/beam_outlines.h"
#include "transom/light_mesh.h"
#include "transom/ray_scene.h"
#include "transom/sky.h"

namespace transom {

/// Direct illuminance of one element [lx].
struct LitElement {
  int element;  ///< counted over all slots: slot * elements_per_slot + element
  glm::vec3 illuminance;
};

/// What beams took: those that some opening or patch outdoors faces, the opening faces that face them, and the patches
/// that their light might reach, summed over beams.
struct BeamPlan {
  int beams = 0, facing_openings = 0, patches = 0;
  bool is_unshaded = false;  ///< the room is convex: no ray has looked for what shades patches behind openings
};

/// Casts light from beams and point sources on patches and points. Openings on the way take their share.
///
/// Elements look for the sun through openings. An opening that is smaller than an element would be missed by most of
/// their samples: its light is sent from the opening instead. Light belongs to the first opening that a point sees on
/// its way to the sun, so that none is counted twice. Lobes come in shafts, whose part of an element is found exactly.
class DirectLight {
 public:
  /// small_opening_m2: area of an element; opening faces below it send their light themselves. is_convex: as
  /// is_convex_room has it. seed: of all samples.
  DirectLight(const LightMesh& mesh, const RayScene& rays, const std::vector<PointSource>& sources,
              const std::vector<Material>& materials, float small_opening_m2, bool is_convex, std::uint32_t seed);
  ~DirectLight();

  /// Patches that receive light, and what of them every beam needs.
  struct Receivers {
    std::vector<int> slots;
    std::vector<char> is_behind_openings;  ///< beams reach it through openings alone
    /// Of each patch, lifted: at (0, 0), (1, 0), (1, 1) and (0, 1) of its cell; of a triangle the third is the fourth.
    std::vector<std::array<glm::vec3, 4>> corners;
    std::vector<glm::vec3> normals;  ///< of the lit side
  };
  /// is_behind_openings: empty where none is known to be.
  Receivers receivers(const std::vector<int>& slots, std::vector<char> is_behind_openings) const;

  /// Mean direct illuminance of the elements of the receivers that receive any, in their order. Stratified over each
  /// element, eight times as densely at edges of light. Patches behind openings cost rays only where the outline of an
  /// opening falls on them. plan: what it took is added to it; may be null.
  std::vector<LitElement> deposit(const std::vector<Beam>& beams, const Receivers& receivers,
                                  BeamPlan* plan = nullptr) const;

  /// Share of a beam that arrives at lifted points: 0 where something opaque intervenes, else the transmittance. Of a
  /// lobe: what the openings before its panel leave, where the panel is the first opening that the point sees.
  void beam_transmission(const Beam& beam, std::span<const glm::vec3> points, std::span<float> share) const;

  /// Direct illuminance at a lifted point with a shading normal [lx].
  glm::vec3 illuminance(const std::vector<Beam>& beams, glm::vec3 point, glm::vec3 normal) const;

  /// The part of it that comes from point sources.
  glm::vec3 point_source_illuminance(glm::vec3 point, glm::vec3 normal) const;

 private:
  struct LocalSource {
    glm::vec3 position, intensity;
  };
  class Patterns;
  using Corners = std::array<glm::vec3, 4>;
  using Points = BeamOutlines::Points;
  Points points_on(int slot, const Corners& corners, std::span<const int> elements, std::size_t samples) const;
  struct SunlitSlot;
  class Sun;
  std::vector<SunlitSlot> reached(const Sun& sun, const Receivers& receivers) const;
  std::vector<SunlitSlot> reached(const Sun& sun, const Receivers& receivers, std::size_t begin, std::size_t end) const;
  void sun_transmission(const Sun& sun, const SunlitSlot& slot, const Points& points, std::span<float> share) const;
  std::vector<float> sample_sun(const Sun& sun, const Receivers& receivers,
                                const std::vector<SunlitSlot>& candidates) const;
  bool is_lit_as_all_around(int slot, const std::vector<int>& place_of_slot,
                            const std::vector<float>& evenly_lit) const;
  std::vector<int> partly_lit(int slot, const std::vector<int>& place_of_slot, const std::vector<float>& share,
                              const std::vector<float>& evenly_lit) const;
  void add_sun(const Beam& sun, const Receivers& receivers, std::vector<std::vector<glm::vec3>>& sum,
               BeamPlan& plan) const;
  std::vector<std::size_t> reached_by_lobe(const Beam& lobe, const Receivers& receivers) const;
  std::vector<std::vector<glm::vec3>> element_outlines(int slot, const Corners& corners) const;
  void lobe_on_slot(const Beam& lobe, int slot, const Corners& corners, std::vector<float>& mean) const;
  void add_lobe(const Beam& lobe, const Receivers& receivers, std::vector<std::vector<glm::vec3>>& sum,
                BeamPlan& plan) const;
  void shaft_transmission(const Beam& lobe, std::span<const glm::vec3> points, std::span<float> share) const;
  void sources_on_slot(int slot, const Corners& corners, glm::vec3 normal, std::vector<glm::vec3>& sum) const;
  void sources_and_beams_on_cluster(const std::vector<Beam>& beams, int slot, std::vector<glm::vec3>& sum) const;

  void ignore_small_openings(glm::vec3 direction, const Points& points, std::span<float> share) const;
  std::map<int, glm::vec3> send_through_small_openings(const std::vector<Beam>& beams) const;

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::uint32_t seed_;
  std::unique_ptr<const Patterns> patterns_;
  bool is_convex_;  // nothing opaque stands between openings and what lies behind them
  std::vector<LocalSource> sources_;
  std::vector<int> openings_, small_openings_;  // faces
  std::vector<char> is_small_opening_;          // by face
};

}  // namespace transom
