// Co-simulation: the FMU integrates itself from one communication point to the next. A step ends
// early where the FMU, of FMI 3.0, has an event; event mode is then between two steps.
#include <fmt/format.h>

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <limits>

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
    resolve_watches();
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
        note_sides();
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
    run.events.push_back({.t = t, .causes = causes, .before = {}, .after = {}});
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
        if (next_sample < options.sample_times.size()) {
            to = std::min(to, options.sample_times[next_sample]);
        }
    } else if (to - t < step_ * (1 - 1e-9)) {
        return end(End::reached_end);  // it takes whole steps only
    }
    if (!watches_.empty()) instance.keep_state();
    const Stepped stepped = instance.step(t, to - t);
    ++run.steps;
    locate_passages(to - t, stepped.t);
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
    note_sides();
    const bool cancelled = options.cancelled != nullptr && *options.cancelled;
    if (cancelled) run.integration = Outcome::cancelled;
    if (!ended && cancelled) end(End::not_integrated, "cancelled");
    if (!ended && t >= t_end) end(End::reached_end);
}

// --- passages of watched variables ---

void Steps::resolve_watches()
{
    const Description& d = instance.description();
    for (const Watch& watch : options.watch) {
        const std::optional<Element> element = d.find(watch.name);
        if (!element) throw Error(fmt::format("{}: has no variable '{}'", d.file, watch.name));
        if (!is_number(d.variables[element->variable].type)) {
            throw Error(fmt::format("{}: '{}' is not a number", d.file, watch.name));
        }
        watches_.push_back({.element = *element, .side = 0});
    }
    const Interface& can = instance.interface();
    if (watches_.empty() || (can.saves_state && can.variable_steps)) return;
    throw Error(
        fmt::format("{}: cannot go back in time; expected an FMU that keeps its state and "
                    "takes steps of any length, for the watch of '{}'",
                    d.file, options.watch.front().name));
}

double Steps::above(std::size_t k)
{
    return instance.get(watches_[k].element) - options.watch[k].level;
}

void Steps::note_sides()
{
    for (std::size_t k = 0; k < watches_.size(); ++k) {
        const double now = above(k);
        if (now != 0) watches_[k].side = now;
    }
}

bool Steps::passes(std::size_t k, double to) const
{
    const double from = watches_[k].side;
    switch (options.watch[k].crossing) {
        case Crossing::falling: return from > 0 && to <= 0;
        case Crossing::rising: return from < 0 && to >= 0;
        case Crossing::either: break;
    }
    return (from > 0 && to <= 0) || (from < 0 && to >= 0);
}

double Steps::length_to_passage(std::size_t k, double h, double at_end)
{
    const auto value = [&](double s) {
        instance.go_back_to_kept_state();
        if (s > 0) (void)instance.step(t, s);
        return above(k);
    };
    const double at_start = value(0);
    if (at_start == 0 || (at_start < 0) == (at_end < 0)) return h;  // it was on the level
    const auto adjacent = [&](double low, double high) {
        const double later = std::nextafter(t + low, std::numeric_limits<double>::infinity());
        return t + high <= later;
    };
    std::uintmax_t most = 200;
    const auto [low, high] = at_end == 0 ? std::pair{h, h}
                                         : boost::math::tools::toms748_solve(
                                               value, 0.0, h, at_start, at_end, adjacent, most);
    return low == high ? low : high;
}

void Steps::locate_passages(double asked, double reached)
{
    struct Passage {
        double s;
        std::size_t watch;
    };
    std::vector<Passage> found;
    std::vector<double> ends;
    for (std::size_t k = 0; k < watches_.size(); ++k) ends.push_back(above(k));
    for (std::size_t k = 0; k < watches_.size(); ++k) {
        if (!passes(k, ends[k])) continue;
        found.push_back({.s = length_to_passage(k, reached - t, ends[k]), .watch = k});
    }
    if (found.empty()) return;
    std::ranges::stable_sort(found, {}, &Passage::s);
    const double start = t;
    for (const Passage& passage : found) {
        instance.go_back_to_kept_state();
        if (passage.s > 0) (void)instance.step(start, passage.s);
        t = start + passage.s;
        record(Row::Place::sample);
        run.events.push_back({.t = t,
                              .causes = {.passage = true},
                              .watch = passage.watch,
                              .before = {},
                              .after = {}});
        // One that ends on the level has passed it.
        watches_[passage.watch].side = -watches_[passage.watch].side;
    }
    t = start;
    instance.go_back_to_kept_state();
    (void)instance.step(start, asked);
}

std::function<void()> Steps::keep()
{
    return [this, watches = watches_, count = count_, next_time = next_time_] {
        watches_ = watches;
        count_ = count;
        next_time_ = next_time;
    };
}

void Steps::answer(const Element& element, double value)
{
    const auto set = [&] { instance.set(element, value); };
    if (!instance.uses_event_mode()) return set();
    handle({.input = true}, set);
}

}  // namespace ricochet::fmi
