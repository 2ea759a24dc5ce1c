// Output of a run besides its events.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
void Loop<X, single>::emit_more_samples(double s, double end)
{
    const auto& times = options().sample_times;
    const auto holds = [&](std::size_t k) {
        return k < times.size() && lies_before(times[k], end);
    };
    if (!holds(next_sample_)) return;
    const std::size_t most_alone = now().most_sampled_alone(options().record_steps);
    const bool on_polynomial =
        most_alone < times.size() - next_sample_ && holds(next_sample_ + most_alone);
    while (holds(next_sample_)) {
        const double offset = std::min(now().until(times[next_sample_]), s);
        X x = now().x0();
        if (offset > 0 && !(starts_at_set() && is_rounding(times[next_sample_], now().time(0)))) {
            now().sample(offset, {options().rtol, options().atol, on_polynomial}, x);
            add_sample(std::move(x), offset);
        } else {
            add_sample(std::move(x), 0);
        }
    }
}

template <class X, bool single>
bool Loop<X, single>::starts_at_set() const noexcept
{
    const double t = now().start().value;
    return (guarded_ && engine_.guards().armed_at() == t) || engine_.is_after_time_event();
}

template <class X, bool single>
void Loop<X, single>::emit_sample_with(double t)
{
    const auto& times = options().sample_times;
    const bool due = next_sample_ < times.size() && is_rounding(times[next_sample_], t);
    if (due && now().start().value == t) add_sample(X(now().x0()), 0);
}

template <class X, bool single>
inline void Loop<X, single>::emit_held_samples(double until)
{
    const auto& times = options().sample_times;
    while (next_sample_ < times.size() && lies_before(times[next_sample_], until)) {
        add_sample(X(now().x0()), 0);
    }
}

template <class X, bool single>
inline void Loop<X, single>::emit_last_samples()
{
    const double t = now().start().value;
    emit_held_samples(std::nextafter(t, backward_ ? -infinity : infinity));
}

template <class X, bool single>
inline void Loop<X, single>::record_place(double length)
{
    X zero = now().x0();
    for_each_component(zero, [&](auto i) { zero[i] = 0; });
    const DenseParts<X> parts{.h = length, .x0 = &now().x0(), .remainder = &zero, .rate0 = &zero};
    result().solution.add(now().time(0), backward_, engine_.shown(now().mode()), parts, length);
}

template <class X, bool single>
void Loop<X, single>::record_restart()
{
    if (!options().record_steps || result().solution.empty()) return;
    const double t = now().start().value;
    const bool complete = same_state(result().solution(t), now().x0()) &&
                          result().solution.mode(t) == engine_.shown(now().mode());
    if (!complete) record_place(0);
}

template <class X, bool single>
inline void Loop<X, single>::add_sample(X&& x, double offset)
{
    if (phases_ && phases_->reaction) add_reaction(options().sample_times[next_sample_], x, offset);
    result().trajectory.t.push_back(options().sample_times[next_sample_]);
    result().trajectory.x.push_back(std::move(x));
    sample_mode_ = engine_.shown(now().mode());
    ++next_sample_;
}

}  // namespace ricochet::detail
