// The module `_ricochet`; what users call is in python/ricochet/.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "callbacks.hpp"
#include "ready.hpp"
#include "record.hpp"
#include "request.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/integrate/outcome.hpp"
#include "ricochet/integrate/snapshot.hpp"
#include "source.hpp"

namespace py = pybind11;

namespace ricochet::python {

namespace {

using Loop = detail::AnyLoop<State>;

// --- what is asked ---

[[nodiscard]] MethodName method_named(const std::string& name)
{
    if (name == "dopri5") return MethodName::dopri5;
    if (name == "fehlberg78") return MethodName::fehlberg78;
    if (name == "cash-karp54") return MethodName::cash_karp54;
    if (name == "rk4") return MethodName::rk4;
    if (name == "euler") return MethodName::euler;
    throw py::value_error("found '" + name +
                          "', expected 'dopri5', 'fehlberg78', 'cash-karp54', 'rk4' or 'euler'");
}

[[nodiscard]] std::string_view one_of(const std::string& name,
                                      std::initializer_list<std::string_view> known)
{
    for (const std::string_view candidate : known) {
        if (candidate == name) return candidate;
    }
    throw py::value_error("found '" + name + "', expected one of those in the documentation");
}

using Setter = void (*)(Request&, const py::handle&);

template <auto member>
void set(Request& request, const py::handle& value)
{
    using T = std::remove_cvref_t<decltype(request.options.*member)>;
    request.options.*member = py::cast<T>(value);
}

[[nodiscard]] const std::map<std::string, Setter, std::less<>>& setters()
{
    static const std::map<std::string, Setter, std::less<>> all{
        {"t_start", &set<&Options::t_start>},
        {"t_end", &set<&Options::t_end>},
        {"mode", &set<&Options::mode>},
        {"step", &set<&Options::step>},
        {"rtol", &set<&Options::rtol>},
        {"atol", &set<&Options::atol>},
        {"h_min", &set<&Options::h_min>},
        {"h_max", &set<&Options::h_max>},
        {"event_tolerance", &set<&Options::event_tolerance>},
        {"event_rtol", &set<&Options::event_rtol>},
        {"event_window", &set<&Options::event_window>},
        {"look_inside", &set<&Options::look_inside>},
        {"stop_at_event", &set<&Options::stop_at_event>},
        {"record_events", &set<&Options::record_events>},
        {"event_states", &set<&Options::event_states>},
        {"sample_times", &set<&Options::sample_times>},
        {"max_steps", &set<&Options::max_steps>},
        {"stall_steps", &set<&Options::stall_steps>},
        {"method",
         [](Request& request, const py::handle& value) {
             request.method = method_named(py::cast<std::string>(value));
         }},
        {"fixed",
         [](Request& request, const py::handle& value) { request.fixed = py::cast<bool>(value); }},
        {"detector",
         [](Request& request, const py::handle& value) {
             request.detector =
                 one_of(py::cast<std::string>(value), {"extremum", "ends", "bernstein", "planned"});
         }},
        {"locator",
         [](Request& request, const py::handle& value) {
             request.locator =
                 one_of(py::cast<std::string>(value), {"newton", "bisection", "toms748"});
         }},
        {"record_steps",
         [](Request& request, const py::handle& value) {
             request.record_steps = py::cast<bool>(value);
         }},
        {"dense",
         [](Request& request, const py::handle& value) {
             request.dense = request.options.record_steps = py::cast<bool>(value);
         }},
        {"scale",
         [](Request& request, const py::handle& value) {
             request.scale = py::cast<std::vector<double>>(value);
         }},
    };
    return all;
}

[[nodiscard]] Request request_from(const py::dict& given)
{
    Request request;
    for (const auto& [key, value] : given) {
        const auto name = py::cast<std::string>(key);
        const auto setter = setters().find(name);
        if (setter == setters().end()) {
            std::string known;
            for (const auto& [option, set] : setters()) {
                if (option != "scale") known += (known.empty() ? "" : ", ") + option;
            }
            throw py::type_error("found an option '" + name + "', expected some of " + known);
        }
        try {
            setter->second(request, value);
        } catch (const py::cast_error&) {
            throw py::type_error(
                name + ": found " + py::cast<std::string>(py::repr(value)) + ", a " +
                py::cast<std::string>(py::str(py::type::of(value).attr("__name__"))));
        } catch (const py::value_error& error) {
            throw py::value_error(name + ": " + error.what());
        }
    }
    return request;
}

// --- what is returned ---

/// Memory of `owner` as an array that is not to be written to.
[[nodiscard]] py::array view(const py::dtype& type, std::vector<py::ssize_t> shape,
                             std::vector<py::ssize_t> strides, const void* data, py::handle owner)
{
    py::array out(type, std::move(shape), std::move(strides), data, owner);
    py::detail::array_proxy(out.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
    return out;
}

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
    add("before", states, sizeof(EventHead));
    add("after", states, sizeof(EventHead) + 8 * width);
    return py::dtype(names, formats, offsets,
                     static_cast<py::ssize_t>(sizeof(EventHead) + 16 * width));
}

/// The type of events with states of `width` components; made once, since NumPy takes its time.
[[nodiscard]] py::dtype event_type(std::size_t width)
{
    // Never destroyed: the interpreter may be gone by then.
    static auto& made = *new std::map<std::size_t, py::dtype>;
    const auto known = made.find(width);
    if (known != made.end()) return known->second;
    return made.emplace(width, make_event_type(width)).first->second;
}

/// A record with the names that belong to it.
struct PyRun {
    Record record;
    py::object modes = py::none();  ///< a list, or None
    std::vector<std::string> guard_names;

    [[nodiscard]] py::object mode_named(Mode mode) const
    {
        if (modes.is_none()) return py::int_(mode);
        const py::list names(modes);
        return mode < names.size() ? py::object(names[mode]) : py::object(py::int_(mode));
    }
};

/// The solution at any time, with states as users have them.
struct PySolution {
    std::shared_ptr<Solution<State>> solution;
    std::vector<double> scale;
    py::object modes = py::none();

    [[nodiscard]] py::array at(const py::object& t, bool before) const
    {
        const auto evaluate = [&](double time) {
            State x = before ? solution->before(time) : (*solution)(time);
            put_state(State(x), scale, x.size(), x.data());
            return x;
        };
        const py::array_t<double, py::array::c_style | py::array::forcecast> times(t);
        if (times.ndim() == 0) {
            const State x = evaluate(*times.data());
            return py::array_t<double>(static_cast<py::ssize_t>(x.size()), x.data());
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
        const auto rows = static_cast<py::ssize_t>(width);
        py::array_t<double> numbers({rows, times.size()});
        for (py::ssize_t k = 0; k < times.size(); ++k) {
            const State& x = states[static_cast<std::size_t>(k)];
            for (py::ssize_t i = 0; i < rows; ++i) {
                const auto c = static_cast<std::size_t>(i);
                numbers.mutable_at(i, k) =
                    c < x.size() ? x[c] : std::numeric_limits<double>::quiet_NaN();
            }
        }
        return py::array(std::move(numbers));
    }
};

using Counts = std::array<std::uint64_t, sizeof(Statistics) / sizeof(std::uint64_t)>;

[[nodiscard]] py::object statistics_of(const Statistics& s)
{
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
    add("guard_calls", s.guard_calls);
    add("checks_put_off", s.checks_put_off);
    add("bound_calls", s.bound_calls);
    add("rollbacks", s.rollbacks);
    add("repeated_steps", s.repeated_steps);
    add("events", s.events);
    add("suppressed", s.suppressed);
    add("disabled", s.disabled);
    counts["evidence"] = evidence;
    return space(**counts);
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
    return py::make_tuple(bytes_of(numbers.numbers), numbers.counts, self.scale, self.modes);
}

[[nodiscard]] PySolution solution_from(const py::tuple& state)
{
    Snapshot numbers;
    numbers.numbers = numbers_of(state[0]);
    numbers.counts = py::cast<std::vector<std::uint64_t>>(state[1]);
    PySolution out{.solution = std::make_shared<Solution<State>>(), .scale = {}};
    detail::SnapshotReader reader(numbers);
    out.solution->visit(reader);
    reader.finish();
    out.scale = py::cast<std::vector<double>>(state[2]);
    out.modes = state[3];
    return out;
}

[[nodiscard]] py::tuple pickled(const PyRun& self)
{
    const Record& r = self.record;
    return py::make_tuple(
        static_cast<int>(r.outcome), r.t, r.x, r.mode, r.guard, r.other_guard,
        std::bit_cast<Counts>(r.statistics), r.width, r.event_count, bytes_of(r.events),
        bytes_of(r.times), bytes_of(r.states), r.wrong_bound,
        r.solution ? py::object(pickled(PySolution{r.solution, r.scale})) : py::object(py::none()),
        self.modes, self.guard_names);
}

[[nodiscard]] PyRun run_from(const py::tuple& state)
{
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
    if (!state[13].is_none()) {
        PySolution solution = solution_from(state[13]);
        r.solution = std::move(solution.solution);
        r.scale = std::move(solution.scale);
    }
    out.modes = state[14];
    out.guard_names = py::cast<std::vector<std::string>>(state[15]);
    return out;
}

// --- running ---

/// Goes to the end; the state at the end of every step into `steps` if there is one, both sides of
/// a reset.
void drive(Loop& loop, Trajectory<State>* steps)
{
    if (!steps) {
        while (!loop.ended()) loop.advance_once(true);
        return;
    }
    const auto push = [&](double t, const State& x) {
        if (x.empty() || (!steps->t.empty() && steps->t.back() == t && steps->x.back() == x)) {
            return;
        }
        steps->t.push_back(t);
        steps->x.push_back(x);
    };
    push(loop.t(), loop.x());
    std::size_t seen = loop.run().events.size();
    while (!loop.ended()) {
        loop.step();
        const auto& events = loop.run().events;
        for (; seen < events.size(); ++seen) {
            const auto& event = events[seen];
            if (event.t == loop.t() && event.before != event.after) {
                push(event.t, event.before);
                seen = events.size();
                break;
            }
        }
        push(loop.t(), loop.x());
    }
}

[[nodiscard]] State scaled(State x, const std::vector<double>& scale)
{
    for (std::size_t i = 0; i < std::min(scale.size(), x.size()); ++i) x[i] /= scale[i];
    return x;
}

/// Raises `error` with the run so far attached to it.
[[noreturn]] void raise_with(const PythonError& error, PyRun&& run)
{
    const py::object attached = py::cast(std::move(run));
    if (PyObject_SetAttrString(error.value(), "ricochet_run", attached.ptr()) != 0) PyErr_Clear();
    error.restore();
    throw py::error_already_set();
}

[[nodiscard]] py::object modes_of(const Source& source, const py::object& given)
{
    if (!given.is_none()) return given;
    const std::vector<std::string> names = source.mode_names();
    return names.empty() ? py::object(py::none()) : py::object(py::cast(names));
}

/// Does what needs no interpreter without it.
template <class Work>
void work_freely(bool freely, const Work& work)
{
    if (freely) {
        const py::gil_scoped_release others;
        work();
    } else {
        work();
    }
}

/// Before the first step.
[[nodiscard]] Record start_of(const State& x0, const Options& options)
{
    Record record;
    record.outcome = Outcome::cancelled;
    record.t = options.t_start;
    record.x = x0;
    record.width = x0.size();
    record.mode = options.mode;
    return record;
}

PyRun integrate(const std::shared_ptr<Source>& source, const State& x0, const py::dict& given,
                const py::object& mode_names)
{
    Request request = request_from(given);
    if (!given.contains("mode")) request.options.mode = source->start_mode();
    PyRun out{
        .record = {}, .modes = modes_of(*source, mode_names), .guard_names = source->guard_names()};

    SignalWatch watch;
    request.options.cancelled = watch.cancelled();
    std::optional<Record> whole;
    if (request.is_plain()) {
        work_freely(true, [&] { whole = source->run_whole(x0, request, watch); });
    }
    if (whole) {
        out.record = std::move(*whole);
        if (watch.raised()) raise_with(*watch.raised(), std::move(out));
        return out;
    }

    const std::unique_ptr<RunDoor> door = source->open(x0, request);
    request.options.cancelled = door->watch().cancelled();
    detail::RunSetup<State> setup = setup_for(request);
    setup.system = &door->table();
    setup.door = door->door();
    Trajectory<State> steps;
    Trajectory<State>* const kept = request.record_steps ? &steps : nullptr;
    std::unique_ptr<Loop> loop;
    try {
        loop = detail::make_loop(setup, scaled(x0, request.scale), request.options);
        work_freely(door->is_free(), [&] { drive(*loop, kept); });
    } catch (const PythonError& error) {
        out.record =
            loop ? record_of(loop->finish(), request.scale, kept) : start_of(x0, request.options);
        raise_with(error, std::move(out));
    }
    out.record = record_of(loop->finish(), request.scale, kept);
    if (door->watch().raised()) raise_with(*door->watch().raised(), std::move(out));
    return out;
}

/// A run driven by hand. One thread at a time.
class PySimulation {
public:
    PySimulation(std::shared_ptr<Source> source, const State& x0, const py::dict& given,
                 const py::object& mode_names)
        : source_(std::move(source)),
          request_(request_from(given)),
          names_{.record = {},
                 .modes = modes_of(*source_, mode_names),
                 .guard_names = source_->guard_names()}
    {
        if (!given.contains("mode")) request_.options.mode = source_->start_mode();
        door_ = source_->open(x0, request_);
        request_.options.cancelled = door_->watch().cancelled();
        detail::RunSetup<State> setup = setup_for(request_);
        setup.system = &door_->table();
        setup.door = door_->door();
        try {
            loop_ = detail::make_loop(setup, scaled(x0, request_.scale), request_.options);
        } catch (const PythonError& error) {
            PyRun run = names_;
            run.record = start_of(x0, request_.options);
            raise_with(error, std::move(run));
        }
    }

    bool step()
    {
        return use([&] { return loop_->step(); });
    }
    bool advance()
    {
        return use([&] { return loop_->advance(); });
    }
    [[nodiscard]] PyRun run_to_end()
    {
        use([&] {
            loop_->show_all();
            while (!loop_->ended()) loop_->advance_once(true);
            return true;
        });
        return finish();
    }
    [[nodiscard]] PyRun finish()
    {
        const Turn turn(*this);
        if (!finished_) {
            finished_.emplace(names_);
            finished_->record = record_of(loop_->finish(), request_.scale);
        }
        return *finished_;
    }

    [[nodiscard]] double t()
    {
        const Turn turn(*this);
        return loop_->t();
    }
    [[nodiscard]] py::array x()
    {
        const Turn turn(*this);
        State x = loop_->x();
        put_state(State(x), request_.scale, x.size(), x.data());
        return py::array_t<double>(static_cast<py::ssize_t>(x.size()), x.data());
    }
    [[nodiscard]] py::object mode()
    {
        const Turn turn(*this);
        return names_.mode_named(loop_->mode());
    }
    [[nodiscard]] bool ended()
    {
        const Turn turn(*this);
        return loop_->ended();
    }
    /// What has been computed so far.
    [[nodiscard]] PyRun so_far()
    {
        const Turn turn(*this);
        if (finished_) return *finished_;
        PyRun out = names_;
        Run<State> run = loop_->run();
        run.t = loop_->t();
        run.x = loop_->x();
        run.mode = loop_->mode();
        if (!loop_->ended()) run.outcome = Outcome::cancelled;
        out.record = record_of(std::move(run), request_.scale);
        return out;
    }

    [[nodiscard]] Snapshot save()
    {
        const Turn turn(*this);
        return loop_->save();
    }
    void restore(const Snapshot& snapshot)
    {
        const Turn turn(*this);
        if (finished_) throw std::runtime_error("Simulation: found finished, expected going on");
        loop_->restore(snapshot);
    }

private:
    /// One caller at a time.
    class Turn {
    public:
        explicit Turn(PySimulation& simulation) : simulation_(simulation)
        {
            if (simulation_.in_use_.exchange(true)) {
                throw std::runtime_error(
                    "Simulation: found in use, by another thread or by the callback that asks; "
                    "expected one caller at a time");
            }
        }
        Turn(const Turn&) = delete;
        Turn& operator=(const Turn&) = delete;
        ~Turn() { simulation_.in_use_ = false; }

    private:
        PySimulation& simulation_;
    };

    template <class Work>
    bool use(const Work& work)
    {
        const Turn turn(*this);
        if (finished_) return false;
        bool goes_on = false;
        try {
            work_freely(door_->is_free(), [&] { goes_on = work(); });
        } catch (const PythonError& error) {
            end_with(error);
        }
        if (const auto& raised = door_->watch().raised()) end_with(*raised);
        return goes_on;
    }

    [[noreturn]] void end_with(const PythonError& error)
    {
        finished_.emplace(names_);
        finished_->record = record_of(loop_->finish(), request_.scale);
        raise_with(error, PyRun(*finished_));
    }

    std::shared_ptr<Source> source_;
    Request request_;
    PyRun names_;
    std::unique_ptr<RunDoor> door_;
    std::unique_ptr<Loop> loop_;
    std::optional<PyRun> finished_;
    std::atomic<bool> in_use_ = false;
};

// --- the module ---

void bind_results(py::module_& module)
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
                return py::array_t<double>(static_cast<py::ssize_t>(times.size()), times.data());
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

    const auto self_of = [](const py::object& self) -> const PyRun& {
        return py::cast<const PyRun&>(self);
    };
    py::class_<PyRun, std::shared_ptr<PyRun>>(
        module, "Run", "What a run has computed; its arrays are views of it.")
        .def("__repr__",
             [](const PyRun& self) {
                 return "<Run: " + std::string(name(self.record.outcome)) + " at t = " +
                        py::str(py::float_(self.record.t)).cast<std::string>() + ", " +
                        std::to_string(self.record.statistics.events) + " events>";
             })
        .def_property_readonly(
            "outcome", [](const PyRun& self) { return std::string(name(self.record.outcome)); },
            "How the run ended, e.g. 'reached_end' or 'zeno'.")
        .def_property_readonly(
            "message",
            [](const PyRun& self) {
                std::string out(describe(self.record.outcome));
                if (!self.record.wrong_bound.empty()) out += ": " + self.record.wrong_bound;
                return out;
            },
            "A sentence about the outcome.")
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
            [self_of](const py::object& self) {
                const Record& r = self_of(self).record;
                return view(py::dtype::of<double>(), {static_cast<py::ssize_t>(r.x.size())}, {8},
                            r.x.data(), self);
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
                if (self.record.other_guard < 0) return py::none();
                return py::int_(self.record.other_guard);
            },
            "Of two conflicting resets the second, or None.")
        .def_readonly("modes", &PyRun::modes, "What the modes are called, or None.")
        .def_readonly("guard_names", &PyRun::guard_names, "What the guards are called.")
        .def_property_readonly(
            "statistics", [](const PyRun& self) { return statistics_of(self.record.statistics); },
            "What the run did, counted; its evidence says why steps were taken to hold no event.")
        .def_property_readonly(
            "events",
            [self_of](const py::object& self) {
                const Record& r = self_of(self).record;
                return view(event_type(r.width), {static_cast<py::ssize_t>(r.event_count)},
                            {static_cast<py::ssize_t>(8 * r.event_stride())}, r.events.data(),
                            self);
            },
            "The events, as a structured array with the fields t, guard, bracket, slope, error, "
            "mode_before, mode_after, kind, late, before, after.")
        .def_property_readonly(
            "times",
            [self_of](const py::object& self) {
                const Record& r = self_of(self).record;
                return view(py::dtype::of<double>(), {static_cast<py::ssize_t>(r.times.size())},
                            {8}, r.times.data(), self);
            },
            "The times of `states`: sample times, or the ends of steps.")
        .def_property_readonly(
            "states",
            [self_of](const py::object& self) {
                const Record& r = self_of(self).record;
                const auto width = static_cast<py::ssize_t>(r.width);
                return view(py::dtype::of<double>(),
                            {static_cast<py::ssize_t>(r.times.size()), width}, {8 * width, 8},
                            r.states.data(), self);
            },
            "States, one a row; shorter ones end in NaN.")
        .def_property_readonly(
            "solution",
            [](const PyRun& self) -> py::object {
                if (!self.record.solution) return py::none();
                return py::cast(PySolution{self.record.solution, self.record.scale, self.modes});
            },
            "The solution at any time, or None where it was not kept.")
        .def(py::pickle([](const PyRun& self) { return pickled(self); },
                        [](const py::tuple& state) { return run_from(state); }));

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

}  // namespace ricochet::python

PYBIND11_MODULE(_ricochet, module)
{
    using namespace ricochet::python;
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const PythonError& error) {
            error.restore();
        }
    });
    py::class_<Source, std::shared_ptr<Source>>(module, "Source")
        .def_property_readonly("guard_count",
                               [](const Source& self) { return self.guard_names().size(); });
    bind_results(module);
    module.def("ready_system", [](const std::string& name, const std::vector<double>& parameters) {
        return ready_system(name, parameters);
    });
    module.def("closed_form", [](const Source& system, const std::string& what,
                                 const std::vector<double>& arguments) {
        return closed_form(system, what, arguments);
    });
    module.def("callback_system", [](const py::dict& specification) {
        return std::shared_ptr<Source>(std::make_shared<CallbackSource>(specification.ptr()));
    });
    module.def("integrate", &integrate);
    py::class_<PySimulation>(module, "Simulation")
        .def(py::init<std::shared_ptr<Source>, const State&, const py::dict&, const py::object&>())
        .def("step", &PySimulation::step,
             "Takes one step, with whatever events it holds. False: the run has ended.")
        .def("advance", &PySimulation::advance,
             "Goes on to the next event or sample time. False: the run has ended.")
        .def("run_to_end", &PySimulation::run_to_end, "Goes on to the end, and returns the Run.")
        .def("finish", &PySimulation::finish, "Ends the run here, and returns what was computed.")
        .def("save", &PySimulation::save, "All that the future depends on, as a Snapshot.")
        .def(
            "restore", &PySimulation::restore,
            "Goes on where the snapshot of a run of the same system was taken, with the same bits.")
        .def_property_readonly("t", &PySimulation::t, "The time.")
        .def_property_readonly("x", &PySimulation::x, "The state, which may be kept.")
        .def_property_readonly("mode", &PySimulation::mode, "The mode.")
        .def_property_readonly("ended", &PySimulation::ended, "Whether the run has ended.")
        .def_property_readonly("run", &PySimulation::so_far,
                               "What has been computed so far, as a Run.");
}
