// A system of any kind, and the adapters of its runs.
#pragma once

#include "python_error.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "record.hpp"
#include "request.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"

namespace ricochet::python {

/// Lets Python treat signals, such as an interrupt, while a run continues without the interpreter.
///
/// `tick` is called by the functions of a system. Every few milliseconds it takes the
/// interpreter for long enough to have signals handled; where a handler raises an exception the
/// run is cancelled, and ends after the step in progress.
class SignalWatch {
public:
    void tick() noexcept
    {
        if (--ticks_left_ == 0) [[unlikely]]
            look();
    }
    [[nodiscard]] const std::atomic<bool>* cancelled() const noexcept { return &cancelled_; }
    /// Exception that a handler has raised.
    [[nodiscard]] const std::optional<PythonError>& raised() const noexcept { return raised_; }
    /// The same exception, to be raised by the caller; afterwards runs are no longer cancelled.
    [[nodiscard]] std::optional<PythonError> take_raised() noexcept
    {
        cancelled_ = false;
        return std::exchange(raised_, std::nullopt);
    }

private:
    using Clock = std::chrono::steady_clock;

    void look() noexcept;

    std::uint32_t ticks_left_ = 16;
    std::uint32_t ticks_between_ = 16;
    std::atomic<bool> cancelled_ = false;
    Clock::time_point looked_{};
    Clock::time_point handled_{};
    std::optional<PythonError> raised_;
};

/// What an implicit method has done beside its steps.
struct ImplicitCounts {
    std::uint64_t jacobians = 0;
    std::uint64_t factorizations = 0;
    std::uint64_t flow_calls = 0;  ///< for differences, which the loop does not count
};

/// The run of a mechanism with contacts.
class ContactLoop {
public:
    ContactLoop() = default;
    ContactLoop(const ContactLoop&) = delete;
    ContactLoop& operator=(const ContactLoop&) = delete;
    virtual ~ContactLoop() = default;

    [[nodiscard]] virtual detail::AnyLoop<State>& loop() noexcept = 0;
    /// Of the last step: those of the contacts, then dry friction of each coordinate.
    [[nodiscard]] virtual std::vector<double> forces() const = 0;
    [[nodiscard]] virtual const std::vector<MotionPhase>& phases() const noexcept = 0;
    [[nodiscard]] virtual ContactCounts counts(const Run<State>& run) const = 0;
};

/// The adapter of one run to its system.
class RunAdapter {
public:
    RunAdapter() = default;
    RunAdapter(const RunAdapter&) = delete;
    RunAdapter& operator=(const RunAdapter&) = delete;
    virtual ~RunAdapter() = default;

    [[nodiscard]] virtual const detail::SystemTable<State>& table() const noexcept = 0;
    [[nodiscard]] virtual void* adapter() noexcept = 0;
    /// Whether none of the system's functions needs the interpreter.
    [[nodiscard]] virtual bool is_free() const noexcept = 0;

    /// Lets a run at this adapter, whose detector is known, take its steps by the method for which
    /// the adapter was opened.
    virtual void choose_method(detail::RunBindings<State>& /*setup*/)
    {
        throw std::logic_error("a adapter that is not opened for a method of its own");
    }

    /// Writes the derivatives of the flow by the state, row by row; false where they are not known.
    virtual bool jacobian(Mode /*mode*/, double /*t*/, const State& /*x*/,
                          std::span<double> /*rows*/)
    {
        return false;
    }
    [[nodiscard]] virtual ImplicitCounts& implicit() noexcept { return implicit_; }

    /// Whether the system has set-valued motion.
    [[nodiscard]] virtual bool has_inclusion() const noexcept { return false; }
    /// Adds the inclusions of such a system to the setup of a run from a state of n components.
    virtual void add_inclusions(detail::PhasedSetup<State>& /*setup*/, std::size_t /*n*/,
                                const Options& /*options*/)
    {
        throw std::logic_error("a adapter to a system without set-valued motion");
    }

    /// Whether the system is a mechanism with contacts.
    [[nodiscard]] virtual bool has_contacts() const noexcept { return false; }
    /// The run of such a system whose flight has this setup.
    /// @throws std::invalid_argument for a start at which no mechanism begins
    [[nodiscard]] virtual std::unique_ptr<ContactLoop> open_contacts(
        const Request& /*request*/, const detail::RunBindings<State>& /*flight*/,
        const State& /*x0*/)
    {
        throw std::logic_error("a adapter to a system without contacts");
    }

    [[nodiscard]] virtual SignalWatch& watch() noexcept { return *watch_; }
    /// Lets signals be handled by the watch of another adapter, which must outlive this one.
    void share_watch(SignalWatch& watch) noexcept { watch_ = &watch; }

private:
    SignalWatch own_watch_;
    SignalWatch* watch_ = &own_watch_;
    ImplicitCounts implicit_;
};

/// Adds what an implicit method has done.
[[nodiscard]] inline Record with_counts(Record record, RunAdapter& adapter)
{
    const ImplicitCounts& counts = adapter.implicit();
    record.jacobians = counts.jacobians;
    record.factorizations = counts.factorizations;
    record.statistics.flow_calls += counts.flow_calls;
    return record;
}

class Source {
public:
    Source() = default;
    Source(const Source&) = delete;
    Source& operator=(const Source&) = delete;
    virtual ~Source() = default;

    /// Opens a adapter for a run; the source must outlive it.
    /// @throws std::invalid_argument for a start that the system does not support.
    [[nodiscard]] virtual std::unique_ptr<RunAdapter> open(const State& x0) const = 0;

    /// The same for steps by Taylor's method.
    /// @throws std::invalid_argument where the flow is no formula
    [[nodiscard]] virtual std::unique_ptr<RunAdapter> open_by_series(const State& /*x0*/) const
    {
        throw std::invalid_argument(
            "method: found 'taylor', which needs the flow as a formula, for functions of Python; "
            "expected a ready system, a system with formula=n, or another method, such as "
            "'fehlberg78'");
    }

    /// The same for steps by Rosenbrock's method.
    [[nodiscard]] virtual std::unique_ptr<RunAdapter> open_implicit(const State& /*x0*/) const
    {
        throw std::invalid_argument("method: found 'rosenbrock4' for a system without it");
    }

    /// The same for the method of a request, with its parameters.
    [[nodiscard]] virtual std::unique_ptr<RunAdapter> open_for(const Request& request,
                                                               const State& x0) const
    {
        if (request.implicit) return open_implicit(x0);
        return request.by_series ? open_by_series(x0) : open(x0);
    }

    /// The whole run by a loop made for this system, if there is one for such a request. Does not
    /// need the interpreter.
    [[nodiscard]] virtual std::optional<Record> run_whole(const State& /*x0*/,
                                                          const Request& /*request*/,
                                                          SignalWatch& /*watch*/) const
    {
        return std::nullopt;
    }

    /// Where the results of rows go that are run together.
    struct Rows {
        std::size_t first = 0, count = 0;
        std::function<State(std::size_t)> start;
        std::function<void(std::size_t, Record&&)> keep;
        std::function<void(std::size_t, std::exception_ptr)> fail;
    };
    /// Whether `run_side_by_side` runs rows of n components, with the bits that they have alone.
    [[nodiscard]] virtual bool runs_side_by_side(const Request& /*request*/,
                                                 std::size_t /*n*/) const
    {
        return false;
    }
    /// Runs rows four at a time.
    virtual void run_side_by_side(const Request& /*request*/, const Rows& /*rows*/) const {}

    /// Whether its runs need no interpreter and hold no function of Python.
    [[nodiscard]] virtual bool is_free() const noexcept { return false; }
    /// Number of parameters that requests for its runs must have.
    [[nodiscard]] virtual std::size_t parameter_count() const noexcept { return 0; }
    /// Names of the modes, empty where they are numbers.
    [[nodiscard]] virtual std::vector<std::string> mode_names() const = 0;
    [[nodiscard]] virtual std::vector<std::string> guard_names() const = 0;
    [[nodiscard]] virtual Mode start_mode() const noexcept { return 0; }

    /// Parameters that networks are trained for, by their names in models.
    std::map<std::string, double, std::less<>> parameters;
};

}  // namespace ricochet::python
