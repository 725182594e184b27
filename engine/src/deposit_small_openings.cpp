// The light of openings smaller than an element, most of whose samples would miss them: it is sent from the openings.
#include <cmath>

#include "deposit_samples.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr std::uint32_t kRaysPerSmallOpening = 256;
constexpr float kGrazingCosine = 1e-3f;  // below it a small opening lets nothing through

}  // namespace

// Takes the light away that comes to the points through a small opening first.
void DirectLight::ignore_small_openings(glm::vec3 direction, const Points& points, std::span<float> share) const {
  if (small_openings_.empty()) return;
  std::vector<Ray> rays;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (share[i] > 0) {
      rays.push_back({points[i], direction});
      index.push_back(i);
    }
  std::vector<Hit> hits(rays.size());
  rays_.intersect(RayScene::What::kOpenings, rays, hits);
  for (std::size_t k = 0; k < hits.size(); ++k)
    if (hits[k].face >= 0 && is_small_opening_[hits[k].face]) share[index[k]] = 0;
}

// Mean illuminance of elements by the light of small openings: equal parts of it from places all over each.
std::map<int, glm::vec3> DirectLight::send_through_small_openings(const std::vector<Beam>& beams) const {
  std::map<int, glm::vec3> sent;
  std::vector<glm::vec3> places(kRaysPerSmallOpening);
  std::vector<float> share(kRaysPerSmallOpening);
  std::vector<Ray> onwards(kRaysPerSmallOpening);
  std::vector<Hit> hits(kRaysPerSmallOpening);
  for (const int f : small_openings_)
    for (const Beam& beam : beams) {
      if (beam.opening >= 0) continue;
      const Face& face = mesh_.faces().faces[f];
      const float cosine = glm::dot(face.normal, beam.direction_to_source);
      if (std::abs(cosine) < kGrazingCosine) continue;
      // Off the face along the beam, not along the normal: the way back to the sun is then through that place of it.
      const glm::vec3 beyond = -mesh_.faces().ray_offset() / std::abs(cosine) * beam.direction_to_source;
      const SobolSequence points(hash_seed(seed_, static_cast<std::uint64_t>(f)));
      for (std::uint32_t i = 0; i < kRaysPerSmallOpening; ++i) {
        const glm::vec2 u = points.point2(i);
        places[i] = face.position(face.is_quad ? u : sample_triangle(u)) + beyond;
        onwards[i] = {places[i], -beam.direction_to_source};
      }
      beam_transmission(beam, places, share);
      rays_.intersect(RayScene::What::kAll, onwards, hits);
      const float flux_share = face.area * std::abs(cosine) / static_cast<float>(kRaysPerSmallOpening);
      for (std::size_t i = 0; i < hits.size(); ++i) {
        const Hit& hit = hits[i];
        if (share[i] <= 0 || hit.face < 0 || mesh_.faces().is_inside_solid(hit.face, hit.side)) continue;
        const int element = mesh_.element_at(hit);
        const float area = mesh_.element_area(element);
        if (area > 0) sent[element] += beam.normal_illuminance * (share[i] * flux_share / area);
      }
    }
  return sent;
}

}  // namespace transom
