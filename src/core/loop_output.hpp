// Output of a run besides its events.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
void Loop<X, single>::emit_more_samples(double s, double end)
{
    const auto& times = options_.sample_times;
    const auto holds = [&](std::size_t k) {
        return k < times.size() && lies_before(times[k], end);
    };
    if (!holds(next_sample_)) return;
    const std::size_t most_alone = step_.most_sampled_alone(options_.record_steps);
    const bool on_polynomial =
        most_alone < times.size() - next_sample_ && holds(next_sample_ + most_alone);
    while (holds(next_sample_)) {
        const double offset = std::min(step_.until(times[next_sample_]), s);
        X x = step_.x0();
        if (offset > 0 && !(starts_at_set() && is_rounding(times[next_sample_], step_.time(0)))) {
            step_.sample(offset, {options_.rtol, options_.atol, on_polynomial}, x);
            add_sample(std::move(x), offset);
        } else {
            add_sample(std::move(x), 0);
        }
    }
}

template <class X, bool single>
bool Loop<X, single>::starts_at_set() const noexcept
{
    const double t = step_.start().value;
    return (guarded_ && guards_.armed_at() == t) || (timed_ && time_events_.was_at(t));
}

template <class X, bool single>
void Loop<X, single>::emit_sample_with(double t)
{
    const auto& times = options_.sample_times;
    const bool due = next_sample_ < times.size() && is_rounding(times[next_sample_], t);
    if (due && step_.start().value == t) add_sample(X(step_.x0()), 0);
}

template <class X, bool single>
inline void Loop<X, single>::emit_held_samples(double until)
{
    const auto& times = options_.sample_times;
    while (next_sample_ < times.size() && lies_before(times[next_sample_], until)) {
        add_sample(X(step_.x0()), 0);
    }
}

template <class X, bool single>
inline void Loop<X, single>::emit_last_samples()
{
    const double t = step_.start().value;
    emit_held_samples(std::nextafter(t, backward_ ? -infinity : infinity));
}

template <class X, bool single>
inline void Loop<X, single>::record_place(double length)
{
    X zero = step_.x0();
    for_each_component(zero, [&](auto i) { zero[i] = 0; });
    const DenseParts<X> parts{.h = length, .x0 = &step_.x0(), .remainder = &zero, .rate0 = &zero};
    run_.solution.add(step_.time(0), backward_, this->shown(step_.mode()), parts, length);
}

template <class X, bool single>
void Loop<X, single>::record_restart()
{
    if (!options_.record_steps || run_.solution.empty()) return;
    const double t = step_.start().value;
    const bool complete = same_state(run_.solution(t), step_.x0()) &&
                          run_.solution.mode(t) == this->shown(step_.mode());
    if (!complete) record_place(0);
}

template <class X, bool single>
inline void Loop<X, single>::add_sample(X&& x, double offset)
{
    if (phases_ && phases_->reaction) add_reaction(options_.sample_times[next_sample_], x, offset);
    run_.trajectory.t.push_back(options_.sample_times[next_sample_]);
    run_.trajectory.x.push_back(std::move(x));
    sample_mode_ = this->shown(step_.mode());
    ++next_sample_;
}

}  // namespace ricochet::detail
