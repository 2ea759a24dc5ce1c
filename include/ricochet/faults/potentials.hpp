// Potentials of rate-and-state friction.
//
// A pair of potentials, of slip rate and state and of the rate of the state, gives
//
//     f = dDdag/dV,                              (5)
//     dD/d(xi') + dDdag/dxi = 0,                 (6)
//     D*(d) = sup over xi' of d xi' - D(xi'),    (8)
//     xi' = dD*/dd at d = -dDdag/dxi             (9)
//
// (equations of S. Liu, K. Bhattacharya and N. Lapusta, arXiv 2507.09796, 2025). The potentials of
// `AgeingPotential` and `StateDependentPotential` reproduce their law exactly; they are not fitted.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "ricochet/faults/laws.hpp"

namespace ricochet {

/// A function of one variable with two derivatives.
struct ScalarJet {
    double value = 0, first = 0, second = 0;
};

/// Potentials as above. Those of the state's rate may depend on the state as well.
template <class Pair>
concept PotentialPair = requires(const Pair& pair, double v, double xi, double d)
{
    {
        pair.rate_potential(v, xi)
        } -> std::same_as<RateStateJet>;  // Ddag
    {
        pair.dual(d, xi)
        } -> std::same_as<ScalarJet>;  // D*
    {
        pair.primal(d, xi)
        } -> std::same_as<ScalarJet>;  // D, of the rate d
    {
        Pair::kind
        } -> std::convertible_to<PotentialKind>;
};

/// The ageing law.
///
///     Ddag(V, xi) = f* V + a V (log(V/V*) - 1) + b xi V + b V* e^-xi    (log)
///     Ddag(V, xi) = a (V asinh(V/w) - s) + b V* e^-xi                   (asinh)
///     D(xi') = (b D_RS / 2) xi'^2,      D*(d) = d^2 / (2 b D_RS)
///
/// dDdag/dxi = b (s - V* e^-xi) with s = V in the log form, so that (9) is
/// xi' = (V* e^-xi - s) / D_RS, the ageing law. D and D* are strictly convex; Ddag is
/// convex in V and in xi, and in both together where V theta / D_RS <= a/b.
template <DirectEffect effect = DirectEffect::asinh>
class AgeingPotential {
public:
    static constexpr PotentialKind kind = PotentialKind::quadratic;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit AgeingPotential(const RateStateParameters& parameters = {}) : law_(parameters) {}

    [[nodiscard]] const AgeingLaw<effect>& law() const noexcept { return law_; }

    /// @throws std::invalid_argument for V <= 0 with the log form.
    [[nodiscard]] RateStateJet rate_potential(double v, double xi) const
    {
        const RateStateParameters& p = law_.parameters();
        const RateStateJet f = law_.friction_jet(v, xi);
        const RateStateJet s = law_.speed_jet(v, xi);
        const double heal = p.b * p.v_star * std::exp(-xi);
        return {v * f.value - p.a * s.value + heal,
                f.value,
                p.b * s.value - heal,
                f.v,
                f.xi,
                p.b * s.xi + heal};
    }

    /// D*(d) = d² / (2 b D_RS) with its first two derivatives.
    [[nodiscard]] ScalarJet dual(double d, double /*xi*/ = 0) const
    {
        const double stiffness = law_.parameters().b * law_.parameters().d_rs;
        return {d * d / (2 * stiffness), d / stiffness, 1 / stiffness};
    }
    /// D(xi') = b D_RS xi'² / 2 with its first two derivatives.
    [[nodiscard]] ScalarJet primal(double rate, double /*xi*/ = 0) const
    {
        const double stiffness = law_.parameters().b * law_.parameters().d_rs;
        return {stiffness / 2 * rate * rate, stiffness * rate, stiffness};
    }

private:
    AgeingLaw<effect> law_;
};

/// The slip law and that of Perrin, Rice and Zheng, for which no D*(d) of d alone exists
/// (docs/rate-and-state.md). With
///
///     Ddag = integral of f dV,      so that d = -b s,
///
/// the rate of the state is a function of d for every xi, whose integral is D*(d; xi):
///
///     slip   D* = (b / 2 D_RS) s^2 (log(s/V*) + xi - 1/2),       s = -d/b
///            convex in d where V theta / D_RS >= 1/e
///     prz    D* = d V* e^-xi / D_RS - d^3 e^xi / (12 b^2 D_RS V*)
///            convex in d <= 0 for every state
template <StateEvolution evolution, DirectEffect effect = DirectEffect::asinh>
requires(evolution != StateEvolution::ageing) class StateDependentPotential {
public:
    static constexpr PotentialKind kind = potential_kind<evolution>;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit StateDependentPotential(const RateStateParameters& parameters = {}) : law_(parameters)
    {
    }

    [[nodiscard]] const RateStateLaw<evolution, effect>& law() const noexcept { return law_; }

    /// @throws std::invalid_argument for V <= 0 with the log form.
    [[nodiscard]] RateStateJet rate_potential(double v, double xi) const
    {
        const RateStateParameters& p = law_.parameters();
        const RateStateJet f = law_.friction_jet(v, xi);
        const RateStateJet s = law_.speed_jet(v, xi);
        return {v * f.value - p.a * s.value, f.value, p.b * s.value, f.v, f.xi, p.b * s.xi};
    }

    /// D*(d; xi) for d <= 0.
    /// @throws std::invalid_argument for d > 0.
    [[nodiscard]] ScalarJet dual(double d, double xi) const;

    /// D(xi'; xi), the transform of D* where that is convex.
    /// @throws std::invalid_argument for a rate that no d of the convex range gives.
    [[nodiscard]] ScalarJet primal(double rate, double xi) const;

private:
    RateStateLaw<evolution, effect> law_;
};

template <DirectEffect effect = DirectEffect::asinh>
using SlipPotential = StateDependentPotential<StateEvolution::slip, effect>;
template <DirectEffect effect = DirectEffect::asinh>
using PrzPotential = StateDependentPotential<StateEvolution::prz, effect>;

/// Friction (5) and rate of the state (9) from the potentials alone.
template <PotentialPair Pair>
[[nodiscard]] FrictionAndRate evaluate(const Pair& pair, double v, double xi)
{
    const RateStateJet potential = pair.rate_potential(v, xi);
    return {potential.v, pair.dual(-potential.xi, xi).first};
}

// A learned pair of potentials made of three monotone functions of one variable.
//
//     f   = A(log(V/V*)) + beta xi
//     xi' = G(d),      d = e^C(xi) - V/V*
//
// A and G rise, C falls. The potentials are
//
//     Ddag = integral of A dV + beta V xi + beta V* c(xi),   c' = -e^C,
//     D*   = beta V* g(d / (beta V*)),                        g' = G,
//
// convex in V, in xi and in d by construction; beta sets the unit of xi and is not
// fitted.

/// offset + slope z + sum of weight_i tanh(scale_i z + shift_i), of at most eight units. It
/// rises where slope >= 0 and every weight_i scale_i >= 0.
struct MonotoneNet {
    static constexpr std::size_t most_units = 8;
    using Row = std::array<double, most_units>;

    std::size_t units = 0;
    double offset = 0, slope = 0;
    Row weight{}, scale{}, shift{};  ///< zero beyond `units`

    /// Value with two derivatives.
    [[nodiscard]] ScalarJet jet(double z) const noexcept;
    /// Weights, scales, shifts, offset and slope.
    [[nodiscard]] std::size_t parameters() const noexcept { return 3 * units + 2; }
};

/// Domain in which a pair was trained.
struct PairDomain {
    double v_min = 0, v_max = 0;  ///< [m/s]
    double xi_min = 0, xi_max = 0;
};

/// A learned pair of potentials, Ddag(V, xi) and D*(d), whose friction is A(log V/V*) + beta xi
/// with monotone networks.
class AdditivePair {
public:
    static constexpr PotentialKind kind = PotentialKind::quadratic;  ///< D* of d alone
    static constexpr DirectEffect effect = DirectEffect::log;

    struct Parameters {
        double v_star = 1e-4;  ///< V* [m/s], a unit; positive
        double beta = 0.01;    ///< positive
        MonotoneNet direct;    ///< A
        MonotoneNet state;     ///< -C
        MonotoneNet rate;      ///< G, without offset: G(0) is set to zero
        PairDomain domain{};
    };

    /// @throws std::invalid_argument for a unit that makes a potential not convex, a weight that is
    /// not finite, or V* or beta that is not positive. The message names the net, the unit and the
    /// value.
    explicit AdditivePair(const Parameters& parameters);

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }
    /// Number of fitted parameters.
    [[nodiscard]] std::size_t fitted() const noexcept;

    /// @throws std::invalid_argument for V <= 0, here and below.
    [[nodiscard]] FrictionAndRate evaluate(double v, double xi) const;
    [[nodiscard]] FrictionAndRateGradient gradient(double v, double xi) const;

    /// Ddag(V, xi) with its derivatives; the value is found by quadrature, in microseconds.
    [[nodiscard]] RateStateJet rate_potential(double v, double xi) const;
    [[nodiscard]] ScalarJet dual(double d, double /*xi*/ = 0) const;
    /// @throws std::invalid_argument for a rate that G does not reach.
    [[nodiscard]] ScalarJet primal(double rate, double /*xi*/ = 0) const;

private:
    Parameters p_;
    double rate_at_zero_ = 0;  ///< rate that the units of G give at d = 0
};

static_assert(PotentialPair<AdditivePair>);

/// A potential file that cannot be read or is not what it claims to be: file, place, what
/// was expected and what was found.
class PotentialFileError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Reads a pair from a file (JSON). A file is refused if it claims to be convex and a unit
/// contradicts it, or if its stored test values are not those of its weights.
/// @throws PotentialFileError
[[nodiscard]] AdditivePair load_pair(const std::filesystem::path& path);
[[nodiscard]] AdditivePair parse_pair(const std::string& text, const std::string& name);

/// Text of a file with test values; reading it back gives the same bits.
[[nodiscard]] std::string to_json(const AdditivePair& pair);

}  // namespace ricochet
