// The engine's panels: what arrives at them, what products make of it, and where lobes are.
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>

#include "streams.h"
#include "transom/engine.h"
#include "transom/error.h"
#include "transom/parallel.h"
#include "transom/sampling.h"
#include "transom/sunlit_polygon.h"

namespace transom {
namespace {

constexpr int kMaximumCycles = 20000;
constexpr double kSameRadiance = 1e-3;   // change of the flux of panels at which rounds end, relative
constexpr double kMostScale = 2;         // of sampled weights: beyond it too few rays have met a bin
constexpr int kMaximumRounds = 16;       // of light between outdoors and the room through panels
constexpr float kGrazingCosine = 1e-4f;  // of a lobe to its panel, from which on it carries nothing

[[noreturn]] void fail(int opening, const std::string& problem) {
  throw InputError("opening " + std::to_string(opening) + ": " + problem);
}

// Whether an opening group holds panels.
bool has_panel(const SceneGeometry& scene, int opening) {
  return opening >= 0 && opening < static_cast<int>(scene.openings.size()) &&
         scene.openings[static_cast<std::size_t>(opening)].panel.has_value();
}

}  // namespace

// Rows of all incident bins of all panels, in the order of their numbers.
void Engine::gather_panels() {
  products_.resize(scene_.openings.size());
  const std::vector<Panel>& panels = panels_->all();
  std::vector<std::vector<GatherRow>> rows(panels.size());
  parallel_indices(panels.size(), 1, [&](std::size_t k) {
    rows[k] = gather_outside(*panels_, panels[k], *mesh_, *rays_, *sky_index_, options_.panel_rays,
                             hash_seed(options_.seed, hash_seed(kPanelStream, k)));
  });
  for (std::vector<GatherRow>& of_panel : rows)
    for (GatherRow& row : of_panel) panel_rows_.push_back(std::move(row));
  facts_.panel_count = static_cast<int>(panels.size());
  facts_.panel_bin_count = panels_->bin_count();
}

void Engine::link_panels(SparseRows& patch_sky) {
  panel_sky_ = SkyRows(SparseRows::of(panel_rows_, &GatherRow::sky), ground_bin());
  for (const GatherRow& row : panel_rows_) panel_patches_.append(to_patches(row.through));
  panel_rows_.clear();
  balance_panels(patch_sky);
}

// A room is closed: all that a panel sends into a bin arrives at patches. Their weights are scaled by bins until that
// holds, as form factors are by rows.
void Engine::balance_panels(SparseRows& patch_sky) const {
  const std::size_t first = static_cast<std::size_t>(sky_index_->count());
  std::vector<double> arrived(static_cast<std::size_t>(panels_->bin_count()), 0.0);
  for (std::size_t p = 0; p < patch_sky.row_count(); ++p)
    for (std::size_t k = patch_sky.begin[p]; k < patch_sky.begin[p + 1]; ++k) {
      const Share& share = patch_sky.entries[k];
      if (static_cast<std::size_t>(share.index) >= first)
        arrived[static_cast<std::size_t>(share.index) - first] += static_cast<double>(patch_area_[p] * share.weight);
    }
  std::vector<float> scale(arrived.size(), 1.f);
  for (const Panel& panel : panels_->all()) {
    const AngleBins& bins = panels_->frame(panel).bins;
    const float area = faces_.faces[static_cast<std::size_t>(panel.face)].area;
    for (int bin = 0; bin < bins.count(); ++bin) {
      const std::size_t number = static_cast<std::size_t>(panel.first_bin) + static_cast<std::size_t>(bin);
      const double sent = static_cast<double>(area * bins.projected_solid_angle(bin));
      if (arrived[number] > 0)
        scale[number] = static_cast<float>(std::clamp(sent / arrived[number], 1 / kMostScale, kMostScale));
    }
  }
  for (Share& share : patch_sky.entries)
    if (static_cast<std::size_t>(share.index) >= first)
      share.weight *= scale[static_cast<std::size_t>(share.index) - first];
}

void Engine::set_product(int opening, Product product) {
  if (!has_panel(scene_, opening)) fail(opening, "holds no panels");
  OpeningGroup& group = scene_.openings[static_cast<std::size_t>(opening)];
  const auto bins = static_cast<std::size_t>(group.panel->bins.count());
  if (product.transmission.size() != bins * bins)
    fail(opening, "a product's transmission has " + std::to_string(product.transmission.size()) + " values, not " +
                      std::to_string(bins) + " x " + std::to_string(bins));
  for (const float value : product.transmission)
    if (!(value >= 0 && std::isfinite(value))) fail(opening, "a product's transmission is negative or not finite");
  if (!(product.room_reflectance >= 0 && product.room_reflectance < 1))
    fail(opening, "room reflectance " + std::to_string(product.room_reflectance) + " is outside 0..1");
  group.diffuse_reflectance = product.room_reflectance;
  products_[static_cast<std::size_t>(opening)] = std::move(product);
  for (std::size_t p = 0; p < slot_of_patch_.size(); ++p) {
    const Slot slot = mesh_->slot(slot_of_patch_[p]);
    const Panel* panel = panels_->at(slot.face);
    if (!panel || panel->opening != opening) continue;
    patch_reflectance_[p] = reflectance(slot.face, slot.side);
    interreflection_->set_reflectance(p, patch_reflectance_[p]);
    if (shooting_) shooting_->set_reflectance(p, patch_reflectance_[p]);
  }
  if (!shooting_) interreflection_->foretell();
  if (nodes_ && !scene_.point_sources.empty()) light_always();
}

// Where the lobes of the condition are, and what the residuals add to the radiance of panels by the share of each that
// the sun reaches.
void Engine::find_shafts(Condition& condition, std::vector<glm::vec3>& residual) const {
  const TracePhase phase(trace_, "shafts");
  const std::vector<Panel>& panels = panels_->all();
  // Of the panels of an opening group, by panel; others have none.
  using Pieces = std::vector<std::vector<SunlitPiece>>;
  using Sun = std::tuple<float, float, float>;
  std::map<Sun, SunlitFaces> sunlit_from;
  std::map<std::pair<int, Sun>, Pieces> pieces_of;  // by opening group and sun
  const auto pieces_at = [&](int opening, glm::vec3 direction) -> const Pieces& {
    const Sun sun(direction.x, direction.y, direction.z);
    const auto [entry, is_new] = pieces_of.try_emplace({opening, sun}, panels.size());
    if (!is_new) return entry->second;
    const SunlitFaces& sunlit =
        sunlit_from.try_emplace(sun, faces_, scene_.materials, scene_.openings, glm::dvec3(direction)).first->second;
    parallel_indices(panels.size(), 1, [&, &pieces = entry->second](std::size_t k) {
      if (panels[k].opening == opening) pieces[k] = sunlit.pieces(panels[k].face);
    });
    return entry->second;
  };
  for (Beam& beam : condition.beams) {
    if (beam.opening < 0) continue;
    if (!has_panel(scene_, beam.opening)) fail(beam.opening, "a lobe needs panels");
    const auto shafts = std::make_shared<std::vector<LightShaft>>();
    beam.shafts = shafts;
    if (beam.normal_illuminance == glm::vec3(0)) continue;
    const Pieces& pieces = pieces_at(beam.opening, beam.direction_to_sun);
    for (std::size_t k = 0; k < panels.size(); ++k) {
      const glm::dvec3 normal(faces_.faces[static_cast<std::size_t>(panels[k].face)].normal),
          back(beam.direction_to_source);
      if (!(glm::dot(normal, back) > kGrazingCosine)) continue;  // it turns away from the room
      for (const SunlitPiece& piece : pieces[k]) shafts->push_back(light_shaft(piece, normal, back));
    }
  }
  residual.assign(static_cast<std::size_t>(panels_->bin_count()), glm::vec3(0));
  for (const Residual& rest : condition.residuals) {
    if (!has_panel(scene_, rest.opening)) fail(rest.opening, "a residual needs panels");
    const int bins = scene_.openings[static_cast<std::size_t>(rest.opening)].panel->bins.count();
    if (static_cast<int>(rest.radiance.size()) != bins)
      fail(rest.opening,
           "a residual has " + std::to_string(rest.radiance.size()) + " bins, not " + std::to_string(bins));
    const Pieces& pieces = pieces_at(rest.opening, rest.direction_to_sun);
    for (std::size_t k = 0; k < panels.size(); ++k) {
      if (panels[k].opening != rest.opening) continue;
      const double share = sunlit_share(faces_.faces[static_cast<std::size_t>(panels[k].face)], pieces[k]);
      for (int bin = 0; bin < bins; ++bin)
        residual[static_cast<std::size_t>(panels[k].first_bin) + static_cast<std::size_t>(bin)] +=
            static_cast<float>(share) * rest.radiance[static_cast<std::size_t>(bin)];
    }
  }
}

// L_o = residual + T (D s + D_outdoors B). radiosity: of patches [lm/m²], or empty. Returns the change of the flux that
// panels send out, as a share of it.
double Engine::find_panel_radiance(const std::vector<glm::vec3>& radiosity, Lighting& lighting) const {
  const std::vector<glm::vec3> before = std::move(lighting.panel_radiance);
  lighting.panel_radiance = lighting.panel_residual;
  std::vector<glm::vec3> arriving(lighting.panel_residual.size());
  const SkyRadiance sky = sky_radiance(lighting);
  parallel_indices(arriving.size(), 16, [&](std::size_t i) {
    arriving[i] = panel_sky_.irradiance(i, sky);
    if (!radiosity.empty()) arriving[i] += panel_patches_.dot(i, radiosity);
  });
  double change = 0, total = 0;
  for (const Panel& panel : panels_->all()) {
    const AngleBins& bins = panels_->frame(panel).bins;
    const auto first = static_cast<std::size_t>(panel.first_bin), count = static_cast<std::size_t>(bins.count());
    const std::vector<float>& transmission = products_[static_cast<std::size_t>(panel.opening)].transmission;
    const float area = faces_.faces[static_cast<std::size_t>(panel.face)].area;
    if (!transmission.empty())
      parallel_indices(count, 16, [&](std::size_t out) {
        glm::vec3 passed(0);
        for (std::size_t in = 0; in < count; ++in) passed += transmission[out * count + in] * arriving[first + in];
        lighting.panel_radiance[first + out] += passed;
      });
    for (std::size_t out = 0; out < count; ++out) {
      const glm::vec3 radiance = lighting.panel_radiance[first + out];
      const glm::vec3 added = before.empty() ? radiance : glm::abs(radiance - before[first + out]);
      const float weight = area * bins.projected_solid_angle(static_cast<int>(out));
      change += static_cast<double>(weight * (added.x + added.y + added.z));
      total += static_cast<double>(weight * (radiance.x + radiance.y + radiance.z));
    }
  }
  return total > 0 ? change / total : 0;
}

// Interreflection. What outdoor surfaces send through panels depends on light that is only known afterwards: found
// again until it no longer changes. False where `after_cycle` has ended it.
bool Engine::solve_with_panels(Lighting& lighting, const Interreflection::AfterCycle& after_cycle) const {
  const TracePhase phase(trace_, "interreflection");
  const std::size_t n = slot_of_patch_.size();
  std::vector<glm::vec3> direct(n), radiosity;
  std::vector<int> bright;
  for (std::size_t p = 0; p < n; ++p)
    if (is_interior_[p] && (lighting.patch_sun[p] != glm::vec3(0) || patch_emitted_[p] != glm::vec3(0)))
      bright.push_back(static_cast<int>(p));
  for (int round = 0; round < kMaximumRounds; ++round) {
    for (std::size_t p = 0; p < n; ++p) direct[p] = lighting.patch_sky[p] + lighting.patch_sun[p];
    const int cycles =
        interreflection_->solve({patch_emitted_, direct, lighting.plan.is_grey, bright}, options_.tolerance,
                                kMaximumCycles, lighting.patch_irradiance, after_cycle);
    if (cycles == 0) return false;
    lighting.sweeps += cycles;
    if (panel_patches_.entries.empty()) return true;
    radiosity.resize(n);
    for (std::size_t p = 0; p < n; ++p)
      radiosity[p] = patch_emitted_[p] + patch_reflectance_[p] * lighting.patch_irradiance[p];
    if (find_panel_radiance(radiosity, lighting) <= kSameRadiance) return true;
    find_sky_light(lighting);
  }
  return true;
}

}  // namespace transom
