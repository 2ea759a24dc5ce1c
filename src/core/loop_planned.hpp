// Steps whose checks are deferred.
#pragma once

#include "core/loop.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void Loop<X, single>::advance_with_check(double remaining)
{
    this->watch_all();
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
    plan_anew();
    if (planner_->steps_aside()) return advance_with_check(remaining);
    if (newly_armed_) this->begin_plan();
    const double proposed = h_next_;
    const std::uint64_t rejected = run_.statistics.rejected;
    if (!take_step(remaining)) {
        if (is_tentative()) {
            // The failure may lie beyond an event; steps that are checked one by one find the event
            // first.
            ended_ = false;
            run_.outcome = Outcome::reached_end;
            take_back();
        }
        return;
    }
    if (watching_) return check_all();
    const double t = step_.time(step_.h());
    const double margin =
        this->ends_on_time() ? tolerances::by_rounding * step_.h() : 0;  // for ties
    const double ends = (backward_ ? -t : t) + margin;
    if (planner_->covers(ends)) {
        planner_->sample_sleeper(step_, guards_, run_.statistics);
        if (planner_->wrong()) return this->name_wrong_bound();
        this->count_deferred(1);
        return pass();
    }
    remember_step(proposed, rejected);
    planner_->overrun(ends);
    if (may_go_on(ends, how)) return accept();
    close_interval();
}

template <class X, bool single>
inline void Loop<X, single>::remember_step(double proposed, std::uint64_t rejected)
{
    auto& tentative = planner_->steps().add();
    step_.store_as_kept(tentative.start);
    tentative.h_next = proposed;
    tentative.last_h = last_h_;
    tentative.samples = next_sample_;
    tentative.pieces = run_.solution.size();
    tentative.rejected = rejected;
    if (planner_->encloses()) describe_polynomial(step_, tentative);
}

template <class X, bool single>
inline bool Loop<X, single>::may_go_on(double ends, const Advance& how)
{
    if (careful_steps_ > 0) {
        --careful_steps_;
        return false;
    }
    const bool must_close = !how.look_ahead || planner_->steps().full() || is_last_ ||
                            time_event_due_ || run_.statistics.steps + 1 >= options_.max_steps ||
                            (how.to_next_sample && holds_sample()) ||
                            !planner_->hopes(ends + h_next_);
    return !must_close;
}

template <class X, bool single>
inline void Loop<X, single>::close_interval()
{
    const std::size_t steps = planner_->steps().size();
    const std::size_t doubt = planner_->close(step_, guards_, run_.statistics, h_next_);
    if (planner_->wrong()) {
        if (doubt != Planner<X, single>::none && doubt + 1 < steps) take_back_to(doubt, steps - 1);
        return this->name_wrong_bound();
    }
    if (doubt == Planner<X, single>::none) {
        this->count_deferred(steps);
        planner_->steps().clear();
        return pass();
    }
    this->count_deferred(doubt);
    if (doubt + 1 < steps) return take_back_to(doubt, steps - 1);
    planner_->steps().clear();
    judge();
}

template <class X, bool single>
inline void Loop<X, single>::judge()
{
    if (this->judges_suspicious() && search(false)) return;
    if (watching_) return pass();
    planner_->settle(step_, guards_, run_.statistics);
    if (planner_->wrong()) return this->name_wrong_bound();
    pass();
}

template <class X, bool single>
inline void Loop<X, single>::take_back_to(std::size_t k, std::size_t accepted)
{
    const auto& tentative = planner_->steps()[k];
    const std::size_t taken = accepted - k;
    ++run_.statistics.rollbacks;
    run_.statistics.repeated_steps += taken;
    run_.statistics.steps -= taken;
    run_.statistics.rejected = tentative.rejected;
    step_.restart(tentative.start);
    h_next_ = tentative.h_next;
    last_h_ = tentative.last_h;
    for (; next_sample_ > tentative.samples; --next_sample_) {
        run_.trajectory.t.pop_back();
        run_.trajectory.x.pop_back();
    }
    run_.solution.shrink(tentative.pieces);
    planner_->steps().clear();
}

}  // namespace ricochet::detail
