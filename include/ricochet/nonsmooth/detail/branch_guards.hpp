// Internal: the declarations of this header may change without notice.
//
// The guards of `AnyModes`, and its reset; a part of branch_modes.hpp.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "ricochet/nonsmooth/branch_modes.hpp"

namespace ricochet::detail {

template <int N, int M>
[[gnu::always_inline]] inline void AnyModes<N, M>::rooms(Mode mode, double t, const Vector& w,
                                                         Motion& motion, Rooms& rooms) const
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    find_motion(mode, t, w, motion);
    const Reaction &r = motion.reaction, &lower = motion.lower, &upper = motion.upper;
    rooms.fill(infinity);
    Mode rest = mode;
    for (Eigen::Index i = 0; i < count(); ++i, rest /= 3) {
        const auto k = static_cast<std::size_t>(i);
        if (rest % 3 != 1) continue;
        if (!std::isinf(lower[i])) rooms[2 * k] = r[i] - lower[i];
        if (!std::isinf(upper[i])) rooms[2 * k + 1] = upper[i] - r[i];
    }
}

template <int N, int M>
double AnyModes<N, M>::guard(std::size_t which, Mode mode, double t, const Vector& w) const
{
    const auto i = static_cast<Eigen::Index>(which / 4);
    if (which >= first_set_guard) {
        Reaction lower, upper;
        matrices_.inclusion().bounds(t, w, lower, upper);
        const auto k = static_cast<Eigen::Index>(which - first_set_guard);
        return is_set(mode, k, lower[k], upper[k], observed(t, w)[k]);
    }
    if (which % 4 < 2) {
        const double y = observed(t, w)[i];
        return which % 4 == 0 ? y : -y;
    }
    return slacks(i, mode, t, w)[which % 4 - 2];
}

template <int N, int M>
void AnyModes<N, M>::guards(Mode mode, double t, const Vector& w, const Motion* known,
                            std::span<double> g) const
{
    const Reaction y = observed(t, w);
    Motion room;
    if (!known) find_bounded_motion(mode < branch_modes ? mode : 0, t, w, room);
    const Motion& here = known ? *known : room;
    Reaction lower = here.lower, upper = here.upper;
    if (matrices_.traits().continues_bounds) matrices_.inclusion().bounds(t, w, lower, upper);
    if (count() < M) std::fill(g.begin(), g.end(), 1.0);
    for (Eigen::Index i = 0; i < count(); ++i) {
        const auto k = static_cast<std::size_t>(i);
        const Slacks slack = slacks(here.lower[i], here.upper[i], here.reaction[i]);
        g[4 * k] = y[i];
        g[4 * k + 1] = -y[i];
        g[4 * k + 2] = slack[0];
        g[4 * k + 3] = slack[1];
        g[first_set_guard + k] = is_set(mode, i, lower[i], upper[i], y[i]);
    }
}

template <int N, int M>
double AnyModes<N, M>::guard_rate(std::size_t which, Mode mode, double t, const Vector& w,
                                  const Vector& dwdt) const
{
    if (which >= first_set_guard) return 0;
    const auto i = static_cast<Eigen::Index>(which / 4);
    if (which % 4 >= 2) {
        return slack_rates(i, mode, t, w, dwdt, motion(mode, t, w))[which % 4 - 2];
    }
    const double rate = observed_rate(i, mode, t, w, dwdt);
    return which % 4 == 0 ? rate : -rate;
}

template <int N, int M>
void AnyModes<N, M>::guard_rates(Mode mode, double t, const Vector& w, const Vector& dwdt,
                                 const Motion* known, std::span<double> rates) const
{
    std::fill(rates.begin(), rates.end(), 0.0);
    if (mode >= branch_modes) return;
    Motion now;
    if (!known && holds(mode)) find_motion(mode, t, w, now);
    for (Eigen::Index i = 0; i < count(); ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (is_held(i, mode)) {
            const Slacks of = slack_rates(i, mode, t, w, dwdt, known ? *known : now);
            rates[4 * k + 2] = of[0];
            rates[4 * k + 3] = of[1];
        } else {
            const double rate = observed_rate(i, mode, t, w, dwdt);
            (branch(k, mode) == Branch::lower ? rates[4 * k] : rates[4 * k + 1]) =
                branch(k, mode) == Branch::lower ? rate : -rate;
        }
    }
}

template <int N, int M>
Mode AnyModes<N, M>::reset(const FiredGuards& fired, Mode mode, double t, State& x) const
{
    Branches branches = branches_of(mode);
    const std::size_t mask = mask_of(mode);
    int left = 0;
    int arrived = 0;
    Branches held = branches;
    Vector w = vector(x);
    if (matrices_.traits().gives_static_bound && is_static(branches)) {
        for (const std::size_t which : fired) {
            if (which >= first_set_guard) return empty;
        }
        const Mode next = reset_static(fired, branches, t, w);
        Eigen::Map<Vector>(x.data()) = w;
        return next;
    }
    // Reactions at a bound whose y is zero too, as for contacts that depend on one another.
    const Branches zero = zero_branches(t, w);
    int undecided = 0;
    for (Eigen::Index i = 0; i < M; ++i) {
        if (zero[i] != Branch::inside || branches[i] == Branch::inside) continue;
        held[i] = Branch::inside;
        ++undecided;
    }
    const bool alone = fired.size() == 1;
    for (const std::size_t which : fired) {
        if (which >= first_set_guard) return empty;
        const auto i = static_cast<Eigen::Index>(which / 4);
        if (alone && which % 4 >= 2 && !leaves_bound(i, which % 4 == 3, mode, t, w)) return mode;
        if (which % 4 < 2) {
            if (held[i] == Branch::inside) --undecided;
            held[i] = Branch::inside;
            ++arrived;
        } else {
            // Those with the same effect meet their bounds together.
            const Eigen::Index first = first_with(i, mask);
            const Branch side = which % 4 == 2 ? Branch::lower : Branch::upper;
            const bool mirrored = times_effect(i, first) < 0;
            left += branches[first] == Branch::inside;
            branches[first] = mirrored ? static_cast<Branch>(-static_cast<int>(side)) : side;
        }
    }
    Branches after = branches;
    follow_first(mask, after);
    hold(held, t, w);
    Eigen::Map<Vector>(x.data()) = w;
    if (faulty(t, w) >= 0) return empty;
    if (left + arrived + undecided > 1 && left > 0) return several;
    if (left == 1) return checked(mode_of(after));
    return settle(held, t, w);
}

}  // namespace ricochet::detail
