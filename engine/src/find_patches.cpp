// Which sides of cells take part in the exchange of light, and which of them lie indoors.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "streams.h"
#include "transom/engine.h"
#include "transom/error.h"
#include "transom/parallel.h"
#include "transom/sampling.h"
#include "transom/survey.h"

namespace transom {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::size_t kGrain = 8;
constexpr double kLeakTolerance = 2e-4;  // share of interior rays that may slip through the rounding of edges

}  // namespace

// The slots from which the search for patches starts: the room sides of openings, and emitters.
std::vector<int> Engine::first_slots() const {
  std::vector<int> slots;
  for (std::size_t f = 0; f < faces_.faces.size(); ++f) {
    const int face = static_cast<int>(f);
    const Material& material = scene_.materials[faces_.faces[f].material];
    const bool is_emitter = material.luminance != glm::vec3(0);
    for (Side side = 0; side < 2; ++side) {
      if (material.opening >= 0 ? side == 0 : (!is_emitter || faces_.is_inside_solid(face, side))) continue;
      for (int cell = 0; cell < mesh_->grid(face).cell_count(); ++cell)
        slots.push_back(mesh_->slot_index(face, side, cell));
    }
  }
  return slots;
}

// The slots that rays from point sources meet first.
std::vector<int> Engine::slots_lit_by_sources() const {
  std::vector<int> slots;
  for (std::size_t i = 0; i < scene_.point_sources.size(); ++i) {
    const SobolSequence points(hash_seed(options_.seed, kSourceStream + i));
    std::vector<Ray> rays;
    for (int k = 0; k < options_.node_samples.hemisphere; ++k) {
      const glm::vec2 u = points.point2(static_cast<std::uint32_t>(k));
      const float z = 1 - 2 * u.x, r = std::sqrt(std::max(0.f, 1 - z * z));
      rays.push_back({glm::vec3(scene_.point_sources[i].position - faces_.origin),
                      {r * std::cos(2 * kPi * u.y), r * std::sin(2 * kPi * u.y), z}});
    }
    std::vector<Hit> hits(rays.size());
    rays_->intersect(RayScene::What::kAll, rays, hits);
    for (const Hit& hit : hits)
      if (hit.face >= 0 && !faces_.is_inside_solid(hit.face, hit.side)) slots.push_back(mesh_->slot_at(hit));
  }
  return slots;
}

// Where the search for patches starts: first_slots, what panels see outdoors, and what point sources light.
std::vector<int> Engine::first_wave() const {
  std::vector<int> wave = first_slots();
  for (const GatherRow& row : panel_rows_)
    for (const Share& share : row.through) wave.push_back(share.index);
  wave.insert(wave.end(), lit_slots_.begin(), lit_slots_.end());
  std::sort(wave.begin(), wave.end());
  wave.erase(std::unique(wave.begin(), wave.end()), wave.end());
  return wave;
}

Engine::PatchRow Engine::patch_row(int slot, const Known& known) const {
  const int known_patch = known.patch(slot);
  const PatchRow* known_row = known_patch >= 0 ? &known.engine->patch_rows_[known_patch] : nullptr;
  if (known_row && known.has_openings && known.has_same_faces()) return *known_row;
  PatchRow row;
  row.around = surroundings_of_patch(slot, known_row ? known_row->around : nullptr, known);
  GatherRow beyond;
  beyond.exposure = row.around->exposure;
  if (known_row && known.has_openings && row.around->exposure == known_row->around->exposure &&
      row.around->sky == known_row->around->sky &&
      !gatherer_->may_meet_through_openings(slot, options_.patch_samples, patch_seed(slot), *known.change)) {
    beyond.sky = known_row->beyond->sky;
    beyond.through = known.change->renumbered(known_row->beyond->through);
  } else {
    beyond.sky = row.around->sky;
    gatherer_->look_through_openings(slot, options_.patch_samples, patch_seed(slot), beyond);
  }
  row.beyond = std::make_shared<const GatherRow>(std::move(beyond));
  return row;
}

// What a patch sees without looking through openings, from what it saw in another state of the scene, if that is known.
std::shared_ptr<const GatherRow> Engine::surroundings_of_patch(int slot,
                                                               const std::shared_ptr<const GatherRow>& known_row,
                                                               const Known& known) const {
  if (known_row && known.has_same_faces()) return known_row;
  const std::uint32_t seed = patch_seed(slot);
  if (!known_row)
    return std::make_shared<const GatherRow>(gatherer_->surroundings_of_patch(slot, options_.patch_samples, seed));
  GatherRow row = *known_row;
  row.reached = known.change->renumbered(row.reached);
  row.left = known.change->renumbered_elements(row.left);
  return std::make_shared<const GatherRow>(gatherer_->surroundings_of_patch(
      slot, options_.patch_samples, seed, std::move(row), *known.engine->gatherer_, *known.change));
}

// Samples of a patch depend on where it is alone.
std::uint32_t Engine::patch_seed(int slot) const {
  return relative_place_seed(options_.seed, kPatchStream, {mesh_->middle_of(slot).position, mesh_->normal_of(slot)},
                             faces_.extent);
}

int Engine::Known::patch(int slot) const {
  const int before = change ? change->slot_before(slot) : -1;
  return before >= 0 ? engine->patch_of_slot_[before] : -1;
}

// Rows wave by wave: what a patch sees becomes a patch in the next wave, until nothing new is seen.
void Engine::find_patches(std::vector<int> wave, const Known& known) {
  while (!wave.empty()) {
    for (const int slot : wave) {
      patch_of_slot_[slot] = static_cast<int>(slot_of_patch_.size());
      slot_of_patch_.push_back(slot);
    }
    const std::size_t base = patch_rows_.size();
    patch_rows_.resize(base + wave.size());
    parallel_indices(wave.size(), kGrain, [&](std::size_t i) { patch_rows_[base + i] = patch_row(wave[i], known); });
    std::vector<int> next;
    for (std::size_t i = base; i < patch_rows_.size(); ++i)
      for (const std::vector<Share>* shares : {&patch_rows_[i].around->reached, &patch_rows_[i].beyond->through})
        for (const Share& share : *shares)
          if (patch_of_slot_[share.index] < 0) next.push_back(share.index);
    std::sort(next.begin(), next.end());
    next.erase(std::unique(next.begin(), next.end()), next.end());
    wave = std::move(next);
  }
}

// Slots that see patches indoors without having been seen by them: then those are indoors, too.
void Engine::find_unseen_patches(const Known& known) {
  for (std::uint64_t round = 0;; ++round) {
    std::vector<char> is_interior(patch_of_slot_.size(), 0);
    for (std::size_t p = 0; p < is_interior_.size(); ++p) is_interior[slot_of_patch_[p]] = is_interior_[p];
    const std::vector<int> unseen =
        slots_that_see(is_interior, patch_of_slot_, *mesh_, *rays_, hash_seed(options_.seed, kUnseenStream + round));
    if (unseen.empty()) return;
    find_patches(unseen, known);
    unseen_slots_.insert(unseen_slots_.end(), unseen.begin(), unseen.end());
    mark_interior();
  }
}

void Engine::mark_interior() {
  is_interior_.assign(patch_rows_.size(), 0);
  std::vector<int> stack;
  const auto mark = [&](int patch) {
    if (patch < 0 || is_interior_[patch]) return;
    is_interior_[patch] = 1;
    stack.push_back(patch);
  };
  // An emitter that sees the sky is a lamp outdoors, or the outside of a luminous wall.
  for (const int slot : first_slots())
    if (scene_.materials[faces_.faces[mesh_->slot(slot).face].material].opening >= 0 ||
        patch_rows_[patch_of_slot_[slot]].around->escaped == 0)
      mark(patch_of_slot_[slot]);
  // What an opening sees is indoors, however small it is itself.
  const auto patch_at = [&](const Share& share) { return patch_of_slot_[share.index]; };
  for (const int patch : std::vector<int>(stack))
    for (const Share& share : patch_rows_[patch].around->reached) mark(patch_at(share));
  for (const std::vector<int>* slots : {&lit_slots_, &unseen_slots_})
    for (const int slot : *slots) mark(patch_of_slot_[slot]);
  // What a patch indoors sees is indoors if it sees a patch indoors itself. One ray that slips through an edge, between
  // slivers, meets the outside of a wall, which does not look back.
  std::vector<int> pending;
  while (!stack.empty()) {
    const int patch = stack.back();
    stack.pop_back();
    for (const Share& share : patch_rows_[patch].around->reached)
      if (patch_at(share) >= 0 && !is_interior_[patch_at(share)]) pending.push_back(patch_at(share));
    if (!stack.empty()) continue;
    std::sort(pending.begin(), pending.end());
    pending.erase(std::unique(pending.begin(), pending.end()), pending.end());
    std::erase_if(pending, [&](int other) {
      const std::vector<Share>& seen = patch_rows_[other].around->reached;
      if (std::none_of(seen.begin(), seen.end(),
                       [&](const Share& share) { return patch_at(share) >= 0 && is_interior_[patch_at(share)]; }))
        return false;
      mark(other);
      return true;
    });
  }
  facts_.interior_patch_count = static_cast<int>(std::count(is_interior_.begin(), is_interior_.end(), 1));
}

void Engine::check_closed() {
  double escaped = 0, total = 0, worst = 0;
  std::size_t worst_patch = 0;
  for (std::size_t p = 0; p < patch_rows_.size(); ++p) {
    if (!is_interior_[p]) continue;
    const double own = patch_rows_[p].around->escaped;
    escaped += own;
    total += 1;
    if (own > worst) worst = own, worst_patch = p;
  }
  facts_.leak_share = total > 0 ? escaped / total : 0;
  if (facts_.leak_share <= kLeakTolerance) return;
  const Slot slot = mesh_->slot(slot_of_patch_[worst_patch]);
  const glm::dvec3 place = faces_.origin + glm::dvec3(mesh_->middle_of(slot_of_patch_[worst_patch]).position);
  std::ostringstream text;
  text.precision(3);
  if (scene_.materials[faces_.faces[slot.face].material].opening >= 0)
    text << "face " << faces_.faces[slot.face].source << ", an opening, looks the wrong way near (" << std::fixed
         << place.x << ", " << place.y << ", " << place.z << ") m: " << 100 * worst
         << " % of the rays from its back leave the building. Turn its front outdoors";
  else
    text << "open wall: " << 100 * facts_.leak_share
         << " % of the rays in the room leave it without passing an opening, most near (" << std::fixed << place.x
         << ", " << place.y << ", " << place.z << ") m, face " << faces_.faces[slot.face].source
         << ". Close the gap, or declare it as an opening with glazing = \"none\"";
  throw InputError(text.str());
}

}  // namespace transom
