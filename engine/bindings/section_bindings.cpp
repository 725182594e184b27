// Python's view of the tracers of sections and of unit cells.
#include "section_bindings.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "transom/section.h"
#include "transom/section_sweep.h"
#include "transom/unit_cell.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace transom;

namespace {

using Directions = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Corners = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Facets = nb::ndarray<const int, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;

constexpr const char* kTraceWords =
    "Exits (N, 4) transmitted and reflected as direction and flux, then the shares absorbed and unfinished.";

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

glm::dvec3 vector(const std::tuple<double, double, double>& v) {
  return {std::get<0>(v), std::get<1>(v), std::get<2>(v)};
}

template <typename Trace>
nb::tuple traced(const Trace& trace, int ray_count, std::uint32_t seed) {
  ProductLight light;
  {
    const nb::gil_scoped_release release;
    TraceOptions options;
    options.ray_count = ray_count;
    options.seed = seed;
    light = trace(options);
  }
  return nb::make_tuple(exits_array(light.transmitted), exits_array(light.reflected), light.absorbed, light.unfinished);
}

}  // namespace

void bind_section(nb::module_& m) {
  nb::enum_<SurfaceKind>(m, "SurfaceKind")
      .value("INTERFACE", SurfaceKind::kInterface)
      .value("GAP", SurfaceKind::kGap)
      .value("MIRROR", SurfaceKind::kMirror)
      .value("DIFFUSE", SurfaceKind::kDiffuse);

  nb::class_<Surface>(m, "Surface")
      .def(
          "__init__",
          [](Surface* self, SurfaceKind kind, int front, int back, double reflectance, double reflectance_back,
             double transmittance, double openness) {
            new (self) Surface{kind, front, back, reflectance, reflectance_back, transmittance, openness};
          },
          "kind"_a, "front"_a, "back"_a, "reflectance"_a, "reflectance_back"_a, "transmittance"_a, "openness"_a);

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
          [](Section& s, std::tuple<double, double> a, std::tuple<double, double> b, double bow,
             const Surface& surface) {
            s.lines.push_back({{std::get<0>(a), std::get<1>(a)}, {std::get<0>(b), std::get<1>(b)}, surface, bow});
          },
          "a"_a, "b"_a, "bow"_a, "surface"_a)
      .def("validate", &Section::validate);

  nb::class_<UnitCellTracer>(m, "UnitCell")
      .def(
          "__init__",
          [](UnitCellTracer* self, double period_x, double period_y, double low_z, double high_z,
             const std::vector<std::tuple<double, double>>& media, const std::vector<Surface>& surfaces,
             const Corners& corners, const Facets& facets) {
            UnitCell cell{period_x, period_y, low_z, high_z, {}, surfaces, {}, {}};
            for (const auto& [index, absorption] : media) cell.media.push_back({index, absorption});
            for (std::size_t i = 0; i < corners.shape(0); ++i)
              cell.corners.emplace_back(corners(i, 0), corners(i, 1), corners(i, 2));
            for (std::size_t i = 0; i < facets.shape(0); ++i)
              cell.facets.push_back({{facets(i, 0), facets(i, 1), facets(i, 2)}, facets(i, 3)});
            new (self) UnitCellTracer(std::move(cell));
          },
          "period_x"_a, "period_y"_a, "low_z"_a, "high_z"_a, "media"_a, "surfaces"_a, "corners"_a, "facets"_a,
          "Corners (N, 3) [m]; facets (M, 4): three corners, counter-clockwise from the front, and a surface.")
      .def(
          "trace",
          [](const UnitCellTracer& cell, std::tuple<double, double, double> direction, int ray_count,
             std::uint32_t seed) {
            return traced([&](const TraceOptions& options) { return cell.trace(vector(direction), options); },
                          ray_count, seed);
          },
          "direction"_a, "ray_count"_a, "seed"_a, kTraceWords);

  m.def(
      "trace_section",
      [](const Section& section, std::tuple<double, double, double> direction, int ray_count, std::uint32_t seed) {
        return traced([&](const TraceOptions& options) { return trace_section(section, vector(direction), options); },
                      ray_count, seed);
      },
      "section"_a, "direction"_a, "ray_count"_a, "seed"_a, kTraceWords);

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
