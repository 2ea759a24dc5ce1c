// The first set of events where several guards may have one.
#pragma once

#include <algorithm>

#include "core/event_search.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool EventSearch<X, single>::find_among(const CurrentStep& step, Guards& guards,
                                               std::uint64_t& calls)
{
    for (const std::size_t i : guards.suspects()) {
        if (!guards[i].acting || !guards.still_suspicious(i, step.h())) continue;
        examine(step, guards, i, calls);
    }
    if (hits_.empty()) return false;
    close_set(step, guards, calls);
    if (fired_.size() == 1) {
        at_ = first_->where.root;
        at_remainder_ = first_->where.root_remainder;
        rated_at_set_ = goes_straight_;
    }
    return true;
}

template <class X, bool single>
inline void EventSearch<X, single>::close_set(const CurrentStep& step, Guards& guards,
                                              std::uint64_t& calls)
{
    first_ = nullptr;
    double first = std::numeric_limits<double>::infinity();
    for (Hit& hit : hits_) {
        hit.guess = guess(hit.finding);
        first = std::min(first, hit.guess);
    }
    for (Hit& hit : hits_) {
        if (hit.guess == first) locate(step, guards, hit, calls);
    }
    double limit = window_end(step);
    for (bool changed = true; changed;) {
        changed = false;
        find_departed(step, guards, std::min(limit, step.h()), calls);
        for (Hit& hit : hits_) {
            if (!hit.departed || hit.located) continue;
            locate(step, guards, hit, calls);
            changed = true;
        }
        limit = window_end(step);
    }
    for (Hit& hit : hits_) {
        if (hit.located && hit.where.root <= limit) fired_.push_back(hit.guard);
    }
}

template <class X, bool single>
inline void EventSearch<X, single>::find_departed(const CurrentStep& step, Guards& guards,
                                                  double at, std::uint64_t& calls)
{
    bool placed = false;
    for (Hit& hit : hits_) {
        if (hit.located) continue;
        hit.departed = hit.finding.hi.s <= at;
        if (hit.departed) continue;
        if (!placed) place(step, at, space_.x);
        placed = true;
        const auto guard = guards.view(hit.guard, step.mode(), calls);
        hit.value = guard.value(step.time(at), space_.x);
        hit.departed = has_left(hit.side, hit.value);
    }
}

template <class X, bool single>
inline void EventSearch<X, single>::place(const CurrentStep& step, double s, X& x)
{
    const double ahead = s - first_->where.root;
    if (goes_straight_ && std::fabs(ahead) <= straight_part * step.h()) {
        move(x, before_, ahead, rate_);
    } else {
        step.restep(s, x);
    }
}

template <class X, bool single>
inline double EventSearch<X, single>::first_root() noexcept
{
    double first = std::numeric_limits<double>::infinity();
    for (const Hit& hit : hits_) {
        if (hit.located) first = std::min(first, hit.where.root);
    }
    return first;
}

template <class X, bool single>
inline void EventSearch<X, single>::settle_place(const CurrentStep& step, bool time_event_due)
{
    if (fired_.size() > 1) {
        has_lost_ = false;
        at_ = 0;
        for (const Hit& hit : hits_) {
            if (hit.located && std::find(fired_.begin(), fired_.end(), hit.guard) != fired_.end()) {
                at_ = std::max(at_, hit.where.root);
            }
        }
        at_remainder_ = 0;
        if (at_ == 0) {
            assign(before_, step.x0());
        } else {
            place(step, at_, before_);
        }
    }
    if (time_event_due && at_ + resolution_.window(step.time(at_)) >= step.h()) stay_at_end(step);
}

template <class X, bool single>
void EventSearch<X, single>::join_at_end(const CurrentStep& step, std::size_t i, Side side,
                                         double rate)
{
    Hit* const known =
        std::find_if(hits_.begin(), hits_.end(), [i](const Hit& hit) { return hit.guard == i; });
    Hit& hit = known != hits_.end() ? *known : hits_.add();
    hit = Hit{};
    hit.guard = i;
    hit.side = side;
    hit.located = true;
    const double h = step.h();
    hit.where = {.lo = h, .hi = h, .root = h, .slope = rate};
    fired_.push_back(i);
}

template <class X, bool single>
inline double EventSearch<X, single>::lacks(const CurrentStep& step, Guards& guards, const X& x,
                                            const TwoSum& at, std::uint64_t& calls)
{
    const double t = step.instant(at.value, at.remainder).value;
    double longest = 0;
    for (const std::size_t i : fired_) {
        for (Hit& hit : hits_) {
            if (hit.guard != i || hit.where.jump) continue;
            const bool known = &x == &before_ && is_at_change(step, hit, at, t);
            hit.value = known ? change_.at.value : guards.view(i, step.mode(), calls).value(t, x);
            if (has_left(hit.side, hit.value)) continue;
            // A guard of the set that the window has put together with later ones may have turned
            // back.
            if (!(at_ - hit.where.root <= resolution_.blur(t))) continue;
            const double wait = std::fabs(hit.value / hit.where.slope);
            longest = wait > longest || wait != wait ? wait : longest;
        }
    }
    return longest;
}

template <class X, bool single>
inline bool EventSearch<X, single>::holds_ahead(const CurrentStep& step, Guards& guards,
                                                double ahead, std::uint64_t& calls)
{
    const X& x = space_.root;
    const TwoSum at = two_sum(at_, at_remainder_ + ahead);
    values_known_ = all_finite(x) && lacks(step, guards, x, at, calls) == 0;
    if (!values_known_) return false;
    at_ = at.value;
    at_remainder_ = at.remainder;
    if (has_lost_) {
        for (std::size_t c = 0; c < static_cast<std::size_t>(x.size()); ++c) {
            const auto i = static_cast<decltype(x.size())>(c);
            lost_[i] += (before_[i] - x[i]) + ahead * rate_[i];
        }
    }
    assign(before_, x);
    return true;
}

template <class X, bool single>
inline bool EventSearch<X, single>::meet_conditions(const CurrentStep& step, Guards& guards,
                                                    std::uint64_t& calls)
{
    if (late_) return true;
    double wait = lacks(step, guards, before_, {at_, at_remainder_}, calls);
    values_known_ = wait == 0;
    if (values_known_) return true;
    double far = at_;
    for (const Hit& hit : hits_) {
        if (hit.located) far = std::max(far, hit.where.hi);
    }
    far = std::min(far, step.h());
    const double room = (far - at_) - at_remainder_;
    const bool straight = straight_in_space_;
    keep_rate(step);
    X& x = space_.root;
    const auto holds = [&](double ahead) { return holds_ahead(step, guards, ahead, calls); };
    for (int k = 0; k <= 8 && wait > 0 && wait < room; ++k, wait *= 2) {
        move(x, before_, wait, rate_);
        if (holds(wait)) return true;
    }
    if (room >= 0) {
        // The end of the bracket, as the locator has evaluated it.
        if (straight) {
            move(x, space_.x, far - straight_from_, rate_);
        } else {
            step.restep(far, x);
        }
        if (holds(room)) return true;
    }
    // Rounding may hide the condition at the end of the bracket, too.
    const double finest = finest_bracket(at_, step.h());
    for (double beyond = finest; beyond <= 8 * finest; beyond *= 2) {
        const double ahead = std::max(room, 0.0) + beyond;
        if (at_ + at_remainder_ + ahead > step.h()) return false;
        move(x, before_, ahead, rate_);
        if (holds(ahead)) return true;
    }
    // A state that the flow moves by less than its last place would not change: its components are
    // moved by units in the last place.
    assign(x, before_);
    for (int k = 0; k < 4; ++k) {
        for_each_component(x, [&](auto i) {
            if (rate_[i] != 0) x[i] = std::nextafter(x[i], std::copysign(HUGE_VAL, rate_[i]));
        });
        if (holds(0)) return true;
    }
    return false;
}

template <class X, bool single>
bool EventSearch<X, single>::meet_conditions_on_time(const CurrentStep& step, Guards& guards,
                                                     std::uint64_t& calls)
{
    const TwoSum at{at_, 0};
    double wait = lacks(step, guards, before_, at, calls);
    if (wait == 0) return true;
    keep_rate(step);
    X& x = space_.root;
    for (int k = 0; k <= 8 && std::isfinite(wait); ++k, wait *= 2) {
        move(x, before_, wait, rate_);
        if (!all_finite(x) || lacks(step, guards, x, at, calls) != 0) continue;
        assign(before_, x);
        return true;
    }
    return false;
}

template <class X, bool single>
double EventSearch<X, single>::go_beyond(const CurrentStep& step, Guards& guards, std::size_t i,
                                         X& x, std::uint64_t& calls)
{
    const double t0 = step.time(at_);
    const double ulps = tolerances::of_time * std::fabs(t0);
    const Location& place = where(i);
    const double most =
        std::max(place.hi - at_, 0.0) + std::max(ulps, finest_bracket(at_, step.h()));
    const double sign = sign_of(side_left(i));
    keep_rate(step);
    for (double ahead = most / 256; ahead <= most; ahead *= 2) {
        move(x, before_, ahead, rate_);
        const double t = step.instant(at_, at_remainder_ + ahead).value;
        const double g = guards.view(i, step.mode(), calls).value(t, x);
        if (sign * g < 0) return t;
    }
    return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace ricochet::detail
