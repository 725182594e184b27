/// @file Small faces taken together: sides that lie close to each other and face about the same way share a patch.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/geometry.h"

namespace transom {

/// A part of a cluster, for light that falls on it and is sent on: an area about a point of one of its faces.
struct ClusterElement {
  glm::vec3 middle{0};  ///< on the surface, lifted off it by Faces::ray_offset
  glm::vec3 normal{0};  ///< unit: the mean of its faces
  float area = 0;       ///< [m²]
};

/// Sides of faces in clusters: of one material, all of them indoors or none, in one cube of space, nearest to one sense
/// of one axis.
class FaceClusters {
 public:
  FaceClusters() = default;
  /// is_small: faces to be taken together. is_indoors: of each face the sides that lie indoors, see survey.h. cube_m:
  /// least edge of the cubes, which grow until there are at most `largest_count` clusters. Each cluster has `elements`
  /// parts of about equal area.
  FaceClusters(const Faces& faces, const std::vector<char>& is_small, const std::vector<char>& is_indoors, float cube_m,
               int largest_count, int elements);

  int count() const { return static_cast<int>(begin_.size()) - 1; }
  /// Cluster of a side, or -1; and its element there.
  int cluster_of(int face, Side side) const {
    return cluster_of_side_.empty() ? -1 : cluster_of_side_[2 * face + side];
  }
  int element_of(int face, Side side) const { return element_of_side_[2 * face + side]; }

  /// The sides of a cluster, each as 2 * face + side.
  std::span<const int> sides(int cluster) const {
    return {sides_.data() + begin_[cluster], begin_[cluster + 1] - begin_[cluster]};
  }
  float area(int cluster) const { return area_[cluster]; }
  const ClusterElement& element(int cluster, int element) const { return elements_[cluster * per_cluster_ + element]; }

  /// A side of the cluster, as 2 * face + side, chosen by area with a uniform number; `u` becomes a new one.
  int sample_side(int cluster, float& u) const;
  /// The same of one of its elements.
  int sample_side(int cluster, int element, float& u) const;
  /// The side that stands for the cluster where one must.
  int main_side(int cluster) const { return sides_[(begin_[cluster] + begin_[cluster + 1]) / 2]; }

 private:
  void find_clusters(const Faces& faces, const std::vector<char>& is_small, const std::vector<char>& is_indoors,
                     float cube_m, int largest_count);
  void find_elements(const Faces& faces, int cluster);
  int sample_between(int cluster, std::size_t first, std::size_t last, float& u) const;
  /// Of the sides of the cluster that begins at `begin`, before side i.
  double area_before(std::size_t i, std::size_t begin) const { return i > begin ? area_up_to_[i - 1] : 0.0; }

  int per_cluster_ = 1;
  std::vector<int> cluster_of_side_;
  std::vector<std::uint8_t> element_of_side_;
  std::vector<std::size_t> begin_{0};       // into sides_, by cluster
  std::vector<std::size_t> element_begin_;  // into sides_, by element of all clusters, and one more
  std::vector<int> sides_;                  // along a curve that keeps neighbours together
  std::vector<double> area_up_to_;          // of the sides of the same cluster up to and with each
  std::vector<float> area_;
  std::vector<ClusterElement> elements_;
};

/// Faces so small against their patches' longest edge that they are better taken together. None where all faces have
/// cells of their own at a bearable cost: about `target_patch_count` of them. Openings never are.
std::vector<char> find_small_faces(const Faces& faces, const std::vector<Material>& materials,
                                   const std::vector<float>& edges, int target_patch_count);

}  // namespace transom
