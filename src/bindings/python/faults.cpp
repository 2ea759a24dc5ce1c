// The module `_faults`: rate-and-state friction, the slider and the strike-slip fault; what users
// call is in python/ricochet/faults.py.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "background.hpp"
#include "ricochet/faults/fault_system.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/faults/incremental.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace py = pybind11;

namespace {

using namespace ricochet;
using python::array_of;
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

template <class T>
[[nodiscard]] T in(const py::dict& given, const char* key)
{
    return py::cast<T>(given[key]);
}

/// One of a list of names, which Python has checked.
template <class Enumerator>
[[nodiscard]] Enumerator at(const py::dict& given, const char* key)
{
    return static_cast<Enumerator>(in<int>(given, key));
}

[[nodiscard]] py::array array_of(const Eigen::VectorXd& values)
{
    return python::array_of(
        std::span<const double>(values.data(), static_cast<std::size_t>(values.size())));
}

[[nodiscard]] RateStateParameters law_of(const py::dict& given)
{
    return {.a = in<double>(given, "a"),
            .b = in<double>(given, "b"),
            .f_star = in<double>(given, "f_star"),
            .v_star = in<double>(given, "v_star"),
            .d_rs = in<double>(given, "d_rs")};
}

/// Does some work without the interpreter lock, and raises what a signal has raised meanwhile.
template <class Work>
void run_freely(const Work& work)
{
    python::Background<int> background(nullptr);
    background.run([&] { work(background.stopped()); });
    if (!background.raised()) return;
    background.raised()->restore();
    throw py::error_already_set();
}

// --- laws ---

/// Calls a function with the law of an evolution and an effect.
template <class Function>
void with_law(const py::dict& given, const Function& function)
{
    const RateStateParameters p = law_of(given);
    const auto of =
        [&]<StateEvolution evolution>(std::integral_constant<StateEvolution, evolution>) {
            if (at<DirectEffect>(given, "effect") == DirectEffect::log) {
                return function(RateStateLaw<evolution, DirectEffect::log>(p));
            }
            return function(RateStateLaw<evolution, DirectEffect::asinh>(p));
        };
    using E = StateEvolution;
    switch (at<E>(given, "evolution")) {
        case E::ageing: return of(std::integral_constant<E, E::ageing>());
        case E::slip: return of(std::integral_constant<E, E::slip>());
        case E::prz: return of(std::integral_constant<E, E::prz>());
    }
}

/// Friction and rate of the state, of numbers one by one.
py::tuple evaluate_law(const py::dict& law, const Numbers& v, const Numbers& xi)
{
    const auto count = static_cast<std::size_t>(v.size());
    std::vector<double> friction(count), rate(count);
    with_law(law, [&](const auto& of) {
        for (std::size_t i = 0; i < count; ++i) {
            const FrictionAndRate found = of.evaluate(v.data()[i], xi.data()[i]);
            friction[i] = found.friction;
            rate[i] = found.rate;
        }
    });
    return py::make_tuple(array_of(friction), array_of(rate));
}

// --- the slider ---

[[nodiscard]] SpringBlock block_of(const py::dict& given)
{
    return {.mass = in<double>(given, "mass"),
            .stiffness = in<double>(given, "stiffness"),
            .normal_force = in<double>(given, "normal_force")};
}

[[nodiscard]] SpringSlider slider_of(const py::dict& given)
{
    std::vector<SliderLoad::Piece> pieces;
    for (const auto& [t, velocity] :
         in<std::vector<std::pair<double, double>>>(given, "load_velocity")) {
        pieces.push_back({t, velocity});
    }
    return {.friction = law_of(given),
            .evolution = at<StateEvolution>(given, "evolution"),
            .block = block_of(given),
            .load = SliderLoad(in<double>(given, "load_start"), std::move(pieces))};
}

[[nodiscard]] py::array rows_of(const std::vector<SliderState>& states)
{
    py::array out = python::new_array<double>({static_cast<py::ssize_t>(states.size()), 4});
    auto* to = static_cast<double*>(out.mutable_data());
    for (const SliderState& s : states) {
        for (const double number : {s.t, s.x, s.v, s.xi}) *to++ = number;
    }
    return out;
}

py::dict run_the_slider(const py::dict& slider, const std::vector<double>& start,
                        const py::dict& given)
{
    const SpringSlider of = slider_of(slider);
    const SliderState from{.t = start[0], .x = start[1], .v = start[2], .xi = start[3]};
    SliderOptions options{.t_end = in<double>(given, "t_end"),
                          .order = in<int>(given, "order"),
                          .step = in<double>(given, "step"),
                          .rtol = in<double>(given, "rtol"),
                          .first_step = in<double>(given, "first_step"),
                          .threshold = in<double>(given, "threshold"),
                          .samples = in<std::size_t>(given, "samples"),
                          .max_steps = in<std::size_t>(given, "max_steps")};
    SliderRun run;
    run_freely([&](const std::atomic<bool>& stopped) {
        options.cancelled = &stopped;
        run = run_slider(of, from, options);
    });
    std::vector<SliderState> at;
    std::vector<std::string> kinds;
    for (const SliderEvent& event : run.events) {
        at.push_back(event.at);
        kinds.emplace_back(name(event.kind));
    }
    using namespace py::literals;
    return py::dict("outcome"_a = std::string(name(run.outcome)), "state"_a = rows_of({run.state}),
                    "events"_a = rows_of(at), "kinds"_a = kinds, "samples"_a = rows_of(run.samples),
                    "steps"_a = run.steps, "rejected"_a = run.rejected, "stages"_a = run.stages,
                    "iterations"_a = run.iterations, "unsolved"_a = run.unsolved,
                    "not_convex"_a = run.not_convex, "residual"_a = run.residual);
}

// --- the fault ---

[[nodiscard]] StrikeSlipFault make_fault(const py::dict& given)
{
    return StrikeSlipFault({.elements = in<int>(given, "elements"),
                            .side = in<double>(given, "side"),
                            .shear_modulus = in<double>(given, "shear_modulus"),
                            .poisson = in<double>(given, "poisson"),
                            .density = in<double>(given, "density"),
                            .damping = in<double>(given, "damping"),
                            .stress_gradient = in<double>(given, "stress_gradient"),
                            .residual_friction = in<double>(given, "residual_friction"),
                            .friction_drop = in<double>(given, "friction_drop"),
                            .slip_distance = in<double>(given, "slip_distance"),
                            .overload = in<double>(given, "overload"),
                            .medium = at<FaultMedium>(given, "medium"),
                            .mesh = at<FaultMesh>(given, "mesh"),
                            .kernel = in<std::filesystem::path>(given, "kernel"),
                            .memory_limit = in<double>(given, "memory_limit")});
}

[[nodiscard]] FaultFriction friction_of(const py::dict& given)
{
    FaultFriction out{.law = law_of(given),
                      .evolution = at<StateEvolution>(given, "evolution"),
                      .effect = at<DirectEffect>(given, "effect"),
                      .plate_velocity = in<double>(given, "plate_velocity"),
                      .normal_stress = in<double>(given, "normal_stress"),
                      .slip_rate = in<double>(given, "slip_rate"),
                      .overload = in<double>(given, "overload")};
    if (!given["theta"].is_none()) out.theta = in<double>(given, "theta");
    return out;
}

[[nodiscard]] RuptureOptions options_of(const py::dict& given)
{
    return {.t_end = in<double>(given, "t_end"),
            .step = in<double>(given, "step"),
            .rtol = in<double>(given, "rtol"),
            .polynomial_bound = in<double>(given, "polynomial_bound"),
            .snapshot_times = in<std::vector<double>>(given, "snapshot_times"),
            .max_steps = in<std::uint64_t>(given, "max_steps")};
}

/// Bathe's steps, with the rule of the command line of this name.
[[nodiscard]] BatheOptions bathe_of(const py::dict& given)
{
    BatheOptions out;
    if (in<bool>(given, "published")) out.first_stage = FirstStage::at_end;
    const auto controller = in<std::string>(given, "controller");
    if (controller == "constant") return out;
    out.rtol = in<double>(given, "rtol");
    if (controller == "error" || controller == "learned") {
        out.controller = ErrorStep{.order = 3, .reject_above = 100};
        out.estimate = ErrorEstimate::embedded;
        if (controller == "error") return out;
        auto policy =
            std::make_shared<const StepPolicy>(load_model(in<std::string>(given, "policy")));
        policy->require(fault_step_layout());
        out.controller = LearnedStep{.policy = std::move(policy)};
        return out;
    }
    out.estimate = ErrorEstimate::doubling;
    out.norm = FaultNorm::components;
    if (controller == "heuristic") out.controller = HeuristicStep{};
    if (controller == "pi") out.controller = FilteredStep::pi3333();
    if (controller == "filter") out.controller = FilteredStep::h211b(4);
    return out;
}

[[nodiscard]] py::dict counts_of(const RuptureStatistics& s)
{
    using namespace py::literals;
    return py::dict("steps"_a = s.steps, "rejected"_a = s.rejected, "evaluations"_a = s.evaluations,
                    "products"_a = s.products, "arrests"_a = s.arrests, "restarts"_a = s.restarts,
                    "solves"_a = s.solves, "iterations"_a = s.iterations, "asked"_a = s.asked,
                    "handed_over"_a = s.handed_over, "degree"_a = s.degree, "bound"_a = s.bound);
}

[[nodiscard]] py::dict dict_of(const Rupture& r)
{
    using namespace py::literals;
    py::list snapshots;
    for (const RuptureSnapshot& s : r.snapshots) {
        snapshots.append(py::make_tuple(s.t, array_of(s.slip), array_of(s.velocity)));
    }
    return py::dict(
        "outcome"_a = std::string(name(r.outcome)), "t"_a = r.t, "mean_slip"_a = r.mean_slip,
        "peak_velocity"_a = r.peak_velocity, "peak_time"_a = r.peak_time,
        "arrest_time"_a = r.arrest_time, "rest_time"_a = r.rest_time,
        "longest_step"_a = r.longest_step, "stable_step"_a = r.stable_step,
        "slip"_a = array_of(r.slip), "velocity"_a = array_of(r.velocity),
        "peak_velocity_of"_a = array_of(r.peak_velocity_of), "arrival"_a = array_of(r.arrival),
        "times"_a = array_of(r.times), "mean_slips"_a = array_of(r.mean_slips),
        "mean_velocities"_a = array_of(r.mean_velocities), "snapshots"_a = snapshots,
        "statistics"_a = counts_of(r.statistics));
}

/// @param bathe  None: explicit steps
py::dict rupture(const StrikeSlipFault& fault, const py::dict& given, const py::object& bathe)
{
    RuptureOptions options = options_of(given);
    std::optional<BatheOptions> implicit;
    if (!bathe.is_none()) implicit = bathe_of(py::cast<py::dict>(bathe));
    Rupture out;
    run_freely([&](const std::atomic<bool>& stopped) {
        options.progress = [&](double) { return !stopped; };
        out = implicit ? simulate(fault, options, *implicit) : simulate(fault, options);
    });
    return dict_of(out);
}

py::dict earthquakes(const StrikeSlipFault& fault, const py::dict& given, const py::dict& friction)
{
    RuptureOptions options = options_of(given);
    const RateStateOptions how{.order = in<int>(given, "order"),
                               .first_step = in<double>(given, "first_step"),
                               .threshold = in<double>(given, "threshold")};
    const FaultFriction law = friction_of(friction);
    RateStateRupture run;
    run_freely([&](const std::atomic<bool>& stopped) {
        options.progress = [&](double) { return !stopped; };
        run = simulate(fault, options, law, how);
    });
    py::array list =
        python::new_array<double>({static_cast<py::ssize_t>(run.earthquakes.size()), 4});
    auto* to = static_cast<double*>(list.mutable_data());
    for (const FaultEarthquake& e : run.earthquakes) {
        for (const double number : {e.start, e.end, e.mean_slip, e.largest_velocity})
            *to++ = number;
    }
    py::dict out = dict_of(run.rupture);
    out["xi"] = array_of(run.xi);
    out["earthquakes"] = list;
    out["residual"] = run.residual;
    out["unsolved"] = run.unsolved;
    out["inner"] = run.inner;
    out["handed_over"] = run.handed_over;
    out["step_times"] = array_of(run.step_times);
    out["fastest"] = array_of(run.fastest);
    out["elements_of_front"] = run.elements_of_front;
    return out;
}

// --- the fault as a system ---

void flow_of(std::uint32_t /*mode*/, double t, const double* x, double* dxdt, std::size_t n,
             void* user)
{
    const std::span<double> state(const_cast<double*>(x), n);  // of one type, and not written
    std::span<double> rate(dxdt, n);
    static_cast<const RateStateFaultSystem*>(user)->flow(t, state, rate);
}

void jacobian_of(std::uint32_t /*mode*/, double t, const double* x, double* rows, std::size_t n,
                 void* user)
{
    static_cast<const RateStateFaultSystem*>(user)->jacobian(t, std::span<const double>(x, n),
                                                             {rows, n * n});
}

[[nodiscard]] std::uintptr_t address(const void* of) noexcept
{
    return reinterpret_cast<std::uintptr_t>(of);
}

[[nodiscard]] std::span<const double> state_in(const Numbers& x)
{
    return {x.data(), static_cast<std::size_t>(x.size())};
}

}  // namespace

PYBIND11_MODULE(_faults, module)
{
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const ModelError& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        }
    });
    module.def("evaluate", &evaluate_law);
    module.def("critical_stiffness",
               [](const py::dict& law, double mass, double normal_force, double v) {
                   const RateStateParameters p = law_of(law);
                   validate(p);
                   return critical_stiffness(p, mass, normal_force, v);
               });
    module.def("largest_convex_step", [](const py::dict& law, const py::dict& block) {
        const SpringBlock of = block_of(block);
        validate(of);
        return largest_convex_step(law_of(law), of);
    });
    module.def("run_slider", &run_the_slider);
    py::class_<StrikeSlipFault, std::shared_ptr<StrikeSlipFault>>(module, "Fault")
        .def(py::init(&make_fault))
        .def_property_readonly("factor", &StrikeSlipFault::factor)
        .def_property_readonly("share", &StrikeSlipFault::share)
        .def_property_readonly("time_unit", &StrikeSlipFault::time_unit)
        .def("depth", &StrikeSlipFault::depth)
        .def("rupture", &rupture)
        .def("earthquakes", &earthquakes);
    py::class_<RateStateFaultSystem, std::shared_ptr<RateStateFaultSystem>>(module, "FaultSystem")
        .def(py::init([](const StrikeSlipFault& fault, const py::dict& friction, double bound) {
            return std::make_shared<RateStateFaultSystem>(fault, friction_of(friction), bound);
        }))
        .def_property_readonly_static(
            "flow", [](const py::object&) { return address(reinterpret_cast<void*>(&flow_of)); })
        .def_property_readonly_static(
            "jacobian",
            [](const py::object&) { return address(reinterpret_cast<void*>(&jacobian_of)); })
        .def_property_readonly("user",
                               [](const RateStateFaultSystem& self) { return address(&self); })
        .def("start", [](const RateStateFaultSystem& self) { return array_of(self.start()); })
        .def("slip", [](const RateStateFaultSystem& self, double t,
                        const Numbers& x) { return array_of(self.slip(t, state_in(x))); })
        .def("velocity", [](const RateStateFaultSystem& self, const Numbers& x) {
            return array_of(self.velocity(state_in(x)));
        });
}
