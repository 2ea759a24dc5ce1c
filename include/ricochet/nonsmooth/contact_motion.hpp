// One run of a mechanical system with contacts: flight by events, contact by time stepping.
//
//     flight   while every contact is open: impacts are located and resolved one instant at
//              a time, by any explicit stepper (free_flight.hpp)
//     contact  where impacts accumulate, where a contact stays closed, or where an impact has
//              no solution: Moreau's midpoint rule, until every contact has opened
//
// A system needs no declarations beyond those that time stepping needs.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/event_loop.hpp"
#include "ricochet/detail/free_flight.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"

namespace ricochet {

/// A system as `TimeStepping` takes it, by its sizes: members that do not fit are refused with a
/// sentence for each.
template <class System>
concept Contacting = requires
{
    System::coordinates;
    System::contacts;
    System::tangents;
};

/// Counts over one run with contacts.
struct ContactStatistics {
    Statistics event_driven;
    TimeSteppingStatistics time_stepping;
    std::uint64_t to_contact = 0;  ///< hand-overs, including a start in contact
    std::uint64_t to_flight = 0;
    double contact_time = 0;  ///< [s] duration of the motion in contact
};

namespace detail {

template <int N>
struct AnyContactRun {
    using X = typename AnyFlight<N>::State;

    Outcome outcome = Outcome::reached_end;
    double t = 0;
    X x{};
    std::vector<Event<X>> events;
    std::vector<Phase> phases;
    Trajectory<X> trajectory;  ///< at the sample times
    ContactStatistics statistics;
    ContactReport failure;  ///< set with `not_converged`, and with `non_finite` in contact
};

}  // namespace detail

/// Events are impacts in flight; `Event::guard` is the contact, and x = (q, v).
template <Contacting System>
struct ContactRun : detail::AnyContactRun<System::coordinates> {
};

namespace detail {

/// Makes simulations of free flight with a given stepper.
template <int N>
struct FlightStepping {
    std::unique_ptr<EventLoop<2 * N>> (*make)(const AnyFlight<N>& flight,
                                              const typename EventLoop<2 * N>::X& x,
                                              const Options& options) = nullptr;
    bool error_controlled = true;
};

template <int N, class Stepping>
std::unique_ptr<EventLoop<2 * N>> make_flight_loop(const AnyFlight<N>& flight,
                                                   const typename EventLoop<2 * N>::X& x,
                                                   const Options& options)
{
    return std::make_unique<EventLoopBy<2 * N, AnyFlight<N>, Stepping>>(flight, x, options);
}

/// `ContactMotion` for systems of any type.
template <int N>
class RICOCHET_ALIGNED AnyContactMotion {
public:
    using Flight = AnyFlight<N>;
    using X = typename Flight::State;
    using Vector = typename Flight::Vector;

    AnyContactMotion(const AnyMechanism<N>& system, const Vector& q, const Vector& v,
                     const HandOverOptions& options, const FlightStepping<N>& stepping);

    [[nodiscard]] AnyContactRun<N> take();

private:
    [[nodiscard]] static TimeSteppingOptions stepping_options(const HandOverOptions& options)
    {
        return {
            .t_start = options.t_start, .t_end = options.t_end, .step = options.set_valued.step};
    }

    void end_with(Outcome outcome)
    {
        run_.outcome = outcome;
        ended_ = true;
    }

    /// In flight and in contact.
    [[nodiscard]] std::uint64_t steps_taken() const
    {
        return run_.statistics.event_driven.steps + steps_.statistics().steps;
    }

    // --- flight ---

    void follow_flight()
    {
        std::unique_ptr<EventLoop<2 * N>> simulation;
        try {
            simulation = stepping_.make(flight_, run_.x, flight_options());
        } catch (const StartRefused&) {
            return touch_down(PhaseCause::stuck);  // behind a contact by more than rounding
        }
        ChatterWatch watch(run_.t, options_.set_valued.step / 100);
        bool chatters = false;
        while (!chatters && simulation->step()) {
            chatters = watch(simulation->t(), simulation->run().statistics.events);
        }
        finish_flight(simulation->finish(), chatters);
    }

    [[nodiscard]] Options flight_options() const
    {
        Options options =
            detail::event_options(options_, run_.t, run_.trajectory.t.size(), steps_taken());
        if (!stepping_.error_controlled) options.step = options_.set_valued.step;
        return options;
    }

    void finish_flight(Run<X>&& done, bool chatters)
    {
        run_.t = done.t;
        run_.x = done.x;
        std::move(done.events.begin(), done.events.end(), std::back_inserter(run_.events));
        run_.trajectory.t.insert(run_.trajectory.t.end(), done.trajectory.t.begin(),
                                 done.trajectory.t.end());
        run_.trajectory.x.insert(run_.trajectory.x.end(), done.trajectory.x.begin(),
                                 done.trajectory.x.end());
        add(run_.statistics.event_driven, done.statistics);
        if (chatters) return touch_down(PhaseCause::chattering);
        if (const auto cause = cause_after(done.outcome)) return touch_down(*cause);
        end_with(done.outcome);
    }

    // --- contact ---

    void touch_down(PhaseCause cause)
    {
        if (options_.events_only) return end_with(Outcome::not_handed_over);
        // A phase that is re-entered immediately is kept longer each time.
        const bool at_once = run_.t - run_.phases.back().from < 10 * options_.set_valued.step;
        patience_ = at_once ? std::min(2 * patience_, std::uint64_t{1} << 20) : 1;
        in_contact_ = true;
        ++run_.statistics.to_contact;
        run_.phases.push_back({.from = run_.t, .set_valued = true, .cause = cause});
        steps_.restart(run_.t, Flight::position(run_.x), Flight::velocity(run_.x));
    }

    void follow_contact()
    {
        const double from = run_.t;
        std::uint64_t open = 0;
        if (steps_.outcome() == Outcome::running && steps_taken() >= options_.max_steps) {
            end_with(Outcome::step_limit);
        }
        while (!ended_ && in_contact_) {
            const double t_before = steps_.state().t;
            const X before = Flight::state(steps_.state().q, steps_.state().v);
            const Outcome outcome = steps_.advance();
            const auto& now = steps_.state();
            run_.t = now.t;
            run_.x = Flight::state(now.q, now.v);
            emit_samples(t_before, before);
            open = is_open() ? open + 1 : 0;
            if (outcome == Outcome::not_converged) run_.failure = steps_.failure();
            if (outcome != Outcome::running) {
                end_with(stepping_outcome(outcome));
            } else if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
                end_with(Outcome::cancelled);
            } else if (steps_taken() >= options_.max_steps) {
                end_with(Outcome::step_limit);
            } else if (open >= patience_) {
                in_contact_ = false;
            }
        }
        run_.statistics.contact_time += run_.t - from;
        if (ended_) return;
        ++run_.statistics.to_flight;
        run_.phases.push_back({.from = run_.t, .set_valued = false, .cause = PhaseCause::released});
    }

    [[nodiscard]] Outcome stepping_outcome(Outcome outcome) const
    {
        const bool failed = outcome == Outcome::not_converged;
        if (failed && std::isinf(run_.failure.residual)) return Outcome::non_finite;
        return outcome;
    }

    /// Whether no contact pushed in the last step, and all are open after it.
    [[nodiscard]] bool is_open() const
    {
        if (!steps_.state().impulse.isZero(0)) return false;
        for (std::size_t c = 0; c < flight_.guard_count(); ++c) {
            if (!(flight_.guard(c, run_.t, run_.x) > 0)) return false;
        }
        return true;
    }

    // --- samples ---

    /// Interpolates linearly, which is as accurate as the steps.
    void emit_samples(double t_before, const X& before)
    {
        while (run_.trajectory.t.size() < options_.sample_times.size()) {
            const double t = options_.sample_times[run_.trajectory.t.size()];
            if (t > run_.t) return;
            const double share = run_.t > t_before ? (t - t_before) / (run_.t - t_before) : 1;
            X x;
            for (std::size_t i = 0; i < x.size(); ++i) {
                x[i] = before[i] + share * (run_.x[i] - before[i]);
            }
            run_.trajectory.t.push_back(t);
            run_.trajectory.x.push_back(x);
        }
    }

    HandOverOptions options_;
    FlightStepping<N> stepping_;
    Flight flight_;
    AnyTimeStepping<N> steps_;
    AnyContactRun<N> run_;
    std::uint64_t patience_ = 1;
    bool in_contact_ = false;
    bool ended_ = false;
};

template <int N>
AnyContactMotion<N>::AnyContactMotion(const AnyMechanism<N>& system, const Vector& q,
                                      const Vector& v, const HandOverOptions& options,
                                      const FlightStepping<N>& stepping)
    : options_(completed(options, false)),
      stepping_(stepping),
      flight_(system),
      steps_(system, q, v, stepping_options(options_))
{
    run_.t = options_.t_start;
    run_.x = Flight::state(q, v);
}

template <int N>
AnyContactRun<N> AnyContactMotion<N>::take()
{
    run_.phases.push_back({.from = run_.t, .set_valued = false, .cause = PhaseCause::start});
    while (!ended_) in_contact_ ? follow_contact() : follow_flight();
    run_.statistics.time_stepping = steps_.statistics();
    return std::move(run_);
}

}  // namespace detail

/// Motion of a mechanical system with contacts: flights between impacts by events, closed contacts
/// by time stepping. `HandOverOptions` are those of the event-driven phases, with `set_valued.step`
/// as the step of time stepping.
template <Contacting System, class Stepping = ErrorControlled<Dopri5>>
class ContactMotion {
    static constexpr int N = System::coordinates;

public:
    using Flight = FreeFlight<System>;
    using X = typename Flight::State;
    using Vector = typename Flight::Vector;

    /// @throws std::invalid_argument for everything that `TimeStepping` rejects, including a start
    /// inside an obstacle.
    ContactMotion(const System& system, const Vector& q, const Vector& v,
                  const HandOverOptions& options)
        : by_(detail::TypedMechanism<System>(system), q, v, options,
              {&detail::make_flight_loop<N, Stepping>,
               std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>})
    {
    }

    /// Advances to the end and returns the result, whatever the outcome.
    [[nodiscard]] ContactRun<System> take() { return {by_.take()}; }

private:
    detail::AnyContactMotion<N> by_;
};

/// Runs a whole motion in one call.
template <Contacting System, class Stepping = ErrorControlled<Dopri5>>
[[nodiscard]] ContactRun<System> hand_over(const System& system,
                                           const Eigen::Matrix<double, System::coordinates, 1>& q,
                                           const Eigen::Matrix<double, System::coordinates, 1>& v,
                                           const HandOverOptions& options,
                                           const Stepping& /*stepping*/ = {})
{
    return ContactMotion<System, Stepping>(system, q, v, options).take();
}

}  // namespace ricochet

#if RICOCHET_ALIGNED_AS_LIBRARY
RICOCHET_CONTACT_MOTION_OF(2, Dopri5, extern)
RICOCHET_CONTACT_MOTION_OF(3, Dopri5, extern)
#endif
