// Python's view of the light outdoors: what an engine is relit by.
#include "condition_bindings.h"

#include <nanobind/stl/tuple.h>

#include "arrays.h"
#include "transom/sky.h"
#include "transom/sky_formula.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace transom;

void bind_condition(nb::module_& m) {
  nb::class_<SkyPicture>(m, "SkyPicture", "What is seen of a sky; rows from the zenith to the horizon.")
      .def(
          "__init__",
          [](SkyPicture* self, In<float, nb::ndim<2>> luminance) {
            new (self) SkyPicture{to_vector<float>(luminance), static_cast<int>(luminance.shape(1)),
                                  static_cast<int>(luminance.shape(0))};
          },
          "luminance"_a);

  nb::class_<SkyBinMeans>(m, "SkyBinMeans", "Luminance of skies that have a formula, averaged over bins.")
      .def(
          "__init__",
          [](SkyBinMeans* self, In<float, nb::shape<-1, 3>> middles, int horizon_count, float steep_cosine,
             In<float, nb::ndim<2>> smooth_weights, In<float, nb::shape<-1, -1, 3>> smooth_directions,
             In<float, nb::ndim<2>> steep_weights, In<float, nb::shape<-1, -1, 3>> steep_directions) {
            new (self) SkyBinMeans(to_vector<glm::vec3>(middles), horizon_count, steep_cosine,
                                   SkyNodes(to_vector<glm::vec3>(smooth_directions), to_vector<float>(smooth_weights)),
                                   SkyNodes(to_vector<glm::vec3>(steep_directions), to_vector<float>(steep_weights)));
          },
          "middles"_a, "horizon_count"_a, "steep_cosine"_a, "smooth_weights"_a, "smooth_directions"_a,
          "steep_weights"_a, "steep_directions"_a)
      .def(
          "of",
          [](const SkyBinMeans& means, std::tuple<float, float, float, float, float, float> formula,
             std::tuple<float, float, float> direction_to_sun) {
            const auto [a, b, c, d, e, k] = formula;
            std::vector<float> luminance = means.of({a, b, c, d, e, k, vector_of(direction_to_sun)});
            const std::size_t count = luminance.size();
            return to_array<float>(std::move(luminance), {count});
          },
          "formula"_a, "direction_to_sun"_a,
          "Of (1 + a exp(b / sin h)) (k + c exp(d x) + e cos² x), at least 0, at altitude h and angle x from the sun;\n"
          "formula: a, b, c, d, e, k [cd/m²].");

  nb::class_<Condition>(m, "Condition")
      .def(
          "__init__",
          [](Condition* self, In<float, nb::ndim<1>> sky_luminance, std::tuple<float, float, float> sky_colour,
             std::tuple<float, float, float> ground_luminance) {
            new (self) Condition{};
            self->sky_luminance = to_vector<float>(sky_luminance);
            self->sky_colour = vector_of(sky_colour);
            self->ground_luminance = vector_of(ground_luminance);
          },
          "sky_luminance"_a, "sky_colour"_a, "ground_luminance"_a)
      .def(
          "add_beam",
          [](Condition& c, std::tuple<float, float, float> direction, std::tuple<float, float, float> illuminance) {
            c.beams.push_back({vector_of(direction), vector_of(illuminance)});
          },
          "direction_to_source"_a, "normal_illuminance"_a)
      .def(
          "add_sub_sun",
          [](Condition& c, std::tuple<float, float, float> direction, std::tuple<float, float, float> illuminance) {
            c.sub_suns.push_back({vector_of(direction), vector_of(illuminance)});
          },
          "direction_to_source"_a, "normal_illuminance"_a,
          "Part of the sun's disc, which stands for the sun where its light is shown or measured at points.")
      .def(
          "add_lobe",
          [](Condition& c, int opening, std::tuple<float, float, float> direction,
             std::tuple<float, float, float> illuminance, std::tuple<float, float, float> sun) {
            c.beams.push_back({vector_of(direction), vector_of(illuminance), opening, vector_of(sun)});
          },
          "opening"_a, "direction_to_source"_a, "normal_illuminance"_a, "direction_to_sun"_a,
          "Parallel light behind the panels of an opening group that the sun reaches.")
      .def(
          "add_residual",
          [](Condition& c, int opening, In<float, nb::shape<-1, 3>> radiance, std::tuple<float, float, float> sun) {
            c.residuals.push_back({opening, vector_of(sun), to_vector<glm::vec3>(radiance)});
          },
          "opening"_a, "radiance"_a, "direction_to_sun"_a,
          "Radiance of panels in full sun by exit bin [cd/m²]: the sun's light that lobes leave.");
}
