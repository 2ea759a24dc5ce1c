// Runs: in one call, or driven by the caller.

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "places.hpp"
#include "read_request.hpp"
#include "results.hpp"
#include "ricochet/detail/core.hpp"
#include "setup.hpp"
#include "turn.hpp"

namespace ricochet::python {

namespace {

using Loop = detail::AnyLoop<State>;

/// Runs a mechanism to its end; returns its forces at the sample times, those of the steps that
/// hold them.
[[nodiscard]] std::vector<std::vector<double>> forces_of(const RunLoop& loop)
{
    std::vector<std::vector<double>> rows;
    const auto& samples = loop->run().trajectory.t;
    const auto note = [&] {
        if (rows.size() < samples.size()) rows.resize(samples.size(), loop.reaction());
    };
    note();
    while (loop->step()) note();
    note();
    return rows;
}

/// Runs to the end. If `kept` is not null, appends the state at the end of every step to it, with
/// both sides of every reset.
void drive(const RunLoop& of, StepEnds<State>* kept)
{
    Loop& loop = *of;
    if (!kept) {
        loop.run_to_end();
        return;
    }
    Trajectory<State>& steps = kept->states;
    const auto push = [&](double t, const State& x) {
        if (x.empty() || (!steps.t.empty() && steps.t.back() == t && steps.x.back() == x)) {
            return;
        }
        if (of.has_contacts() || !loop.run().phases.empty()) {
            kept->reactions.push_back(of.reaction());
        }
        steps.t.push_back(t);
        steps.x.push_back(x);
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

/// The ends of all steps of a run that has kept its solution, as `drive` collects them.
[[nodiscard]] StepEnds<State> step_ends_of(const Run<State>& run)
{
    StepEnds<State> out;
    Trajectory<State>& steps = out.states;
    const auto push = [&](double t, const State& x) {
        if (x.empty() || (!steps.t.empty() && steps.t.back() == t && steps.x.back() == x)) return;
        steps.t.push_back(t);
        steps.x.push_back(x);
    };
    const auto& solution = run.solution;
    const bool backward = !solution.empty() && run.t < solution.time(0);
    std::size_t next = 0;
    const auto push_both_sides = [&](double t, const State& after) {
        bool seen = false;
        for (; next < run.events.size(); ++next) {
            const auto& event = run.events[next];
            if (backward ? event.t < t : event.t > t) break;
            if (seen || event.t != t || event.before == event.after) continue;
            push(t, event.before);
            seen = true;
        }
        push(t, after);
    };
    for (std::size_t k = 0; k < solution.size(); ++k) {
        push_both_sides(solution.time(k), solution(solution.time(k)));
    }
    push_both_sides(run.t, run.x);
    return out;
}

/// Calls `work`, without the interpreter lock if `freely` is set.
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

/// Result of a run before its first step.
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

PyRun run_of(const std::shared_ptr<Source>& source, const State& x0, Request&& request,
             const py::object& mode_names)
{
    PyRun out{
        .record = {}, .modes = modes_of(*source, mode_names), .guard_names = source->guard_names()};

    SignalWatch watch;
    request.options.cancelled = watch.cancelled();
    std::optional<Record> whole;
    if (request.is_plain_or_series()) {
        work_freely(true, [&] { whole = source->run_whole(x0, request, watch); });
    }
    if (whole) {
        out.record = std::move(*whole);
        if (watch.raised()) raise_with(*watch.raised(), std::move(out));
        return out;
    }

    const std::unique_ptr<RunAdapter> adapter = source->open_for(request, x0);
    request.options.cancelled = adapter->watch().cancelled();
    const OwnedSetup owned = setup_for(request, *source, *adapter);
    StepEnds<State> steps;
    StepEnds<State>* const kept = request.record_steps ? &steps : nullptr;
    RunLoop loop;
    std::vector<std::vector<double>> forces;
    const auto record = [&] {
        Run<State> run = loop->finish();
        forces.resize(loop.has_contacts() ? run.trajectory.t.size() : 0, loop.reaction());
        if (!forces.empty()) run.reactions = std::move(forces);
        return loop.record(std::move(run), *adapter, kept);
    };
    try {
        loop = RunLoop(request, owned, *adapter, x0);
        if (loop.has_contacts() && !kept) {
            forces = forces_of(loop);
        } else {
            work_freely(adapter->is_free(), [&] { drive(loop, kept); });
        }
    } catch (const PythonError& error) {
        out.record = loop ? record() : start_of(x0, request.options);
        raise_with(error, std::move(out));
    }
    out.record = record();
    if (adapter->watch().raised()) raise_with(*adapter->watch().raised(), std::move(out));
    return out;
}

PyRun integrate(const std::shared_ptr<Source>& source, const State& x0, const py::dict& given,
                const py::object& mode_names)
{
    Request request = request_from(given);
    if (!given.contains("mode")) request.options.mode = source->start_mode();
    return run_of(source, x0, std::move(request), mode_names);
}

[[nodiscard]] bool is_plain_number(const py::handle& value)
{
    return PyFloat_CheckExact(value.ptr()) || PyLong_CheckExact(value.ptr()) ||
           PyBool_Check(value.ptr());
}

/// Whether `integrate` in Python would pass these options on as they are.
[[nodiscard]] bool are_plain_options(const py::dict& given)
{
    // Names in a call are interned, and so are these.
    const auto interned = [](const auto*... names) {
        return std::array{PyUnicode_InternFromString(names)...};
    };
    static const auto translated =
        interned("mode", "gate", "sample_times", "record_steps", "t_end");  // by Python
    static const auto texts = interned("method", "detector", "locator");
    const auto is_one_of = [](const auto& names, const py::handle& key) {
        return std::ranges::find(names, key.ptr()) != names.end();
    };
    for (const auto& [key, value] : given) {
        if (!PyUnicode_CHECK_INTERNED(key.ptr()) || is_one_of(translated, key)) return false;
        const bool is_text = PyUnicode_CheckExact(value.ptr()) && is_one_of(texts, key);
        if (!is_text && !is_plain_number(value)) return false;
    }
    return true;
}

/// The start, if it is a list or tuple of Python's floats, or else nothing.
[[nodiscard]] State plain_start(PyObject* x0)
{
    if (!PyTuple_CheckExact(x0) && !PyList_CheckExact(x0)) return {};
    const auto count = static_cast<std::size_t>(PySequence_Fast_GET_SIZE(x0));
    PyObject** const items = PySequence_Fast_ITEMS(x0);
    State start(count);
    for (std::size_t i = 0; i < count; ++i) {
        if (!PyFloat_CheckExact(items[i])) return {};
        start[i] = PyFloat_AS_DOUBLE(items[i]);
    }
    return start;
}

/// A run whose arguments are numbers and names, without a translation in Python;
/// None if they are not. A short run takes no longer than the translation.
py::object run_plainly(const std::shared_ptr<Source>& source, const py::object& mode_names,
                       const py::object& x0, const py::object& t_end, const py::dict& options)
{
    const State start = plain_start(x0.ptr());
    if (start.empty() || !PyFloat_CheckExact(t_end.ptr()) || !are_plain_options(options)) {
        return py::none();
    }
    Request request = request_from(options);
    request.options.t_end = PyFloat_AS_DOUBLE(t_end.ptr());
    request.options.mode = source->start_mode();
    return py::cast(run_of(source, start, std::move(request), mode_names));
}

py::object integrate_plain(const std::shared_ptr<Source>& source, const py::object& x0,
                           const py::object& t_end, const py::dict& options)
{
    return run_plainly(source, py::none(), x0, t_end, options);
}

/// The same for a system of formulas, by the source that is kept of it; None also where something
/// has changed at one of the places that it was made from.
py::object integrate_kept(const py::tuple& places, const std::shared_ptr<Source>& source,
                          const py::object& mode_names, const py::object& x0,
                          const py::object& t_end, const py::dict& options)
{
    if (!are_unchanged(places.ptr())) return py::none();
    return run_plainly(source, mode_names, x0, t_end, options);
}

/// A run driven by the caller. Not for two threads at a time.
class PySimulation {
public:
    PySimulation(std::shared_ptr<Source> source, const State& x0, const py::dict& given,
                 const py::object& mode_names)
        : source_(std::move(source)),
          names_{.record = {},
                 .modes = modes_of(*source_, mode_names),
                 .guard_names = source_->guard_names()}
    {
        Request request = request_from(given);
        if (!given.contains("mode")) request.options.mode = source_->start_mode();
        record_steps_ = request.record_steps;
        adapter_ = source_->open_for(request, x0);
        request.options.cancelled = adapter_->watch().cancelled();
        setup_ = setup_for(request, *source_, *adapter_);
        try {
            loop_ = RunLoop(request, setup_, *adapter_, x0);
        } catch (const PythonError& error) {
            PyRun run = names_;
            run.record = start_of(x0, request.options);
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
            loop_->run_to_end();
            return true;
        });
        const Turn turn(in_use_, "Simulation");
        if (!finished_) {
            finished_.emplace(names_);
            finished_->record = recorded(loop_->bring_up_to_date());
            may_go_on_ = true;
        }
        return *finished_;
    }
    [[nodiscard]] PyRun finish()
    {
        const Turn turn(in_use_, "Simulation");
        if (!finished_) {
            finished_.emplace(names_);
            finished_->record = recorded(loop_->finish());
        }
        may_go_on_ = false;
        return *finished_;
    }
    void restart(double t, const State& x, std::optional<Mode> mode)
    {
        intervene([&] { loop_->restart(t, x, mode.value_or(loop_->mode())); });
    }
    void extend(double t_end)
    {
        intervene([&] { loop_->extend(t_end); });
    }

    [[nodiscard]] double t()
    {
        const Turn turn(in_use_, "Simulation");
        return loop_->t();
    }
    [[nodiscard]] py::array x()
    {
        const Turn turn(in_use_, "Simulation");
        return array_of(loop_->x());
    }
    [[nodiscard]] py::array reaction()
    {
        if (finished_) return array_of(finished_->record.reaction);
        std::vector<double> r;
        use([&] {
            r = loop_.reaction();
            return true;
        });
        return array_of(r);
    }
    [[nodiscard]] py::object mode()
    {
        const Turn turn(in_use_, "Simulation");
        return names_.mode_named(loop_->mode());
    }
    [[nodiscard]] bool ended()
    {
        const Turn turn(in_use_, "Simulation");
        return loop_->ended();
    }
    /// Result so far.
    [[nodiscard]] PyRun so_far()
    {
        const Turn turn(in_use_, "Simulation");
        if (finished_) return *finished_;
        PyRun out = names_;
        Run<State> run = loop_->run();
        run.t = loop_->t();
        run.x = loop_->x();
        run.mode = loop_->mode();
        if (!loop_->ended()) run.outcome = Outcome::cancelled;
        out.record = recorded(std::move(run));
        return out;
    }

    [[nodiscard]] Snapshot save()
    {
        const Turn turn(in_use_, "Simulation");
        return loop_->save();
    }
    void restore(const Snapshot& snapshot)
    {
        const Turn turn(in_use_, "Simulation");
        if (finished_) throw std::runtime_error("Simulation: found finished, expected going on");
        loop_->restore(snapshot);
    }

private:
    template <class Work>
    bool use(const Work& work)
    {
        const Turn turn(in_use_, "Simulation");
        if (finished_) return false;
        bool goes_on = false;
        try {
            work_freely(adapter_->is_free(), [&] { goes_on = work(); });
        } catch (const PythonError& error) {
            end_with(error);
        }
        if (const auto& raised = adapter_->watch().raised()) end_with(*raised);
        return goes_on;
    }

    /// Lets the run go on from another place, or to another end.
    template <class Work>
    void intervene(const Work& work)
    {
        const Turn turn(in_use_, "Simulation");
        if (finished_ && !may_go_on_) {
            throw std::runtime_error("Simulation: found finished, expected going on");
        }
        try {
            work_freely(adapter_->is_free(), work);
        } catch (const PythonError& error) {
            PyRun run = names_;
            run.record = record_of(Run<State>(loop_->run()));
            raise_with(error, std::move(run));
        }
        finished_.reset();
        may_go_on_ = false;
    }

    [[nodiscard]] Record recorded(Run<State> run)
    {
        if (!record_steps_) return loop_.record(std::move(run), *adapter_);
        const StepEnds<State> steps = step_ends_of(run);
        return loop_.record(std::move(run), *adapter_, &steps);
    }

    [[noreturn]] void end_with(const PythonError& error)
    {
        finished_.emplace(names_);
        finished_->record = recorded(loop_->finish());
        raise_with(error, PyRun(*finished_));
    }

    std::shared_ptr<Source> source_;
    PyRun names_;
    std::unique_ptr<RunAdapter> adapter_;
    OwnedSetup setup_;
    RunLoop loop_;
    std::optional<PyRun> finished_;
    bool record_steps_ = false;
    bool may_go_on_ = false;  ///< it has been run to its end, but its loop is still there
    std::atomic<bool> in_use_ = false;
};

}  // namespace

void bind_runs(py::module_& module)
{
    module.def("integrate", &integrate);
    module.def("integrate_plain", &integrate_plain);
    module.def("integrate_kept", &integrate_kept);
    module.def("option_names", &option_names);
    py::class_<PySimulation>(module, "Simulation")
        .def(py::init<std::shared_ptr<Source>, const State&, const py::dict&, const py::object&>())
        .def("step", &PySimulation::step,
             "Takes one step, with whatever events it holds. False: the run has ended.")
        .def("advance", &PySimulation::advance,
             "Advances to the next event, also one that is only recorded, or sample time; what "
             "happens at one instant is shown once. False: the run has ended.")
        .def("run_to_end", &PySimulation::run_to_end, "Advances to the end, and returns the Run.")
        .def("finish", &PySimulation::finish, "Ends the run here, and returns what was computed.")
        .def("save", &PySimulation::save, "All that the future depends on, as a Snapshot.")
        .def("restore", &PySimulation::restore,
             "Continues where the snapshot of a run of the same system was taken, with the same "
             "bits.")
        .def("_restart", &PySimulation::restart)
        .def("_extend", &PySimulation::extend)
        .def_property_readonly("t", &PySimulation::t, "The time.")
        .def_property_readonly("x", &PySimulation::x, "The state, which may be kept.")
        .def_property_readonly("mode", &PySimulation::mode, "The mode.")
        .def_property_readonly("reaction", &PySimulation::reaction,
                               "The reactions of a system with set_valued there, after the events: "
                               "empty where the mode has no inclusion, NaN where none follows.")
        .def_property_readonly("ended", &PySimulation::ended, "Whether the run has ended.")
        .def_property_readonly("run", &PySimulation::so_far,
                               "What has been computed so far, as a Run.");
}

}  // namespace ricochet::python
