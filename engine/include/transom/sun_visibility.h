/// @file How much of the sun's disc places see: asked to decide whether a point may stand for it.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "transom/engine.h"

namespace transom {

/// Places on the patches of rooms, lifted off their surfaces.
struct Places {
  std::vector<glm::vec3> points;  ///< in the engine's frame (see Faces) [m]
  std::vector<float> weights;     ///< flux that parallel light of 1 lx would bring to what each stands for [lm]
};

/// Places on patches that face a direction and belong to a room, two on each. Clusters of small faces have none.
Places places_facing(const Engine& engine, glm::vec3 direction);

/// Share of parallel light from each direction (unit, towards the source) that arrives at each point (in the engine's
/// frame), by point and direction: 0 where something opaque intervenes, else the transmittance of the openings on the
/// way.
std::vector<float> shares_from(const Engine& engine, std::span<const glm::vec3> points,
                               std::span<const glm::vec3> directions);

}  // namespace transom
