// Motion of a mechanical system with contacts: flight by events, contact by time stepping.
//
//     flight   while every contact is open: impacts are located and resolved one instant at
//              a time, by any explicit stepper (free_flight.hpp)
//     contact  where impacts accumulate, where a contact stays closed, where an impact has no
//              solution, or where dry friction holds a coordinate: Moreau's midpoint rule, until
//              nothing is held any more
//
// A mechanism is a value as time_stepping.hpp describes it. Beside that it may declare what any
// hybrid system does (system.hpp), for the state x = (q, v), an array: guards with resets,
// time events, and modes, if `force` takes one. They act in both kinds of phases.
#pragma once

#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/nonsmooth/detail/contact_run.hpp"
#include "ricochet/nonsmooth/detail/free_flight.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"
#include "ricochet/simulation.hpp"

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

/// Result of a run. Events are impacts in flight, with the contact as `Event::guard`, and those of
/// the mechanism's own guards, whose numbers follow those of the contacts; x = (q, v).
template <Contacting System>
struct ContactRun : Run<typename detail::FreeFlight<System>::State> {
    std::vector<ContactForces> forces;  ///< at the sample times, of the steps that hold them
    ContactStatistics statistics;       ///< in place of the counts of all steps together
    ContactReport failure;  ///< set with `not_converged`, and with `non_finite` in contact
};

namespace detail {

template <class System>
inline constexpr bool is_free_flight = false;
template <class System>
inline constexpr bool is_free_flight<detail::FreeFlight<System>> = true;

/// The loop of a mechanism.
template <class System, class X, class Stepping, class Detector>
requires(is_free_flight<System>) class LoopOf<System, X, Stepping, Detector> {
    using C = CoreState<X>;
    static_assert(!DetectorTableOf<Detector, System, X>::predicts,
                  "ricochet: found a mechanism and a detector with predictions of its flow alone; "
                  "expected Extremum, Ends or Bernstein");

public:
    LoopOf() = default;
    template <class Parts>
    LoopOf(const System& system, Parts& parts, const X& x0, const Options& options)
        : run_(make_contact_run<C>(setup(system, parts), core_state(x0), options))
    {
    }
    [[nodiscard]] AnyLoop<C>* operator->() const noexcept { return &run_->loop(); }
    [[nodiscard]] const ContactRunner<C>& contacts() const noexcept { return *run_; }

private:
    template <class Parts>
    [[nodiscard]] static ContactSetup<C> setup(const System& system, Parts& parts)
    {
        constexpr int N = System::N;
        ContactSetup<C> out;
        out.flight = parts.setup();
        out.steps = Owner<ContactSteps>(new ContactStepsOf<N>(system.mechanism()));
        out.phases = system.phase_options();
        out.kinds = system.kinds();
        for (std::size_t k = 0; k < out.kinds.dry(); ++k) {
            out.dry.push_back(static_cast<std::size_t>(N + system.dry()[k].coordinate));
        }
        out.contacts = static_cast<std::size_t>(System::C);
        out.event_guards = system.event_guards();
        out.modes = system.own_mode_count();
        return out;
    }

    Owner<ContactRunner<C>> run_;
};

}  // namespace detail

/// A run of a mechanism that the caller drives, with everything that a `Simulation` has: flights
/// between impacts by events, what is held by time stepping.
///
/// A step in contact is one of Moreau's; its samples lie on the straight line between its ends. A
/// snapshot continues with the same bits in any phase.
template <Contacting System, class Stepping = ErrorControlled<Dopri5>>
class ContactMotion : public Simulation<detail::FreeFlight<System>,
                                        typename detail::FreeFlight<System>::State, Stepping> {
    using Flight = detail::FreeFlight<System>;
    using Base = Simulation<Flight, typename Flight::State, Stepping>;
    static constexpr bool controlled =
        std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>;

public:
    using X = typename Flight::State;
    using Vector = typename Flight::Vector;

    /// @throws std::invalid_argument for everything that `TimeStepping` rejects, including a start
    /// inside an obstacle.
    ContactMotion(const System& system, const Vector& q, const Vector& v,
                  const HandOverOptions& options)
        : ContactMotion(system, q, v, loop_options(options), phase_options(options))
    {
    }
    /// With all options of `integrate`.
    /// @param step  [s] length of the steps in contact; 0: a thousandth of the run
    ContactMotion(const System& system, const Vector& q, const Vector& v, const Options& options,
                  double step)
        : ContactMotion(system, q, v, options, detail::ContactPhaseOptions{.step = step})
    {
    }

    /// Coordinates at `t`.
    [[nodiscard]] Vector q() const { return Flight::position(this->x()); }
    /// Velocities at `t`.
    [[nodiscard]] Vector v() const { return Flight::velocity(this->x()); }
    /// Mean forces over the last step; zero in flight.
    [[nodiscard]] ContactForces forces() const { return contacts().forces(); }
    [[nodiscard]] const std::vector<MotionPhase>& phases() const noexcept
    {
        return contacts().phases();
    }
    [[nodiscard]] bool in_contact() const noexcept { return phases().back().set_valued; }
    [[nodiscard]] ContactStatistics statistics() const
    {
        return contacts().statistics(contacts().loop().run().statistics, this->t());
    }
    [[nodiscard]] const ContactReport& failure() const noexcept { return contacts().failure(); }

    /// Advances to the end and returns the result, whatever the outcome.
    [[nodiscard]] ContactRun<System> take()
    {
        ContactRun<System> out;
        const auto& samples = contacts().loop().run().trajectory.t;
        const auto note_forces = [&] {
            if (out.forces.size() == samples.size()) return;
            out.forces.resize(samples.size(), forces());
        };
        note_forces();
        while (this->step()) note_forces();
        note_forces();
        static_cast<Run<X>&>(out) = this->finish();
        out.forces.resize(out.trajectory.t.size(), forces());
        out.phases = phases();
        out.statistics = contacts().statistics(Run<X>(out).statistics, out.t);
        const bool failed =
            out.outcome == Outcome::not_converged || out.outcome == Outcome::non_finite;
        if (failed && in_contact()) out.failure = failure();
        return out;
    }

private:
    [[nodiscard]] static Options loop_options(const HandOverOptions& options)
    {
        const HandOverOptions given = detail::completed(options, false);
        Options out = detail::loop_options(given);
        if (!controlled) out.step = given.set_valued.step;
        return out;
    }
    [[nodiscard]] static detail::ContactPhaseOptions phase_options(const HandOverOptions& options)
    {
        return {detail::completed(options, false).set_valued.step, options.events_only};
    }
    ContactMotion(const System& system, const Vector& q, const Vector& v, const Options& options,
                  const detail::ContactPhaseOptions& phases)
        : Base(checked(system, q, v, options, phases), Flight::state(q, v), options)
    {
    }
    [[nodiscard]] static Flight checked(const System& system, const Vector& q, const Vector& v,
                                        const Options& options,
                                        const detail::ContactPhaseOptions& phases)
    {
        Flight flight(system, phases);
        detail::check_start(flight.mechanism(), options.t_start, q, v);
        return flight;
    }
    [[nodiscard]] const detail::ContactRunner<detail::CoreState<X>>& contacts() const noexcept
    {
        return this->loop_.contacts();
    }
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

/// The error of a run that `hand_over` has returned for the other arguments, from two more runs
/// with shorter `set_valued.step`: five times the work of that run.
template <Contacting System, class Stepping = ErrorControlled<Dopri5>>
[[nodiscard]] auto estimate_error(const ContactRun<System>& run, const System& system,
                                  const Eigen::Matrix<double, System::coordinates, 1>& q,
                                  const Eigen::Matrix<double, System::coordinates, 1>& v,
                                  const HandOverOptions& options, const Stepping& stepping = {})
{
    using X = typename detail::FreeFlight<System>::State;
    return detail::estimated_error<X>(run, [&](double part) {
        const auto finer = detail::with_part_of_steps(options, false, part);
        return hand_over(system, q, v, finer, stepping);
    });
}

}  // namespace ricochet

#if RICOCHET_ALIGNED_AS_LIBRARY
RICOCHET_CONTACT_MOTION_OF(2, extern)
RICOCHET_CONTACT_MOTION_OF(3, extern)
#endif
