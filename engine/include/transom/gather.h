/// @file Where the light of a point or a patch comes from: shares of slots, sky bins, and openings looked through.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/light_mesh.h"
#include "transom/ray_scene.h"
#include "transom/sky.h"

namespace transom {

class Panels;
class SceneChange;
class SobolSequence;
struct HemisphereTally;

/// Numbers of samples for one receiver.
struct GatherSamples {
  int hemisphere = 0;  ///< rays over the hemisphere
  int openings = 0;    ///< rays towards the openings in all

  bool operator==(const GatherSamples&) const = default;
};

/// An index and a weight.
struct Share {
  int index;
  float weight;

  bool operator==(const Share&) const = default;
};

/// The light of one receiver as weights. Illuminance E = sum reached B + sum through B + sum sky L.
struct GatherRow {
  std::vector<Share> reached;  ///< slots seen without looking through an opening: form factors
  std::vector<Share> through;  ///< slots seen through openings: form factors x transmittance
  /// Sky bins, then the ground, then exit bins of panels (Panels): illuminance per luminance [lx per cd/m²].
  std::vector<Share> sky;
  /// Of a point: elements reached, as `reached` has them by slot; of near patches, or of all where that was asked for.
  std::vector<Share> near;
  /// Of a patch but a cluster: the same by the patch's own element that the ray has left, as slot reached * elements
  /// per slot + own element.
  std::vector<Share> left;
  float escaped = 0;            ///< share of the hemisphere that meets nothing: open sky
  float exposure = 1;           ///< share of the receiver that does not lie inside a solid
  float harmonic_distance = 0;  ///< harmonic mean distance of what is seen [m]
  /// Sum over the rays of 1 / distance, as a whole number of steps, so that single rays can be taken back.
  std::int64_t inverse_distance = 0;
};

/// Samples the surroundings of receivers. The row of a receiver depends on its seed alone.
///
/// Hemisphere: cosine-distributed rays to the first surface, opening or not. An opening's own reflection is thus part
/// of `reached`. What is seen through the openings is sampled on the openings: solid-angle sampling of their triangles
/// [Arvo 1995], each ray continued outdoors to an obstruction, the sky or the ground, times the transmittance of all
/// openings on its way. A ray that meets another opening first is left to that opening. A ray ends at the room side of
/// a panel: what it sees there is the panel's exit bin, a light source like a bin of the sky.
class Gatherer {
 public:
  Gatherer(const LightMesh& mesh, const RayScene& rays, const std::vector<Material>& materials,
           const std::vector<OpeningGroup>& openings, const SkyBinIndex& sky, const Panels& panels);

  /// What is seen without looking through an opening: `reached`, `escaped`, `exposure`, `harmonic_distance`, and the
  /// sky seen by itself. No glazing changes it.
  GatherRow surroundings_of_point(const Node& point, GatherSamples samples, std::uint32_t seed) const;
  /// Of a patch: means over its exposed part.
  GatherRow surroundings_of_patch(int slot, GatherSamples samples, std::uint32_t seed) const;

  /// The same of a receiver of which the row is known that `before` found with the same samples and seed, in another
  /// state of the scene: only rays that may meet what has changed are cast, in both states, and the row is equal bit by
  /// bit to one that is found anew. known: its slots as they are numbered here, sorted, less those that are gone; of an
  /// open sky, what is seen without looking through openings.
  GatherRow surroundings_of_point(const Node& point, GatherSamples samples, std::uint32_t seed, GatherRow known,
                                  const Gatherer& before, const SceneChange& change) const;
  GatherRow surroundings_of_patch(int slot, GatherSamples samples, std::uint32_t seed, GatherRow known,
                                  const Gatherer& before, const SceneChange& change) const;

  /// Distance [m] up to which points see a slot by its elements; 0 for a cluster.
  float near_distance(int slot) const { return near_distance_[static_cast<std::size_t>(slot)]; }

  /// Whether a ray that `look_through_openings` casts with these samples and seed may meet what has changed. False is
  /// certain.
  bool may_meet_through_openings(const Node& point, GatherSamples samples, std::uint32_t seed,
                                 const SceneChange& change) const;
  bool may_meet_through_openings(int slot, GatherSamples samples, std::uint32_t seed, const SceneChange& change) const;

  /// Adds what is seen through openings, `through` and `sky`, to a row of which the exposure is known.
  void look_through_openings(const Node& point, GatherSamples samples, std::uint32_t seed, GatherRow& row) const;
  void look_through_openings(int slot, GatherSamples samples, std::uint32_t seed, GatherRow& row) const;

  /// Irradiance at a point [Cohen & Wallace 1993, eq. 2.54]: surroundings, and through openings. All elements reached
  /// are in `near`, but those of clusters.
  GatherRow gather_at_point(const Node& point, GatherSamples samples, std::uint32_t seed) const;

 private:
  struct OpeningTriangle {
    glm::vec3 corner[3];
    int face;
    float area;
  };
  struct Origin {
    glm::vec3 position, normal;
    int element = -1;  // of the patch that it is on
  };
  // Rays, and the elements of a patch that they leave, if they do not leave a point.
  struct Cast {
    std::vector<Ray> rays;
    std::vector<int> elements;

    void clear() {
      rays.clear();
      elements.clear();
    }
    template <typename Condition>
    void keep_if(const Condition& is_kept) {
      std::size_t kept = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!is_kept(rays[i])) continue;
        rays[kept] = rays[i];
        if (!elements.empty()) elements[kept] = elements[i];
        ++kept;
      }
      rays.resize(kept);
      if (!elements.empty()) elements.resize(kept);
    }
  };
  enum class Elements { kNone, kNear, kAll };  // which of those reached are told, besides their slots
  auto places_on(int slot_index) const;
  template <typename OriginOf>
  GatherRow gather_hemisphere(const OriginOf& origin_of, int count, std::uint32_t seed, Elements told) const;
  template <typename OriginOf>
  bool gather_again(const OriginOf& origin_of, const Node& middle, float radius, int count, std::uint32_t seed,
                    Elements told, const Gatherer& before, const SceneChange& change, GatherRow& row) const;
  GatherRow gather_from_point(const Node& point, int count, std::uint32_t seed, Elements told) const;
  void add_hits(const Cast& cast, Elements told, HemisphereTally& tally) const;
  void add_hit(const Hit& hit, glm::vec3 direction, int element, Elements told, HemisphereTally& tally) const;
  template <typename OriginOf>
  static void add_rays(const OriginOf& origin_of, const SobolSequence& points, std::span<const std::uint32_t> indices,
                       int count, Cast& cast);
  static void add_rays_from_point(const Node& point, const SobolSequence& points,
                                  std::span<const std::uint32_t> indices, int count, std::vector<Ray>& rays);
  std::vector<float> past_further_openings(std::span<const Ray> rays, std::vector<Hit>& hits) const;
  float radius_of(int slot) const;
  template <typename OriginOf>
  bool may_meet_through_openings(const Node& middle, float radius, const OriginOf& origin_of, int count,
                                 std::uint32_t seed, const SceneChange& change) const;
  template <typename OriginOf, typename Visit>
  bool visit_opening_rays(const Origin& middle, const OriginOf& origin_of, int count, std::uint32_t seed,
                          const Visit& visit) const;
  template <typename OriginOf>
  void gather_openings(const Origin& middle, const OriginOf& origin_of, int count, std::uint32_t seed,
                       GatherRow& row) const;

  const LightMesh& mesh_;
  const RayScene& rays_;
  const std::vector<Material>& materials_;
  const std::vector<OpeningGroup>& openings_;
  const SkyBinIndex& sky_;
  const Panels& panels_;
  std::vector<OpeningTriangle> opening_triangles_;
  std::vector<float> near_distance_;  // by slot [m]
};

/// Adds up the weights of equal indices and sorts by index.
void merge_shares(std::vector<Share>& shares);

}  // namespace transom
