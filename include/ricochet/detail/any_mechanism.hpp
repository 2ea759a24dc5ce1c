// Internal: the declarations of this header may change without notice.
//
// A mechanical system with contacts of which only the number of coordinates is known.
//
// Integrators of such systems are compiled for N coordinates, and see a system through
// `AnyMechanism`, which `TypedMechanism` implements for the user's system.
#pragma once

#include <Eigen/Cholesky>

#include <memory>

#include "ricochet/detail/alignment.hpp"
#include "ricochet/detail/owned.hpp"

namespace ricochet::detail {

/// Interface with the functions of time_stepping.hpp.
template <int N>
class RICOCHET_ALIGNED AnyMechanism {
public:
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;
    using Gaps = Eigen::VectorXd;
    using Directions = Eigen::Matrix<double, Eigen::Dynamic, N>;

    AnyMechanism(int of_contacts, int of_components)
        : contacts(of_contacts), components(of_components)
    {
    }
    virtual ~AnyMechanism() = default;

    const int contacts;
    const int components;  ///< per contact: one normal and its tangents

    [[nodiscard]] virtual std::unique_ptr<const AnyMechanism> clone() const = 0;
    virtual void mass(const Vector& q, Square& m) const = 0;
    virtual void force(double t, const Vector& q, const Vector& v, Vector& f) const = 0;
    /// M^-1 F in one call, so that the compiler sees both.
    virtual void acceleration(double t, const Vector& q, const Vector& v, Vector& a) const = 0;
    virtual void gaps(const Vector& q, Gaps& g) const = 0;
    virtual void directions(const Vector& q, Directions& h) const = 0;
    [[nodiscard]] virtual double gap(int contact, const Vector& q) const = 0;
    [[nodiscard]] virtual double gap_rate(int contact, const Vector& q, const Vector& v) const = 0;
    [[nodiscard]] virtual double restitution(int contact) const = 0;
    [[nodiscard]] virtual double friction(int contact) const = 0;
};

/// Refuses a system that does not fit, with a sentence for each member. Returns true.
template <class System>
[[nodiscard]] consteval bool check_mechanism()
{
    using Vector = Eigen::Matrix<double, System::coordinates, 1>;
    using Square = Eigen::Matrix<double, System::coordinates, System::coordinates>;
    using Gaps = Eigen::Matrix<double, System::contacts, 1>;
    using Directions =
        Eigen::Matrix<double, System::contacts*(1 + System::tangents), System::coordinates>;
    static_assert(
        System::tangents == 1 || System::tangents == 2,
        "ricochet: found tangents outside its range; expected 1 in the plane, 2 in space");
    static_assert(
        requires(const System& s, const Vector& q, Square& m) { s.mass(q, m); },
        "ricochet: found no `mass` that fits; expected void mass(const Vector& q, Square& M) "
        "const, Eigen matrices of coordinates rows and 1 or coordinates columns");
    static_assert(
        requires(const System& s, double t, const Vector& q, Vector& f) { s.force(t, q, q, f); },
        "ricochet: found no `force` that fits; expected void force(double t, const Vector& q, "
        "const Vector& v, Vector& F) const, Eigen vectors of coordinates rows");
    static_assert(
        requires(const System& s, const Vector& q, Gaps& g) { s.gaps(q, g); },
        "ricochet: found no `gaps` that fits; expected void gaps(const Vector& q, Gaps& g) const, "
        "Eigen vectors of coordinates and of contacts rows");
    static_assert(
        requires(const System& s, const Vector& q, Directions& h) { s.directions(q, h); },
        "ricochet: found no `directions` that fits; expected void directions(const Vector& q, "
        "Matrix& H) const, an Eigen matrix of contacts * (1 + tangents) rows and coordinates "
        "columns");
    static_assert(
        requires(const System& s) { static_cast<double>(s.restitution(0) + s.friction(0)); },
        "ricochet: found no `restitution` or `friction` that fits; expected double "
        "restitution(int contact) const and double friction(int contact) const");
    return true;
}

template <class System>
class RICOCHET_ALIGNED TypedMechanism final : public AnyMechanism<System::coordinates> {
    static_assert(check_mechanism<System>());
    using Any = AnyMechanism<System::coordinates>;
    using Vector = typename Any::Vector;
    static constexpr int C = System::contacts;
    static constexpr int D = 1 + System::tangents;

public:
    explicit TypedMechanism(const System& system) : Any(C, D), system_(system) {}

    [[nodiscard]] std::unique_ptr<const Any> clone() const override
    {
        return std::make_unique<TypedMechanism>(system_);
    }
    void mass(const Vector& q, typename Any::Square& m) const override { system_.mass(q, m); }
    void force(double t, const Vector& q, const Vector& v, Vector& f) const override
    {
        system_.force(t, q, v, f);
    }
    void acceleration(double t, const Vector& q, const Vector& v, Vector& a) const override
    {
        typename Any::Square m;
        Vector f;
        system_.mass(q, m);
        system_.force(t, q, v, f);
        a = m.llt().solve(f);
    }
    void gaps(const Vector& q, typename Any::Gaps& g) const override
    {
        Eigen::Matrix<double, C, 1> all;
        system_.gaps(q, all);
        g = all;
    }
    void directions(const Vector& q, typename Any::Directions& h) const override
    {
        Eigen::Matrix<double, C * D, System::coordinates> all;
        system_.directions(q, all);
        h = all;
    }
    [[nodiscard]] double gap(int contact, const Vector& q) const override
    {
        Eigen::Matrix<double, C, 1> all;
        system_.gaps(q, all);
        return all[contact];
    }
    [[nodiscard]] double gap_rate(int contact, const Vector& q, const Vector& v) const override
    {
        Eigen::Matrix<double, C * D, System::coordinates> all;
        system_.directions(q, all);
        return all.row(contact * D).dot(v);
    }
    [[nodiscard]] double restitution(int contact) const override
    {
        return system_.restitution(contact);
    }
    [[nodiscard]] double friction(int contact) const override { return system_.friction(contact); }

private:
    System system_;
};

}  // namespace ricochet::detail
