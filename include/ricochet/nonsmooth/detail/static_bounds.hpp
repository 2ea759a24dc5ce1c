// Internal: the declarations of this header may change without notice.
//
// Reactions that hold more than they have where y moves, such as static friction; a part of
// branch_modes.hpp.
//
// The reactions whose y is zero are held together, if the reactions that this takes lie within
// their static bounds. Else the one that meets its static bound first is released: as the loads
// grow from nothing, and later as the reaction released last falls from its static to its kinetic
// bound. It leaves to the side of its load, and the others are asked again.
//
// Reactions that act on the same motion, such as those of two contacts of one block, hold it as
// long as all of them together suffice. They are then at a bound together.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>

#include "ricochet/nonsmooth/branch_modes.hpp"

namespace ricochet::detail {

[[noreturn]] inline void refuse_bounds(Eigen::Index i, const char* what, double one, double other)
{
    throw std::invalid_argument("inclusion: reaction " + std::to_string(i) + ": " + what + " " +
                                std::to_string(one) + " and " + std::to_string(other));
}

template <int N, int M>
void AnyModes<N, M>::check_bounds(double t, const Vector& w) const
{
    for (Eigen::Index i = 0; i < count(); ++i) {
        const double influence = terms_.delassus(i, i);
        if (influence == 0 || !w.allFinite()) continue;
        const Reaction s = offset(t);
        // Below all speeds over which a law of friction varies.
        const double y = 1e-12 * std::max(1.0, w.template lpNorm<Eigen::Infinity>());
        const auto bound_at = [&](double to, Branch side) {
            Vector there = w;
            there += terms_.lever.col(i) * ((to - observed(t, w)[i]) / influence);
            matrices_.hold(i, to, s[i], there);
            Reaction lower, upper;
            const bool fine = matrices_.inclusion().bounds(t, there, lower, upper);
            const double bound = side == Branch::lower ? lower[i] : upper[i];
            return fine ? bound : std::numeric_limits<double>::quiet_NaN();
        };
        for (const Branch side : {Branch::lower, Branch::upper}) {
            const double at = bound_at(0, side);
            const double beside = bound_at(side == Branch::lower ? y : -y, side);
            if (at == beside || std::isnan(at) || std::isnan(beside)) continue;
            if (std::abs(at - beside) <= 1e-3 * std::max(std::abs(at), std::abs(beside))) continue;
            refuse_bounds(i,
                          "its bound jumps at y = 0; expected the limit of the bounds beside y = 0 "
                          "there, and static_bound(t, w, i) for what holds y; found",
                          at, beside);
        }
    }
}

template <int N, int M>
auto AnyModes<N, M>::static_loads(double t, const Vector& w) const -> Loads
{
    Loads loads;
    Vector f;
    matrices_.smooth(t, w, f);
    loads.rate.noalias() = times(terms_.observe, times(terms_.inverse_mass, f));
    if (moves()) loads.rate -= offset_rate(t);
    matrices_.inclusion().branch_bounds(t, w, loads.lower, loads.upper);
    for (Eigen::Index i = 0; i < M; ++i) {
        loads.most[i] = matrices_.inclusion().static_bound(t, w, i);
        const double kinetic = std::max(-loads.lower[i], loads.upper[i]);
        if (i >= count() || loads.most[i] >= kinetic * (1 - negligible)) continue;
        refuse_bounds(i, "its static bound lies below the kinetic one; found", loads.most[i],
                      kinetic);
    }
    return loads;
}

template <int N, int M>
double AnyModes<N, M>::times_effect(Eigen::Index i, Eigen::Index j) const
{
    if (i == j) return 1;
    // That of b in the direction of a, where a is a multiple of b.
    const auto ratio = [](const auto& a, const auto& b) {
        const double of = b.squaredNorm() > 0 ? a.dot(b) / b.squaredNorm() : 0;
        return (a - of * b).norm() <= 1e-12 * a.norm() ? of : 0;
    };
    const double on_motion = ratio(terms_.lever.col(i), terms_.lever.col(j));
    const double on_y = ratio(terms_.observe.row(i), terms_.observe.row(j));
    return on_motion * on_y > 0 ? on_motion : 0;
}

template <int N, int M>
void AnyModes<N, M>::divide(std::size_t mask, const Reaction& lower, const Reaction& upper,
                            Reaction& r) const
{
    if (!terms_.holds[mask].joint) return;
    const auto is_of = [&](Eigen::Index i, Eigen::Index j) {
        return (mask >> i & 1) && first_with(i, mask) == j;
    };
    for (Eigen::Index j = 0; j < count(); ++j) {
        if (!is_of(j, j)) continue;
        double low = 0, width = 0, unbounded = 0;
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (!is_of(i, j)) continue;
            const double times = times_effect(i, j);
            const bool bounded = std::isfinite(lower[i]) && std::isfinite(upper[i]);
            unbounded += bounded ? 0 : std::abs(times);
            low += times * (times > 0 ? lower[i] : upper[i]);
            width += std::abs(times) * (upper[i] - lower[i]);
        }
        const double all = r[j], part = width > 0 ? (all - low) / width : 0;
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (!is_of(i, j)) continue;
            const bool bounded = std::isfinite(lower[i]) && std::isfinite(upper[i]);
            const double times = times_effect(i, j);
            if (unbounded > 0) {
                r[i] = bounded ? 0 : std::copysign(1.0, times) * all / unbounded;
            } else {
                const double span = upper[i] - lower[i];
                r[i] = times > 0 ? lower[i] + part * span : upper[i] - part * span;
            }
        }
    }
}

template <int N, int M>
bool AnyModes<N, M>::join_bounds(const Branches& at, LinearInequality<M>& of) const
{
    const std::size_t mask = mask_of(mode_of(at));
    for (Eigen::Index i = 0; i < count(); ++i) {
        if (!(mask >> i & 1)) continue;
        const Eigen::Index first = first_with(i, mask);
        if (first == i) continue;
        const double times = times_effect(i, first);
        of.lower[first] += times * (times > 0 ? of.lower[i] : of.upper[i]);
        of.upper[first] += times * (times > 0 ? of.upper[i] : of.lower[i]);
        if (!std::isfinite(of.lower[first]) || !std::isfinite(of.upper[first])) return false;
        // What is left of reaction i has no effect, and no part in what follows.
        of.w.row(i).setZero();
        of.w.col(i).setZero();
        of.w(i, i) = 1;
        of.y0[i] = 0;
        of.lower[i] = -1;
        of.upper[i] = 1;
    }
    return true;
}

template <int N, int M>
auto AnyModes<N, M>::held_by(const Branches& at, const Reaction& known, const Loads& loads) const
    -> Reaction
{
    Reaction r = known;
    for (Eigen::Index i = 0; i < M; ++i) {
        if (at[i] == Branch::inside) r[i] = 0;
    }
    const std::size_t mask = mask_of(mode_of(at));
    const Reaction free = loads.rate + times(terms_.delassus, r);
    r -= times(terms_.holds[mask].inverse, free);
    divide(mask, -loads.most, loads.most, r);
    return r;
}

template <int N, int M>
bool AnyModes<N, M>::room_falls(Eigen::Index i, bool upper, Mode mode, double t, const Vector& w,
                                double noise) const
{
    const Motion now = motion(mode, t, w);
    const TimeScales times(t, largest_component(w), largest_component(now.rate));
    const double step = 1e-5 * times.shortest;
    const auto room = [&](double s) {
        Vector there = w;
        move(there, w, s, now.rate);
        return slacks(i, mode, t + s, there)[upper ? 1 : 0];
    };
    const double here = room(0), near = room(step), far = room(2 * step);
    noise *= rounding_of_held(mode, now.rate, now.reaction);
    const double first = (4 * near - far - 3 * here) / 2;
    if (std::abs(first) > noise) return first < 0;
    return far - 2 * near + here < -noise;
}

template <int N, int M>
Mode AnyModes<N, M>::settle_static(Branches at, std::size_t fired, double t, const Vector& w) const
{
    const Loads loads = static_loads(t, w);
    const Branches candidates = at;
    Reaction known = Reaction::Zero();
    for (Eigen::Index i = 0; i < M; ++i) {
        if (at[i] != Branch::inside) known[i] = loads.kinetic(i, at[i]);
    }
    Reaction from = Reaction::Zero();  // the reactions at the start of the way to the present ones
    for (;;) {
        const Mode mode = mode_of(at);
        if (!terms_.holds[mask_of(mode)].determined) return no_flow;
        const Reaction r = held_by(at, known, loads);
        const double rounding = negligible * (terms_.holds[mask_of(mode)].largest *
                                                  loads.rate.template lpNorm<Eigen::Infinity>() +
                                              r.template lpNorm<Eigen::Infinity>());
        Reaction part = Reaction::Constant(std::numeric_limits<double>::infinity());
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (at[i] != Branch::inside) continue;
            const double beyond = std::abs(r[i]) - loads.most[i];
            // A guard is located where its room is zero only to the resolution of the time.
            const double located = fired >> i & 1 ? 1e-9 * loads.most[i] : 0;
            const double doubt = std::max(rounding, located);
            const bool leaves =
                beyond > rounding || (beyond >= -doubt && room_falls(i, r[i] > 0, mode, t, w, 4));
            if (!leaves) continue;
            const double before = std::copysign(1.0, r[i]) * from[i];
            const double way = std::abs(r[i]) - before;
            part[i] = way > 0 ? std::clamp((loads.most[i] - before) / way, 0.0, 1.0) : 0;
        }
        const double first = part.minCoeff();
        if (std::isinf(first)) return leads(candidates, at, r, loads.rate) ? mode : several;
        from = r;
        Reaction start = known;
        Branches others = at;
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (!(part[i] <= first + 1e-9)) continue;
            others[i] = r[i] > 0 ? Branch::upper : Branch::lower;
            start[i] = std::copysign(loads.most[i], r[i]);
            known[i] = loads.kinetic(i, others[i]);
        }
        at = others;
        if (terms_.holds[mask_of(mode_of(at))].determined) from = held_by(at, start, loads);
    }
}

template <int N, int M>
bool AnyModes<N, M>::leads(const Branches& before, const Branches& after, const Reaction& r,
                           const Reaction& rate) const
{
    const Reaction moves = rate + times(terms_.delassus, r);
    for (Eigen::Index i = 0; i < count(); ++i) {
        if (before[i] != Branch::inside || after[i] == Branch::inside) continue;
        double terms = std::abs(rate[i]);
        for (Eigen::Index j = 0; j < count(); ++j) terms += std::abs(terms_.delassus(i, j) * r[j]);
        const double away = after[i] == Branch::upper ? -moves[i] : moves[i];
        if (away < -negligible * terms) return false;
    }
    return true;
}

template <int N, int M>
Mode AnyModes<N, M>::reset_static(const FiredGuards& fired, Branches branches, double t,
                                  Vector& w) const
{
    const Branches zero = zero_branches(t, w);
    std::size_t rooms = 0;
    for (const std::size_t which : fired) {
        const auto i = static_cast<Eigen::Index>(which / 4);
        branches[i] = Branch::inside;
        if (which % 4 >= 2) rooms |= std::size_t{1} << i;
    }
    hold(branches, t, w);
    if (faulty(t, w) >= 0) return empty;
    const Mode mode = settle_static(branches, rooms, t, w);
    if (mode >= branch_modes) return mode;
    // One that has just left is held again only where the others drive it back.
    const Vector rate = motion(mode, t, w).rate;
    bool again = false;
    for (Eigen::Index i = 0; i < count(); ++i) {
        if (zero[i] != Branch::inside || branches[i] == Branch::inside) continue;
        const double moves = observed_rate(i, mode, t, w, rate);
        if (branches[i] == Branch::upper ? moves <= 0 : moves >= 0) continue;
        branches[i] = Branch::inside;
        again = true;
    }
    if (!again) return mode;
    hold(branches, t, w);
    return settle_static(branches, rooms, t, w);
}

}  // namespace ricochet::detail
