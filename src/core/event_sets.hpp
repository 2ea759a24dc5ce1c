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
    if (fired_.size() == 1) locate_alone(step, bank, calls);
    return true;
}

template <class X, bool single>
inline void EventSearch<X, single>::locate_alone(const CurrentStep& step, Bank& bank,
                                                 std::uint64_t& calls)
{
    Hit& hit = *std::find_if(hits_.begin(), hits_.end(),
                             [this](const Hit& candidate) { return candidate.guard == fired_[0]; });
    const auto guard = bank.view(hit.guard, step.mode(), calls);
    Probe probe(guard, step, space_);
    probe.watch(hit.side);
    hit.where = find(probe, hit.finding, bank, hit.guard).value();
    at_ = hit.where.root;
    at_remainder_ = hit.where.root_remainder;
    assign(before_, hit.finding.late ? step.x0() : probe.state_at(hit.where));
}

template <class X, bool single>
inline void EventSearch<X, single>::close_set(const CurrentStep& step, Bank& bank,
                                              std::uint64_t& calls)
{
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
        const double at = std::min(limit, step.h());
        bool placed = false;
        for (Hit& hit : hits_) {
            if (hit.located) continue;
            if (hit.finding.hi.s > at) {
                if (!placed) step.restep(at, before_);
                placed = true;
                const auto guard = bank.view(hit.guard, step.mode(), calls);
                if (!has_left(hit.side, guard.value(step.time(at), before_))) continue;
            }
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
            step.restep(at_, before_);
        }
    }
    if (time_event_due && at_ + resolution_.window(step.time(at_)) >= step.h()) {
        at_ = step.h();
        at_remainder_ = 0;
        assign(before_, step.x1());
    }
}

}  // namespace ricochet::detail
