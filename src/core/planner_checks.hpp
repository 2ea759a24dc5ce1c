// Tests of the bounds that a plan relies on.
#pragma once

#include "core/planner.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void Planner<X, single>::check_change(std::size_t i, const Check& from, const Check& to,
                                             const Bank& bank)
{
    if (!bounded_ || !detector_->checks_bounds || !from.exact || !to.exact) return;
    if (bank[i].info.boolean) return;  // its values only carry a sign
    blame_change(i, from, to, bank);
}

template <class X, bool single>
inline void Planner<X, single>::check_covered(std::size_t i, const Check& from, const Check& to,
                                              const Bank& bank)
{
    if (!bounded_) return;
    if (to.bound.distance <= 0 && from.time < to.time) blame_change(i, from, to, bank);
    check_change(i, from, to, bank);
}

template <class X, bool single>
inline void Planner<X, single>::blame_change(std::size_t i, const Check& from, const Check& to,
                                             const Bank& bank)
{
    const double tau = to.time - from.time;
    const double allowed = (1 + detector_->margin) * largest_change(from.bound, to.bound, tau) +
                           2 * band(bank, i, from.value, to.value);
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
inline void Planner<X, single>::watch_sleeper(std::size_t i, Check now, Mode mode, const Bank& bank,
                                              Statistics& counts)
{
    if (wrong_ || !bank[i].enabled || never_sleeps(bank[i])) return;
    const Check from = last_check(i);
    // A bound that stands for the guard at this time tells nothing of where it is.
    if (from.exact && !(now.time > from.time)) return;
    now.value = value_at(i, now, mode, bank, counts);
    now.bound = bound(i, now, mode, bank[i].side);
    const double tau = now.time - from.time;
    if (detector_->checks_bounds || !from.exact) check_bound(i, now, mode, bank);
    if (wrong_) return;
    if (now.bound.distance < -band(bank, i, from.value, now.value)) {
        blame(i, from, now, (from.bound.speed + 0.5 * from.bound.acceleration * tau) * tau);
    } else {
        check_change(i, from, now, bank);
    }
}

template <class X, bool single>
inline void Planner<X, single>::check_bound(std::size_t i, const Check& check, Mode mode,
                                            const Bank& bank)
{
    if (!bounded_) return;
    void* const adapter = system_.adapter();
    if (system_->lower_bound && bank[i].side == Side::above) {
        check_against(system_->lower_bound(adapter, i, mode, check.t, *check.x), i, check, bank);
    }
    if (system_->upper_bound && bank[i].side == Side::below) {
        check_against(system_->upper_bound(adapter, i, mode, check.t, *check.x), i, check, bank);
    }
}

template <class X, bool single>
inline void Planner<X, single>::check_against(double bound, std::size_t i, const Check& check,
                                              const Bank& bank)
{
    const double sign = sign_of(bank[i].side);
    if (wrong_) return;
    const double reach = band(bank, i, check.value, 0);
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
