/// @file Panels: faces of openings that hold a glazing product, and the bins by which light arrives at them and leaves
/// them.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "transom/gather.h"
#include "transom/geometry.h"
#include "transom/ray_scene.h"
#include "transom/sky.h"

namespace transom {

/// What a product does to light that is not parallel. transmission: BTDF from outdoors, mean over bins [1/sr], row by
/// row: row = exit bin, column = incident bin; empty: nothing passes.
struct Product {
  std::vector<float> transmission;
  float room_reflectance = 0;  ///< hemispherical, of the room side
};

/// A face of an opening group that has a PanelFrame. Its bins are numbered from first_bin on, over all panels.
struct Panel {
  int face;
  int opening;
  int first_bin;
};

/// The panels of a scene and the numbering of their bins: one number for a panel and a bin of its basis.
class Panels {
 public:
  Panels(const Faces& faces, const std::vector<Material>& materials, const std::vector<OpeningGroup>& openings);

  const std::vector<Panel>& all() const { return panels_; }
  int bin_count() const { return bin_count_; }
  const PanelFrame& frame(const Panel& panel) const {
    return *openings_[static_cast<std::size_t>(panel.opening)].panel;
  }

  /// The panel that is a face, or null.
  const Panel* at(int face) const {
    const int index = panel_of_face_[static_cast<std::size_t>(face)];
    return index < 0 ? nullptr : &panels_[static_cast<std::size_t>(index)];
  }

  /// Number of a panel's bin for light that propagates in a direction of the world.
  int bin(const Panel& panel, glm::vec3 propagation) const {
    const PanelFrame& frame_of_panel = frame(panel);
    return panel.first_bin + frame_of_panel.bins.bin_of(frame_of_panel.to_panel(propagation));
  }

 private:
  const std::vector<OpeningGroup>& openings_;
  std::vector<Panel> panels_;
  std::vector<int> panel_of_face_;
  int bin_count_ = 0;
};

/// The exterior matrix: light that arrives at the outside of a panel, one row an incident bin. `sky`: its irradiance by
/// sky bin [lx per cd/m²]; `through`: by element outdoors [lx per lm/m²], all with what other openings on the way take.
///
/// rays_per_bin directions, spread over each bin and, independently, over the panel [after Ward et al. 2011, the
/// three-phase method].
std::vector<GatherRow> gather_outside(const Panels& panels, const Panel& panel, const LightMesh& mesh,
                                      const RayScene& rays, const SkyBinIndex& sky, int rays_per_bin,
                                      std::uint32_t seed);

}  // namespace transom
