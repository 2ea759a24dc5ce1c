// Tests of the bounds that a plan relies on.
#pragma once

#include "core/planner.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void Planner<X, single>::check_change(std::size_t i, const Check& from, const Check& to,
                                             const Guards& guards)
{
    if (!bounded_ || !detector_->checks_bounds || !from.exact || !to.exact) return;
    if (guards[i].info.boolean) return;  // its values only carry a sign
    blame_change(i, from, to, guards);
}

template <class X, bool single>
inline void Planner<X, single>::check_covered(std::size_t i, const Check& from, const Check& to,
                                              const Guards& guards)
{
    if (!bounded_) return;
    if (to.bound.distance <= 0 && from.time < to.time) blame_change(i, from, to, guards);
    check_change(i, from, to, guards);
}

template <class X, bool single>
inline void Planner<X, single>::blame_change(std::size_t i, const Check& from, const Check& to,
                                             const Guards& guards)
{
    const double tau = to.time - from.time;
    const double allowed = (1 + detector_->margin) * largest_change(from.bound, to.bound, tau) +
                           2 * tolerance_of(guards, i, from.value, to.value);
    const double change = to.value - from.value;
    const bool wrong = from.exact ? std::fabs(change) > allowed : change < -allowed;
    if (wrong && !wrong_) blame(i, from, to, allowed);
}

template <class X, bool single>
inline void Planner<X, single>::blame(std::size_t i, const Check& from, const Check& to,
                                      double allowed)
{
    wrong_ = {.guard = i,
              .lower_bound = false,
              .upper_bound = false,
              .t = to.t,
              .x = *to.x,
              .value = to.value,
              .since = clock(from.time),
              .value_then = from.value,
              .allowed = allowed};
}

template <class X, bool single>
inline void Planner<X, single>::watch_sleeper(std::size_t i, Check now, Mode mode,
                                              const Guards& guards, Statistics& counts)
{
    if (wrong_ || !guards[i].enabled || never_sleeps(guards[i])) return;
    const Check from = last_check(i);
    // A bound that stands for the guard at this time tells nothing of where it is.
    if (from.exact && !(now.time > from.time)) return;
    now.value = value_at(i, now, mode, guards, counts);
    now.bound = bound(i, now, mode, guards[i].side);
    const double tau = now.time - from.time;
    if (detector_->checks_bounds || !from.exact) check_bound(i, now, mode, guards);
    if (wrong_) return;
    if (now.bound.distance < -tolerance_of(guards, i, from.value, now.value)) {
        blame(i, from, now, (from.bound.speed + 0.5 * from.bound.acceleration * tau) * tau);
    } else {
        check_change(i, from, now, guards);
    }
}

template <class X, bool single>
inline void Planner<X, single>::check_bound(std::size_t i, const Check& check, Mode mode,
                                            const Guards& guards)
{
    if (!bounded_) return;
    void* const adapter = system_.adapter();
    if (system_->lower_bound && guards[i].side == Side::above) {
        check_against(system_->lower_bound(adapter, i, mode, check.t, *check.x), i, check, guards);
    }
    if (system_->upper_bound && guards[i].side == Side::below) {
        check_against(system_->upper_bound(adapter, i, mode, check.t, *check.x), i, check, guards);
    }
}

template <class X, bool single>
inline void Planner<X, single>::check_against(double bound, std::size_t i, const Check& check,
                                              const Guards& guards)
{
    const double sign = sign_of(guards[i].side);
    if (wrong_) return;
    const double reach = tolerance_of(guards, i, check.value, 0);
    if (!(sign * bound > std::max(sign * check.value, 0.0) + reach)) return;
    wrong_ = {.guard = i,
              .lower_bound = sign > 0,
              .upper_bound = sign < 0,
              .t = check.t,
              .x = *check.x,
              .value = check.value,
              .since = check.t,
              .value_then = check.value,
              .allowed = bound};
}

}  // namespace ricochet::detail
