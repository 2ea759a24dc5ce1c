// Internal: the declarations of this header may change without notice.
//
// A mechanical system with contacts, between its impacts, as a hybrid system.
//
//     flow    q' = v,   M(q) v' = F(t, q, v)
//     guards  the gaps, falling
//     reset   v⁺ = v⁻ + M⁻¹ H' p  with the impulses p of Newton's law of impact and Coulomb's
//             of friction, for all contacts that closed at that instant, together
//
// The system is a value as for `TimeStepping`. No reaction holds a contact that stays closed:
// the run ends there (`Outcome::zeno`), and `contact_motion.hpp` continues.
#pragma once

#include <array>
#include <vector>

#include "ricochet/detail/any_mechanism.hpp"
#include "ricochet/detail/contact_problem.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet {

namespace detail {

template <int N>
class RICOCHET_ALIGNED AnyFlight {
public:
    using State = std::array<double, 2 * static_cast<std::size_t>(N)>;
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;

    static constexpr bool forward_only = true;

    explicit AnyFlight(const AnyMechanism<N>& system, const ContactOptions& contacts = {})
        : system_(system), contacts_(contacts)
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

    [[nodiscard]] std::size_t guard_count() const noexcept
    {
        return static_cast<std::size_t>(system_->contacts);
    }
    [[nodiscard]] static GuardInfo guard_info(std::size_t /*contact*/) noexcept
    {
        GuardInfo info;
        info.name = "gap";
        info.unilateral = true;
        return info;
    }

    void flow(double t, const State& x, State& dxdt) const
    {
        const Vector v = velocity(x);
        Vector acceleration;
        system_->acceleration(t, position(x), v, acceleration);
        Eigen::Map<Vector>(dxdt.data()) = v;
        Eigen::Map<Vector>(dxdt.data() + N) = acceleration;
    }

    [[nodiscard]] double guard(std::size_t contact, double /*t*/, const State& x) const
    {
        return system_->gap(static_cast<int>(contact), position(x));
    }
    [[nodiscard]] double guard_rate(std::size_t contact, double /*t*/, const State& x,
                                    const State& /*dxdt*/) const
    {
        return system_->gap_rate(static_cast<int>(contact), position(x), velocity(x));
    }

    /// Applies the impact. If the solver finds no solution of its contact problem, the
    /// velocity stays as it is, and the run ends because it cannot continue.
    void reset(const FiredGuards& fired, double /*t*/, State& x) const
    {
        const Vector q = position(x);
        Vector v = velocity(x);
        const int D = system_->components;
        typename AnyMechanism<N>::Directions all;
        system_->directions(q, all);
        const auto count = static_cast<Eigen::Index>(fired.size());
        Eigen::Matrix<double, Eigen::Dynamic, N> h(count * D, N);
        std::vector<double> friction;
        for (Eigen::Index k = 0; k < count; ++k) {
            const auto c = static_cast<int>(fired[static_cast<std::size_t>(k)]);
            h.middleRows(k * D, D) = all.middleRows(c * D, D);
            friction.push_back(system_->friction(c));
        }
        Square mass;
        system_->mass(q, mass);
        const Eigen::Matrix<double, N, Eigen::Dynamic> lever = mass.llt().solve(h.transpose());
        Eigen::VectorXd u = h * v;
        for (Eigen::Index k = 0; k < count; ++k) {
            const auto c = static_cast<int>(fired[static_cast<std::size_t>(k)]);
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
    Owned<AnyMechanism<N>> system_;
    ContactOptions contacts_;
};

}  // namespace detail

/// A mechanical system in flight, with the state x = (q, v). An impact allocates memory; flight
/// does not. The impact of one contact without friction, or with one tangent, is computed in closed
/// form: at restitution 1 it keeps the energy to rounding.
template <class System>
class FreeFlight : public detail::AnyFlight<System::coordinates> {
public:
    static constexpr int N = System::coordinates;
    static constexpr int C = System::contacts;
    static constexpr int D = 1 + System::tangents;

    explicit FreeFlight(const System& system, const ContactOptions& contacts = {})
        : FreeFlight::AnyFlight(detail::TypedMechanism<System>(system), contacts)
    {
    }
};

}  // namespace ricochet
