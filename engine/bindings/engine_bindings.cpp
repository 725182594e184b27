// Python's view of the engine: arrays in, arrays out, nothing computed here.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <oneapi/tbb/global_control.h>
#include "arrays.h"
#include "condition_bindings.h"
#include "section_bindings.h"

#include <memory>

#include "transom/build.h"
#include "transom/engine.h"
#include "transom/error.h"
#include "transom/frame.h"
#include "transom/gl_context.h"
#include "transom/relight_worker.h"
#include "transom/sun_visibility.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace transom;

namespace {

nb::ndarray<nb::numpy, float> picture(Picture&& pixels, int width, int height) {
  return to_array<float>(std::move(pixels), {static_cast<std::size_t>(height), static_cast<std::size_t>(width), 3});
}

// The engine with its present light, the renderer that looks at it, and the sensors that were asked last.
struct Session {
  Engine engine;
  FrameRenderer renderer;
  std::shared_ptr<const Lighting> present = std::make_shared<const Lighting>();
  std::shared_ptr<const Sensors> sensors;
  std::unique_ptr<RelightWorker> worker;  // while light is found beside other work; after the engine that it uses
  RelightWorker& running() {
    if (!worker) throw std::runtime_error("no light is being found: the `with` block of relighting() has ended");
    return *worker;
  }
  // What asks the worker for a state, without Python's lock; the state is made the present one with it.
  template <typename Ask>
  std::pair<std::uint64_t, bool> take(const Ask& ask) {
    RelightWorker& from = running();
    RelightWorker::State state = without_lock([&] { return ask(from); });
    if (state.number > 0) present = std::move(state.lighting);
    return {state.number, state.number > 0 && present->is_final};
  }
  template <typename Body>
  static auto without_lock(const Body& body) {
    const nb::gil_scoped_release release;
    return body();
  }
  Session(SceneGeometry scene, const SkyBins& bins, SolveOptions options)
      : engine(std::move(scene), bins, options), renderer(engine) {}
  Session(const Session& solved, SceneGeometry scene) : engine(solved.engine, std::move(scene)), renderer(engine) {}
};

// At most so many threads while a `with` block lasts.
struct ThreadLimit {
  explicit ThreadLimit(int threads) : count(threads) {}
  int count;
  std::unique_ptr<oneapi::tbb::global_control> control;
};

}  // namespace

NB_MODULE(_engine, m) {
  m.doc() = "Transom's light transport engine.";
  nb::exception<InputError>(m, "EngineInputError", PyExc_ValueError);
  nb::exception<GlError>(m, "GlError", PyExc_RuntimeError);
  bind_section(m);

  m.def(
      "gl_backend", [] { return GlContext().name(); }, "Name of the OpenGL context that volumes would use.");
  m.def(
      "build_description", [] { return std::string(build_description()); },
      "Compiler, flags and libraries of this build.");

  nb::class_<ThreadLimit>(m, "ThreadLimit", "A `with` block in which the engine uses at most `count` threads.")
      .def(nb::init<int>(), "count"_a)
      .def("__enter__",
           [](ThreadLimit& limit) {
             limit.control = std::make_unique<oneapi::tbb::global_control>(
                 oneapi::tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(limit.count));
           })
      .def(
          "__exit__", [](ThreadLimit& limit, nb::object, nb::object, nb::object) { limit.control.reset(); },
          "kind"_a.none(), "error"_a.none(), "trace"_a.none());

  nb::class_<OpeningGroup>(m, "OpeningGroup")
      .def(nb::init<>())
      .def_prop_rw(
          "transmittance", [](const OpeningGroup& g) { return g.transmittance; },
          [](OpeningGroup& g, In<float, nb::ndim<1>> table) { g.transmittance = to_vector<float>(table); })
      .def_rw("diffuse_reflectance", &OpeningGroup::diffuse_reflectance);

  nb::class_<SceneGeometry>(m, "SceneGeometry")
      .def(
          "__init__",
          [](SceneGeometry* self, In<double, nb::shape<-1, 3>> vertices, In<int, nb::shape<-1, 4>> faces,
             In<int, nb::ndim<1>> face_material, In<float, nb::shape<-1, 3>> corner_normals) {
            new (self) SceneGeometry{};
            self->vertices = to_vector<glm::dvec3>(vertices);
            self->faces = to_vector<glm::ivec4>(faces);
            self->face_material = to_vector<int>(face_material);
            self->corner_normals = to_vector<glm::vec3>(corner_normals);
          },
          "vertices"_a, "faces"_a, "face_material"_a, "corner_normals"_a)
      .def(
          "add_material",
          [](SceneGeometry& s, std::tuple<float, float, float> rho, std::tuple<float, float, float> luminance,
             bool smooth, int opening) {
            const auto [r, g, b] = rho;
            const auto [lr, lg, lb] = luminance;
            s.materials.push_back({{r, g, b}, {lr, lg, lb}, smooth, opening});
          },
          "reflectance"_a, "luminance"_a, "smooth"_a, "opening"_a)
      .def(
          "add_opening",
          [](SceneGeometry& s, In<float, nb::ndim<1>> table, float diffuse_reflectance) {
            s.openings.push_back({to_vector<float>(table), diffuse_reflectance});
          },
          "transmittance"_a, "diffuse_reflectance"_a)
      .def(
          "add_panels",
          [](SceneGeometry& s, In<float, nb::shape<3, 3>> axes, In<float, nb::ndim<1>> polar_edges,
             In<int, nb::ndim<1>> counts, float diffuse_reflectance) {
            const std::vector<glm::vec3> rows = to_vector<glm::vec3>(axes);
            s.openings.push_back({std::vector<float>(2, 0.f), diffuse_reflectance,
                                  PanelFrame{rows[0], rows[1], rows[2],
                                             AngleBins(to_vector<float>(polar_edges), to_vector<int>(counts))}});
          },
          "axes"_a, "polar_edges"_a, "counts"_a, "diffuse_reflectance"_a,
          "An opening group that holds a product; rows x, y, z of its frame in the world, bins of its directions.")
      .def(
          "add_point_source",
          [](SceneGeometry& s, std::tuple<double, double, double> position, std::tuple<float, float, float> intensity) {
            const auto [x, y, z] = position;
            const auto [r, g, b] = intensity;
            s.point_sources.push_back({{x, y, z}, {r, g, b}});
          },
          "position"_a, "intensity"_a);

  nb::class_<SkyBins>(m, "SkyBins")
      .def(
          "__init__",
          [](SkyBins* self, In<float, nb::ndim<1>> edges, In<int, nb::ndim<1>> counts) {
            new (self) SkyBins{to_vector<float>(edges), to_vector<int>(counts)};
          },
          "row_altitude_edges"_a, "row_counts"_a);

  nb::class_<GatherSamples>(m, "GatherSamples")
      .def(nb::init<int, int>(), "hemisphere"_a, "openings"_a)
      .def_rw("hemisphere", &GatherSamples::hemisphere)
      .def_rw("openings", &GatherSamples::openings);

  nb::enum_<Method>(m, "Method").value("GATHER", Method::kGather).value("CLASSIC", Method::kClassic);

  nb::class_<SolveOptions>(m, "SolveOptions")
      .def(nb::init<>())
      .def_rw("method", &SolveOptions::method)
      .def_rw("maximum_edge_m", &SolveOptions::maximum_edge_m)
      .def_rw("target_patch_count", &SolveOptions::target_patch_count)
      .def_rw("elements_per_edge", &SolveOptions::elements_per_edge)
      .def_rw("patch_samples", &SolveOptions::patch_samples)
      .def_rw("node_samples", &SolveOptions::node_samples)
      .def_rw("panel_rays", &SolveOptions::panel_rays)
      .def_rw("node_tolerance", &SolveOptions::node_tolerance)
      .def_rw("tolerance", &SolveOptions::tolerance)
      .def_rw("seed", &SolveOptions::seed)
      .def_rw("trace", &SolveOptions::trace);

  nb::class_<TransferDefects>(m, "TransferDefects")
      .def_ro("raw_reciprocity", &TransferDefects::raw_reciprocity)
      .def_ro("raw_row_sum", &TransferDefects::raw_row_sum)
      .def_ro("row_sum", &TransferDefects::row_sum)
      .def_ro("reciprocity", &TransferDefects::reciprocity)
      .def_ro("iterations", &TransferDefects::iterations);

  nb::class_<SolveFacts>(m, "SolveFacts")
      .def_ro("face_count", &SolveFacts::face_count)
      .def_ro("patch_count", &SolveFacts::patch_count)
      .def_ro("interior_patch_count", &SolveFacts::interior_patch_count)
      .def_ro("node_count", &SolveFacts::node_count)
      .def_ro("maximum_edge_m", &SolveFacts::maximum_edge_m)
      .def_ro("leak_share", &SolveFacts::leak_share)
      .def_ro("defects", &SolveFacts::defects)
      .def_ro("cluster_count", &SolveFacts::cluster_count)
      .def_ro("link_bytes", &SolveFacts::link_bytes)
      .def_ro("kept_patch_rows", &SolveFacts::kept_patch_rows)
      .def_ro("kept_node_rows", &SolveFacts::kept_node_rows)
      .def_ro("panel_count", &SolveFacts::panel_count)
      .def_ro("panel_bin_count", &SolveFacts::panel_bin_count);

  bind_condition(m);

  nb::class_<View>(m, "View").def(
      "__init__",
      [](View* self, std::tuple<double, double, double> position, std::tuple<double, double, double> target,
         std::tuple<double, double, double> up, double vertical_fov_rad, int width, int height) {
        const auto at = [](const std::tuple<double, double, double>& t) {
          return glm::dvec3(std::get<0>(t), std::get<1>(t), std::get<2>(t));
        };
        new (self) View{at(position), at(target), at(up), vertical_fov_rad, width, height};
      },
      "position"_a, "target"_a, "up"_a, "vertical_fov_rad"_a, "width"_a, "height"_a);

  m.def(
      "trace_primary",
      [](const SceneGeometry& scene, const View& view) {
        PrimaryHits hits = trace_primary(scene, view);
        const std::vector<std::size_t> shape{static_cast<std::size_t>(view.height),
                                             static_cast<std::size_t>(view.width)};
        return nb::make_tuple(to_array<int>(std::move(hits.face), shape),
                              to_array<double>(std::move(hits.position), {shape[0], shape[1], 3}));
      },
      "scene"_a, "view"_a, "First face (height, width), -1 for none, and its point (height, width, 3) [m].");

  nb::enum_<Visibility>(m, "Visibility").value("RAYS", Visibility::kRays).value("VOLUMES", Visibility::kVolumes);

  nb::class_<Session>(m, "Engine")
      .def(nb::init<SceneGeometry, const SkyBins&, SolveOptions>(), "scene"_a, "sky_bins"_a, "options"_a,
           nb::call_guard<nb::gil_scoped_release>(), "Solves the scene: everything that depends on geometry alone.")
      .def(nb::init<const Session&, SceneGeometry>(), "solved"_a, "scene"_a, nb::call_guard<nb::gil_scoped_release>(),
           "Solves an edited scene, and takes over what is still valid: equal to solving it afresh.")
      .def_prop_ro("facts", [](const Session& s) { return s.engine.facts(); })
      .def(
          "set_product",
          [](Session& s, int opening, In<float, nb::shape<-1, -1>> transmission, float room_reflectance) {
            s.engine.set_product(opening, {to_vector<float>(transmission), room_reflectance});
          },
          "opening"_a, "transmission"_a, "room_reflectance"_a,
          "BTDF by bins [1/sr], row = exit bin, and room reflectance of an opening group's panels.")
      .def(
          "relight",
          [](Session& s, const Condition& c) {
            const std::shared_ptr<const Lighting> before = s.present;
            s.present = Session::without_lock([&] { return s.engine.relight(c, before.get()); });
          },
          "condition"_a)
      .def(
          "start_worker", [](Session& s) { s.worker = std::make_unique<RelightWorker>(s.engine, s.present); },
          nb::call_guard<nb::gil_scoped_release>(), "Begins to relight on a thread of its own.")
      .def(
          "stop_worker", [](Session& s) { s.worker.reset(); }, nb::call_guard<nb::gil_scoped_release>())
      .def(
          "submit", [](Session& s, const Condition& c) { return s.running().submit(c); }, "condition"_a,
          nb::call_guard<nb::gil_scoped_release>(), "Gives the worker a condition; its number.")
      .def(
          "take_latest", [](Session& s) { return s.take([](RelightWorker& worker) { return worker.latest(); }); },
          "Makes the worker's newest state the present light; number of its condition, and whether it is complete.")
      .def(
          "take_finished", [](Session& s) { return s.take([](RelightWorker& worker) { return worker.finished(); }); },
          "The same, once the newest condition is complete.")
      .def(
          "render",
          [](Session& s, const View& view, Visibility visibility, int edge_samples, bool components,
             const SkyPicture& sky) {
            const std::shared_ptr<const Lighting> light = s.present;
            Frame frame = Session::without_lock([&] {
              return s.renderer.render(view, *light, {visibility, edge_samples, components, &sky});
            });
            nb::dict result;
            const int w = frame.width, h = frame.height;
            result["radiance"] = picture(std::move(frame.radiance), w, h);
            result["edge_pixel_count"] = frame.edge_pixel_count;
            result["pass_count"] = frame.pass_count;
            if (!components) return result;
            result["sun"] = picture(std::move(frame.sun), w, h);
            result["sky"] = picture(std::move(frame.sky), w, h);
            result["indirect"] = picture(std::move(frame.indirect), w, h);
            result["emitted"] = picture(std::move(frame.emitted), w, h);
            result["exterior"] = picture(std::move(frame.exterior), w, h);
            return result;
          },
          "view"_a, "visibility"_a, "edge_samples"_a, "components"_a, "sky"_a)
      .def(
          "illuminance",
          [](Session& s, In<double, nb::shape<-1, 3>> points, In<float, nb::shape<-1, 3>> normals,
             GatherSamples samples) {
            const std::vector<glm::dvec3> places = to_vector<glm::dvec3>(points);
            const std::vector<glm::vec3> up = to_vector<glm::vec3>(normals);
            const std::shared_ptr<const Lighting> light = s.present;
            std::shared_ptr<const Sensors> sensors = s.sensors;
            std::vector<Irradiance> e = Session::without_lock([&] {
              if (!sensors || !sensors->are(places, up, samples))
                sensors = std::make_shared<const Sensors>(s.engine.sensors(places, up, samples));
              return s.engine.illuminance(*light, *sensors);
            });
            s.sensors = sensors;
            const std::size_t n = e.size();
            return to_array<float>(std::move(e), {n, 3, 3});
          },
          "points"_a, "normals"_a, "samples"_a, "Irradiance (N, 3, 3): rows direct, sky, indirect; columns RGB [lx].")
      .def(
          "places_facing",
          [](const Session& s, std::tuple<float, float, float> direction) {
            Places places;
            {
              const nb::gil_scoped_release release;
              places = places_facing(s.engine, vector_of(direction));
            }
            const std::size_t n = places.points.size();
            return nb::make_tuple(to_array<float>(std::move(places.points), {n, 3}),
                                  to_array<float>(std::move(places.weights), {n}));
          },
          "direction"_a,
          "Places (N, 3) on patches of rooms in the engine's frame [m], for `shares_from`, and the flux (N,) that 1 "
          "lx\n"
          "brings to each [lm]. direction: unit, towards the source.")
      .def(
          "shares_from",
          [](const Session& s, In<float, nb::shape<-1, 3>> points, In<float, nb::shape<-1, 3>> directions) {
            const std::vector<glm::vec3> from = to_vector<glm::vec3>(points), to = to_vector<glm::vec3>(directions);
            std::vector<float> shares;
            {
              const nb::gil_scoped_release release;
              shares = shares_from(s.engine, from, to);
            }
            return to_array<float>(std::move(shares), {from.size(), to.size()});
          },
          "points"_a, "directions"_a,
          "Share (N, M), 0..1, of parallel light from each unit direction (M, 3) that arrives at each place (N, 3) of\n"
          "`places_facing`.")
      .def(
          "audit",
          [](const Session& s, int rays_per_opening) {
            const EnergyAudit a = s.engine.audit(*s.present, rays_per_opening);
            nb::dict result;
            const auto put = [&](const char* name, glm::dvec3 v) { result[name] = nb::make_tuple(v.x, v.y, v.z); };
            put("in_sky", a.in_sky);
            put("in_beams", a.in_beams);
            put("in_reflected", a.in_reflected);
            put("in_emitted", a.in_emitted);
            put("absorbed", a.absorbed);
            put("out", a.out);
            return result;
          },
          "rays_per_opening"_a, "Flux balance of the interior [lm], linear RGB.")
      .def_prop_ro(
          "form_factors",
          [](const Session& s) {
            const SparseRows& f = s.engine.form_factors();
            std::vector<int> columns;
            std::vector<float> values;
            std::vector<long long> begin(f.begin.begin(), f.begin.end());
            for (const Share& share : f.entries) {
              columns.push_back(share.index);
              values.push_back(share.weight);
            }
            const std::size_t count = columns.size(), rows = begin.size();
            return nb::make_tuple(to_array<long long>(std::move(begin), {rows}),
                                  to_array<int>(std::move(columns), {count}),
                                  to_array<float>(std::move(values), {count}));
          },
          "Form factors between patches as compressed sparse rows: begin, column, value.")
      .def_prop_ro(
          "patch_areas",
          [](const Session& s) {
            std::vector<float> areas = s.engine.patch_areas();
            const std::size_t n = areas.size();
            return to_array<float>(std::move(areas), {n});
          },
          nb::rv_policy::move, "Exposed area of each patch [m²].")
      .def_prop_ro(
          "plan",
          [](const Session& s) {
            const RelightPlan& plan = s.present->plan;
            nb::dict result;
            result["channels"] = plan.is_grey ? 1 : 3;
            result["beams"] = plan.beams.beams;
            result["facing_openings"] = plan.beams.facing_openings;
            result["beam_patches"] = plan.beams.patches;
            result["unshaded"] = plan.beams.is_unshaded;
            return result;
          },
          "How much of the last relighting its condition needed.")
      .def_prop_ro("sweeps", [](const Session& s) { return s.present->sweeps; })
      .def_prop_ro("shots", [](const Session& s) { return s.present->shots; })
      .def_prop_ro("unshot_share", [](const Session& s) { return s.present->unshot_share; })
      .def_prop_ro("forward_rays", [](const Session& s) { return s.present->forward_ray_count; })
      .def_prop_ro("trace",
                   [](Session& s) {
                     nb::list events;
                     for (const TraceEvent& e : s.engine.trace().events())
                       events.append(nb::make_tuple(e.name, e.begin_s, e.end_s));
                     return events;
                   })
      .def("clear_trace", [](Session& s) { s.engine.trace().clear(); });
}
