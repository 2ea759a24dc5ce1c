// Internal: the declarations of this header may change without notice.
//
// A mechanical system with contacts of which only the number of coordinates is known.
//
// Integrators of such systems are compiled for N coordinates, and see a system through
// `AnyMechanism`, which `TypedMechanism` implements for the user's system.
#pragma once

#include <Eigen/Cholesky>

#include <memory>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/nonsmooth/detail/alignment.hpp"
#include "ricochet/nonsmooth/detail/owned.hpp"

namespace ricochet::detail {

/// Where the functions of a mechanism are evaluated.
struct MechanismAt {
    Mode mode = 0;
    double t = 0;  ///< [s]
};

/// Interface with the functions of time_stepping.hpp.
template <int N>
class RICOCHET_ALIGNED AnyMechanism {
public:
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;
    using Gaps = Eigen::VectorXd;
    using Directions = Eigen::Matrix<double, Eigen::Dynamic, N>;

    /// @param surfaces_move  whether there are `surface_rates`
    AnyMechanism(int of_contacts, int of_components, bool surfaces_move)
        : contacts(of_contacts), components(of_components), moves(surfaces_move)
    {
    }
    virtual ~AnyMechanism() = default;

    const int contacts;
    const int components;  ///< per contact: one normal and its tangents
    const bool moves;

    [[nodiscard]] virtual std::unique_ptr<const AnyMechanism> clone() const = 0;
    virtual void mass(const Vector& q, Square& m) const = 0;
    virtual void force(MechanismAt at, const Vector& q, const Vector& v, Vector& f) const = 0;
    /// M^-1 F in one call, so that the compiler sees both.
    virtual void acceleration(MechanismAt at, const Vector& q, const Vector& v,
                              Vector& a) const = 0;
    virtual void gaps(double t, const Vector& q, Gaps& g) const = 0;
    virtual void directions(double t, const Vector& q, Directions& h) const = 0;
    /// Relative velocities of the contacts where v = 0.
    virtual void surface_rates(double t, const Vector& q, Eigen::VectorXd& b) const = 0;
    [[nodiscard]] virtual double gap(int contact, double t, const Vector& q) const = 0;
    [[nodiscard]] virtual double gap_rate(int contact, double t, const Vector& q,
                                          const Vector& v) const = 0;
    [[nodiscard]] virtual double restitution(int contact) const = 0;
    [[nodiscard]] virtual double friction(int contact) const = 0;
    [[nodiscard]] virtual double dry_friction(int coordinate) const = 0;
};

/// A coordinate with dry friction.
struct DryFriction {
    int coordinate;
    double force;  ///< [N], or [N m] where it is an angle; positive
};

/// @throws std::invalid_argument, naming the coordinate, for a force that is negative or not finite
[[nodiscard]] DryFriction checked(const DryFriction& of);

template <int N>
[[nodiscard]] std::vector<DryFriction> dry_frictions(const AnyMechanism<N>& mechanism)
{
    std::vector<DryFriction> all;
    for (int i = 0; i < N; ++i) {
        const DryFriction of = checked({i, mechanism.dry_friction(i)});
        if (of.force > 0) all.push_back(of);
    }
    return all;
}

/// Refuses members of contacts that do not fit.
template <class System>
consteval void check_contacts()
{
    using Vector = Eigen::Matrix<double, System::coordinates, 1>;
    using Gaps = Eigen::Matrix<double, System::contacts, 1>;
    using Directions =
        Eigen::Matrix<double, System::contacts*(1 + System::tangents), System::coordinates>;
    using Rates = Eigen::Matrix<double, System::contacts*(1 + System::tangents), 1>;
    static_assert(
        requires(const System& s, const Vector& q, Gaps& g) { s.gaps(q, g); } ||
            requires(const System& s, double t, const Vector& q, Gaps& g) { s.gaps(t, q, g); },
        "ricochet: found no `gaps` that fits; expected void gaps(const Vector& q, Gaps& g) const, "
        "Eigen vectors of coordinates and of contacts rows, or the same with a double t before q");
    static_assert(
        requires(const System& s, const Vector& q, Directions& h) { s.directions(q, h); } ||
            requires(const System& s, double t, const Vector& q, Directions& h) {
                s.directions(t, q, h);
            },
        "ricochet: found no `directions` that fits; expected void directions(const Vector& q, "
        "Matrix& H) const, an Eigen matrix of contacts * (1 + tangents) rows and coordinates "
        "columns, or the same with a double t before q");
    constexpr bool names_rates = requires
    {
        &System::surface_rates;
    };
    constexpr bool has_rates = requires(const System& s, double t, const Vector& q, Rates& b)
    {
        s.surface_rates(t, q, b);
    };
    static_assert(
        has_rates || !names_rates,
        "ricochet: found no `surface_rates` that fits; expected void surface_rates(double t, "
        "const Vector& q, Vector& b) const, an Eigen vector of contacts * (1 + tangents) rows");
    static_assert(
        has_rates ||
            !requires(const System& s, double t, const Vector& q, Gaps& g) { s.gaps(t, q, g); },
        "ricochet: found `gaps` with a time, and no `surface_rates`; expected void "
        "surface_rates(double t, const Vector& q, Vector& b) const, the rates of the gaps and "
        "slip velocities where v = 0");
    static_assert(
        requires(const System& s) { static_cast<double>(s.restitution(0) + s.friction(0)); },
        "ricochet: found no `restitution` or `friction` that fits; expected double "
        "restitution(int contact) const and double friction(int contact) const");
}

/// Refuses a system that does not fit, with a sentence for each member; one without contacts needs
/// none of their members. Returns true.
template <class System>
[[nodiscard]] consteval bool check_mechanism()
{
    using Vector = Eigen::Matrix<double, System::coordinates, 1>;
    using Square = Eigen::Matrix<double, System::coordinates, System::coordinates>;
    static_assert(
        System::tangents == 1 || System::tangents == 2,
        "ricochet: found tangents outside its range; expected 1 in the plane, 2 in space");
    static_assert(
        requires(const System& s, const Vector& q, Square& m) { s.mass(q, m); },
        "ricochet: found no `mass` that fits; expected void mass(const Vector& q, Square& M) "
        "const, Eigen matrices of coordinates rows and 1 or coordinates columns");
    static_assert(
        requires(const System& s, double t, const Vector& q, Vector& f) { s.force(t, q, q, f); } ||
            requires(const System& s, Mode mode, const Vector& q, Vector& f) {
                s.force(mode, 0.0, q, q, f);
            },
        "ricochet: found no `force` that fits; expected void force(double t, const Vector& q, "
        "const Vector& v, Vector& F) const, Eigen vectors of coordinates rows, or the same with a "
        "Mode before t");
    if constexpr (System::contacts > 0) check_contacts<System>();
    constexpr bool names_friction = requires
    {
        &System::dry_friction;
    };
    static_assert(
        !names_friction || requires(const System& s) { static_cast<double>(s.dry_friction(0)); },
        "ricochet: found no `dry_friction` that fits; expected double dry_friction(int coordinate) "
        "const, the force of dry friction of a coordinate");
    return true;
}

template <class System>
class RICOCHET_ALIGNED TypedMechanism final : public AnyMechanism<System::coordinates> {
    static_assert(check_mechanism<System>());
    using Any = AnyMechanism<System::coordinates>;
    using Vector = typename Any::Vector;
    static constexpr int C = System::contacts;
    static constexpr int D = 1 + System::tangents;
    using FixedGaps = Eigen::Matrix<double, C, 1>;
    using FixedRates = Eigen::Matrix<double, C * D, 1>;
    using FixedDirections = Eigen::Matrix<double, C * D, System::coordinates>;
    static constexpr bool has_rates =
        requires(const System& s, double t, const Vector& q, FixedRates& b)
    {
        s.surface_rates(t, q, b);
    };

public:
    explicit TypedMechanism(const System& system) : Any(C, D, has_rates), system_(system) {}

    [[nodiscard]] std::unique_ptr<const Any> clone() const override
    {
        return std::make_unique<TypedMechanism>(system_);
    }
    void mass(const Vector& q, typename Any::Square& m) const override { system_.mass(q, m); }
    void force(MechanismAt at, const Vector& q, const Vector& v, Vector& f) const override
    {
        if constexpr (requires { system_.force(at.mode, at.t, q, v, f); }) {
            system_.force(at.mode, at.t, q, v, f);
        } else {
            system_.force(at.t, q, v, f);
        }
    }
    void acceleration(MechanismAt at, const Vector& q, const Vector& v, Vector& a) const override
    {
        typename Any::Square m;
        Vector f;
        system_.mass(q, m);
        force(at, q, v, f);
        a = m.llt().solve(f);
    }
    void gaps(double t, const Vector& q, typename Any::Gaps& g) const override
    {
        g = fixed_gaps(t, q);
    }
    void directions(double t, const Vector& q, typename Any::Directions& h) const override
    {
        h = fixed_directions(t, q);
    }
    void surface_rates(double t, const Vector& q, Eigen::VectorXd& b) const override
    {
        b = fixed_rates(t, q);
    }
    [[nodiscard]] double gap(int contact, double t, const Vector& q) const override
    {
        if constexpr (C > 0) return fixed_gaps(t, q)[contact];
        return 0;
    }
    [[nodiscard]] double gap_rate(int contact, double t, const Vector& q,
                                  const Vector& v) const override
    {
        double rate = 0;
        if constexpr (C > 0) rate = fixed_directions(t, q).row(contact * D).dot(v);
        if constexpr (has_rates) rate += fixed_rates(t, q)[contact * D];
        return rate;
    }
    [[nodiscard]] double restitution(int contact) const override
    {
        if constexpr (C > 0) return system_.restitution(contact);
        return 0;
    }
    [[nodiscard]] double friction(int contact) const override
    {
        if constexpr (C > 0) return system_.friction(contact);
        return 0;
    }
    [[nodiscard]] double dry_friction(int coordinate) const override
    {
        if constexpr (requires { system_.dry_friction(coordinate); }) {
            return system_.dry_friction(coordinate);
        }
        return 0;
    }

private:
    [[nodiscard]] FixedGaps fixed_gaps(double t, const Vector& q) const
    {
        FixedGaps all;
        if constexpr (requires { system_.gaps(t, q, all); }) {
            system_.gaps(t, q, all);
        } else if constexpr (C > 0) {
            system_.gaps(q, all);
        }
        return all;
    }
    [[nodiscard]] FixedDirections fixed_directions(double t, const Vector& q) const
    {
        FixedDirections all;
        if constexpr (requires { system_.directions(t, q, all); }) {
            system_.directions(t, q, all);
        } else if constexpr (C > 0) {
            system_.directions(q, all);
        }
        return all;
    }
    [[nodiscard]] FixedRates fixed_rates(double t, const Vector& q) const
    {
        FixedRates all = FixedRates::Zero();
        if constexpr (has_rates) system_.surface_rates(t, q, all);
        return all;
    }

    System system_;
};

}  // namespace ricochet::detail
