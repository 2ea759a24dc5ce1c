// Co-simulation: the FMU integrates itself from one communication point to the next. A step ends
// early where the FMU, of FMI 3.0, has an event; event mode is then between two steps.
#include <algorithm>
#include <cmath>

#include "fmi/parts.hpp"

namespace ricochet::fmi {

namespace {

constexpr double default_steps = 500;  // of a run, where neither caller nor FMU names a length

}  // namespace

Steps::Steps(const Fmu& fmu, const Options& given) : Parts(fmu, given, Kind::co_simulation)
{
    step_ = options.step.value_or(instance.description().step.value_or(0));
    if (!(step_ > 0 && std::isfinite(step_))) step_ = (t_end - t) / default_steps;
    next_time_ = HUGE_VAL;
    initialize();
    try {
        if (instance.uses_event_mode()) {
            const EventInfo info = instance.iterate();
            next_time_ = info.next_time;
            if (info.terminate) {
                end(End::terminated);
                return;
            }
            instance.enter_step_mode();
        }
        if (sample_is_due(t, true)) record(Row::Place::sample);
        skip_samples(t);
    } catch (const CallError& error) {
        throw Error(std::string(error.what()) + " at the start");
    }
    if (t == t_end) end(End::reached_end);
}

template <class Set>
void Steps::handle(const Causes& causes, const Set& set)
{
    record(Row::Place::before_event);
    instance.enter_event_mode();
    inputs.set_all(instance, t);
    set();
    const EventInfo info = instance.iterate();
    next_time_ = info.next_time;
    record(Row::Place::after_event);
    run.events.push_back(
        {.t = t, .causes = causes, .indicator = no_indicator, .before = {}, .after = {}});
    if (info.terminate) return end(End::terminated);
    instance.enter_step_mode();
}

void Steps::advance()
{
    inputs.set_continuous(instance, t, true);
    if (!instance.uses_event_mode()) inputs.set_all(instance, t);
    double to = std::min(t_start + static_cast<double>(count_ + 1) * step_, t_end);
    if (instance.interface().variable_steps) {
        to = std::min({to, inputs.next_break(t), next_time_});
        if (next_sample_ < options.sample_times.size()) {
            to = std::min(to, options.sample_times[next_sample_]);
        }
    } else if (to - t < step_ * (1 - 1e-9)) {
        return end(End::reached_end);  // it takes whole steps only
    }
    const Stepped stepped = instance.step(t, to - t);
    ++run.steps;
    t = run.t = stepped.t;
    while (t_start + static_cast<double>(count_ + 1) * step_ <= t) ++count_;
    if (stepped.terminate) return end(End::terminated);
    const Causes causes{.time = t >= next_time_,
                        .step = stepped.event,
                        .input = instance.uses_event_mode() && inputs.jumps_at(t)};
    if (causes.any() && instance.uses_event_mode()) {
        handle(causes, [] {});
    } else if (sample_is_due(t, true)) {
        record(Row::Place::sample);
    }
    skip_samples(t);
    const bool cancelled = options.cancelled != nullptr && *options.cancelled;
    if (cancelled) run.integration = Outcome::cancelled;
    if (!ended && cancelled) end(End::not_integrated, "cancelled");
    if (!ended && t >= t_end) end(End::reached_end);
}

void Steps::answer(const Element& element, double value)
{
    const auto set = [&] { instance.set(element, value); };
    if (!instance.uses_event_mode()) return set();
    handle({.input = true}, set);
}

}  // namespace ricochet::fmi
