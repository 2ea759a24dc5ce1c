#include "ricochet/systems/impact_oscillator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "base/require.hpp"
#include "ricochet/systems/descriptor.hpp"

namespace ricochet {

namespace {

using Real = long double;

struct Motion {
    Real u;
    Real v;
    Real a = 0;
};

/// The motion between impacts, as a function of the time since the last:
///
///     u = a cos w t + b sin w t + exp(-c s / 2) (p cos k s + q sin k s),
///
/// with k² = 1 - c² / 4 and t = t0 + s.
class Flight {
public:
    Flight(const ImpactOscillator::Parameters& parameters, Real t0, Motion start)
        : w_(parameters.frequency), c_(parameters.damping), k_(std::sqrt(1 - c_ * c_ / 4)), t0_(t0)
    {
        const Real stiff = 1 - w_ * w_;
        const Real size = stiff * stiff + c_ * w_ * c_ * w_;
        a_ = stiff / size;
        b_ = c_ * w_ / size;
        const Motion forced = this->forced(0);
        p_ = start.u - forced.u;
        q_ = (start.v - forced.v + c_ / 2 * p_) / k_;
    }

    [[nodiscard]] Motion operator()(Real s) const noexcept
    {
        const Motion forced = this->forced(s);
        const Real decay = std::exp(-c_ / 2 * s);
        const Real cosine = std::cos(k_ * s);
        const Real sine = std::sin(k_ * s);
        const Real u = decay * (p_ * cosine + q_ * sine);
        const Real v = decay * k_ * (q_ * cosine - p_ * sine) - c_ / 2 * u;
        return {forced.u + u, forced.v + v, forced.a - c_ * v - u};
    }

    /// Rounding of a displacement.
    [[nodiscard]] Real rounding() const noexcept
    {
        constexpr Real epsilon = std::numeric_limits<Real>::epsilon();
        return epsilon * (std::fabs(a_) + std::fabs(b_) + std::fabs(p_) + std::fabs(q_));
    }

private:
    [[nodiscard]] Motion forced(Real s) const noexcept
    {
        const Real angle = w_ * (t0_ + s);
        const Real cosine = std::cos(angle);
        const Real sine = std::sin(angle);
        const Real u = a_ * cosine + b_ * sine;
        return {u, w_ * (b_ * cosine - a_ * sine), -w_ * w_ * u};
    }

    Real w_, c_, k_, t0_;
    Real a_, b_;  // of the forced oscillation
    Real p_, q_;  // of the free one
};

/// The point in (lo, hi] at which `positive` becomes false, to neighbouring numbers.
template <class Positive>
Real bisect(Real lo, Real hi, const Positive& positive)
{
    for (;;) {
        const Real middle = lo + (hi - lo) / 2;
        if (middle <= lo || middle >= hi) return hi;
        (positive(middle) ? lo : hi) = middle;
    }
}

/// The point in (lo, hi) at which `value` changes its sign; hi if it does not.
template <class Value>
Real change_of_sign(Real lo, Real hi, const Value& value)
{
    const bool positive = value(lo) > 0;
    if (positive == (value(hi) > 0)) return hi;
    return bisect(lo, hi, [&](Real s) { return (value(s) > 0) == positive; });
}

/// The first time in (0, longest] at which the flight reaches the wall; negative: none.
///
/// A step is divided where the acceleration changes its sign, and each part where the velocity
/// does: between these points the displacement is monotone.
Real first_impact(const Flight& flight, Real wall, Real step, Real longest)
{
    const auto inside = [&](Real s) { return flight(s).u < wall; };
    const auto velocity = [&](Real s) { return flight(s).v; };
    const auto acceleration = [&](Real s) { return flight(s).a; };
    Real s = 0;
    Motion here = flight(0);
    while (s < longest) {
        const Real next = s + step;
        const Motion there = flight(next);
        if ((here.v > 0) == (there.v > 0) && (here.a > 0) == (there.a > 0)) {
            if (there.u >= wall) return bisect(s, next, inside);
        } else {
            for (const Real hi : {change_of_sign(s, next, acceleration), next}) {
                for (const Real end : {change_of_sign(s, hi, velocity), hi}) {
                    if (!inside(end)) return bisect(s, end, inside);
                    s = end;
                }
            }
        }
        s = next;
        here = there;
    }
    return -1;
}

}  // namespace

ImpactOscillator::ImpactOscillator(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "ImpactOscillator";
    detail::require_positive(self, "frequency", p_.frequency);
    detail::require_positive(self, "wall", p_.wall);
    detail::require(p_.restitution >= 0 && p_.restitution <= 1, self, "restitution",
                    "lie in [0, 1]", p_.restitution);
    detail::require(p_.damping > 0 && p_.damping < 2, self, "damping", "lie in (0, 2)", p_.damping);
}

double ImpactOscillator::period() const noexcept
{
    return 2 * std::numbers::pi / p_.frequency;
}

std::vector<double> ImpactOscillator::impacts(double t_end) const
{
    constexpr Real shortest = 1e-9L;  // shortest flight
    const Real step = 2 * std::numbers::pi_v<Real> / (128 * std::max(1.0, p_.frequency));
    std::vector<double> times;
    Real t = 0;
    Motion now{start[0], start[1]};
    for (;;) {
        const Flight flight(p_, t, now);
        const Real s = first_impact(flight, p_.wall, step, t_end - t);
        if (s < 0 || t + s > t_end) return times;
        // The height of a flight is a quarter of v s; below a hundred roundings its end is noise.
        const bool lost = s < step && std::fabs(now.v) * s < 400 * flight.rounding();
        if (!times.empty() && (s < shortest || lost)) return times;
        t += s;
        now = {p_.wall, -p_.restitution * flight(s).v};
        times.push_back(static_cast<double>(t));
    }
}

const SystemDescriptor& ImpactOscillator::descriptor()
{
    using Numbers = std::span<const double>;
    static const SystemDescriptor all{
        .name = name,
        .type = "ImpactOscillator",
        .description = "A forced and damped oscillator hits a wall on one side.",
        .source =
            "S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear "
            "oscillator, Journal of Sound and Vibration 90, 1983, pages 129 to 155",
        .equations = {"u'' = cos(frequency t) - u - damping u' while u <= wall",
                      "impact at u = wall: v+ = -restitution v"},
        .parameters =
            {{.name = "frequency",
              .initial = Parameters{}.frequency,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the force, in units of the oscillator's own"},
             {.name = "wall",
              .initial = Parameters{}.wall,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "position of the wall"},
             {.name = "restitution",
              .initial = Parameters{}.restitution,
              .unit = "1",
              .range = {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
              .meaning = "Newton's coefficient, speed after over speed before"},
             {.name = "damping",
              .initial = Parameters{}.damping,
              .unit = "1",
              .range = {.lower = 0, .upper = 2},
              .meaning = "twice the damping ratio"}},
        .state = {{.name = "u", .unit = "1", .meaning = "position", .title = "position"},
                  {.name = "v", .unit = "1", .meaning = "velocity", .title = "velocity"}},
        .events = {"impact"},
        .t_end = 100,
        .comparison_step = 0.01,
        .known = {{.name = "impacts",
                   .meaning = "Times of all impacts from the default start up to `t_end`.",
                   .arguments = {{.name = "t_end"}},
                   .values =
                       [](Numbers p, Numbers a) {
                           return with_parameters<ImpactOscillator>(p).impacts(a[0]);
                       },
                   .many = true}},
        .event_times = [](Numbers p, Numbers /*x0*/, double until) {
            return with_parameters<ImpactOscillator>(p).impacts(until);
        }};
    return all;
}

}  // namespace ricochet
