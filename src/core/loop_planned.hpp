// Steps whose checks are deferred.
#pragma once

#include "core/loop.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void Loop<X, single>::advance_with_check(double remaining)
{
    engine_.watch_all();
    if (take_step(remaining)) check_all();
}

template <class X, bool single>
inline void Loop<X, single>::check_all()
{
    mark_what_lasts();
    if (handle_events()) return;
    pass();
}

template <class X, bool single>
inline void Loop<X, single>::advance_by_plan(double remaining, const Advance& how)
{
    engine_.plan_again();
    if (planner().steps_aside()) return advance_with_check(remaining);
    if (engine_.newly_armed()) engine_.begin_plan();
    const double proposed = h_next();
    const std::uint64_t rejected = result().statistics.rejected;
    if (!take_step(remaining)) {
        if (is_tentative()) {
            // The failure may lie beyond an event; steps that are checked one by one find the event
            // first.
            engine_.reopen();
            take_back();
        }
        return;
    }
    if (engine_.watching()) return check_all();
    const double t = now().time(now().h());
    const double margin =
        engine_.ends_on_time() ? tolerances::by_rounding * now().h() : 0;  // for ties
    const double ends = (backward_ ? -t : t) + margin;
    if (planner().covers(ends)) {
        if (engine_.sample_sleeper()) return;
        engine_.count_deferred(1);
        return pass();
    }
    remember_step(proposed, rejected);
    planner().overrun(ends);
    if (may_go_on(ends, how)) return accept();
    close_interval();
}

template <class X, bool single>
inline void Loop<X, single>::remember_step(double proposed, std::uint64_t rejected)
{
    auto& tentative = planner().steps().add();
    now().store_as_kept(tentative.start);
    tentative.h_next = proposed;
    tentative.last_h = engine_.last_h();
    tentative.samples = next_sample_;
    tentative.pieces = result().solution.size();
    tentative.rejected = rejected;
    if (planner().encloses()) describe_polynomial(now(), tentative);
}

template <class X, bool single>
inline bool Loop<X, single>::may_go_on(double ends, const Advance& how)
{
    if (careful_steps_ > 0) {
        --careful_steps_;
        return false;
    }
    const bool must_close =
        !how.look_ahead || planner().steps().full() || is_last_ || engine_.ends_at().time_event ||
        result().statistics.steps + 1 >= options().max_steps ||
        (how.to_next_sample && holds_sample()) || !planner().hopes(ends + h_next());
    return !must_close;
}

template <class X, bool single>
inline void Loop<X, single>::close_interval()
{
    const std::size_t steps = planner().steps().size();
    const std::size_t doubt = engine_.close_interval();
    if (planner().wrong()) {
        if (doubt != Planner<X, single>::none && doubt + 1 < steps) take_back_to(doubt, steps - 1);
        return engine_.name_wrong_bound();
    }
    if (doubt == Planner<X, single>::none) {
        engine_.count_deferred(steps);
        planner().steps().clear();
        return pass();
    }
    engine_.count_deferred(doubt);
    if (doubt + 1 < steps) return take_back_to(doubt, steps - 1);
    planner().steps().clear();
    verify();
}

template <class X, bool single>
inline void Loop<X, single>::verify()
{
    if (engine_.doubts_remain() && search(false)) return;
    if (engine_.watching()) return pass();
    if (engine_.settle_verified()) return;
    pass();
}

template <class X, bool single>
inline void Loop<X, single>::take_back_to(std::size_t k, std::size_t accepted)
{
    const auto& tentative = planner().steps()[k];
    const std::size_t taken = accepted - k;
    ++result().statistics.rollbacks;
    result().statistics.repeated_steps += taken;
    result().statistics.steps -= taken;
    result().statistics.rejected = tentative.rejected;
    now().restart(tentative.start);
    h_next() = tentative.h_next;
    engine_.last_h() = tentative.last_h;
    for (; next_sample_ > tentative.samples; --next_sample_) {
        result().trajectory.t.pop_back();
        result().trajectory.x.pop_back();
    }
    result().solution.shrink(tentative.pieces);
    planner().steps().clear();
}

}  // namespace ricochet::detail
