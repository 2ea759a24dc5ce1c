// The module `_scenes`: scenes of many bodies, for python/ricochet/_scene.py.

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.hpp"
#include "background.hpp"
#include "ricochet/scene/measure.hpp"
#include "ricochet/scene/scene.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::python {

namespace {

/// A scene with the options that its file gives for a run.
struct PyScene {
    Scene scene;
    SceneOptions options;
};

// --- motions of surfaces ---

[[nodiscard]] bool has(const py::dict& given, const char* key)
{
    return given.contains(key);
}

/// @throws py::value_error for a key that the motion does not have
void refuse_others(const py::dict& given, std::initializer_list<std::string_view> known,
                   const std::string& whose = "motion")
{
    for (const auto& [key, value] : given) {
        const auto name = py::cast<std::string>(key);
        if (std::ranges::find(known, name) != known.end()) continue;
        std::string all;
        for (const std::string_view one : known)
            all += (all.empty() ? "" : ", ") + std::string(one);
        throw py::value_error(whose + ": found '" + name + "', expected some of " + all);
    }
}

template <class T>
void put(const py::dict& given, const char* key, T& to, const std::string& whose = "motion")
{
    if (!has(given, key)) return;
    try {
        to = py::cast<T>(given[key]);
    } catch (const py::cast_error&) {
        throw py::type_error(whose + ": " + std::string(key) + ": found " +
                             py::cast<std::string>(py::repr(given[key])) + ", expected " +
                             (std::is_same_v<T, double>                ? "a number"
                              : std::is_same_v<T, std::vector<double>> ? "numbers"
                                                                       : "pairs of numbers"));
    }
}

using Along = std::function<Vector2(double)>;

/// A function of Python, which the run calls without the interpreter lock.
[[nodiscard]] Along along(const py::dict& given, const char* key)
{
    if (!has(given, key) || !PyCallable_Check(given[key].ptr())) {
        throw py::type_error("motion: found no function '" + std::string(key) +
                             "', expected one of t");
    }
    // Released with the interpreter lock held, wherever the scene ends.
    const std::shared_ptr<py::object> function(new py::object(given[key]), [](py::object* object) {
        const py::gil_scoped_acquire held;
        delete object;
    });
    return [function, key](double t) {
        const py::gil_scoped_acquire held;
        const py::object result = (*function)(t);
        try {
            return py::cast<Vector2>(result);
        } catch (const py::cast_error&) {
            throw py::type_error("motion: " + std::string(key) + " returned " +
                                 py::cast<std::string>(py::repr(result)) +
                                 ", expected two numbers");
        }
    };
}

[[nodiscard]] SurfaceMotion motion_from(const py::object& given)
{
    if (given.is_none()) return Fixed{};
    if (!py::isinstance<py::dict>(given)) {
        throw py::type_error("motion: found " + py::cast<std::string>(py::repr(given)) +
                             ", expected a dictionary");
    }
    const py::dict of(given);
    if (has(of, "amplitude")) {
        refuse_others(of, {"amplitude", "frequency", "phase"});
        Oscillation motion;
        put(of, "amplitude", motion.amplitude);
        put(of, "frequency", motion.frequency);
        put(of, "phase", motion.phase);
        return motion;
    }
    if (has(of, "times")) {
        refuse_others(of, {"times", "displacements"});
        PiecewiseLinear motion;
        put(of, "times", motion.times);
        put(of, "displacements", motion.displacements);
        return motion;
    }
    if (has(of, "displacement")) {
        refuse_others(of,
                      {"displacement", "velocity", "acceleration_bound", "speed_bound", "reach"});
        GivenMotion motion;
        motion.displacement = along(of, "displacement");
        motion.velocity = along(of, "velocity");
        put(of, "acceleration_bound", motion.acceleration_bound);
        put(of, "speed_bound", motion.speed_bound);
        put(of, "reach", motion.reach);
        return motion;
    }
    if (has(of, "velocity")) {
        refuse_others(of, {"velocity", "since"});
        ConstantVelocity motion;
        put(of, "velocity", motion.velocity);
        put(of, "since", motion.since);
        return motion;
    }
    throw py::value_error("motion: found " + py::cast<std::string>(py::repr(given)) +
                          ", expected a key 'amplitude', 'velocity', 'times' or 'displacement'");
}

/// How restitution depends on the speed: None, {"speed": v, "exponent": p}, or {"speeds": [...],
/// "restitutions": [...]}.
[[nodiscard]] SpeedLaw law_from(const py::object& given)
{
    if (given.is_none()) return {};
    if (!py::isinstance<py::dict>(given)) {
        throw py::type_error("by_speed: found " + py::cast<std::string>(py::repr(given)) +
                             ", expected a dictionary");
    }
    const py::dict of(given);
    if (has(of, "speeds")) {
        refuse_others(of, {"speeds", "restitutions"}, "by_speed");
        TableOfSpeed table;
        put(of, "speeds", table.speeds, "by_speed");
        put(of, "restitutions", table.restitutions, "by_speed");
        return table;
    }
    refuse_others(of, {"speed", "exponent"}, "by_speed");
    PowerOfSpeed power;
    put(of, "speed", power.speed, "by_speed");
    put(of, "exponent", power.exponent, "by_speed");
    return power;
}

// --- options ---

using Setter = std::function<void(SceneOptions&, const py::handle&)>;

template <class T>
[[nodiscard]] Setter setter(T SceneOptions::*member)
{
    return [member](SceneOptions& options, const py::handle& value) {
        options.*member = py::cast<T>(value);
    };
}

[[nodiscard]] const std::map<std::string, Setter>& setters()
{
    static const std::map<std::string, Setter> all{
        {"t_start", setter(&SceneOptions::t_start)},
        {"t_end", setter(&SceneOptions::t_end)},
        {"rtol", setter(&SceneOptions::rtol)},
        {"atol", setter(&SceneOptions::atol)},
        {"impacts",
         [](SceneOptions& options, const py::handle& value) {
             const auto name = py::cast<std::string>(value);
             if (name != "waves" && name != "together") {
                 throw py::value_error("impacts: found '" + name +
                                       "', expected 'waves' or 'together'");
             }
             options.impacts = name == "waves" ? ImpactLaw::waves : ImpactLaw::together;
         }},
        {"elastic_within", setter(&SceneOptions::elastic_within)},
        {"contact_step", setter(&SceneOptions::contact_step)},
        {"crowded_from", setter(&SceneOptions::crowded_from)},
        {"record_events", setter(&SceneOptions::record_events)},
        {"sample_times", setter(&SceneOptions::sample_times)},
        {"max_events", setter(&SceneOptions::max_events)},
        {"seed", setter(&SceneOptions::seed)},
    };
    return all;
}

[[nodiscard]] SceneOptions options_for(const PyScene& of, const py::dict& given)
{
    SceneOptions options = of.options;
#ifdef RICOCHET_WITH_SCENE_CONTACT
    options.contacts = scene_contacts();
#endif
    for (const auto& [key, value] : given) {
        const auto name = py::cast<std::string>(key);
        const auto found = setters().find(name);
        if (found == setters().end()) {
            std::string all;
            for (const auto& [known, set] : setters()) all += (all.empty() ? "" : ", ") + known;
            throw py::type_error("found an option '" + name + "', expected some of " + all);
        }
        try {
            found->second(options, value);
        } catch (const py::cast_error&) {
            throw py::type_error(name + ": found " + py::cast<std::string>(py::repr(value)) +
                                 ", expected a number, or numbers, of its kind");
        }
    }
    return options;
}

// --- results ---

template <class T, class Of>
[[nodiscard]] py::array column(const std::vector<SceneEvent>& events, const Of& of)
{
    py::array out = new_array<T>({static_cast<py::ssize_t>(events.size())});
    auto* at = static_cast<T*>(out.mutable_data());
    for (const SceneEvent& event : events) *at++ = static_cast<T>(of(event));
    return out;
}

/// Pairs of numbers: `count` of them for each event.
template <class Of>
[[nodiscard]] py::array pairs(const std::vector<SceneEvent>& events, std::size_t count,
                              const Of& of)
{
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(events.size())};
    if (count > 1) shape.push_back(static_cast<py::ssize_t>(count));
    shape.push_back(2);
    py::array out = new_array<double>(std::move(shape));
    auto* at = static_cast<double*>(out.mutable_data());
    for (const SceneEvent& event : events) {
        const Vector2* const first = of(event);
        for (std::size_t i = 0; i < count; ++i) at = std::ranges::copy(first[i], at).out;
    }
    return out;
}

[[nodiscard]] py::dict columns_of(const std::vector<SceneEvent>& events)
{
    using namespace py::literals;
    return py::dict(
        "t"_a = column<double>(events, [](const SceneEvent& e) { return e.t; }),
        "number"_a = column<std::uint64_t>(events, [](const SceneEvent& e) { return e.number; }),
        "kind"_a = column<std::uint8_t>(events, [](const SceneEvent& e) { return e.kind; }),
        "body"_a = column<std::int64_t>(events, [](const SceneEvent& e) { return e.body; }),
        "other"_a = column<std::int64_t>(events, [](const SceneEvent& e) { return e.other.index; }),
        "surface"_a = column<bool>(events, [](const SceneEvent& e) { return e.other.is_surface; }),
        "impulse"_a = pairs(events, 1, [](const SceneEvent& e) { return &e.impulse; }),
        "before"_a = pairs(events, 2, [](const SceneEvent& e) { return e.before.data(); }),
        "after"_a = pairs(events, 2, [](const SceneEvent& e) { return e.after.data(); }));
}

/// States of all bodies at some times: positions, velocities, whether they sleep, and the periods
/// that they have gone.
[[nodiscard]] py::tuple states_of(const std::vector<std::vector<BodyState>>& rows,
                                  std::size_t bodies)
{
    const auto times = static_cast<py::ssize_t>(rows.size());
    const auto count = static_cast<py::ssize_t>(bodies);
    py::array at = new_array<double>({times, count, 2});
    py::array velocity = new_array<double>({times, count, 2});
    py::array asleep = new_array<bool>({times, count});
    py::array winding = new_array<std::int32_t>({times, count, 2});
    auto* x = static_cast<double*>(at.mutable_data());
    auto* v = static_cast<double*>(velocity.mutable_data());
    auto* sleeps = static_cast<bool*>(asleep.mutable_data());
    auto* gone = static_cast<std::int32_t*>(winding.mutable_data());
    for (const auto& row : rows) {
        for (const BodyState& body : row) {
            x = std::ranges::copy(body.at, x).out;
            v = std::ranges::copy(body.velocity, v).out;
            *sleeps++ = body.asleep;
            gone = std::ranges::copy(body.winding, gone).out;
        }
    }
    return py::make_tuple(at, velocity, asleep, winding);
}

/// Angles and spins of all bodies at some times; zeros where no disc turns.
[[nodiscard]] py::tuple turns_of(const std::vector<std::vector<BodyTurn>>& rows, std::size_t times,
                                 std::size_t bodies)
{
    const auto count = static_cast<py::ssize_t>(bodies);
    py::array angle = new_array<double>({static_cast<py::ssize_t>(times), count});
    py::array spin = new_array<double>({static_cast<py::ssize_t>(times), count});
    auto* a = static_cast<double*>(angle.mutable_data());
    auto* s = static_cast<double*>(spin.mutable_data());
    for (std::size_t k = 0; k < times; ++k) {
        for (std::size_t i = 0; i < bodies; ++i) {
            const BodyTurn turn = k < rows.size() && i < rows[k].size() ? rows[k][i] : BodyTurn{};
            *a++ = turn.angle;
            *s++ = turn.spin;
        }
    }
    return py::make_tuple(angle, spin);
}

[[nodiscard]] py::dict counts_of(const SceneStatistics& s)
{
    using namespace py::literals;
    return py::dict(
        "impacts"_a = s.impacts, "events"_a = s.events, "waves"_a = s.waves,
        "collapses"_a = s.collapses, "predictions"_a = s.predictions, "stale"_a = s.stale,
        "crossings"_a = s.crossings, "steps"_a = s.steps, "rejected"_a = s.rejected,
        "flow_calls"_a = s.flow_calls, "joins"_a = s.joins, "contact_steps"_a = s.contact_steps,
        "crowded_steps"_a = s.crowded_steps, "crowded_rebounds"_a = s.crowded_rebounds,
        "contact_defect"_a = s.contact_defect, "alone"_a = s.alone, "groups"_a = s.groups);
}

/// The surfaces as they are drawn: whether it is a wall, its points, the normal, the centre and
/// radius of an arc, and its displacements at some times, none where it is fixed.
[[nodiscard]] py::list surfaces_of(const PyScene& of, const std::vector<double>& times)
{
    py::list out;
    for (const Scene::Surface& surface : of.scene.surfaces()) {
        std::vector<Vector2> moved;
        if (!std::holds_alternative<Fixed>(surface.motion)) {
            for (const double t : times) moved.push_back(displacement(surface.motion, t));
        }
        out.append(py::make_tuple(surface.is_wall, surface.points, surface.normal, surface.centre,
                                  surface.radius, moved));
    }
    return out;
}

/// Runs a scene while other threads of Python go on.
[[nodiscard]] SceneRun run_without_lock(const Scene& scene, SceneOptions& options)
{
    Background<int> background(nullptr);
    options.cancelled = &background.stopped();
    SceneRun run;
    background.run([&] { run = simulate(scene, options); });
    if (background.raised()) {
        background.raised()->restore();
        throw py::error_already_set();
    }
    return run;
}

[[nodiscard]] py::dict simulated(const PyScene& of, const py::dict& given)
{
    SceneOptions options = options_for(of, given);
    const SceneRun run = run_without_lock(of.scene, options);
    using namespace py::literals;
    const std::size_t bodies = of.scene.bodies().size();
    std::vector<std::vector<BodyState>> last{run.bodies};
    return py::dict(
        "outcome"_a = std::string(name(run.outcome)), "message"_a = run.message,
        "involved"_a = array_of(run.involved), "t"_a = run.t, "last"_a = states_of(last, bodies),
        "samples"_a = states_of(run.samples, bodies), "turns"_a = turns_of({run.turns}, 1, bodies),
        "sample_turns"_a = turns_of(run.sample_turns, run.samples.size(), bodies),
        "times"_a = array_of(run.sample_times), "events"_a = columns_of(run.events),
        "statistics"_a = counts_of(run.statistics));
}

/// Runs a gas from its start, and measures it from t_start to t_end. `lengths` [m] of surfaces, NaN
/// where they are not known.
[[nodiscard]] py::dict measured(const PyScene& of, double t_start, double t_end, std::size_t blocks,
                                double area, const std::vector<double>& lengths,
                                const py::dict& given)
{
    SceneOptions options = options_for(of, given);
    options.t_end = t_end;
    options.record_events = false;
    SceneMeasure measure(of.scene,
                         {.t_start = t_start, .t_end = t_end, .blocks = blocks, .area = area});
    for (std::uint32_t s = 0; s < lengths.size(); ++s) {
        if (!std::isnan(lengths[s])) measure.length_of(SurfaceId{s}, lengths[s]);
    }
    options.observe = [&](const SceneEvent& event) { measure.add(event); };
    const SceneRun run = run_without_lock(of.scene, options);
    using namespace py::literals;
    const SceneMeasures found = measure.result();
    const auto pair = [](const Measured& m) { return std::pair(m.mean, m.error); };
    std::vector<std::pair<double, double>> surfaces;
    for (const Measured& pressure : found.surface_pressure) surfaces.push_back(pair(pressure));
    return py::dict(
        "outcome"_a = std::string(name(run.outcome)), "message"_a = run.message,
        "collision_rate"_a = pair(found.collision_rate), "wall_rate"_a = pair(found.wall_rate),
        "temperature"_a = pair(found.temperature),
        "virial_pressure"_a = pair(found.virial_pressure),
        "mean_free_path"_a = pair(found.mean_free_path), "surface_pressure"_a = surfaces);
}

using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Energies at some times, of positions and velocities of shape (times, bodies, 2).
[[nodiscard]] py::array energies(const PyScene& of, const Rows& at, const Rows& velocity)
{
    const std::size_t bodies = of.scene.bodies().size();
    const auto fits = [&](const Rows& rows) {
        return rows.ndim() == 3 && rows.shape(1) == static_cast<py::ssize_t>(bodies) &&
               rows.shape(2) == 2;
    };
    if (!fits(at) || !fits(velocity) || at.shape(0) != velocity.shape(0)) {
        throw py::value_error(
            "energy: found positions and velocities of other shapes, expected "
            "(times, " +
            std::to_string(bodies) + ", 2)");
    }
    py::array out = new_array<double>({at.shape(0)});
    auto* energy_at = static_cast<double*>(out.mutable_data());
    std::vector<BodyState> row(bodies);
    const double* x = at.data();
    const double* v = velocity.data();
    for (py::ssize_t k = 0; k < at.shape(0); ++k) {
        for (BodyState& body : row) {
            body.at = {x[0], x[1]};
            body.velocity = {v[0], v[1]};
            x += 2;
            v += 2;
        }
        energy_at[k] = energy(of.scene, row);
    }
    return out;
}

[[nodiscard]] std::shared_ptr<PyScene> from_file(SceneFile&& file)
{
    return std::make_shared<PyScene>(PyScene{std::move(file.scene), std::move(file.options)});
}

// Long: a list of what a scene is built of.
void bind_parts(py::class_<PyScene, std::shared_ptr<PyScene>>& scene)
{
    scene
        .def("material",
             [](PyScene& self, const std::string& name, double restitution, double friction,
                const py::object& by_speed) {
                 return self.scene
                     .material({.name = name,
                                .restitution = restitution,
                                .friction = friction,
                                .by_speed = law_from(by_speed)})
                     .index;
             })
        .def("pair",
             [](PyScene& self, std::uint32_t first, std::uint32_t second, double restitution,
                double friction, const py::object& by_speed) {
                 self.scene.pair({.between = {MaterialId{first}, MaterialId{second}},
                                  .restitution = restitution,
                                  .friction = friction,
                                  .by_speed = law_from(by_speed)});
             })
        .def("disc",
             [](PyScene& self, const std::string& name, const Vector2& at, const Vector2& velocity,
                double radius, double mass, double drag, std::uint32_t material, double inertia,
                double angle, double spin) {
                 return self.scene
                     .disc({.name = name,
                            .at = at,
                            .velocity = velocity,
                            .radius = radius,
                            .mass = mass,
                            .drag = drag,
                            .material = {material},
                            .inertia = inertia,
                            .angle = angle,
                            .spin = spin})
                     .index;
             })
        .def("point",
             [](PyScene& self, const std::string& name, const Vector2& at, const Vector2& velocity,
                double mass, double drag, std::uint32_t material) {
                 return self.scene
                     .point({.name = name,
                             .at = at,
                             .velocity = velocity,
                             .mass = mass,
                             .drag = drag,
                             .material = {material}})
                     .index;
             })
        .def("plate",
             [](PyScene& self, const std::string& name, const std::array<Vector2, 2>& ends,
                const Vector2& along, double speed, double mass, std::uint32_t material) {
                 return self.scene
                     .plate({.name = name,
                             .ends = ends,
                             .along = along,
                             .speed = speed,
                             .mass = mass,
                             .material = {material}})
                     .index;
             })
        .def("wall",
             [](PyScene& self, const std::string& name, const Vector2& point, const Vector2& normal,
                std::uint32_t material, const py::object& motion, double temperature) {
                 return self.scene
                     .wall({.name = name,
                            .point = point,
                            .normal = normal,
                            .material = {material},
                            .motion = motion_from(motion),
                            .temperature = temperature})
                     .index;
             })
        .def("terrain",
             [](PyScene& self, const std::string& name, const std::vector<Vector2>& points,
                bool closed, std::uint32_t material, const py::object& motion, double temperature) {
                 return self.scene
                     .terrain({.name = name,
                               .points = points,
                               .closed = closed,
                               .material = {material},
                               .motion = motion_from(motion),
                               .temperature = temperature})
                     .index;
             })
        .def("arc",
             [](PyScene& self, const std::string& name, const Vector2& centre, double radius,
                const std::array<Vector2, 2>& ends, std::uint32_t material, double temperature) {
                 return self.scene
                     .arc({.name = name,
                           .centre = centre,
                           .radius = radius,
                           .ends = ends,
                           .material = {material},
                           .temperature = temperature})
                     .index;
             })
        .def("spring", [](PyScene& self, std::uint32_t first, std::uint32_t second, double rest,
                          double stiffness, double damping) {
            self.scene.spring({.between = {BodyId{first}, BodyId{second}},
                               .rest = rest,
                               .stiffness = stiffness,
                               .damping = damping});
        });
}

}  // namespace

}  // namespace ricochet::python

// Long: a list of what the module has.
PYBIND11_MODULE(_scenes, module)
{
    using namespace ricochet;
    using namespace ricochet::python;
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const SceneFileError& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        }
    });
    py::class_<PyScene, std::shared_ptr<PyScene>> scene(module, "Scene");
    scene.def(py::init([](const Vector2& gravity, const Vector2& period, double memory_limit) {
        return std::make_shared<PyScene>(PyScene{
            Scene({.gravity = gravity, .period = period, .memory_limit = memory_limit}), {}});
    }));
    bind_parts(scene);
    scene
        .def_property_readonly("body_names",
                               [](const PyScene& self) {
                                   std::vector<std::string> names;
                                   for (std::uint32_t i = 0; i < self.scene.bodies().size(); ++i) {
                                       names.push_back(self.scene.name_of(BodyId{i}));
                                   }
                                   return names;
                               })
        .def_property_readonly("surface_names",
                               [](const PyScene& self) {
                                   std::vector<std::string> names;
                                   for (std::uint32_t i = 0; i < self.scene.surfaces().size();
                                        ++i) {
                                       names.push_back(self.scene.name_of(SurfaceId{i}));
                                   }
                                   return names;
                               })
        .def_property_readonly("material_names",
                               [](const PyScene& self) {
                                   std::vector<std::string> names;
                                   for (const Material& material : self.scene.materials()) {
                                       names.push_back(material.name);
                                   }
                                   return names;
                               })
        .def_property_readonly("period",
                               [](const PyScene& self) { return self.scene.settings().period; })
        .def_property_readonly("inertias",
                               [](const PyScene& self) {
                                   std::vector<double> inertias;
                                   for (const Disc& body : self.scene.bodies()) {
                                       inertias.push_back(body.inertia);
                                   }
                                   return array_of(inertias);
                               })
        .def_property_readonly("radii",
                               [](const PyScene& self) {
                                   std::vector<double> radii;
                                   for (const Disc& body : self.scene.bodies()) {
                                       radii.push_back(body.radius);
                                   }
                                   return array_of(radii);
                               })
        .def("body", [](const PyScene& self,
                        const std::string& name) { return self.scene.body(name).index; })
        .def("check", [](const PyScene& self, double t) { self.scene.check(t); })
        .def("simulate", &simulated)
        .def("measure", &measured)
        .def("explain",
             [](const PyScene& self, const py::dict& given) {
                 return explain(self.scene, options_for(self, given));
             })
        .def("surfaces", &surfaces_of)
        .def("energy", &energies);
    module.def("read_scene", [](const std::string& text, const std::string& file) {
        return from_file(read_scene(text, file));
    });
    module.def("load_scene", [](const std::string& path) { return from_file(load_scene(path)); });
}
