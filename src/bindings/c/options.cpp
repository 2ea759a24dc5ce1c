// Options as a C program gives them.
#include <cmath>
#include <limits>
#include <string>

#include "bindings/c/run.hpp"
#include "bindings/c/structs.hpp"

namespace ricochet::c {

namespace {

[[nodiscard]] rc_options defaults() noexcept
{
    const Options standard;
    rc_options options{};
    options.size = sizeof options;
    options.t_start = standard.t_start;
    options.t_end = standard.t_end;
    options.mode = standard.mode;
    options.method = RC_DOPRI5;
    options.detector = RC_EXTREMUM;
    options.locator = RC_NEWTON;
    options.look_inside = standard.look_inside;
    options.stop_at_event = standard.stop_at_event;
    options.record_events = standard.record_events;
    options.event_states = standard.event_states;
    options.record_steps = standard.record_steps;
    options.step = standard.step;
    options.rtol = standard.rtol;
    options.atol = standard.atol;
    options.h_min = standard.h_min;
    options.h_max = standard.h_max;
    options.event_tolerance = standard.event_tolerance;
    options.event_rtol = standard.event_rtol;
    options.event_window = standard.event_window;
    options.max_steps = standard.max_steps;
    options.stall_steps = standard.stall_steps;
    return options;
}

[[noreturn]] void refuse(const std::string& message)
{
    throw Refusal(RC_INVALID, "rc_options: " + message);
}

[[nodiscard]] bool flag(const char* name, std::int32_t value)
{
    if (value == 0 || value == 1) return value == 1;
    refuse(std::string(name) + " must be 0 or 1, got " + std::to_string(value));
}

/// @throws Refusal unless the value is one of 0 to `last`.
template <class Enum>
[[nodiscard]] Enum one_of(const char* name, std::int32_t value, Enum last)
{
    if (value >= 0 && value <= static_cast<std::int32_t>(last)) return static_cast<Enum>(value);
    refuse(std::string(name) + ": there is no rc_" + name + " " + std::to_string(value));
}

}  // namespace

RunOptions read_options(const rc_options* given)
{
    const auto from = read_struct<rc_options>(given, "rc_options", defaults());
    RunOptions run;
    run.method = one_of("method", from.method, RC_EULER);
    run.detector = one_of("detector", from.detector, RC_FORESEEN);
    run.locator = one_of("locator", from.locator, RC_TOMS748);
    run.fixed_step = flag("fixed_step", from.fixed_step);
    const bool asks_gate = run.detector >= RC_CALIBRATED;
    if (asks_gate && !from.gate) refuse("found no gate; expected the path of its model");
    if (!asks_gate && from.gate) refuse("found a gate for a detector that asks none");
    if (asks_gate) run.gate = from.gate;
    if (from.sample_count > 0 && !from.sample_times) {
        refuse("found a sample_count of " + std::to_string(from.sample_count) +
               " without sample_times");
    }
    Options& options = run.options;
    options.t_start = from.t_start;
    options.t_end = from.t_end;
    options.mode = from.mode;
    options.step = from.step;
    options.rtol = from.rtol;
    options.atol = from.atol;
    options.h_min = from.h_min;
    options.h_max = from.h_max;
    options.event_tolerance = from.event_tolerance;
    options.event_rtol = from.event_rtol;
    options.event_window = from.event_window;
    options.look_inside = flag("look_inside", from.look_inside);
    options.stop_at_event = flag("stop_at_event", from.stop_at_event);
    options.record_events = flag("record_events", from.record_events);
    options.event_states = flag("event_states", from.event_states);
    options.record_steps = flag("record_steps", from.record_steps);
    options.sample_times.assign(from.sample_times, from.sample_times + from.sample_count);
    options.max_steps = from.max_steps;
    options.stall_steps = from.stall_steps;
    return run;
}

}  // namespace ricochet::c

extern "C" rc_status rc_options_default(rc_options* options, size_t size)
{
    using namespace ricochet::c;
    return guarded([&] {
        if (!options) throw_null("rc_options_default, options");
        rc_options full = defaults();
        // Checked as if it were there already: memory of the caller's may hold anything.
        full.size = size;
        static_cast<void>(size_of_given<rc_options>(&full, "rc_options"));
        std::memcpy(options, &full, size);
    });
}
