/// @file How fixed points see the patches that beams light: found once for a geometry, used for every condition.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "transom/first_bounce.h"
#include "transom/light_mesh.h"
#include "transom/node_field.h"
#include "transom/ray_scene.h"
#include "transom/scene_change.h"
#include "transom/screens.h"

namespace transom {

/// The first reflection of beams towards fixed points, as FirstBounce finds it for any point, without rays once a
/// patch has been linked: each link holds what stands between a point and a patch.
///
/// A patch at least four diameters away counts as a point at the centroid of its light, seen as much as the middle of
/// its exposed part is seen; if it is evenly lit, all that is known beforehand. Where that middle is seen otherwise
/// from a point beside, or is seen otherwise than the middle of the patch beside, something may hide a part of the
/// patch: such a point asks for its elements, and so do those around it as far as they see a part. Nearer points see
/// each element for itself, with its own weight.
class PointLinks {
 public:
  /// neighbours: of the points, itself among them. Left out: a far patch is seen as its middle is. memory: for what is
  /// kept [bytes].
  PointLinks(const LightMesh& mesh, const RayScene& rays, const std::vector<Node>& points,
             NodeNeighbours neighbours = {}, std::size_t memory = kMemory);

  /// What has been linked in another state of the scene.
  struct Known {
    const PointLinks* links = nullptr;
    const SceneChange* change = nullptr;  ///< between that state and this one
    std::vector<int> point;               ///< its number of each point here, or -1
    bool has_same_points = false;         ///< all of them, in the same order, and no face has changed
    bool has_same_glazing = false;        ///< else only what is seen without looking through an opening is of use
  };

  static constexpr std::size_t kMemory = 512u << 20;

  /// Links the patches of these slots to all points. Where memory would not do for all, the weights of evenly lit ones
  /// are not kept, and then not all links: relighting finds again what it needs. known: what need not be found.
  void prepare(const std::vector<int>& slots, const Known& known) const;

  /// Adds to the irradiance of every point [lx] what the bright elements send to it; elements of one slot stand
  /// together. Links what has not been linked. Threads may ask at once. Patches of one hue cost one channel.
  void add_irradiance(std::span<const BrightElement> bright, std::vector<glm::vec3>& irradiance) const;

  /// Memory held by links [bytes].
  std::size_t byte_count() const;

 private:
  static constexpr std::size_t kBlock = 64;  // points
  static constexpr int kGroups = 16;         // of elements
  static constexpr float kLeastDistance2 =
      1e-15f;  // keeps 0 / 0 out of weights that are 0; its square is a normal number
  /// A far point that sees some of the exposed elements of a patch. Elements are told apart in sixteen groups.
  struct Partial {
    int point;
    std::uint16_t groups;               // those that are seen, bit by bit
    std::uint8_t seen, seen_of_middle;  // share seen of these, and of the middle of the exposed part
  };
  /// What one patch is to all points. A seen share T is stored as 255 sqrt(T): 1 is exact, dark glass keeps its digits.
  struct Link {
    std::vector<int> block;  // blocks of points in front of the patch, ascending
    std::vector<std::uint8_t>
        seen;  // kBlock for each of them: of far points, or of what they see of it; 0 for near ones
    std::vector<std::uint64_t> asked;  // for each of them a bit a point: whether it has asked for elements
    // For each seen share: irradiance per radiosity where the light of the patch is even, in units of `weight_unit`.
    std::vector<std::uint16_t> weight;
    float weight_unit = 0;
    std::vector<Partial> partial;    // ascending
    std::vector<int> near_point;     // ascending
    std::vector<float> near_weight;  // for each near point, by element: irradiance per radiosity
    std::vector<float> near_sum;     // for each near point: the sum of these
    std::vector<glm::vec4> element;  // of the patch: middle, lifted, and area
    std::vector<int> glazed_point;   // ascending: points between which and the patch some opening stands
  };
  /// What another state of the scene had as the link of a patch. Points by their numbers there.
  class KnownPoints {
   public:
    KnownPoints(const Known& known, const Link* link);
    const SceneChange& change() const { return *known_.change; }
    int number(int point) const;  // there; -1: to be found anew
    bool is_glazed(int known_point) const { return is_glazed_[static_cast<std::size_t>(known_point)] != 0; }
    bool is_asked(int known_point) const;
    std::uint8_t seen_of_middle(int known_point) const;
    const Partial* partial(int known_point) const;       // null: none
    const float* near_weight_of(int known_point) const;  // null: not among the near points

   private:
    const Known& known_;
    const Link* link_;                     // null: none is known
    std::vector<int> place_;               // of each block of points, among those of the link; -1: not among them
    std::vector<std::uint8_t> is_glazed_;  // by point
  };
  struct LitPatch {
    std::shared_ptr<const Link> link;
    glm::vec3 centroid{0}, normal{0};    // of the light
    glm::vec3 hue{1};                    // of the light: its strongest channel is 1. In that channel:
    float flux = 0;                      // reflected [lm], over pi
    bool is_even = true;                 // all elements send the same
    float radiosity = 0;                 // of each of them then
    std::vector<float> sent;             // by element: radiosity; where their hues differ, three channels one by one
    std::vector<float> share_of_groups;  // of the light: of any set of the first eight groups, then of the others
    float share_of(std::uint16_t groups) const {
      return share_of_groups[groups & 255u] + share_of_groups[256 + (groups >> 8)];
    }
  };
  struct Hue {
    glm::vec3 colour;  // its strongest channel is 1
    std::vector<const LitPatch*> patches;
  };
  std::size_t bytes_of(const Link& link) const;
  void forget_weights() const;
  /// The part of a patch that does not lie inside a solid.
  struct Exposed {
    glm::vec3 middle{0};
    float radius = 0;           // around it, of the middles of its elements
    std::vector<int> elements;  // within the slot: one of each group, those farthest from each other first
    bool operator==(const Exposed&) const = default;
  };
  /// How points see the middle of a patch.
  struct MiddleView {
    int slot;
    Exposed exposed;
    std::shared_ptr<const Link> before;  // of another state of the scene, if the same part was exposed there
    std::vector<std::uint8_t> seen;      // by point: the stored share, or kNotFar
    std::vector<int> near_point, glazed_point;
  };
  static constexpr std::uint8_t kNotFar = 1;  // no share is stored so
  class ElementViews;
  /// Whether openings may stand between places of a patch and points, asked in their order: once for each block.
  class MayBeGlazed {
   public:
    MayBeGlazed(const PointLinks& links, std::span<const glm::vec3> places)
        : links_(links), places_(links.openings_.places(places)) {}
    bool operator()(int point) {
      const std::size_t block = static_cast<std::size_t>(point) / kBlock;
      if (block != block_) answer_ = links_.openings_.may_hide(places_, block);
      block_ = block;
      return answer_;
    }

   private:
    const PointLinks& links_;
    Screens::Places places_;
    std::size_t block_ = static_cast<std::size_t>(-1);
    bool answer_ = true;
  };
  Exposed exposed_part(int slot) const;
  int group_of(int element) const { return std::min(element, element * kGroups / mesh_.elements_per_slot()); }
  std::vector<int> slots_beside(int slot) const;
  std::shared_ptr<const Link> known_link(int slot, const Exposed& exposed, const Known& known) const;
  std::vector<std::shared_ptr<const Link>> links_of(const std::vector<int>& slots, const Known& known) const;
  std::vector<std::shared_ptr<const Link>> found_links(const std::vector<int>& slots, const Known& known) const;
  MiddleView middle_view(int slot, Exposed exposed, const Known& known) const;
  void see_middle(MiddleView& view, const std::vector<int>& far_points, const KnownPoints& known) const;
  std::shared_ptr<const Link> link(const MiddleView& view, const std::vector<const MiddleView*>& beside,
                                   const Known& known) const;
  void link_far(Link& link, const MiddleView& view, const std::vector<const MiddleView*>& beside,
                const KnownPoints& known) const;
  void link_near(Link& link, int slot, const KnownPoints& known) const;
  std::vector<float> shares_of_groups(const Link& link, std::span<const BrightElement> bright, float sum) const;
  static std::vector<Hue> hues_of(const std::vector<LitPatch>& lit);
  void add_far(const Hue& hue, std::size_t first_block, std::size_t last_block, float* received) const;
  void add_block(const LitPatch& patch, std::size_t place, std::size_t from,
                 std::vector<Partial>::const_iterator& partial, float* received) const;
  void add_blocks(const std::vector<LitPatch>& lit, const std::vector<Hue>& hues, std::size_t chunk,
                  std::vector<glm::vec3>& irradiance) const;
  // As it is stored, and back.
  static std::uint8_t stored_share(float seen) {
    return seen > 0 ? static_cast<std::uint8_t>(std::max(kNotFar + 1L, std::lround(255 * std::sqrt(seen)))) : 0;
  }
  static float seen_share(std::uint8_t seen) {
    const float root = static_cast<float>(static_cast<int>(seen)) * (1.f / 255);
    return root * root;
  }
  // Irradiance of a point per intensity along the normal of a small surface at `centre`, whatever stands between.
  float point_weight(glm::vec3 centre, glm::vec3 normal, std::size_t point) const {
    const float dx = centre.x - x_[point], dy = centre.y - y_[point], dz = centre.z - z_[point];
    const float height = std::max(0.f, -(dx * normal.x + dy * normal.y + dz * normal.z));
    const float cosine = std::max(0.f, dx * nx_[point] + dy * ny_[point] + dz * nz_[point]);
    const float distance2 = std::max(kLeastDistance2, dx * dx + dy * dy + dz * dz);
    return height * cosine / (distance2 * distance2);
  }
  void seen_shares(std::vector<Ray> segments, const std::vector<std::uint8_t>& may_be_glazed, RayScene::Order order,
                   std::vector<float>& shares, std::vector<std::uint8_t>& is_glazed) const;
  void weigh_far(Link& link, int slot) const;
  LitPatch lit_patch(std::shared_ptr<const Link> link, std::span<const BrightElement> bright, std::size_t first,
                     std::size_t last) const;

  const LightMesh& mesh_;
  const RayScene& rays_;
  std::size_t point_count_;
  NodeNeighbours neighbours_;
  std::size_t memory_;                           // for links [bytes]
  std::vector<float> x_, y_, z_, nx_, ny_, nz_;  // of the points, padded to whole blocks
  std::vector<glm::vec3> block_middle_;
  std::vector<float> block_radius_;
  Screens openings_;  // that may stand between places and the blocks

  // What has been found is kept. It changes no answer but for the rounding of weights, only what the next one costs.
  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<const Link>> links_;  // by slot
  mutable std::size_t byte_count_ = 0;
  mutable bool keeps_weights_ = true;
};

}  // namespace transom
