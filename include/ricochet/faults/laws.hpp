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
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ricochet/detail/parameters.hpp"

namespace ricochet {

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

}  // namespace ricochet
