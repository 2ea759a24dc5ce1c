// Internal: the declarations of this header may change without notice.
//
// A mechanical system with contacts as a hybrid system: its flight, and what it declares beside.
//
//     flow    q' = v,   M(q) v' = F(t, q, v) - dry friction of moving coordinates
//     guards  the gaps, falling, in flight; then those that the system declares; then, in flight,
//             the velocities of coordinates with dry friction, towards zero
//     reset   v⁺ = v⁻ + M⁻¹ H' p  with the impulses p of Newton's law of impact and Coulomb's
//             of friction, for all contacts that closed at that instant, together; then the resets
//             that the system declares
//
// A mode is one of the system's and, in the bits above it, the kind of phase (own_mode.hpp): the
// signs of the velocities under dry friction, or contact, where no contact that stays closed and no
// coordinate that stands still is held by this flow (contact_motion.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/own_mode.hpp"
#include "ricochet/nonsmooth/contact_problem.hpp"
#include "ricochet/nonsmooth/detail/any_mechanism.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// Kinds of phases of a mechanism. Bit k of a kind of flight: the k-th coordinate with dry friction
/// moves backward.
class FlightKinds {
public:
    /// With more such coordinates there are no flights.
    static constexpr std::size_t most_dry = 7;

    explicit FlightKinds(std::size_t dry) : dry_(dry <= most_dry ? dry : 0), flies_(dry <= most_dry)
    {
    }
    /// Number of coordinates whose velocities are watched in flight.
    [[nodiscard]] std::size_t dry() const noexcept { return dry_; }
    [[nodiscard]] bool flies() const noexcept { return flies_; }
    [[nodiscard]] Mode contact() const noexcept { return Mode{1} << dry_; }
    [[nodiscard]] Mode count() const noexcept { return contact() + 1; }
    [[nodiscard]] bool is_flight(Mode mode) const noexcept
    {
        return kind_of_phase(mode) != contact();
    }
    [[nodiscard]] static bool is_backward(std::size_t k, Mode mode) noexcept
    {
        return (kind_of_phase(mode) >> k & 1) != 0;
    }

private:
    std::size_t dry_;
    bool flies_;
};

template <int N>
class RICOCHET_ALIGNED AnyFlight {
public:
    using State = std::array<double, 2 * static_cast<std::size_t>(N)>;
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;

    explicit AnyFlight(const AnyMechanism<N>& system, const ContactOptions& contacts = {})
        : system_(system), contacts_(contacts), dry_(dry_frictions(system)), kinds_(dry_.size())
    {
    }

    [[nodiscard]] static State state(const Vector& q, const Vector& v)
    {
        State x;
        Eigen::Map<Vector>(x.data()) = q;
        Eigen::Map<Vector>(x.data() + N) = v;
        return x;
    }
    [[nodiscard]] static Vector position(const State& x)
    {
        return Eigen::Map<const Vector>(x.data());
    }
    [[nodiscard]] static Vector velocity(const State& x)
    {
        return Eigen::Map<const Vector>(x.data() + N);
    }

    [[nodiscard]] const AnyMechanism<N>& mechanism() const noexcept { return *system_; }
    [[nodiscard]] const FlightKinds& kinds() const noexcept { return kinds_; }
    [[nodiscard]] const std::vector<DryFriction>& dry() const noexcept { return dry_; }

    void accelerate(Mode mode, double t, const State& x, State& dxdt) const
    {
        const Vector v = velocity(x);
        Vector acceleration;
        const MechanismAt at{own_mode(mode), t};
        system_->acceleration(at, position(x), v, acceleration);
        if (kinds_.dry() > 0) acceleration += friction_in(mode, position(x));
        Eigen::Map<Vector>(dxdt.data()) = v;
        Eigen::Map<Vector>(dxdt.data() + N) = acceleration;
    }

    [[nodiscard]] double gap(std::size_t contact, double t, const State& x) const
    {
        return system_->gap(static_cast<int>(contact), t, position(x));
    }
    [[nodiscard]] double gap_rate(std::size_t contact, double t, const State& x) const
    {
        return system_->gap_rate(static_cast<int>(contact), t, position(x), velocity(x));
    }

    /// Applies the impact of some contacts. If the solver finds no solution of their contact
    /// problem, the velocity stays as it is, and the run ends because it cannot continue.
    void collide(std::span<const std::size_t> closed, double t, State& x) const
    {
        const Vector q = position(x);
        Vector v = velocity(x);
        const int D = system_->components;
        typename AnyMechanism<N>::Directions all;
        system_->directions(t, q, all);
        const auto count = static_cast<Eigen::Index>(closed.size());
        Eigen::Matrix<double, Eigen::Dynamic, N> h(count * D, N);
        std::vector<double> friction;
        for (Eigen::Index k = 0; k < count; ++k) {
            const auto c = static_cast<int>(closed[static_cast<std::size_t>(k)]);
            h.middleRows(k * D, D) = all.middleRows(c * D, D);
            friction.push_back(system_->friction(c));
        }
        Square mass;
        system_->mass(q, mass);
        const Eigen::Matrix<double, N, Eigen::Dynamic> lever = mass.llt().solve(h.transpose());
        Eigen::VectorXd u = h * v;
        if (system_->moves) {
            Eigen::VectorXd rates;
            system_->surface_rates(t, q, rates);
            for (Eigen::Index k = 0; k < count; ++k) {
                const auto c = static_cast<int>(closed[static_cast<std::size_t>(k)]);
                u.segment(k * D, D) += rates.segment(c * D, D);
            }
        }
        for (Eigen::Index k = 0; k < count; ++k) {
            const auto c = static_cast<int>(closed[static_cast<std::size_t>(k)]);
            u[k * D] *= 1 + system_->restitution(c);
        }
        Eigen::VectorXd p = Eigen::VectorXd::Zero(count * D);
        ContactSolver solver(contacts_);
        const Eigen::MatrixXd w = h * lever;
        if (!w.allFinite() || !u.allFinite()) return;
        if (!solver.solve(w, u, friction, D, p).converged) return;
        v += lever * p;
        Eigen::Map<Vector>(x.data() + N) = v;
    }

private:
    /// The acceleration by dry friction of the coordinates, which all move.
    [[nodiscard]] Vector friction_in(Mode mode, const Vector& q) const
    {
        Vector force = Vector::Zero();
        for (std::size_t k = 0; k < kinds_.dry(); ++k) {
            force[dry_[k].coordinate] =
                kinds_.is_backward(k, mode) ? dry_[k].force : -dry_[k].force;
        }
        Square mass;
        system_->mass(q, mass);
        return mass.llt().solve(force);
    }

    Owned<AnyMechanism<N>> system_;
    ContactOptions contacts_;
    std::vector<DryFriction> dry_;
    FlightKinds kinds_;
};

/// What a mechanism declares as a hybrid system, with the flow that makes it one.
template <class System>
struct DeclaredBeside : System {
    using State = typename AnyFlight<System::coordinates>::State;
    using Vector = Eigen::Matrix<double, System::coordinates, 1>;
    static constexpr bool has_modes =
        requires(const System& s, Mode mode, const Vector& q, Vector& f)
    {
        s.force(mode, 0.0, q, q, f);
    };

    explicit DeclaredBeside(const System& system) : System(system) {}

    static void flow(Mode, double, const State&, State&) requires has_modes {}
    static void flow(double, const State&, State&) requires(!has_modes) {}
};

/// What a run of a mechanism has besides its `Options`.
struct ContactPhaseOptions {
    double step = 0;           ///< [s] length of the steps in contact; 0: a thousandth of the run
    bool events_only = false;  ///< the run ends where contact would begin
};

/// A mechanical system with the state x = (q, v). An impact allocates memory; flight does not. The
/// impact of one contact without friction, or with one tangent, is computed in closed form: at
/// restitution 1 it keeps the energy to rounding.
template <class System>
class FreeFlight : public AnyFlight<System::coordinates> {
    using Declared = DeclaredBeside<System>;
    static constexpr std::size_t contacts = static_cast<std::size_t>(System::contacts);

public:
    static constexpr int N = System::coordinates;
    static constexpr int C = System::contacts;
    static constexpr int D = 1 + System::tangents;
    using State = typename AnyFlight<N>::State;

private:
    static constexpr bool has_guards = Guarded<Declared, State>;
    static constexpr bool moded = Moded<Declared, State>;
    static constexpr bool is_rated = !has_guards || RatedGuard<Declared, State>;

public:
    static constexpr bool forward_only = true;
    static constexpr bool unchecked_names = true;  ///< those of the system are checked below

    explicit FreeFlight(const System& system, const ContactPhaseOptions& phases = {})
        : FreeFlight::AnyFlight(TypedMechanism<System>(system)),
          declared_(system),
          phases_(phases),
          own_guards_(has_guards ? guard_count_of<State>(declared_) : 0)
    {
        static_assert(check_system<Declared, State>());
        static_assert(
            !Resting<Declared, State>,
            "ricochet: found a mechanism with `rest`; expected none, since contact takes over "
            "where impacts accumulate");
    }

    [[nodiscard]] const ContactPhaseOptions& phase_options() const noexcept { return phases_; }
    /// Number of modes of the system; 0: not declared.
    [[nodiscard]] std::size_t own_mode_count() const
    {
        return moded ? mode_count_of(declared_) : 1;
    }
    [[nodiscard]] std::size_t mode_count() const
    {
        return static_cast<std::size_t>(this->kinds().count()) * own_modes;
    }

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        this->accelerate(mode, t, x, dxdt);
    }

    // --- guards ---

    /// Contacts and the guards of the system.
    [[nodiscard]] std::size_t event_guards() const noexcept { return contacts + own_guards_; }
    [[nodiscard]] std::size_t guard_count() const noexcept
    {
        return event_guards() + this->kinds().dry();
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        GuardInfo info;
        if (which < contacts) {
            info.name = "gap";
            info.unilateral = true;
        } else if (which < event_guards()) {
            info = guard_info_of<State>(declared_, which - contacts);
            info.resets = info.resets && Resetting<Declared, State>;
        } else {
            info.name = "velocity under dry friction";
        }
        return info;
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        if (which < contacts || which >= event_guards()) return !is_asleep(which, mode);
        if constexpr (EnabledIn<Declared>) {
            return call_enabled_in(declared_, which - contacts, own_mode(mode));
        }
        return true;
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode, double t,
                               const State& x) const requires EnabledAt<Declared, State>
    {
        if (which < contacts || which >= event_guards()) return true;
        return call_enabled_at(declared_, which - contacts, own_mode(mode), t, x);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        if (is_asleep(which, mode)) return 1;
        if (which < contacts) return this->gap(which, t, x);
        if (which >= event_guards()) return speed(which - event_guards(), mode, x);
        if constexpr (has_guards) {
            std::uint64_t calls = 0;  // the loop counts them
            return own_guard(which, mode, calls).value(t, x);
        }
        return 0;
    }
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const State& x,
                                    const State& dxdt) const requires is_rated
    {
        if (is_asleep(which, mode)) return 0;
        if (which < contacts) return this->gap_rate(which, t, x);
        if (which >= event_guards()) return speed(which - event_guards(), mode, dxdt);
        if constexpr (has_guards) {
            std::uint64_t calls = 0;
            return own_guard(which, mode, calls).rate(t, x, dxdt, 1);
        }
        return 0;
    }

    // --- resets ---

    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t, State& x) const
    {
        const std::span<const std::size_t> all = fired.guards();
        std::size_t closed = 0;
        while (closed < all.size() && all[closed] < contacts) ++closed;
        if (closed > 0) this->collide(all.first(closed), t, x);
        const Mode own = own_mode(mode);
        return reached(mode, own_resets(all.subspan(closed), fired.time_event(), own, t, x));
    }
    [[nodiscard]] Mode time_reset(Mode mode, double t,
                                  State& x) const requires TimeResetting<Declared, State>
    {
        return reached(mode, call_time_reset(declared_, own_mode(mode), t, x));
    }

    // --- time events ---

    [[nodiscard]] const Times& time_events() const requires ListsTimes<Declared>
    {
        return times_of(declared_);
    }
    [[nodiscard]] double next_time_event(double t) const requires TimedByFunction<Declared>
    {
        return declared_.next_time_event(t);
    }
    [[nodiscard]] double next_time_event(Mode mode, double t, const State& x) const requires
        TimedByState<Declared, State>
    {
        return call_timer(declared_, own_mode(mode), t, x);
    }

private:
    /// Whether a guard of flights is not watched in a mode.
    [[nodiscard]] bool is_asleep(std::size_t which, Mode mode) const noexcept
    {
        return (which < contacts || which >= event_guards()) && !this->kinds().is_flight(mode);
    }
    [[nodiscard]] GuardView<Declared, State> own_guard(std::size_t which, Mode mode,
                                                       std::uint64_t& calls) const
    {
        return {declared_, calls, {which - contacts, own_mode(mode)}};
    }
    /// The size of a velocity, or of its rate, in the direction in which the coordinate moves.
    [[nodiscard]] double speed(std::size_t k, Mode mode, const State& x) const
    {
        const double v = x[static_cast<std::size_t>(N + this->dry()[k].coordinate)];
        return FlightKinds::is_backward(k, mode) ? -v : v;
    }
    /// The mode after a reset, or one that no system has.
    [[nodiscard]] Mode reached(Mode before, Mode own) const
    {
        const std::size_t modes = own_mode_count();
        if (own >= (modes > 0 ? modes : own_modes - 1)) return static_cast<Mode>(-1);
        return kind_of_phase(before) * own_modes + own;
    }
    /// Applies the resets that the system declares, in the order of its guards, a time event last.
    [[nodiscard]] Mode own_resets(std::span<const std::size_t> fired, bool time_event, Mode mode,
                                  double t, State& x) const;

    Declared declared_;
    ContactPhaseOptions phases_;
    std::size_t own_guards_;
};

template <class System>
Mode FreeFlight<System>::own_resets(std::span<const std::size_t> fired, bool time_event, Mode mode,
                                    double t, State& x) const
{
    if constexpr (Resetting<Declared, State>) {
        std::vector<std::size_t> own;
        for (const std::size_t i : fired) {
            const bool is_own = i < event_guards();
            if (is_own && guard_info(i).resets) own.push_back(i - contacts);
        }
        if constexpr (ResetsTogether<Declared, State>) {
            const FiredGuards set(own, time_event);
            if (!own.empty()) return call_reset_set(declared_, set, mode, t, x);
        } else {
            for (const std::size_t i : own) mode = call_reset(declared_, i, mode, t, x);
        }
    }
    if constexpr (TimeResetting<Declared, State>) {
        if (time_event) return call_time_reset(declared_, mode, t, x);
    }
    return mode;
}

}  // namespace ricochet::detail
