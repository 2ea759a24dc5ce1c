#include "ricochet/systems/buck_converter.hpp"

#include <cmath>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/require.hpp"
#include "ricochet/systems/descriptor.hpp"

namespace ricochet {

namespace {

using Real = long double;

/// The motion while the transistor is on or off, in closed form: x' = A (x - equilibrium) with
/// A = ((0, -1/L), (1/C, -1/(R C))), whose eigenvalues are a +- sqrt(d).
class Phase {
public:
    struct Point {
        Real i, v;
    };

    explicit Phase(const BuckConverter::Parameters& p)
        : p_(p),
          a_(-1 / (2 * Real{p.resistance} * p.capacitance)),
          d_(a_ * a_ - 1 / (Real{p.inductance} * p.capacitance))
    {
    }

    [[nodiscard]] Point after(Real s, const Point& from, bool on) const
    {
        const Real source = on ? p_.input : 0;
        const Real di = from.i - source / p_.resistance, dv = from.v - source;
        const Real r = std::sqrt(std::fabs(d_));
        const Real decay = std::exp(a_ * s);
        const Real c = decay * (d_ < 0 ? std::cos(r * s) : std::cosh(r * s));
        const Real n = decay * (d_ < 0 ? std::sin(r * s) / r : d_ > 0 ? std::sinh(r * s) / r : s);
        // exp(A s) = c + n (A - a), since (A - a)^2 = d.
        return {source / p_.resistance + c * di + n * (-a_ * di - dv / p_.inductance),
                source + c * dv + n * (di / p_.capacitance + a_ * dv)};
    }

    /// Time until the current, which rises while on and falls while off, reaches its bound.
    [[nodiscard]] Real duration(const Point& from, bool on) const
    {
        const auto inside = [&](Real s) {
            const Real i = after(s, from, on).i;
            return on ? i < p_.high : i > p_.low;
        };
        Real low = 0, high = (Real{p_.high} - p_.low) * p_.inductance / p_.input;
        while (inside(high)) low = high, high *= 2;
        for (;;) {
            const Real middle = low + (high - low) / 2;
            if (middle <= low || middle >= high) return high;
            (inside(middle) ? low : high) = middle;
        }
    }

private:
    BuckConverter::Parameters p_;
    Real a_, d_;
};

std::vector<double> switch_times(std::span<const double> parameters, std::span<const double> start,
                                 double t_end)
{
    const auto& [input, inductance, capacitance, resistance, low, high] =
        detail::parameters_from<BuckConverter::Parameters>(parameters,
                                                           std::make_index_sequence<6>{});
    if (start[0] < low || start[0] > high || start[1] < 0 || start[1] > resistance * high) {
        throw std::invalid_argument(
            "the event times of buck-converter are known from low <= current <= high and 0 <= "
            "voltage <= resistance high");
    }
    const Phase phase({input, inductance, capacitance, resistance, low, high});
    std::vector<double> times;
    Phase::Point now{start[0], start[1]};
    bool on = true;
    for (Real t = 0;; on = !on) {
        const Real s = phase.duration(now, on);
        t += s;
        if (!(t <= t_end)) return times;
        times.push_back(static_cast<double>(t));
        now = {on ? high : low, phase.after(s, now, on).v};
    }
}

}  // namespace

BuckConverter::BuckConverter(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "BuckConverter";
    detail::require_positive(self, "inductance", p_.inductance);
    detail::require_positive(self, "capacitance", p_.capacitance);
    detail::require_positive(self, "resistance", p_.resistance);
    detail::require_positive(self, "low", p_.low);
    detail::require_above(self, "high", p_.high, "low", p_.low);
    detail::require_above(self, "input", p_.input, "resistance * high", p_.resistance * p_.high);
}

const SystemDescriptor& BuckConverter::descriptor()
{
    static const SystemDescriptor all{
        .name = name,
        .type = "BuckConverter",
        .description = "A step-down converter is switched by the current through its inductor.",
        .source =
            "R. W. Erickson and D. Maksimovic, Fundamentals of Power Electronics, "
            "Springer, 2001, chapters 2 and 12",
        .equations = {"inductance i' = input - v (on), -v (off); off at i = high, on at i = low",
                      "capacitance v' = i - v / resistance"},
        .parameters = {{.name = "input",
                        .initial = Parameters{}.input,
                        .unit = "V",
                        .range = {.lower = 0},
                        .meaning = "voltage of the source, above resistance high"},
                       {.name = "inductance",
                        .initial = Parameters{}.inductance,
                        .unit = "H",
                        .range = {.lower = 0},
                        .meaning = "of the inductor"},
                       {.name = "capacitance",
                        .initial = Parameters{}.capacitance,
                        .unit = "F",
                        .range = {.lower = 0},
                        .meaning = "beside the load"},
                       {.name = "resistance",
                        .initial = Parameters{}.resistance,
                        .unit = "Ohm",
                        .range = {.lower = 0},
                        .meaning = "of the load"},
                       {.name = "low",
                        .initial = Parameters{}.low,
                        .unit = "A",
                        .range = {.lower = 0},
                        .meaning = "current where the transistor is switched on"},
                       {.name = "high",
                        .initial = Parameters{}.high,
                        .unit = "A",
                        .range = {.lower = 0},
                        .meaning = "current where it is switched off, above low"}},
        .state = {{.name = "i",
                   .unit = "A",
                   .meaning = "current",
                   .title = "current",
                   .start = start[0],
                   .start_meaning = "at the start, transistor on"},
                  {.name = "v",
                   .unit = "V",
                   .meaning = "voltage of the load",
                   .title = "voltage",
                   .start = start[1],
                   .start_meaning = "at the start"}},
        .events = {"off", "on"},
        .t_end = 0.005,
        .comparison_step = 1e-6,
        .event_times = switch_times};
    return all;
}

}  // namespace ricochet
