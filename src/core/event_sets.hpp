// The first set of events where several guards may have one.
#pragma once

#include "core/event_search.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool EventSearch<X, single>::find_among(const CurrentStep& step, Bank& bank,
                                               std::uint64_t& calls)
{
    for (const std::size_t i : bank.suspects()) {
        if (!bank[i].acting || !bank.still_suspicious(i, step.h())) continue;
        examine(step, bank, i, calls);
    }
    if (hits_.empty()) return false;
    close_set(step, bank, calls);
    if (fired_.size() == 1) {
        at_ = first_->where.root;
        at_remainder_ = first_->where.root_remainder;
        rated_at_set_ = goes_straight_;
    }
    return true;
}

template <class X, bool single>
inline void EventSearch<X, single>::close_set(const CurrentStep& step, Bank& bank,
                                              std::uint64_t& calls)
{
    first_ = nullptr;
    double first = std::numeric_limits<double>::infinity();
    for (Hit& hit : hits_) {
        hit.guess = guess(hit.finding);
        first = std::min(first, hit.guess);
    }
    for (Hit& hit : hits_) {
        if (hit.guess == first) locate(step, bank, hit, calls);
    }
    double limit = window_end(step);
    for (bool changed = true; changed;) {
        changed = false;
        find_departed(step, bank, std::min(limit, step.h()), calls);
        for (Hit& hit : hits_) {
            if (!hit.departed || hit.located) continue;
            locate(step, bank, hit, calls);
            changed = true;
        }
        limit = window_end(step);
    }
    for (Hit& hit : hits_) {
        if (hit.located && hit.where.root <= limit) fired_.push_back(hit.guard);
    }
}

template <class X, bool single>
inline void EventSearch<X, single>::find_departed(const CurrentStep& step, Bank& bank, double at,
                                                  std::uint64_t& calls)
{
    bool placed = false;
    for (Hit& hit : hits_) {
        if (hit.located) continue;
        hit.departed = hit.finding.hi.s <= at;
        if (hit.departed) continue;
        if (!placed) place(step, at, space_.x);
        placed = true;
        const auto guard = bank.view(hit.guard, step.mode(), calls);
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
inline double EventSearch<X, single>::window_end(const CurrentStep& step) noexcept
{
    double first = std::numeric_limits<double>::infinity();
    for (const Hit& hit : hits_) {
        if (hit.located) first = std::min(first, hit.where.root);
    }
    return first + resolution_.window(step.time(first));
}

template <class X, bool single>
inline void EventSearch<X, single>::settle_place(const CurrentStep& step, bool time_event_due)
{
    if (fired_.size() > 1) {
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
    if (time_event_due && at_ + resolution_.window(step.time(at_)) >= step.h()) {
        at_ = step.h();
        at_remainder_ = 0;
        rated_at_set_ = false;
        assign(before_, step.x1());
    }
}

}  // namespace ricochet::detail
