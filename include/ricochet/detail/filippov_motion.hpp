// Internal: the declarations of this header may change without notice.
//
// Motion across and along switching surfaces: the fields that meet at a point, and the
// combinations of them that slide. The base of `Filippov`; it makes no decisions.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <utility>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/filippov_events.hpp"
#include "ricochet/detail/filippov_rates.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

/// The fields give the rates of their surfaces.
template <class Fields, class X>
concept RatedSurfaces = requires(const Fields& fields, double t, const X& x)
{
    {
        fields.surface_rate(std::size_t{}, t, x, x)
        } -> std::convertible_to<double>;
};

template <class X>
[[nodiscard]] double largest_component(const X& x) noexcept
{
    double largest = 0;
    for_each_component(x, [&](auto i) { largest = greatest_of(largest, std::fabs(x[i])); });
    return largest;
}

/// Times [s] over which a motion may change, as far as its present state tells: the time in
/// which the state would change by its own size, and |t|. A motion that starts at 0 has
/// neither, and gets 1 s. They are first guesses, for searches.
struct TimeScales {
    double shortest;
    double longest;

    TimeScales(double t, double size, double speed) noexcept
    {
        const double turn = size / speed;
        const double day = std::fabs(t);
        const bool turns = turn > 0 && std::isfinite(turn);
        longest = greatest_of(turns ? turn : 0, day);
        if (!(longest > 0)) longest = 1;
        shortest = turns && day > 0 ? least_of(turn, day) : longest;
    }
};

/// Values of the four exits: 2 surface + (0 below, 1 above).
using Exits = std::array<double, 4>;

/// Rates [1/s] at s = 0 of functions of time, the size of whose values is `size`, by a
/// central difference. The displacement is fitted so that the largest change is 1e-6 to 1e-3
/// of that size, which loses about 1e-10 to truncation and to rounding each. It is searched
/// for from 1e-5 of the shortest time upward, to 1/100 of the longest.
template <class Function, std::size_t count>
[[nodiscard]] std::array<double, count> fitted_rates(const Function& g,
                                                     const std::array<double, count>& here,
                                                     double size, const TimeScales& times)
{
    using Values = std::array<double, count>;
    const double most = 1e-2 * times.longest;
    double s = 1e-5 * greatest_of(times.shortest, 1e-6 * times.longest);
    Values rates;
    rates.fill(std::numeric_limits<double>::quiet_NaN());
    for (int round = 0; round < 20; ++round) {
        const Values ahead = g(s);
        const Values behind = g(-s);
        double change = 0;
        for (std::size_t k = 0; k < count; ++k) {
            change = greatest_of(change, std::fabs(ahead[k] - here[k]) / size);
            change = greatest_of(change, std::fabs(here[k] - behind[k]) / size);
        }
        if (change > 1e-3) {
            s *= greatest_of(1e-5 / change, 1e-6);
        } else if (change < 1e-6 && s < most) {
            s = least_of(s * least_of(1e-5 / change, 1e4), most);
        } else {
            for (std::size_t k = 0; k < count; ++k) rates[k] = (ahead[k] - behind[k]) / (2 * s);
            break;
        }
    }
    return rates;
}

/// The motion in every mode, and the fields around a point.
template <class Fields>
class FilippovMotion {
public:
    static constexpr std::size_t surface_count = Fields::surface_count;
    static_assert(surface_count == 1 || surface_count == 2,
                  "ricochet: sliding is defined for one or two switching surfaces");
    static constexpr Surfaces both = 3;

    FilippovMotion(Fields fields, const FilippovOptions& options)
        : fields_(std::move(fields)), options_(options)
    {
        check_restoring_rate(options_.restoring_rate);
    }

    [[nodiscard]] const OwnEvents<Fields>& fields() const noexcept { return fields_; }

    // --- places ---

    [[nodiscard]] static constexpr Surfaces bit(std::size_t surface) noexcept
    {
        return 1u << surface;
    }
    /// The one surface of a set of one.
    [[nodiscard]] static constexpr std::size_t only(Surfaces on) noexcept
    {
        return on == bit(0) ? 0 : 1;
    }
    [[nodiscard]] static constexpr Surfaces sliding_in(const Places& at) noexcept
    {
        return (at[0] == Place::sliding ? 1u : 0u) | (at[1] == Place::sliding ? 2u : 0u);
    }
    /// Sliding on all the surfaces in `on`.
    [[nodiscard]] static constexpr Places held_on(Surfaces on, Places at) noexcept
    {
        for (std::size_t i = 0; i < surface_count; ++i) {
            if (on & bit(i)) at[i] = Place::sliding;
        }
        return at;
    }
    [[nodiscard]] static constexpr Places put(Places at, std::size_t surface, Place place) noexcept
    {
        at[surface] = place;
        return at;
    }

    // --- motion ---

    template <class X>
    void flow(const Places& at, double t, const X& x, X& dxdt) const
    {
        const Surfaces on = sliding_in(at);
        if constexpr (surface_count == 2) {
            if (on == both) return slide_on_both(t, x, dxdt);
        }
        if (on == 0) {
            fields_.field(region_of(at), t, x, dxdt);
        } else {
            slide_on(only(on), at, t, x, dxdt);
        }
    }

    template <class X>
    [[nodiscard]] double surface(std::size_t which, double t, const X& x) const
    {
        return fields_.surface(which, t, x);
    }

    template <class X>
    [[nodiscard]] double surface_rate(std::size_t which, double t, const X& x, const X& v) const
    {
        if constexpr (RatedSurfaces<Fields, X>) {
            return fields_.surface_rate(which, t, x, v);
        } else {
            const double size = greatest_of(1.0, largest_component(x));
            const double speed = largest_component(v);
            const double delta = 6e-6 * (speed > 0 ? size / speed : greatest_of(1.0, std::fabs(t)));
            Scratch<X, 1> moved(x);
            move(moved[0], x, delta, v);
            const double ahead = fields_.surface(which, t + delta, moved[0]);
            move(moved[0], x, -delta, v);
            return (ahead - fields_.surface(which, t - delta, moved[0])) / (2 * delta);
        }
    }

    /// Rounding of h at x, where the components had the values of `before` as well: 64 units of the
    /// terms |dh/dx_c| |x_c|, and of that of the time.
    template <class X>
    [[nodiscard]] double rounding(std::size_t which, double t, const X& before, const X& x) const
    {
        Scratch<X, 1> along(x);
        for_each_component(x, [&](auto i) { along[0][i] = 0; });
        const bool known = before.size() == x.size();
        double terms = std::fabs(t) * std::fabs(slope(which, t, x, along[0], 1));
        for_each_component(x, [&](auto i) {
            along[0][i] = 1;
            const double size = greatest_of(std::fabs(x[i]), known ? std::fabs(before[i]) : 0.0);
            if (size > 0) terms += size * std::fabs(slope(which, t, x, along[0], 0));
            along[0][i] = 0;
        });
        return 64 * std::numeric_limits<double>::epsilon() * terms;
    }

    /// Same as `surface_rate`, but 0 where that is within the rounding of its terms, the rates for
    /// single components of v. Only a rate that is small by any measure is worth this check.
    template <class X>
    [[nodiscard]] double resolved_rate(std::size_t which, double t, const X& x, const X& v) const
    {
        const double rate = surface_rate(which, t, x, v);
        if constexpr (RatedSurfaces<Fields, X>) {
            if (rate == 0 || std::fabs(rate) > 1e-6 * largest_component(v)) return rate;
            Scratch<X, 1> part(x);
            for_each_component(x, [&](auto i) { part[0][i] = 0; });
            const double base = surface_rate(which, t, x, part[0]);
            double terms = std::fabs(base);
            for_each_component(x, [&](auto i) {
                part[0][i] = v[i];
                terms += std::fabs(surface_rate(which, t, x, part[0]) - base);
                part[0][i] = 0;
            });
            constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();
            return std::fabs(rate) <= rounding * terms ? 0 : rate;
        } else {
            return rate;
        }
    }

    /// The rate of a surface along the motion at some places.
    template <class X>
    [[nodiscard]] double rate_along(std::size_t which, const Places& at, double t, const X& x) const
    {
        Scratch<X, 1> v(x);
        flow(at, t, x, v[0]);
        return surface_rate(which, t, x, v[0]);
    }

    // --- fields that meet at a point ---

    /// The fields that meet at a point of the surfaces in `on`.
    struct Around {
        RegionRates rates{};
        double speed = 0;  ///< largest component of a field
    };

    template <class X>
    [[nodiscard]] Around around(Surfaces on, const Places& at, double t, const X& x) const
    {
        Around result;
        Scratch<X, 1> f(x);
        const unsigned aside = region_of(at) & ~on;
        for (unsigned region = 0; region < 4; ++region) {
            if ((region & ~on) != aside) continue;
            fields_.field(region, t, x, f[0]);
            result.speed = greatest_of(result.speed, largest_component(f[0]));
            for (std::size_t i = 0; i < surface_count; ++i) {
                if (on & bit(i)) result.rates[i][region] = resolved_rate(i, t, x, f[0]);
            }
        }
        return result;
    }

    /// The exits of a motion that slides on `on`; 1 for those of other surfaces.
    [[nodiscard]] static Exits exits(const RegionRates& rates, Surfaces on,
                                     const Places& at) noexcept
    {
        Exits result = {1, 1, 1, 1};
        if (on == both) {
            const auto [shares, apart] = sliding_shares(rates);
            result = {shares.first, 1 - shares.first, shares.second, 1 - shares.second};
            for (double& exit : result) exit = least_of(exit, apart);
        } else if (on != 0) {
            const std::size_t i = only(on);
            result[2 * i] = rates[i][region_of(put(at, i, Place::below))];
            result[2 * i + 1] = -rates[i][region_of(put(at, i, Place::above))];
        }
        return result;
    }

    /// The shares of the fields above in the motion.
    template <class X>
    [[nodiscard]] Shares shares_in(const Places& at, double t, const X& x) const
    {
        const Surfaces on = sliding_in(at);
        Shares shares{at[0] == Place::above ? 1.0 : 0.0, at[1] == Place::above ? 1.0 : 0.0};
        if (on == 0) return shares;
        const RegionRates rates = around(on, at, t, x).rates;
        if (on == both) return sliding_shares(rates).shares;
        const std::size_t i = only(on);
        const Exits exit = exits(rates, on, at);
        const double sum = exit[2 * i] + exit[2 * i + 1];
        (i == 0 ? shares.first : shares.second) = sum == 0 ? 0.5 : exit[2 * i] / sum;
        return shares;
    }

    // --- onto the surface ---

    /// The surfaces that a motion beside them has reached or crossed: rounding may hide from the
    /// loop that they were met.
    template <class X>
    [[nodiscard]] Surfaces reached_in(const Places& at, double t, const X& x) const
    {
        Surfaces result = 0;
        for (std::size_t i = 0; i < surface_count; ++i) {
            const double h = surface(i, t, x);
            if (at[i] == Place::above ? h <= 0 : at[i] == Place::below && h >= 0) result |= bit(i);
        }
        return result;
    }

    /// Whether x is on the wrong side of a surface.
    template <class X>
    [[nodiscard]] bool is_beyond(std::size_t which, Place place, double t, const X& x) const
    {
        const double h = surface(which, t, x);
        return place == Place::above ? h < 0 : place == Place::below && h > 0;
    }

    /// Moves x along the jumps of the field: onto the surfaces on which the motion is to
    /// slide, and off the surfaces that it leaves, to the side to which it leaves, by no
    /// more than rounding makes necessary.
    template <class X>
    void settle(Surfaces on, const Places& from, const Places& next, double t, X& x) const
    {
        Surfaces held = on & (sliding_in(from) | sliding_in(next));
        // A motion of x onto one of two surfaces also moves it with respect to the other.
        if (on == both && (held | misplaced_in(next, t, x))) held = both;
        if (!held) return;
        Scratch<X, 4> f(x);
        RegionRates rates{};
        const unsigned aside = region_of(next) & ~held;
        for (unsigned region = 0; region < 4; ++region) {
            // Regions that do not meet here repeat those that do: no jump between them.
            fields_.field((region & held) | aside, t, x, f[region]);
            for (std::size_t i = 0; i < surface_count; ++i) {
                if (held & bit(i)) rates[i][region] = resolved_rate(i, t, x, f[region]);
            }
        }
        // Where the motion ceases to slide on both, the jumps at its sliding shares may be
        // parallel.
        const bool slides = sliding_in(next) == both;
        const Shares shares = slides ? sliding_shares(rates).shares : middle_of(next);
        auto normal = normals(shares, rates);
        for (std::size_t i = 0; i < surface_count; ++i) {
            if (!transversal(normal[i], rates[i])) {
                held &= ~bit(i);
                normal[i] = {};
            }
        }
        for (int round = 0; round < 8; ++round) {
            std::array<double, 2> residue{};
            for (std::size_t i = 0; i < surface_count; ++i) {
                if (held & bit(i)) residue[i] = misplaced(i, next[i], round, t, x);
            }
            if (residue[0] == 0 && residue[1] == 0) return;
            const Elimination eliminate(normal, residue, parallel<X>);
            for_each_component(x, [&](auto i) {
                x[i] = eliminate(x[i], by_first(shares, f[0][i], f[1][i], f[2][i], f[3][i]),
                                 by_second(shares, f[0][i], f[1][i], f[2][i], f[3][i]));
            });
        }
    }

private:
    /// Derivative of h along (dt, direction).
    template <class X>
    [[nodiscard]] double slope(std::size_t which, double t, const X& x, const X& direction,
                               double dt) const
    {
        if constexpr (RatedSurfaces<Fields, X>) {
            Scratch<X, 1> none(x);
            for_each_component(x, [&](auto i) { none[0][i] = 0; });
            const double in_time = fields_.surface_rate(which, t, x, none[0]);
            return fields_.surface_rate(which, t, x, direction) - (1 - dt) * in_time;
        } else {
            const double delta = 6e-6 * greatest_of(greatest_of(1.0, largest_component(x)),
                                                    dt != 0 ? std::fabs(t) : 0.0);
            Scratch<X, 1> moved(x);
            move(moved[0], x, delta, direction);
            const double ahead = fields_.surface(which, t + dt * delta, moved[0]);
            move(moved[0], x, -delta, direction);
            return (ahead - fields_.surface(which, t - dt * delta, moved[0])) / (2 * delta);
        }
    }

    /// x' = f_below - (r_below + c h) (f_above - f_below) / (r_above - r_below). Where the
    /// surface is one component of the state, minus a constant, the quotient is 1 and the
    /// component's rate exactly 0.
    template <class X>
    [[gnu::noinline]] void slide_on(std::size_t which, const Places& at, double t, const X& x,
                                    X& dxdt) const
    {
        Scratch<X, 1> f(x);
        fields_.field(region_of(put(at, which, Place::below)), t, x, dxdt);
        fields_.field(region_of(put(at, which, Place::above)), t, x, f[0]);
        const double rate_below = surface_rate(which, t, x, dxdt);
        const double normal = surface_rate(which, t, x, f[0]) - rate_below;
        // A share in [0, 1] keeps the excess within the jump. Beyond the exit, in a step that will
        // be cut there, and where both fields become tangent, only this clamp does.
        const double most = 2 * std::fabs(normal);
        const double excess =
            least_of(greatest_of(rate_below + restoring(which, t, x), -most), most);
        for_each_component(x, [&](auto i) {
            const double jump = f[0][i] - dxdt[i];
            // Fields with the same rate of the surface do not determine the share.
            dxdt[i] -= normal != 0 ? excess * (jump / normal) : -0.5 * jump;
        });
    }

    [[nodiscard]] double restoring(std::size_t which, double t, const auto& x) const
    {
        const double c = options_.restoring_rate;
        return c > 0 ? c * fields_.surface(which, t, x) : 0;
    }

    /// The bilinear combination, minus the rounding that it leaves in the rates of the
    /// surfaces.
    template <class X>
    [[gnu::noinline]] void slide_on_both(double t, const X& x, X& dxdt) const
    {
        Scratch<X, 4> f(x);
        RegionRates rates;
        for (unsigned region = 0; region < 4; ++region) {
            fields_.field(region, t, x, f[region]);
            for (std::size_t i = 0; i < 2; ++i) {
                rates[i][region] = resolved_rate(i, t, x, f[region]);
            }
        }
        const Shares shares = sliding_shares(rates).shares;
        const auto weights = shares.weights();
        for_each_component(
            x, [&](auto i) __attribute__((always_inline)) {
                dxdt[i] = blend(weights, f[0][i], f[1][i], f[2][i], f[3][i]);
            });
        const std::array residue{surface_rate(0, t, x, dxdt) + restoring(0, t, x),
                                 surface_rate(1, t, x, dxdt) + restoring(1, t, x)};
        const Elimination eliminate(normals(shares, rates), residue, parallel<X>);
        if (!eliminate.possible()) return;
        for_each_component(x, [&](auto i) {
            dxdt[i] = eliminate(dxdt[i], by_first(shares, f[0][i], f[1][i], f[2][i], f[3][i]),
                                by_second(shares, f[0][i], f[1][i], f[2][i], f[3][i]));
        });
    }

    /// Ratio below which two directions count as parallel: above the errors of the rates.
    template <class X>
    static constexpr double parallel = RatedSurfaces<Fields, X> ? 0x1p-40 : 0x1p-28;

    /// Derivatives of the bilinear combination with respect to the shares.
    [[nodiscard]] static double by_first(const Shares& shares, double f0, double f1, double f2,
                                         double f3) noexcept
    {
        return (1 - shares.second) * (f1 - f0) + shares.second * (f3 - f2);
    }
    [[nodiscard]] static double by_second(const Shares& shares, double f0, double f1, double f2,
                                          double f3) noexcept
    {
        return (1 - shares.first) * (f2 - f0) + shares.first * (f3 - f1);
    }
    [[nodiscard]] static std::array<std::array<double, 2>, 2> normals(
        const Shares& shares, const RegionRates& rates) noexcept
    {
        std::array<std::array<double, 2>, 2> normal;
        for (std::size_t i = 0; i < 2; ++i) {
            const auto& r = rates[i];
            normal[i] = {by_first(shares, r[0], r[1], r[2], r[3]),
                         by_second(shares, r[0], r[1], r[2], r[3])};
        }
        return normal;
    }

    /// Distance of h from its intended value.
    template <class X>
    [[nodiscard]] double misplaced(std::size_t which, Place place, int round, double t,
                                   const X& x) const
    {
        const double h = fields_.surface(which, t, x);
        if (place == Place::sliding) return round < 3 ? h : 0;
        if (round == 0) return h;
        const bool right_side = place == Place::above ? h >= 0 : h <= 0;
        return right_side ? 0 : std::ldexp(h, round);
    }

    /// The surfaces for which x is on the wrong side.
    template <class X>
    [[nodiscard]] Surfaces misplaced_in(const Places& at, double t, const X& x) const
    {
        Surfaces result = 0;
        for (std::size_t i = 0; i < surface_count; ++i) {
            if (is_beyond(i, at[i], t, x)) result |= bit(i);
        }
        return result;
    }

    /// Whether the jumps lead across a surface rather than along it. Where fields hold the
    /// motion on a surface, the jump is larger than either rate.
    [[nodiscard]] static bool transversal(const std::array<double, 2>& jump,
                                          const std::array<double, 4>& rates) noexcept
    {
        return largest_component(jump) > 0x1p-6 * largest_component(rates);
    }

    OwnEvents<Fields> fields_;
    FilippovOptions options_;
};

}  // namespace ricochet::detail
