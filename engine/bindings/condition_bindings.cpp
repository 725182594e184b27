// Python's view of the light outdoors: what an engine is relit by.
#include "condition_bindings.h"

#include <nanobind/stl/tuple.h>

#include "arrays.h"
#include "transom/sky.h"

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
