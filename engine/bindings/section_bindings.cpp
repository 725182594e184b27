// Python's view of the section tracer.
#include "section_bindings.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include "transom/section.h"
#include "transom/section_sweep.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace transom;

namespace {

using Directions = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

// Exits as (N, 4): direction and flux.
nb::ndarray<nb::numpy, double> exits_array(const std::vector<Exit>& exits) {
  auto* kept = new std::vector<double>;
  for (const Exit& e : exits) kept->insert(kept->end(), {e.direction.x, e.direction.y, e.direction.z, e.flux});
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return nb::ndarray<nb::numpy, double>(kept->data(), {exits.size(), 4}, owner);
}

// A vector as an array that owns it.
template <typename T>
nb::ndarray<nb::numpy, T> owned_array(std::vector<T>&& values) {
  auto* kept = new std::vector<T>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T>(kept->data(), {kept->size()}, owner);
}

}  // namespace

void bind_section(nb::module_& m) {
  nb::enum_<LineKind>(m, "LineKind")
      .value("INTERFACE", LineKind::kInterface)
      .value("GAP", LineKind::kGap)
      .value("MIRROR", LineKind::kMirror)
      .value("DIFFUSE", LineKind::kDiffuse);

  nb::class_<Section>(m, "Section")
      .def(
          "__init__",
          [](Section* self, double period, double low_z, double high_z) {
            new (self) Section{};
            self->period = period;
            self->low_z = low_z;
            self->high_z = high_z;
          },
          "period"_a, "low_z"_a, "high_z"_a)
      .def(
          "add_medium",
          [](Section& s, double index, double absorption) {
            s.media.push_back({index, absorption});
          },
          "index"_a, "absorption"_a)
      .def(
          "add_line",
          [](Section& s, std::tuple<double, double> a, std::tuple<double, double> b, LineKind kind, int left, int right,
             double reflectance, double reflectance_right, double transmittance, double openness) {
            s.lines.push_back({{std::get<0>(a), std::get<1>(a)},
                               {std::get<0>(b), std::get<1>(b)},
                               kind,
                               left,
                               right,
                               reflectance,
                               reflectance_right,
                               transmittance,
                               openness});
          },
          "a"_a, "b"_a, "kind"_a, "left"_a, "right"_a, "reflectance"_a, "reflectance_right"_a, "transmittance"_a,
          "openness"_a)
      .def("validate", &Section::validate);

  m.def(
      "trace_section",
      [](const Section& section, std::tuple<double, double, double> direction, int ray_count, std::uint32_t seed) {
        SectionLight light;
        {
          const nb::gil_scoped_release release;
          SectionOptions options;
          options.ray_count = ray_count;
          options.seed = seed;
          const auto [x, y, z] = direction;
          light = trace_section(section, {x, y, z}, options);
        }
        return nb::make_tuple(exits_array(light.transmitted), exits_array(light.reflected), light.absorbed,
                              light.unfinished);
      },
      "section"_a, "direction"_a, "ray_count"_a, "seed"_a,
      "Exits (N, 4) transmitted and reflected as direction and flux, then the shares absorbed and unfinished.");

  m.def(
      "trace_section_sweep",
      [](const Section& section, const Directions& directions, int ray_count, std::uint32_t seed) {
        std::vector<glm::dvec3> incident(directions.shape(0));
        for (std::size_t i = 0; i < incident.size(); ++i)
          incident[i] = {directions(i, 0), directions(i, 1), directions(i, 2)};
        SectionSweep sweep;
        {
          const nb::gil_scoped_release release;
          sweep = trace_section_sweep(section, incident, ray_count, seed);
        }
        return nb::make_tuple(exits_array(sweep.transmitted), owned_array(std::move(sweep.incidence)),
                              owned_array(std::move(sweep.transmitted_shares)),
                              owned_array(std::move(sweep.reflected_shares)));
      },
      "section"_a, "directions"_a, "ray_count"_a, "seed"_a,
      "Of directions (N, 3): exits (M, 4) transmitted as direction and flux, the direction (M,) that each belongs to, "
      "and the shares (N,) transmitted and reflected.");
}
