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
        X x = now().x0();
        const double t = now().start().value;
        const PhaseVerdict verdict =
            has_ended()
                ? phases_->give_up(phases_->adapter,
                                   {result().outcome, result().guard, t, now().mode(), now().x0()},
                                   x)
                : phases_->review(
                      phases_->adapter,
                      {t, now().mode(), now().x0(), now().rate0(), h_next(), has_advanced}, x);
        if (verdict.kind == PhaseVerdict::Kind::stands) break;
        if (verdict.kind == PhaseVerdict::Kind::ends) {
            engine_.end(verdict.outcome);
            result().reason = phases_->reason(phases_->adapter);
            break;
        }
        continue_from(x, verdict.mode, verdict.h);
    }
    engine_.hide_guards_of_phases();
    if (has_ended() && phases_->reaction) result().reaction = reaction_here();
}

template <class X, bool single>
std::vector<double> Loop<X, single>::reaction_at(const PhasePlace<X>& place) const
{
    std::vector<double> r;
    phases_->reaction(system().adapter(), place, r);
    return r;
}

template <class X, bool single>
std::vector<double> Loop<X, single>::reaction_here() const
{
    const double t = now().start().value;
    return reaction_at({now().mode(), t, now().x0(), 0, t, now().x0()});
}

template <class X, bool single>
std::vector<double> Loop<X, single>::reaction() const
{
    if (!phases_ || !phases_->reaction) return {};
    if (showing_ == Showing::sample) return result().reactions[shown_samples_ - 1];
    if (showing_ == Showing::step) return reaction_here();
    const ShownStep& step = shown_step_;
    return reaction_at({step.mode, step.t, step.x, t() - step.t, t(), x()});
}

template <class X, bool single>
void Loop<X, single>::add_reaction(double t, const X& x, double offset)
{
    // A run that has ended stays where it is, and none of its functions is called any more.
    result().reactions.push_back(
        has_ended() ? result().reaction
                    : reaction_at({now().mode(), now().start().value, now().x0(), offset, t, x}));
}

template <class X, bool single>
void Loop<X, single>::continue_from(const X& x, Mode mode, double h)
{
    engine_.change_phase(x, mode);
    if (error_controlled_ && h >= 0) {
        if (h == 0) h = initial_step(now(), options(), now().until(options().t_end));
        h_next() = std::min(h, options().h_max);
    }
    settle_and_record();
}

}  // namespace ricochet::detail
