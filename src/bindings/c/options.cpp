// Options as a C program gives them.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "bindings/c/options.hpp"
#include "bindings/c/structs.hpp"

namespace ricochet::c {

namespace {

/// The methods of C, but for RC_TAYLOR, which C does not run.
struct Method {
    rc_method value;
    MethodName name;
    const char* spelled;
};
constexpr std::array methods{Method{RC_DOPRI5, MethodName::dopri5, "RC_DOPRI5"},
                             Method{RC_FEHLBERG78, MethodName::fehlberg78, "RC_FEHLBERG78"},
                             Method{RC_CASH_KARP54, MethodName::cash_karp54, "RC_CASH_KARP54"},
                             Method{RC_RK4, MethodName::rk4, "RC_RK4"},
                             Method{RC_EULER, MethodName::euler, "RC_EULER"}};
static_assert(methods.size() == detail::named_methods.size(),
              "a method of detail::NamedMethods has no line here");

/// "A, B or C" of those that belong.
template <class List, class Belongs>
[[nodiscard]] std::string alternatives(const List& list, const Belongs& belongs)
{
    std::string out, last;
    for (const auto& each : list) {
        if (!belongs(each)) continue;
        if (!last.empty()) out += out.empty() ? last : ", " + last;
        last = each.spelled;
    }
    return out + " or " + last;
}

/// "RC_DOPRI5, RC_FEHLBERG78 or ...": those with an error estimate, or without one.
[[nodiscard]] std::string spelled_methods(bool estimates)
{
    return alternatives(
        methods, [=](const Method& each) { return estimates_error(each.name) == estimates; });
}

template <class T>
[[nodiscard]] T defaults() noexcept;

template <>
rc_options defaults<rc_options>() noexcept
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
    options.check_inside = standard.check_inside;
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

template <>
rc_monitor_options defaults<rc_monitor_options>() noexcept
{
    const Options standard;
    rc_monitor_options options{};
    options.size = sizeof options;
    options.event_tolerance = standard.event_tolerance;
    options.event_rtol = standard.event_rtol;
    options.event_window = standard.event_window;
    options.detector = RC_EXTREMUM;
    options.locator = RC_NEWTON;
    options.check_inside = standard.check_inside;
    options.record_events = standard.record_events;
    options.event_states = standard.event_states;
    return options;
}

/// Fills in a struct of the caller with the defaults, up to its `size`.
template <class T>
[[nodiscard]] rc_status fill_in(const char* name, T* options, std::size_t size) noexcept
{
    return guarded([&] {
        if (!options) throw_null((std::string(name) + "_default, options").c_str());
        T full = defaults<T>();
        // `size` is checked in `full`, since the caller's struct may be uninitialised.
        full.size = size;
        static_cast<void>(size_of_given<T>(&full, name));
        std::memcpy(options, &full, size);
    });
}

/// Reader of the fields of a struct, whose name appears in messages.
class Reader {
public:
    explicit Reader(const char* name) : struct_(name) {}

    [[noreturn]] void refuse(const std::string& message) const
    {
        throw Refusal(RC_INVALID, std::string(struct_) + ": " + message);
    }

    [[nodiscard]] bool flag(const char* name, std::int32_t value) const
    {
        if (value == 0 || value == 1) return value == 1;
        refuse(std::string(name) + " must be 0 or 1, got " + std::to_string(value));
    }

    /// @throws Refusal unless the value is one of 0 to `last`.
    template <class Enum>
    [[nodiscard]] Enum one_of(const char* name, std::int32_t value, Enum last) const
    {
        if (value >= 0 && value <= static_cast<std::int32_t>(last)) return static_cast<Enum>(value);
        refuse(std::string(name) + ": there is no rc_" + name + " " + std::to_string(value));
    }

    /// @throws Refusal unless the value is a method, or RC_TAYLOR
    [[nodiscard]] rc_method method(std::int32_t value) const
    {
        const auto is_value = [&](const Method& each) { return each.value == value; };
        if (value == RC_TAYLOR || std::any_of(methods.begin(), methods.end(), is_value)) {
            return static_cast<rc_method>(value);
        }
        refuse("method: there is no rc_method " + std::to_string(value));
    }

    template <class T>
    [[nodiscard]] FinderOptions finders(const T& from) const
    {
        FinderOptions finders{.detector = one_of("detector", from.detector, last_detector),
                              .locator = one_of("locator", from.locator, RC_TOMS748),
                              .gate = {}};
        const bool asks_gate = place_of_detector(finders.detector) == named_detectors.size() &&
                               finders.detector != RC_PLANNED;
        if (asks_gate && !from.gate) refuse("found no gate; expected the path of its model");
        if (!asks_gate && from.gate) refuse("found a gate for a detector that asks none");
        if (asks_gate) finders.gate = from.gate;
        return finders;
    }

    /// Options that runs and monitors share.
    template <class T>
    void read_events(const T& from, Options& options) const
    {
        options.event_tolerance = from.event_tolerance;
        options.event_rtol = from.event_rtol;
        options.event_window = from.event_window;
        options.check_inside = flag("check_inside", from.check_inside);
        options.record_events = flag("record_events", from.record_events);
        options.event_states = flag("event_states", from.event_states);
    }

private:
    const char* struct_;
};

}  // namespace

RunOptions read_options(const rc_options* given)
{
    const Reader reader("rc_options");
    const auto from = read_struct<rc_options>(given, "rc_options", defaults<rc_options>());
    RunOptions run;
    run.method = reader.method(from.method);
    if (run.method == RC_TAYLOR) {
        reader.refuse(
            "method: found RC_TAYLOR, whose power series need the flow as a formula, for "
            "callbacks; expected RC_FEHLBERG78, or the system in C++ with "
            "ricochet/taylor/taylor.hpp");
    }
    run.fixed_step = reader.flag("fixed_step", from.fixed_step);
    if (!run.fixed_step && !estimates_error(method_of(run.method))) {
        reader.refuse("method: found " + spelled_methods(false) +
                      ", which have no error estimate; expected fixed_step = 1 and a step, or " +
                      spelled_methods(true));
    }
    run.finders = reader.finders(from);
    if (from.sample_count > 0 && !from.sample_times) {
        reader.refuse("found a sample_count of " + std::to_string(from.sample_count) +
                      " without sample_times");
    }
    if (from.component_count > 0 && !from.component_atol) {
        reader.refuse("found a component_count of " + std::to_string(from.component_count) +
                      " without component_atol");
    }
    Options& options = run.options;
    options.t_start = from.t_start;
    if (std::isnan(from.t_end)) reader.refuse("t_end: found nan, expected a finite time");
    options.t_end = from.t_end;
    options.mode = from.mode;
    options.step = from.step;
    options.rtol = from.rtol;
    options.atol = from.atol;
    options.h_min = from.h_min;
    options.h_max = from.h_max;
    options.continues = reader.flag("continues", from.continues);
    options.stop_at_event = reader.flag("stop_at_event", from.stop_at_event);
    options.record_steps = reader.flag("record_steps", from.record_steps);
    reader.read_events(from, options);
    options.sample_times.assign(from.sample_times, from.sample_times + from.sample_count);
    options.component_atol.assign(from.component_atol, from.component_atol + from.component_count);
    options.max_steps = from.max_steps;
    options.stall_steps = from.stall_steps;
    return run;
}

void require_options_of_phases(const RunOptions& options)
{
    const Reader reader("rc_options");
    if (options.fixed_step) {
        reader.refuse("found fixed_step = 1 and a system with set_valued; expected error control");
    }
    if (place_of_detector(options.finders.detector) == named_detectors.size()) {
        reader.refuse(
            "detector: found one that defers checks and a system with set_valued; expected " +
            alternatives(named_detectors, [](const NamedDetector&) { return true; }));
    }
}

MethodName method_of(rc_method method) noexcept
{
    for (const Method& each : methods) {
        if (each.value == method) return each.name;
    }
    return MethodName::dopri5;
}

MonitorOptions read_options(const rc_monitor_options* given)
{
    const Reader reader("rc_monitor_options");
    const auto standard = defaults<rc_monitor_options>();
    const auto from = given ? read_struct(given, "rc_monitor_options", standard) : standard;
    MonitorOptions monitor;
    monitor.finders = reader.finders(from);
    monitor.backward = reader.flag("backward", from.backward);
    monitor.cut_at_all = reader.flag("cut_at_all", from.cut_at_all);
    Options& options = monitor.options;
    reader.read_events(from, options);
    options.t_end = monitor.backward ? -1 : 1;
    validate(options, false, "rc_monitor_options");
    constexpr double forever = std::numeric_limits<double>::infinity();
    options.t_end = monitor.backward ? -forever : forever;
    return monitor;
}

}  // namespace ricochet::c

extern "C" {

rc_status rc_options_default(rc_options* options, size_t size)
{
    return ricochet::c::fill_in("rc_options", options, size);
}

rc_status rc_monitor_options_default(rc_monitor_options* options, size_t size)
{
    return ricochet::c::fill_in("rc_monitor_options", options, size);
}
}
