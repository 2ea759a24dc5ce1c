#include "results.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "ricochet/run.hpp"

namespace ricochet::python {

namespace {

[[nodiscard]] py::dtype make_event_type(std::size_t width)
{
    py::list names, formats, offsets;
    const auto add = [&](const char* name, const std::string& format, std::size_t offset) {
        names.append(name);
        formats.append(format);
        offsets.append(offset);
    };
    const std::string states = "(" + std::to_string(width) + ",)f8";
    add("t", "f8", offsetof(EventHead, t));
    add("guard", "i8", offsetof(EventHead, guard));
    add("bracket", "(2,)f8", offsetof(EventHead, bracket));
    add("slope", "f8", offsetof(EventHead, slope));
    add("error", "f8", offsetof(EventHead, error));
    add("mode_before", "u4", offsetof(EventHead, mode_before));
    add("mode_after", "u4", offsetof(EventHead, mode_after));
    add("kind", "u1", offsetof(EventHead, kind));
    add("late", "?", offsetof(EventHead, late));
    add("reaction", "i4", offsetof(EventHead, reaction));
    add("before", states, sizeof(EventHead));
    add("after", states, sizeof(EventHead) + 8 * width);
    return py::dtype(names, formats, offsets,
                     static_cast<py::ssize_t>(sizeof(EventHead) + 16 * width));
}

/// NumPy type of events with states of `width` components; cached, since NumPy is slow to make it.
[[nodiscard]] py::dtype event_type(std::size_t width)
{
    // Never destroyed: the interpreter may be gone by then.
    static auto& made = *new std::map<std::size_t, py::dtype>;
    const auto known = made.find(width);
    if (known != made.end()) return known->second;
    return made.emplace(width, make_event_type(width)).first->second;
}
using Counts = std::array<std::uint64_t, sizeof(Statistics) / sizeof(std::uint64_t)>;

[[nodiscard]] py::object statistics_of(const Record& record)
{
    const Statistics& s = record.statistics;
    static const auto& space =
        *new py::object(py::module_::import("types").attr("SimpleNamespace"));
    using namespace py::literals;
    const py::object evidence =
        space("proved"_a = s.evidence.proved, "checked"_a = s.evidence.checked,
              "gated"_a = s.evidence.gated, "assumed"_a = s.evidence.assumed);
    py::dict counts;
    const auto add = [&](const char* name, std::uint64_t count) { counts[name] = count; };
    add("steps", s.steps);
    add("rejected", s.rejected);
    add("refined_steps", s.refined_steps);
    add("unresolved_steps", s.unresolved_steps);
    add("resteps", s.resteps);
    add("flow_calls", s.flow_calls);
    add("jacobians", record.jacobians);
    add("factorizations", record.factorizations);
    add("guard_calls", s.guard_calls);
    add("checks_deferred", s.checks_deferred);
    add("checks_put_off", s.checks_deferred);  // its name before version 0.2
    add("bound_calls", s.bound_calls);
    add("rollbacks", s.rollbacks);
    add("repeated_steps", s.repeated_steps);
    add("events", s.events);
    add("suppressed", s.suppressed);
    add("disabled", s.disabled);
    add("unmet_conditions", s.unmet_conditions);
    add("ineffective_resets", s.ineffective_resets);
    add("either_relays", s.either_relays);
    const auto add_guard = [&](const char* name, std::size_t guard) {
        counts[name] = guard == no_guard ? py::object(py::none()) : py::object(py::int_(guard));
    };
    add_guard("declined_guard", s.declined_guard);
    add_guard("relay_guard", s.relay_guard);
    add("armed_beyond", s.armed_beyond);
    counts["evidence"] = evidence;
    return space(**counts);
}

[[nodiscard]] py::object contact_of(const Record& record)
{
    if (!record.contact) return py::none();
    static const auto& space =
        *new py::object(py::module_::import("types").attr("SimpleNamespace"));
    using namespace py::literals;
    const ContactCounts& c = *record.contact;
    py::object failure = py::none();
    if (c.failed) failure = space("contact"_a = c.contact, "residual"_a = c.residual);
    return space("steps"_a = c.steps, "problems"_a = c.problems, "iterations"_a = c.iterations,
                 "sweeps"_a = c.sweeps, "unsolved"_a = c.unsolved, "to_contact"_a = c.to_contact,
                 "to_flight"_a = c.to_flight, "time"_a = c.time, "failure"_a = failure);
}

[[nodiscard]] py::object pickled(const std::optional<ContactCounts>& counts)
{
    if (!counts) return py::none();
    const ContactCounts& c = *counts;
    return py::make_tuple(c.steps, c.problems, c.iterations, c.sweeps, c.unsolved, c.to_contact,
                          c.to_flight, c.time, c.failed, c.contact, c.residual);
}

[[nodiscard]] std::optional<ContactCounts> contact_from(const py::object& state)
{
    if (state.is_none()) return std::nullopt;
    const py::tuple of = py::cast<py::tuple>(state);
    const auto count = [&](std::size_t i) { return py::cast<std::uint64_t>(of[i]); };
    return ContactCounts{.steps = count(0),
                         .problems = count(1),
                         .iterations = count(2),
                         .sweeps = count(3),
                         .unsolved = count(4),
                         .to_contact = count(5),
                         .to_flight = count(6),
                         .time = py::cast<double>(of[7]),
                         .failed = py::cast<bool>(of[8]),
                         .contact = py::cast<int>(of[9]),
                         .residual = py::cast<double>(of[10])};
}

[[nodiscard]] py::bytes bytes_of(const std::vector<double>& numbers)
{
    return py::bytes(reinterpret_cast<const char*>(numbers.data()),
                     numbers.size() * sizeof(double));
}

[[nodiscard]] std::vector<double> numbers_of(const py::bytes& bytes)
{
    const std::string_view text = bytes;
    if (text.size() % sizeof(double) != 0) throw py::value_error("found a pickle that was cut");
    std::vector<double> out(text.size() / sizeof(double));
    std::memcpy(out.data(), text.data(), text.size());
    return out;
}

[[nodiscard]] py::tuple pickled(const PySolution& self)
{
    Snapshot numbers;
    self.solution->visit(detail::SnapshotWriter(numbers));
    return py::make_tuple(bytes_of(numbers.numbers), numbers.counts, self.modes);
}

[[nodiscard]] PySolution solution_from(const py::tuple& state)
{
    if (state.size() != 3) throw py::value_error("found a pickle of another version");
    Snapshot numbers;
    numbers.numbers = numbers_of(state[0]);
    numbers.counts = py::cast<std::vector<std::uint64_t>>(state[1]);
    PySolution out{.solution = std::make_shared<Solution<State>>(), .modes = state[2]};
    detail::SnapshotReader reader(numbers);
    out.solution->visit(reader);
    reader.finish();
    return out;
}

[[nodiscard]] py::list listed(const std::vector<MotionPhase>& phases)
{
    py::list out;
    for (const MotionPhase& phase : phases) {
        const std::string cause(name(phase.cause));
        out.append(py::make_tuple(phase.from, phase.set_valued, cause));
    }
    return out;
}

[[nodiscard]] py::list pickled(const std::vector<MotionPhase>& phases)
{
    py::list out;
    for (const MotionPhase& phase : phases) {
        out.append(py::make_tuple(phase.from, phase.set_valued, static_cast<int>(phase.cause)));
    }
    return out;
}

[[nodiscard]] py::tuple pickled(const PyRun& self)
{
    const Record& r = self.record;
    return py::make_tuple(
        static_cast<int>(r.outcome), r.t, r.x, r.mode, r.guard, r.other_guard,
        std::bit_cast<Counts>(r.statistics), r.width, r.event_count, bytes_of(r.events),
        bytes_of(r.times), bytes_of(r.states), r.wrong_bound,
        r.solution ? py::object(pickled(PySolution{r.solution})) : py::object(py::none()),
        self.modes, self.guard_names, r.reason, r.armed_beyond, pickled(r.phases),
        bytes_of(r.reaction), bytes_of(r.reactions), r.armed_on_surface, r.jacobians,
        r.factorizations, pickled(r.contact));
}

[[nodiscard]] PyRun run_from(const py::tuple& state)
{
    if (state.size() != 25) throw py::value_error("found a pickle of another version");
    PyRun out;
    Record& r = out.record;
    r.outcome = static_cast<Outcome>(py::cast<int>(state[0]));
    r.t = py::cast<double>(state[1]);
    r.x = py::cast<std::vector<double>>(state[2]);
    r.mode = py::cast<Mode>(state[3]);
    r.guard = py::cast<std::int64_t>(state[4]);
    r.other_guard = py::cast<std::int64_t>(state[5]);
    r.statistics = std::bit_cast<Statistics>(py::cast<Counts>(state[6]));
    r.width = py::cast<std::size_t>(state[7]);
    r.event_count = py::cast<std::size_t>(state[8]);
    r.events = numbers_of(state[9]);
    r.times = numbers_of(state[10]);
    r.states = numbers_of(state[11]);
    if (r.events.size() != r.event_count * r.event_stride() ||
        r.states.size() != r.times.size() * r.width) {
        throw py::value_error("found a pickle of a run that does not fit together");
    }
    r.wrong_bound = py::cast<std::string>(state[12]);
    if (!state[13].is_none()) r.solution = solution_from(state[13]).solution;
    out.modes = state[14];
    out.guard_names = py::cast<std::vector<std::string>>(state[15]);
    r.reason = py::cast<std::string>(state[16]);
    r.armed_beyond = py::cast<std::vector<std::size_t>>(state[17]);
    for (const py::handle phase : py::cast<py::list>(state[18])) {
        const py::tuple of = py::cast<py::tuple>(phase);
        r.phases.push_back({py::cast<double>(of[0]), py::cast<bool>(of[1]),
                            static_cast<PhaseCause>(py::cast<int>(of[2]))});
    }
    r.reaction = numbers_of(state[19]);
    r.reactions = numbers_of(state[20]);
    r.armed_on_surface = py::cast<std::vector<std::size_t>>(state[21]);
    r.jacobians = py::cast<std::uint64_t>(state[22]);
    r.factorizations = py::cast<std::uint64_t>(state[23]);
    r.contact = contact_from(state[24]);
    if (!r.times.empty()) r.reaction_width = r.reactions.size() / r.times.size();
    return out;
}

}  // namespace

py::array PySolution::at(const py::object& t, bool before) const
{
    const auto evaluate = [&](double time) {
        if (std::isnan(time)) throw py::value_error("t: found nan, expected numbers");
        return before ? solution->before(time) : (*solution)(time);
    };
    if (py::isinstance<py::array>(t) && py::array(t).dtype().kind() == 'c') {
        throw py::type_error("t: found complex numbers, expected real ones");
    }
    const py::array_t<double, py::array::c_style | py::array::forcecast> times(t);
    if (times.ndim() == 0) {
        return array_of(evaluate(*times.data()));
    }
    if (times.ndim() != 1) {
        throw py::value_error("t: found " + std::to_string(times.ndim()) +
                              " dimensions, expected a number or one dimension");
    }
    std::vector<State> states;
    std::size_t width = 0;
    for (py::ssize_t k = 0; k < times.size(); ++k) {
        states.push_back(evaluate(times.data()[k]));
        width = std::max(width, states.back().size());
    }
    if (states.empty()) width = evaluate(solution->time(0)).size();
    py::array columns = new_array<double>({static_cast<py::ssize_t>(width), times.size()});
    auto* at = static_cast<double*>(columns.mutable_data());
    for (std::size_t i = 0; i < width; ++i) {
        for (const State& x : states) {
            *at++ = i < x.size() ? x[i] : std::numeric_limits<double>::quiet_NaN();
        }
    }
    return columns;
}

py::array events_of(const Record& record, const py::handle& owner)
{
    return view_of(event_type(record.width), {static_cast<py::ssize_t>(record.event_count)},
                   {static_cast<py::ssize_t>(8 * record.event_stride())}, record.events.data(),
                   owner);
}

py::array new_events(std::size_t width, std::size_t count)
{
    return {event_type(width),
            {static_cast<py::ssize_t>(count)},
            {static_cast<py::ssize_t>(sizeof(EventHead) + 2 * width * sizeof(double))}};
}

void raise_with(const PythonError& error, PyRun&& run)
{
    const py::object attached = py::cast(std::move(run));
    if (PyObject_SetAttrString(error.value(), "ricochet_run", attached.ptr()) != 0) PyErr_Clear();
    error.restore();
    throw py::error_already_set();
}

py::object modes_of(const Source& source, const py::object& given)
{
    if (!given.is_none()) return given;
    const std::vector<std::string> names = source.mode_names();
    return names.empty() ? py::object(py::none()) : py::object(py::cast(names));
}

namespace {

/// A sentence about the outcome, with the names that Python has for functions and guards.
[[nodiscard]] std::string message_of(const PyRun& self)
{
    const Record& r = self.record;
    std::string out = detail::describe_run(r.outcome, r.reason, {}, {});
    const bool conflicts = r.outcome == Outcome::conflicting_resets;
    if (conflicts) {
        constexpr std::string_view in_cpp = "reset(fired, t, x)";
        if (const auto at = out.find(in_cpp); at != std::string::npos) {
            out.replace(at, in_cpp.size(), "reset_set(t, x, fired)");
        }
    }
    const bool in_turn = r.outcome == Outcome::zeno && r.other_guard >= 0;
    if (conflicts || in_turn) {
        const auto named = [&](std::int64_t guard) {
            const auto which = static_cast<std::size_t>(guard);
            return which < self.guard_names.size() ? self.guard_names[which] : "a time event";
        };
        out += ": " + named(r.guard) + ", " + named(r.other_guard);
    }
    if (!r.wrong_bound.empty()) out += ": " + r.wrong_bound;
    const std::vector<std::size_t>& on = r.armed_on_surface;
    const auto add = [&](bool on_surface, std::string_view before) {
        for (const std::size_t which : r.armed_beyond) {
            if (std::binary_search(on.begin(), on.end(), which) != on_surface) continue;
            const bool named = which < self.guard_names.size();
            out += std::string(std::exchange(before, ", ")) +
                   (named ? self.guard_names[which] : "a velocity under dry friction");
        }
    };
    add(false,
        "; began beyond their surface, and waited until they had returned (at_start "
        "and at_entry let them fire there): ");
    add(true,
        "; began on their surface and moved on beyond it, which is no event "
        "(unilateral and at_start give them one; a start from what a run has left at "
        "rest is held again by continues): ");
    const std::string more = describe(r.statistics, self.guard_names);
    return more.empty() ? out : out + "; " + more;
}

void bind_solution(py::module_& module)
{
    py::class_<PySolution, std::shared_ptr<PySolution>>(
        module, "Solution",
        "The solution at any time: called with a time, or an array of them, it gives the state, or "
        "states as columns; at an event those after it.")
        .def("__call__",
             [](const PySolution& self, const py::object& t) { return self.at(t, false); })
        .def(
            "before", [](const PySolution& self, const py::object& t) { return self.at(t, true); },
            "The state before an event at t; else as a call.")
        .def(
            "mode",
            [](const PySolution& self, double t) {
                const PyRun names{.record = {}, .modes = self.modes, .guard_names = {}};
                return names.mode_named(self.solution->mode(t));
            },
            "The mode at t, after an event there.")
        .def_property_readonly(
            "ts",
            [](const PySolution& self) {
                std::vector<double> times;
                for (std::size_t k = 0; k <= self.solution->size(); ++k) {
                    times.push_back(self.solution->time(k));
                }
                return array_of(times);
            },
            "When the steps start, and the end of the last.")
        .def_property_readonly(
            "t_min",
            [](const PySolution& self) {
                const auto& solution = *self.solution;
                return std::min(solution.time(0), solution.time(solution.size()));
            },
            "The earlier end of the solution.")
        .def_property_readonly(
            "t_max",
            [](const PySolution& self) {
                const auto& solution = *self.solution;
                return std::max(solution.time(0), solution.time(solution.size()));
            },
            "The later end of the solution.")
        .def(py::pickle([](const PySolution& self) { return pickled(self); },
                        [](const py::tuple& state) { return solution_from(state); }));
}

using RunClass = py::class_<PyRun, std::shared_ptr<PyRun>>;

[[nodiscard]] const Record& record_in(const py::object& self)
{
    return py::cast<const PyRun&>(self).record;
}

/// The outcome, and where the run ended.
void bind_end(RunClass& run)
{
    run.def_property_readonly(
           "outcome", [](const PyRun& self) { return std::string(name(self.record.outcome)); },
           "How the run ended, e.g. 'reached_end' or 'zeno'.")
        .def_property_readonly(
            "message", &message_of,
            "A sentence about the outcome, about guards that began beyond their surface, and on "
            "resets that declined.")
        .def_property_readonly(
            "reason", [](const PyRun& self) { return self.record.reason; },
            "The text of the `Stop` that ended the run, a sentence about reactions that did, the "
            "function that was not finite, or an empty text.")
        .def_property_readonly(
            "success",
            [](const PyRun& self) {
                return self.record.outcome == Outcome::reached_end ||
                       self.record.outcome == Outcome::stopped_by_event;
            },
            "Whether the run reached its end, or an event that ends it.")
        .def_property_readonly(
            "t", [](const PyRun& self) { return self.record.t; }, "The time reached.")
        .def_property_readonly(
            "x",
            [](const py::object& self) {
                const Record& r = record_in(self);
                return view_of(r.x.data(), {static_cast<py::ssize_t>(r.x.size())}, self);
            },
            "The state at that time.")
        .def_property_readonly(
            "mode", [](const PyRun& self) { return self.mode_named(self.record.mode); },
            "The mode at that time.")
        .def_property_readonly(
            "guard",
            [](const PyRun& self) -> py::object {
                if (self.record.guard < 0) return py::none();
                return py::int_(self.record.guard);
            },
            "The number of the guard that ended the run, or None.")
        .def_property_readonly(
            "other_guard",
            [](const PyRun& self) -> py::object {
                constexpr auto on_time = static_cast<std::int64_t>(time_event_reset);
                if (self.record.other_guard == on_time) return py::int_(-1);
                if (self.record.other_guard < 0) return py::none();
                return py::int_(self.record.other_guard);
            },
            "The guard of the second of two conflicting resets, -1 for a time event; another guard "
            "of "
            "a cycle that accumulates; or None.");
}

/// The phases and reactions of a system with set-valued motion.
void bind_reactions(RunClass& run)
{
    run.def_property_readonly(
           "phases", [](const PyRun& self) { return listed(self.record.phases); },
           "Of a system with set_valued: tuples of the time from which a phase lasts, whether "
           "something is held or followed by implicit steps in it, and why it began. Of a "
           "mechanism: whether it is in contact.")
        .def_property_readonly(
            "contact", [](const PyRun& self) { return contact_of(self.record); },
            "Of a mechanism: counts of its motion in contact (steps, problems, iterations, sweeps, "
            "unsolved, to_contact, to_flight), its time [s], and failure: None, or the contact and "
            "the residual of the problem that was not solved.")
        .def_property_readonly(
            "reaction",
            [](const py::object& self) {
                const Record& r = record_in(self);
                return view_of(r.reaction.data(), {static_cast<py::ssize_t>(r.reaction.size())},
                               self);
            },
            "Of a system with set_valued: the reactions at the end, after its events; empty where "
            "the mode has no inclusion, NaN where none follows from the state. Of a mechanism: the "
            "forces [N] of the contacts, the normal one of each first, and of dry friction of each "
            "coordinate, means over the last step.")
        .def_property_readonly(
            "reactions",
            [](const py::object& self) {
                const Record& r = record_in(self);
                return view_of(r.reactions.data(),
                               {static_cast<py::ssize_t>(r.times.size()),
                                static_cast<py::ssize_t>(r.reaction_width)},
                               self);
            },
            "The same at `times`, in rows; NaN in modes without an inclusion.");
}

/// The events, the samples and the counts of the run.
void bind_records(RunClass& run)
{
    run.def_property_readonly(
           "statistics", [](const PyRun& self) { return statistics_of(self.record); },
           "What the run did, counted; its evidence says why steps were taken to hold no event.")
        .def_property_readonly(
            "events", [](const py::object& self) { return events_of(record_in(self), self); },
            "The events, as a structured array with the fields t, guard, bracket, slope, error, "
            "mode_before, mode_after, kind, late, reaction, before, after.")
        .def_property_readonly(
            "event_modes",
            [](const PyRun& self) {
                py::list modes;
                const Record& r = self.record;
                for (std::size_t i = 0; i < r.event_count; ++i) {
                    EventHead head;
                    std::memcpy(&head, r.events.data() + i * r.event_stride(), sizeof head);
                    modes.append(py::make_tuple(self.mode_named(head.mode_before),
                                                self.mode_named(head.mode_after)));
                }
                return modes;
            },
            "The modes before and after each event, by name where the system names them.")
        .def_property_readonly(
            "times",
            [](const py::object& self) {
                const Record& r = record_in(self);
                return view_of(r.times.data(), {static_cast<py::ssize_t>(r.times.size())}, self);
            },
            "The times of `states`: sample times, or the ends of steps.")
        .def_property_readonly(
            "states",
            [](const py::object& self) {
                const Record& r = record_in(self);
                return view_of(
                    r.states.data(),
                    {static_cast<py::ssize_t>(r.times.size()), static_cast<py::ssize_t>(r.width)},
                    self);
            },
            "States, one a row; shorter ones end in NaN.")
        .def_property_readonly(
            "solution",
            [](const PyRun& self) -> py::object {
                if (!self.record.solution) return py::none();
                return py::cast(PySolution{self.record.solution, self.modes});
            },
            "The solution at any time, or None where it was not kept.");
}

void bind_run(py::module_& module)
{
    RunClass run(module, "Run", "What a run has computed; its arrays are views of it.");
    run.def("__repr__",
            [](const PyRun& self) {
                return "<Run: " + std::string(name(self.record.outcome)) +
                       " at t = " + py::str(py::float_(self.record.t)).cast<std::string>() + ", " +
                       std::to_string(self.record.statistics.events) + " events>";
            })
        .def_readonly("modes", &PyRun::modes, "What the modes are called, or None.")
        .def_readonly("guard_names", &PyRun::guard_names, "What the guards are called.")
        .def(py::pickle([](const PyRun& self) { return pickled(self); },
                        [](const py::tuple& state) { return run_from(state); }));
    bind_end(run);
    bind_reactions(run);
    bind_records(run);
}

void bind_snapshot(py::module_& module)
{
    py::class_<Snapshot>(module, "Snapshot", "A simulation, saved.")
        .def_property_readonly(
            "text", [](const Snapshot& self) { return to_text(self); },
            "The snapshot as text, with a checksum.")
        .def_static(
            "from_text", [](const std::string& text) { return snapshot_from_text(text); },
            "The snapshot that was written as this text.")
        .def("__eq__", [](const Snapshot& self, const Snapshot& other) { return self == other; })
        .def(py::pickle([](const Snapshot& self) { return to_text(self); },
                        [](const std::string& text) { return snapshot_from_text(text); }));
}

}  // namespace

void bind_results(py::module_& module)
{
    bind_solution(module);
    bind_run(module);
    bind_snapshot(module);
}

}  // namespace ricochet::python
