// Rate-and-state friction: its laws, and the potentials from which they follow.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/faults/parameters.hpp"

namespace ricochet {

// Laws of rate-and-state friction: friction and rate of the state, with derivatives.
//
// Everything is a function of the slip rate V [m/s] and of xi = log(V* theta / D_RS). With
// DirectEffect::asinh (J. R. Rice and Y. Ben-Zion, PNAS 93, 1996, pages 3811 to 3818)
//
//     f = a asinh(V / w),     w(xi) = 2 V* exp(-(f* + b xi) / a),
//
// odd in V and smooth through V = 0. The speed that drives the state is then
// s = sqrt(V^2 + w^2) - w in place of |V|, for which exact potentials exist; the two
// differ by less than w, which is of the order of 1e-24 m/s.

/// A function of slip rate and state with its derivatives to second order.
struct RateStateJet {
    double value = 0;
    double v = 0, xi = 0;              ///< first derivatives
    double vv = 0, vxi = 0, xixi = 0;  ///< second derivatives
};

/// Friction coefficient and rate of the state [1/s].
struct FrictionAndRate {
    double friction = 0, rate = 0;
};

/// Friction and state rate with their derivatives by V and xi.
struct FrictionAndRateGradient {
    double friction = 0, friction_v = 0, friction_xi = 0;
    double rate = 0, rate_v = 0, rate_xi = 0;
};

namespace detail {

/// The direct effect at one point. In the log form s = r = V and w = 0.
struct DirectTerms {
    double friction;  ///< f
    double w;         ///< [m/s]
    double r;         ///< sqrt(V^2 + w^2)
    double s;         ///< r - w
};

/// A function of the speed s and xi to second order.
struct SpeedJet {
    double value, s, xi, ss, sxi, xixi;
};

/// xi' of each evolution law, for a speed s >= 0.
template <StateEvolution evolution>
[[nodiscard]] inline double state_rate(const RateStateParameters& p, double s, double xi)
{
    if constexpr (evolution == StateEvolution::ageing) {
        return (p.v_star * std::exp(-xi) - s) / p.d_rs;
    } else if constexpr (evolution == StateEvolution::slip) {
        return s > 0 ? -(s / p.d_rs) * (std::log(s / p.v_star) + xi) : 0;
    } else {
        const double heal = p.v_star * std::exp(-xi);
        return (heal - s * s / (4 * heal)) / p.d_rs;
    }
}

template <StateEvolution evolution>
[[nodiscard]] inline SpeedJet state_rate_jet(const RateStateParameters& p, double s, double xi)
{
    const double l = p.d_rs;
    if constexpr (evolution == StateEvolution::ageing) {
        const double heal = p.v_star * std::exp(-xi) / l;
        return {heal - s / l, -1 / l, -heal, 0, 0, heal};
    } else if constexpr (evolution == StateEvolution::slip) {
        if (!(s > 0)) return {};  // the slope in s is +infinity here, but ds/dV vanishes
        const double log_omega = std::log(s / p.v_star) + xi;  // log(V theta / D_RS)
        return {-(s / l) * log_omega, -(log_omega + 1) / l, -s / l, -1 / (l * s), -1 / l, 0};
    } else {
        const double heal = p.v_star * std::exp(-xi) / l;
        const double cut = 1 / (4 * heal * l * l);
        return {heal - s * s * cut, -2 * s * cut, -heal - s * s * cut,
                -2 * cut,           -2 * s * cut, heal - s * s * cut};
    }
}

}  // namespace detail

/// A law of rate-and-state friction.
template <StateEvolution evolution_, DirectEffect effect_>
class RateStateLaw {
public:
    static constexpr StateEvolution evolution = evolution_;
    static constexpr DirectEffect effect = effect_;
    static constexpr PotentialKind potential = potential_kind<evolution>;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit RateStateLaw(const RateStateParameters& parameters = {})
        : p_(parameters), inverse_v_star_(1 / parameters.v_star), inverse_a_(1 / parameters.a)
    {
        validate(parameters);
    }

    [[nodiscard]] const RateStateParameters& parameters() const noexcept { return p_; }

    /// f(V, xi).
    /// @throws std::invalid_argument for V <= 0 with the log form, here and below.
    [[nodiscard]] double friction(double v, double xi) const { return direct(v, xi).friction; }

    /// xi'(V, xi) [1/s].
    [[nodiscard]] double state_rate(double v, double xi) const
    {
        return detail::state_rate<evolution>(p_, direct(v, xi).s, xi);
    }

    /// Friction f(V, xi) and state rate xi'(V, xi) [1/s].
    [[nodiscard]] FrictionAndRate evaluate(double v, double xi) const
    {
        const detail::DirectTerms t = direct(v, xi);
        return {t.friction, detail::state_rate<evolution>(p_, t.s, xi)};
    }

    /// Friction and state rate with their derivatives by V [m/s] and xi.
    [[nodiscard]] FrictionAndRateGradient gradient(double v, double xi) const
    {
        const detail::DirectTerms t = direct(v, xi);
        const detail::SpeedJet g = detail::state_rate_jet<evolution>(p_, t.s, xi);
        const double inverse_r = 1 / t.r;
        const double s_v = v * inverse_r;
        const double s_xi = effect == DirectEffect::log ? 0 : speed_by_state(t);
        return {t.friction, p_.a * inverse_r, p_.b * s_v, g.value, g.s * s_v, g.xi + g.s * s_xi};
    }

    /// The friction to second order.
    [[nodiscard]] RateStateJet friction_jet(double v, double xi) const
    {
        const detail::DirectTerms t = direct(v, xi);
        const double tilt = t.w / t.r * (t.w / t.r) / t.r;  // w^2 / r^3
        return {t.friction,     p_.a / t.r,
                p_.b * v / t.r, -p_.a * v / (t.r * t.r * t.r),
                p_.b * tilt,    p_.b * p_.b * inverse_a_ * v * tilt};
    }

    /// The rate of the state to second order.
    [[nodiscard]] RateStateJet state_rate_jet(double v, double xi) const
    {
        const detail::DirectTerms t = direct(v, xi);
        const detail::SpeedJet g = detail::state_rate_jet<evolution>(p_, t.s, xi);
        const RateStateJet s = speed_jet(v, t);
        return {g.value,
                g.s * s.v,
                g.xi + g.s * s.xi,
                g.ss * s.v * s.v + g.s * s.vv,
                g.sxi * s.v + g.ss * s.v * s.xi + g.s * s.vxi,
                g.xixi + 2 * g.sxi * s.xi + g.ss * s.xi * s.xi + g.s * s.xixi};
    }

    /// s(V, xi) [m/s], the speed that drives the state, with its derivatives.
    [[nodiscard]] RateStateJet speed_jet(double v, double xi) const
    {
        return speed_jet(v, direct(v, xi));
    }

    /// xi of theta [s].
    /// @throws std::invalid_argument unless theta > 0.
    [[nodiscard]] double xi_of_theta(double theta) const
    {
        if (!(theta > 0)) detail::refuse_theta(theta);
        return std::log(p_.v_star * theta / p_.d_rs);
    }
    /// theta [s] of xi.
    [[nodiscard]] double theta_of_xi(double xi) const noexcept
    {
        return p_.d_rs * inverse_v_star_ * std::exp(xi);
    }

    /// The state of steady sliding at V > 0: V theta / D_RS = 1, or 2 of Perrin, Rice, Zheng.
    [[nodiscard]] double steady_state(double v) const
    {
        if (!(v > 0)) detail::refuse_slip_rate(v);
        constexpr double omega = evolution == StateEvolution::prz ? 2 : 1;
        return std::log(omega / (v * inverse_v_star_));
    }
    [[nodiscard]] double steady_friction(double v) const { return friction(v, steady_state(v)); }

    /// f(V, xi) and w, r, s at that point.
    [[nodiscard]] detail::DirectTerms direct(double v, double xi) const
    {
        if constexpr (effect == DirectEffect::log) {
            if (!(v > 0)) detail::refuse_slip_rate(v);
            return {p_.f_star + p_.a * std::log(v * inverse_v_star_) + p_.b * xi, 0, v, v};
        } else {
            const double speed = std::abs(v);
            const double strength = p_.f_star + p_.b * xi;
            const double f = strength + p_.a * std::log(speed * inverse_v_star_);
            // f / a = log(2 V / w): above 40 the asinh is its logarithm and w / V < 1e-17.
            if (f > 40 * p_.a) return {std::copysign(f, v), 0, speed, speed};
            const double w = 2 * p_.v_star * std::exp(-strength * inverse_a_);
            const double r = std::hypot(v, w);
            return {p_.a * std::asinh(v / w), w, r, speed / (r + w) * speed};
        }
    }

private:
    /// ds/dxi = (b/a) w (1 - w/r).
    [[nodiscard]] double speed_by_state(const detail::DirectTerms& t) const
    {
        return p_.b * inverse_a_ * t.w * (t.s / t.r);
    }

    [[nodiscard]] RateStateJet speed_jet(double v, const detail::DirectTerms& t) const
    {
        const double q = t.w / t.r;
        const double ba = p_.b * inverse_a_;
        const double s_xi = speed_by_state(t);
        return {
            t.s, v / t.r, s_xi, q * q / t.r, ba * (v / t.r) * q * q, -ba * s_xi * (1 - q - q * q)};
    }

    RateStateParameters p_;
    double inverse_v_star_, inverse_a_;
};

template <DirectEffect effect = DirectEffect::asinh>
using AgeingLaw = RateStateLaw<StateEvolution::ageing, effect>;
template <DirectEffect effect = DirectEffect::asinh>
using SlipLaw = RateStateLaw<StateEvolution::slip, effect>;
/// Perrin, Rice and Zheng, Journal of the Mechanics and Physics of Solids 43, 1995,
/// pages 1461 to 1495.
template <DirectEffect effect = DirectEffect::asinh>
using PrzLaw = RateStateLaw<StateEvolution::prz, effect>;

// Histories of slip rate and friction, as experiments give them, and the exact state of the
// ageing law along them.

/// Slip rate and friction coefficient at rising times.
struct FrictionHistory {
    /// How the slip rate continues between samples.
    enum class Between {
        constant,  ///< the slip rate keeps the value of a sample until the next, and jumps there
        linear,    ///< the slip rate is linear between samples
    };
    Between between = Between::constant;
    std::vector<double> t{};         ///< [s], rising
    std::vector<double> v{};         ///< [m/s], positive; at a jump the value after it
    std::vector<double> friction{};  ///< empty if it is not known
};

/// Validates a history. @throws std::invalid_argument, saying where, for a history that is empty or
/// unsorted, whose lists differ in length, or that has a slip rate that is not positive.
void validate(const FrictionHistory& history);

/// theta of the ageing law over an interval in which the slip rate goes linearly from v0 to
/// v1, and its derivative by log(D_RS):
///
///     theta(h) = theta e^(-S(h)/D_RS) + integral over 0..h of e^(-(S(h) - S(t))/D_RS) dt,
///
/// S the slip; by Gauss quadrature to rounding, or in closed form where v0 = v1.
struct AgeingState {
    double theta = 0;     ///< [s]
    double by_log_l = 0;  ///< dtheta / dlog(D_RS) [s]
};
/// Advances theta of the ageing law by h [s], see `AgeingState`.
[[nodiscard]] AgeingState advance_ageing(const AgeingState& from, double d_rs, double v0, double v1,
                                         double h);

/// Friction of the exact pair along a history from the state xi at its start.
[[nodiscard]] std::vector<double> ageing_friction(const RateStateParameters& parameters,
                                                  const FrictionHistory& history, double xi = 0);

/// Relative error |found - expected| / |expected| in the Euclidean norm.
[[nodiscard]] double relative_error(const std::vector<double>& found,
                                    const std::vector<double>& expected);
/// Same, relative to expected - f*, the part of friction that depends on state and rate.
[[nodiscard]] double relative_error_beyond(const std::vector<double>& found,
                                           const std::vector<double>& expected, double f_star);

/// Histories with the friction of the ageing law, xi = 0 at their start: half of them with
/// one to five jumps, half continuous with two to eight corners, levels log-uniform in
/// [1e-3, 10] V*, 100 samples 0.02 s apart. (The protocol of Liu, Bhattacharya and Lapusta,
/// arXiv 2507.09796, section 4.2, with our choice of what it leaves open.)
[[nodiscard]] std::vector<FrictionHistory> make_histories(
    std::size_t count, std::uint64_t seed, const RateStateParameters& parameters = {});

/// Histories for training, validation and test.
struct FrictionData {
    std::vector<FrictionHistory> training, validation, test;  ///< 480, 160, 160
};
/// Makes 480, 160 and 160 histories by `make_histories` from one seed.
[[nodiscard]] FrictionData make_friction_data(std::uint64_t seed,
                                              const RateStateParameters& parameters = {});

/// Adds independent normal noise of the given standard deviation to the friction.
void add_noise(std::vector<FrictionHistory>& histories, double deviation, std::uint64_t seed);

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
