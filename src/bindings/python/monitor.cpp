// Events of a motion that a host in Python integrates.

#include <pybind11/stl.h>

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "numbers.hpp"
#include "read_request.hpp"
#include "results.hpp"
#include "ricochet/monitor.hpp"
#include "setup.hpp"
#include "turn.hpp"

namespace ricochet::python {

namespace {

/// An array that a host has passed.
using Given = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// A step of a host: its interpolant is a function of the time.
struct ShownStep {
    PyObject* interpolate;
    const detail::HostStepTable& shown;
    double sign;  ///< of the direction in which time runs
    mutable bool is_checked = false;

    static void at(const void* step, double s, double* x, std::size_t n)
    {
        const auto& self = *static_cast<const ShownStep*>(step);
        if (!std::exchange(self.is_checked, true)) self.refuse_offsets(n);
        self.at_time(self.shown.t + self.sign * s, x, n);
    }

    /// Refuses a function of the offset, as the interpolants of C++ and C are: one that misses x0
    /// at the time t0 and meets x0 and x1 at the times 0 and h.
    void refuse_offsets(std::size_t n) const
    {
        State x(n);
        const auto distance = [&](double t, const double* from) {
            at_time(t, x.data(), n);
            double sum = 0;
            for (std::size_t i = 0; i < n; ++i) sum += std::fabs(x[i] - from[i]);
            return sum;
        };
        double moved = 0;
        for (std::size_t i = 0; i < n; ++i) moved += std::fabs(shown.x1[i] - shown.x0[i]);
        const double missed = distance(shown.t, shown.x0);
        if (!(missed > 0.01 * moved)) return;
        try {
            if (!(distance(0, shown.x0) + distance(shown.h, shown.x1) < 1e-6 * missed)) return;
        } catch (const PythonError& error) {  // of a function that is asked outside its step
            if (PyErr_GivenExceptionMatches(error.value(), PyExc_Exception)) return;
            throw;
        }
        raise(PyExc_ValueError,
              "interpolate: found the state as a function of the offset from t0, expected a "
              "function of the time");
    }

    void at_time(double t, double* x, std::size_t n) const
    {
        static const std::string no_guard;
        const Ref time = checked(PyFloat_FromDouble(t));
        const Ref result = checked(PyObject_CallOneArg(interpolate, time.get()));
        const Numbers numbers(result.get(), "interpolate", no_guard);
        if (numbers.size() != n) {
            raise(PyExc_ValueError, "interpolate returned " + std::to_string(numbers.size()) +
                                        " numbers for a state of " + std::to_string(n));
        }
        numbers.copy(x);
    }
};

void hermite_at(const void* step, double s, double* x, std::size_t n)
{
    static_cast<const HermiteStep*>(step)->interpolate(s, {x, n});
}

void hermite_rate_at(const void* step, double s, double* dxdt, std::size_t n)
{
    static_cast<const HermiteStep*>(step)->interpolate_rate(s, {dxdt, n});
}

/// Implementation of `ricochet.Monitor`. Not for two threads at a time.
class PyMonitor {
public:
    PyMonitor(std::shared_ptr<Source> source, const State& like, py::dict given, bool backward,
              bool cut_at_all, const py::object& mode_names)
        : source_(std::move(source)),
          sign_(backward ? -1 : 1),
          names_{.record = {},
                 .modes = modes_of(*source_, mode_names),
                 .guard_names = source_->guard_names()}
    {
        Request request = request_from(given);
        request.options.t_end = sign_;  // any finite time
        validate(request.options, false, "Monitor");
        request.options.t_end = sign_ * std::numeric_limits<double>::infinity();
        start_mode_ = source_->start_mode();
        components_ = like.size();
        adapter_ = source_->open(like);
        if (adapter_->has_inclusion() || adapter_->has_contacts()) {
            const char* found =
                adapter_->has_contacts() ? "a mechanism" : "a system with set_valued";
            throw std::invalid_argument(std::string("Monitor: found ") + found +
                                        ", which a monitor cannot follow, expected integrate or "
                                        "Simulation");
        }
        // Guards see whole states: a host's interpolant need be no polynomial.
        table_ = adapter_->table();
        table_.guard_on = nullptr;
        table_.rate_on = nullptr;
        setup_ = setup_for(request, *source_, *adapter_);
        setup_.setup.system = &table_;
        // There is no method of our own: the host has its own.
        setup_.setup.stepping = "";
        monitor_ = detail::make_monitor(setup_.setup, like, request.options, cut_at_all);
    }

    [[nodiscard]] Verdict start(double t, const Given& x, double scale, const py::object& rate,
                                const py::object& mode)
    {
        const Mode in = mode.is_none() ? start_mode_ : py::cast<Mode>(mode);
        return use([&] {
            require_dimension("x", x);
            const State state = state_from(x);
            const std::optional<State> dxdt = rate_from("rate", rate, state.size());
            const Verdict verdict =
                monitor_->start(Instant{t}, state, dxdt ? dxdt->data() : nullptr, in, scale);
            has_cut_ = false;
            return verdict;
        });
    }

    [[nodiscard]] Verdict examine(double t0, double h, const Given& x0, const Given& x1,
                                  const Given& rate0, const Given& rate1,
                                  const py::object& interpolate)
    {
        return use([&] {
            const std::size_t n = monitor_->x().size();
            const Given* const arrays[] = {&x0, &x1, &rate0, &rate1};
            const char* const names[] = {"x0", "x1", "rate0", "rate1"};
            for (std::size_t i = 0; i < 4; ++i) {
                require_size(names[i], *arrays[i], n);
                // States at the end of no length are none; the monitor refuses the length.
                if (i > 0 && std::isfinite(h)) {
                    detail::require_finite(names[i], {arrays[i]->data(), n});
                }
            }
            const auto along = [&](const Given& rate, State& room) {
                if (sign_ > 0) return rate.data();
                room.assign(rate.data(), rate.data() + n);
                for (double& r : room) r = -r;
                return static_cast<const double*>(room.data());
            };
            detail::HostStepTable table{.t = t0,
                                        .h = h,
                                        .x0 = x0.data(),
                                        .x1 = x1.data(),
                                        .rate0 = along(rate0, rates_[0]),
                                        .rate1 = along(rate1, rates_[1])};
            if (interpolate.is_none()) {
                const HermiteStep cubic(Instant{t0}, h, {table.x0, n}, {table.x1, n},
                                        {table.rate0, n}, {table.rate1, n});
                table.host = &cubic;
                table.interpolate = &hermite_at;
                table.rate = &hermite_rate_at;
                table.is_cubic = true;
                return monitor_->examine(table);
            }
            if (!PyCallable_Check(interpolate.ptr())) {
                throw py::type_error("interpolate: found a " + type_of(interpolate.ptr()) +
                                     ", expected a function of the time, or None");
            }
            const ShownStep step{interpolate.ptr(), table, sign_};
            table.host = &step;
            table.interpolate = &ShownStep::at;
            return monitor_->examine(table);
        });
    }

    [[nodiscard]] Verdict resume(double scale, const py::object& rate, const py::object& after,
                                 const py::object& mode)
    {
        return use([&] {
            if (after.is_none() && mode.is_none()) {
                const std::optional<State> dxdt = rate_from("rate", rate, monitor_->x().size());
                return monitor_->resume(dxdt ? dxdt->data() : nullptr, scale);
            }
            if (!after.is_none()) require_dimension("after", py::cast<Given>(after));
            const State state =
                after.is_none() ? monitor_->x() : state_from(py::cast<Given>(after));
            const std::optional<State> dxdt = rate_from("rate", rate, state.size());
            const Mode in = mode.is_none() ? monitor_->mode() : py::cast<Mode>(mode);
            return monitor_->resume(state, in, dxdt ? dxdt->data() : nullptr, scale);
        });
    }

    [[nodiscard]] Verdict hold(double t)
    {
        return use([&] { return monitor_->hold(t); });
    }

    void skip_to(double t, const Given& x, const Given& rate)
    {
        use([&] {
            require_size("x", x, monitor_->x().size());
            const State state = state_from(x);
            const std::optional<State> dxdt = rate_from("rate", rate, state.size());
            monitor_->skip_to(Instant{t}, state, dxdt->data());
            return Verdict::stands;
        });
    }

    /// Arguments of `ricochet.Cut`.
    [[nodiscard]] py::tuple cut()
    {
        const Turn turn = take_turn();
        if (!has_cut_) {
            throw std::runtime_error(
                "cut: found no set of events since the start, expected a Verdict.CUT before");
        }
        const Cut<State>& cut = monitor_->cut();
        py::list fired_names;
        for (const std::size_t which : cut.fired) fired_names.append(names_.guard_names[which]);
        return py::make_tuple(cut.t.value, cut.s, array_of(cut.before), array_of(cut.after),
                              names_.mode_named(cut.mode_before), names_.mode_named(cut.mode_after),
                              cut.fired, fired_names, cut.on_time, cut.accumulation,
                              cut.state_changed);
    }

    [[nodiscard]] double t()
    {
        const Turn turn = take_turn();
        return monitor_->t().value;
    }
    [[nodiscard]] py::array x()
    {
        const Turn turn = take_turn();
        return array_of(monitor_->x());
    }
    [[nodiscard]] py::object mode()
    {
        const Turn turn = take_turn();
        return names_.mode_named(monitor_->mode());
    }
    [[nodiscard]] std::vector<std::size_t> held()
    {
        const Turn turn = take_turn();
        return {monitor_->held().begin(), monitor_->held().end()};
    }
    [[nodiscard]] double must_stop_at()
    {
        const Turn turn = take_turn();
        return monitor_->must_stop_at();
    }
    [[nodiscard]] double quiet_until()
    {
        const Turn turn = take_turn();
        return monitor_->quiet_until();
    }
    [[nodiscard]] PyRun so_far()
    {
        const Turn turn = take_turn();
        return record();
    }
    void clear_events()
    {
        const Turn turn = take_turn();
        monitor_->clear_events();
    }
    [[nodiscard]] Snapshot save()
    {
        const Turn turn = take_turn();
        return monitor_->save();
    }
    void restore(const Snapshot& snapshot)
    {
        const Turn turn = take_turn();
        monitor_->restore(snapshot);
        ended_ = has_cut_ = false;
    }

private:
    [[nodiscard]] Turn take_turn() { return {in_use_, "Monitor"}; }

    /// Calls the monitor. An exception of the system's functions gets the run so far attached.
    template <class Work>
    Verdict use(const Work& work)
    {
        const Turn turn = take_turn();
        try {
            const Verdict verdict = work();
            ended_ = verdict == Verdict::ended;
            has_cut_ = has_cut_ || verdict == Verdict::cut;
            if (const auto raised = adapter_->watch().take_raised()) raise_with(*raised, record());
            return verdict;
        } catch (const PythonError& error) {
            raise_with(error, record());
        }
    }

    [[nodiscard]] PyRun record() const
    {
        PyRun out = names_;
        Run<State> run = monitor_->run();
        run.t = monitor_->t().value;
        run.x = monitor_->x();
        run.mode = monitor_->mode();
        if (!ended_) run.outcome = Outcome::cancelled;
        out.record = record_of(std::move(run));
        return out;
    }

    static void require_size(const char* name, const Given& given, std::size_t n)
    {
        if (given.ndim() == 1 && static_cast<std::size_t>(given.size()) == n) return;
        throw py::value_error(std::string(name) + ": found shape " +
                              py::cast<std::string>(py::str(given.attr("shape"))) + ", expected (" +
                              std::to_string(n) + ",)");
    }

    /// Refuses a state of another dimension than that of the motion, unless the system may change
    /// it.
    void require_dimension(const char* name, const Given& x) const
    {
        const bool varies = table_.moded || table_.changes_dimension;
        require_size(name, x, varies ? static_cast<std::size_t>(x.size()) : components_);
        // A ready system or a formula refuses a state that is not its own.
        if (varies) (void)source_->open(state_from(x));
    }

    [[nodiscard]] static State state_from(const Given& x)
    {
        require_size("x", x, static_cast<std::size_t>(x.size()));
        return {x.data(), x.data() + x.size()};
    }

    /// The rate with respect to offsets: for a motion backward in time, minus the given one.
    [[nodiscard]] std::optional<State> rate_from(const char* name, const py::object& given,
                                                 std::size_t n) const
    {
        if (given.is_none()) return std::nullopt;
        const auto rate = py::cast<Given>(given);
        require_size(name, rate, n);
        detail::require_finite(name, {rate.data(), n});
        State out(rate.data(), rate.data() + n);
        for (double& r : out) r *= sign_;
        return out;
    }

    std::shared_ptr<Source> source_;
    double sign_;
    PyRun names_;
    Mode start_mode_ = 0;
    std::size_t components_ = 0;  ///< number of components of `like`
    std::unique_ptr<RunAdapter> adapter_;
    detail::SystemTable<State> table_;
    OwnedSetup setup_;
    detail::Owner<detail::AnyMonitor<State>> monitor_;
    std::array<State, 2> rates_;
    bool ended_ = false;
    bool has_cut_ = false;  ///< since the start
    std::atomic<bool> in_use_ = false;
};

}  // namespace

void bind_monitor(py::module_& module)
{
    const auto number = [](Verdict verdict) { return static_cast<int>(verdict); };
    py::class_<PyMonitor>(module, "Monitor")
        .def(py::init<std::shared_ptr<Source>, const State&, const py::dict&, bool, bool,
                      const py::object&>())
        .def("_start",
             [number](PyMonitor& self, double t, const Given& x, double scale,
                      const py::object& rate, const py::object& mode) {
                 return number(self.start(t, x, scale, rate, mode));
             })
        .def("_examine",
             [number](PyMonitor& self, double t0, double h, const Given& x0, const Given& x1,
                      const Given& rate0, const Given& rate1, const py::object& interpolate) {
                 return number(self.examine(t0, h, x0, x1, rate0, rate1, interpolate));
             })
        .def("_resume",
             [number](PyMonitor& self, double scale, const py::object& rate,
                      const py::object& after, const py::object& mode) {
                 return number(self.resume(scale, rate, after, mode));
             })
        .def("_hold", [number](PyMonitor& self, double t) { return number(self.hold(t)); })
        .def("_skip_to", &PyMonitor::skip_to)
        .def("_cut", &PyMonitor::cut)
        .def("clear_events", &PyMonitor::clear_events, "Forgets the events so far.")
        .def("save", &PyMonitor::save,
             "All that the future depends on, between two steps, as a Snapshot.")
        .def("restore", &PyMonitor::restore,
             "Continues where the snapshot of a monitor of the same system was taken.")
        .def_property_readonly("t", &PyMonitor::t, "Where the next step begins.")
        .def_property_readonly("x", &PyMonitor::x, "The state there, which may be kept.")
        .def_property_readonly("mode", &PyMonitor::mode, "The mode there.")
        .def_property_readonly("held", &PyMonitor::held,
                               "The components that a rest holds, as a list of numbers: the host "
                               "keeps them constant in its next steps, while the others flow.")
        .def_property_readonly("must_stop_at", &PyMonitor::must_stop_at,
                               "The next time event, beyond which no step goes; infinite where "
                               "there is none.")
        .def_property_readonly(
            "quiet_until", &PyMonitor::quiet_until,
            "The time up to which no guard needs a check, by the bounds that the "
            "system declares: the host may go there by `skip_to`. Where nothing "
            "is known it is the current time.")
        .def_property_readonly("run", &PyMonitor::so_far, "What has been found so far, as a Run.")
        .def_property_readonly(
            "events",
            [](PyMonitor& self) {
                const py::object run = py::cast(self.so_far());
                return events_of(py::cast<const PyRun&>(run).record, run);
            },
            "The events since `clear_events`, as the structured array of a Run.");
}

}  // namespace ricochet::python
