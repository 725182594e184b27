#include "transom/sun_visibility.h"

#include "transom/parallel.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr std::uint32_t kPlacesPerPatch = 2;
constexpr std::uint64_t kPlaceStream = 0xd15c;
constexpr std::size_t kBlock = 256;  // points that look in one direction at once

}  // namespace

Places places_facing(const Engine& engine, glm::vec3 direction) {
  Places places;
  const LightMesh& mesh = engine.mesh();
  for (std::size_t p = 0; p < engine.patch_slots().size(); ++p) {
    const int slot = engine.patch_slots()[p];
    if (!engine.is_interior(p) || mesh.is_cluster(slot)) continue;
    const float cosine = glm::dot(mesh.normal_of(slot), direction);
    if (cosine <= 0) continue;
    const SobolSequence sequence(hash_seed(kPlaceStream, p));
    for (std::uint32_t i = 0; i < kPlacesPerPatch; ++i) {
      places.points.push_back(mesh.place_on(slot, sequence.point2(i)).position);
      places.weights.push_back(mesh.slot_area(slot) * cosine / static_cast<float>(kPlacesPerPatch));
    }
  }
  return places;
}

std::vector<float> shares_from(const Engine& engine, std::span<const glm::vec3> points,
                               std::span<const glm::vec3> directions) {
  std::vector<float> shares(points.size() * directions.size());
  parallel_ranges(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<float> of_beam(end - begin);
    for (std::size_t d = 0; d < directions.size(); ++d) {
      Beam beam;
      beam.direction_to_source = directions[d];
      engine.direct_light().beam_transmission(beam, points.subspan(begin, end - begin), of_beam);
      for (std::size_t i = begin; i < end; ++i) shares[i * directions.size() + d] = of_beam[i - begin];
    }
  });
  return shares;
}

}  // namespace transom
