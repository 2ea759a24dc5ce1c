// Changes of phase between the steps of the loop.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
void Loop<X, single>::change_phase(bool has_advanced)
{
    // A phase that ends at once may be followed by another one, which ends at once.
    constexpr int most = 8;
    for (int i = 0; i < most; ++i, has_advanced = false) {
        X x = step_.x0();
        const double t = step_.start().value;
        const PhaseVerdict verdict =
            ended_ ? phases_->give_up(phases_->adapter,
                                      {run_.outcome, run_.guard, t, step_.mode(), step_.x0()}, x)
                   : phases_->review(
                         phases_->adapter,
                         {t, step_.mode(), step_.x0(), step_.rate0(), h_next_, has_advanced}, x);
        if (verdict.kind == PhaseVerdict::Kind::stands) break;
        if (verdict.kind == PhaseVerdict::Kind::ends) {
            end(verdict.outcome);
            run_.reason = phases_->reason(phases_->adapter);
            break;
        }
        continue_from(x, verdict.mode, verdict.h);
    }
    if (this->is_of_phases(run_.guard)) run_.guard = no_guard;
    if (this->is_of_phases(run_.other_guard)) run_.other_guard = no_guard;
    if (ended_ && phases_->reaction) run_.reaction = reaction_here();
}

template <class X, bool single>
std::vector<double> Loop<X, single>::reaction_at(const PhasePlace<X>& place) const
{
    std::vector<double> r;
    phases_->reaction(system_.adapter(), place, r);
    return r;
}

template <class X, bool single>
std::vector<double> Loop<X, single>::reaction_here() const
{
    const double t = step_.start().value;
    return reaction_at({step_.mode(), t, step_.x0(), 0, t, step_.x0()});
}

template <class X, bool single>
std::vector<double> Loop<X, single>::reaction() const
{
    if (!phases_ || !phases_->reaction) return {};
    if (showing_ == Showing::sample) return run_.reactions[shown_samples_ - 1];
    if (showing_ == Showing::step) return reaction_here();
    const ShownStep& step = shown_step_;
    return reaction_at({step.mode, step.t, step.x, t() - step.t, t(), x()});
}

template <class X, bool single>
void Loop<X, single>::add_reaction(double t, const X& x, double offset)
{
    // A run that has ended stays where it is, and none of its functions is called any more.
    run_.reactions.push_back(
        ended_ ? run_.reaction
               : reaction_at({step_.mode(), step_.start().value, step_.x0(), offset, t, x}));
}

template <class X, bool single>
void Loop<X, single>::continue_from(const X& x, Mode mode, double h)
{
    ended_ = this->stops_ = false;
    holds_.wake();
    run_.outcome = Outcome::reached_end;
    this->forget_cause();
    search_.fired().clear();
    this->leave_from_start(0);
    assign(search_.before(), step_.x0());
    this->mode_before_ = step_.mode();
    this->changed_mode_ = mode != step_.mode();
    this->enters_mode_ = this->shown(mode) != this->shown(step_.mode());
    this->leaves_phase_ = true;
    on_time_ = this->located_ = on_change_ = change_due_ = false;
    const X from = step_.x0(), remainder = step_.remainder();
    step_.restart(step_.start(), x, mode);
    for (std::size_t c = 0; c < static_cast<std::size_t>(from.size()); ++c) {
        if (from[c] == x[c]) step_.set_remainder(c, remainder[c]);
    }
    if (error_controlled_ && h >= 0) {
        if (h == 0) h = initial_step(step_, options_, step_.until(options_.t_end));
        h_next_ = std::min(h, options_.h_max);
    }
    pending_ = Engine::Pending::settle;
    settle_and_record();
}

}  // namespace ricochet::detail
