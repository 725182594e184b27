/// @file What an edit leaves of a scene: which faces and slots stay, and which rays can tell the difference.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

#include "transom/gather.h"
#include "transom/light_mesh.h"
#include "transom/ray_scene.h"

namespace transom {

class HemisphereCells;

/// Two states of a scene compared. A face stays if it is in the same place with the same cells, of whatever material
/// and number, is as solid as it was, and is no wall that has become an opening; a slot stays with its face. What has
/// changed is all in a few boxes: a ray that meets none of them meets the same places in both states.
///
/// Slots are numbered as in the later state where nothing else is said.
class SceneChange {
 public:
  /// Nothing stays where the origin, the extent or the number of elements differs: then all coordinates do.
  SceneChange(const LightMesh& before, const LightMesh& after);

  /// Every face and every slot stays, with its number.
  bool is_none() const { return is_none_; }
  /// Number in the earlier state; -1: was not there.
  int face_before(int face) const { return face_before_[static_cast<std::size_t>(face)]; }
  int slot_before(int slot) const { return slot_before_[static_cast<std::size_t>(slot)]; }
  /// Number in the later state of a slot of the earlier one; -1: is gone.
  int slot_after(int slot_before) const { return slot_after_[static_cast<std::size_t>(slot_before)]; }

  /// Shares of slots of the earlier state by their numbers in the later one, sorted, less those that are gone.
  std::vector<Share> renumbered(std::vector<Share> slots) const;
  /// The same of elements.
  std::vector<Share> renumbered_elements(std::vector<Share> elements) const;

  /// Whether a ray or segment may meet what has changed. False is certain.
  bool may_meet(const Ray& ray) const;

  /// Whether a segment from a point to no farther than `radius` from another may meet what has changed. False is
  /// certain.
  bool may_meet(glm::vec3 from, glm::vec3 to, float radius) const;

  /// Of the cells of a hemisphere (HemisphereCells): whether a ray within each, from no farther than `radius` from the
  /// place, may meet what has changed. False is certain. Returns whether any may.
  bool may_meet(const Node& place, float radius, const HemisphereCells& cells, std::vector<char>& of_cell) const;

  /// Whether a ray from no farther than `radius` from the place, through a triangle and on without end, may meet what
  /// has changed. False is certain.
  bool may_meet(glm::vec3 place, float radius, const glm::vec3 (&triangle)[3]) const;

 private:
  static constexpr std::size_t kBoxes = 16, kSpheres = 32;  // at most; they hold all that has changed
  struct Box {
    glm::vec3 low{Ray::kInfinity}, high{-Ray::kInfinity};
  };
  struct Sphere {
    glm::vec3 middle{0};
    float radius = 0;
  };
  void match_faces(const LightMesh& before, const LightMesh& after);
  void match_clusters(const LightMesh& before, const LightMesh& after);
  void match_slots(const LightMesh& before, const LightMesh& after);
  void enclose(std::vector<Box> boxes);

  int elements_per_slot_;
  bool is_none_ = false;
  std::vector<int> face_before_, face_after_, slot_before_, slot_after_;
  Box all_;  // that has changed
  Sphere around_all_;
  std::array<std::array<float, kBoxes>, 3> low_, high_;  // of the boxes, by axis; those that are not needed are empty
  std::vector<Sphere> spheres_;                          // around the boxes
};

/// The hemisphere around +z in the cells that sampling fills evenly: equal squares of the unit square, as
/// sample_cosine_hemisphere maps them. Cell (i, j) has number j * per_axis + i.
class HemisphereCells {
 public:
  /// bits: 2^bits cells along each axis; beyond 3 the cells of 3.
  static const HemisphereCells& of(int bits);

  int bits() const { return bits_; }
  int per_axis() const { return 1 << bits_; }
  int count() const { return 1 << 2 * bits_; }

 private:
  friend class SceneChange;
  explicit HemisphereCells(int bits);
  int bits_;
  std::vector<glm::vec3> axis_;               // unit
  std::vector<float> cos_angle_, sin_angle_;  // between the axis and the farthest direction of the cell
};

}  // namespace transom
