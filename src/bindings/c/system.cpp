#include "bindings/c/system.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bindings/c/structs.hpp"

namespace ricochet::c {

void throw_callback_failed(const char* callback, int code, std::size_t guard, double t)
{
    throw CallbackFailed{.callback = callback, .code = code, .guard = guard, .t = t};
}

namespace {

[[noreturn]] void refuse(const std::string& message)
{
    throw Refusal(RC_INVALID, "rc_callbacks: " + message);
}

void require(bool fulfilled, const char* message)
{
    if (!fulfilled) refuse(message);
}

void check(const rc_callbacks& has)
{
    require(has.flow, "found no flow; expected a callback");
    require(has.dimension > 0, "found a dimension of 0; expected at least 1");
    const bool guarded = has.guard_count > 0;
    require(!guarded || has.guards || has.guard,
            "found neither `guards` nor `guard` for a guard_count above 0; expected one of them");
    require(guarded || !(has.guards || has.guard),
            "found `guards` or `guard` with a guard_count of 0; expected the number of guards");
    require(guarded || !(has.guard_rates || has.guard_rate || has.reset || has.reset_set ||
                         has.rest || has.enabled_in || has.enabled || has.speed_bound),
            "found a callback of guards with a guard_count of 0");
    require(!(has.reset && has.reset_set),
            "found both `reset` and `reset_set`; expected one of them");
    require(!has.rest || has.reset || has.reset_set, "found a rest without a reset");
    const bool listed = has.time_event_count > 0;
    const bool ticks = has.time_event_period != 0;
    const bool asked = has.next_time_event || has.next_time_event_at;
    require(!listed || has.time_events, "found a time_event_count above 0 without time_events");
    require(
        (has.next_time_event != nullptr) + (has.next_time_event_at != nullptr) + listed + ticks <=
            1,
        "found several of next_time_event, next_time_event_at, time_events and "
        "time_event_period; expected one of them");
    require(!has.time_reset || asked || listed || ticks || has.time_events,
            "found a time_reset without a next_time_event, next_time_event_at, time_events or "
            "time_event_period");
    require(!has.previous_time_event || asked,
            "found a previous_time_event without a next_time_event");
    require(has.speed_bound || !(has.acceleration_bound || has.lower_bound || has.upper_bound),
            "found a bound without a speed_bound");
    require(has.mode_count <= UINT32_MAX, "found a mode_count that is no rc_mode");
}

[[noreturn]] void refuse_info(std::size_t which, const std::string& message)
{
    throw Refusal(RC_INVALID, "rc_guard_info of guard " + std::to_string(which) + ": " + message);
}

/// @throws Refusal unless the field is 0 or 1.
[[nodiscard]] bool flag(std::size_t which, const char* field, std::int32_t value)
{
    if (value == 0 || value == 1) return value == 1;
    refuse_info(which, std::string(field) + " must be 0 or 1, got " + std::to_string(value));
}

[[nodiscard]] Crossing crossing_of(std::size_t which, std::int32_t given)
{
    switch (given) {
        case RC_FALLING: return Crossing::falling;
        case RC_RISING: return Crossing::rising;
        case RC_EITHER: return Crossing::either;
        default: refuse_info(which, "crossing " + std::to_string(given) + " is no rc_crossing");
    }
}

[[nodiscard]] GuardInfo info_of(std::size_t which, const rc_guard_info& given)
{
    if (!(given.touch >= 0 && std::isfinite(given.touch))) {
        refuse_info(which,
                    "touch must be finite and not negative, got " + std::to_string(given.touch));
    }
    if (!(given.lipschitz >= 0 && std::isfinite(given.lipschitz))) {
        refuse_info(which, "lipschitz must be finite and not negative, got " +
                               std::to_string(given.lipschitz));
    }
    if (given.degree < 0) {
        refuse_info(which, "degree must not be negative, got " + std::to_string(given.degree));
    }
    return {.crossing = crossing_of(which, given.crossing),
            .resets = !flag(which, "notifies", given.notifies),
            .stop_after = given.stop_after,
            .unilateral = flag(which, "unilateral", given.unilateral),
            .boolean = flag(which, "boolean", given.boolean),
            .degree = given.degree,
            .touch = given.touch,
            .at_start = flag(which, "at_start", given.at_start),
            .at_entry = flag(which, "at_entry", given.at_entry)};
}

/// The reason of the last call of rc_stop in this thread.
thread_local std::optional<std::string> reason_here;

}  // namespace

void end_run_if_asked(int code, Mode mode)
{
    if (code != stop_code || !reason_here) return;
    std::string reason = std::move(*reason_here);
    reason_here.reset();
    throw StopRun(std::move(reason), mode);
}

CallbackSystem::CallbackSystem(const rc_callbacks& given)
    : name(given.name ? given.name : "callbacks"), at_(given)
{
    check(given);
    at_.name = nullptr;
    at_.time_events = nullptr;
    if (given.time_event_count > 0) {
        const double* first = given.time_events;
        times = Times(std::vector<double>(first, first + given.time_event_count),
                      "rc_callbacks.time_events");
    } else if (given.time_event_period != 0) {
        times = every(given.time_event_period, given.time_event_phase,
                      "rc_callbacks.time_event_period");
    }
    if (given.set_valued) inclusion_.emplace(given.set_valued, given);
    at_.set_valued = nullptr;
    const std::size_t count = given.guard_count;
    infos_.resize(count);
    guard_names_.resize(count);
    lipschitz_.assign(count, 1.0);
    const auto* bytes = reinterpret_cast<const unsigned char*>(given.guard_infos);
    at_.guard_infos = nullptr;
    for (std::size_t i = 0; i < count && inclusion_; ++i) {
        infos_[i].reaction = inclusion_->reaction_of(i);
    }
    if (!bytes || count == 0) return;
    const std::size_t stride = size_of_given<rc_guard_info>(bytes, "rc_guard_info");
    for (std::size_t i = 0; i < count; ++i) {
        const auto info = read_struct<rc_guard_info>(bytes + i * stride, "rc_guard_info");
        if (size_of_given<rc_guard_info>(bytes + i * stride, "rc_guard_info") != stride) {
            throw Refusal(RC_WRONG_SIZE, "rc_guard_info of guard " + std::to_string(i) +
                                             ": its size is not that of the first");
        }
        infos_[i] = info_of(i, info);
        if (inclusion_) infos_[i].reaction = inclusion_->reaction_of(i);
        if (info.name) guard_names_[i] = info.name;
        infos_[i].name = guard_names_[i];
        if (info.lipschitz > 0) lipschitz_[i] = info.lipschitz;
    }
}

std::optional<double> CallbackSystem::parameter(std::string_view parameter_name) const
{
    if (!at_.parameter) return std::nullopt;
    double value = nan;
    heed(at_.parameter(at_.user, std::string(parameter_name).c_str(), &value), "parameter", nan);
    return value == value ? std::optional(value) : std::nullopt;
}

}  // namespace ricochet::c

using namespace ricochet::c;

extern "C" {

rc_status rc_system_new(const rc_callbacks* callbacks, rc_system** system)
{
    return guarded([&] {
        if (!system) throw_null("rc_system_new, system");
        *system = nullptr;
        *system = new rc_system(read_struct<rc_callbacks>(callbacks, "rc_callbacks"));
    });
}

int rc_stop(const char* reason)
{
    // Without memory for the text the run is ended without it.
    try {
        reason_here = reason ? reason : "";
    } catch (const std::bad_alloc&) {
        reason_here = "";
    }
    return stop_code;
}

double rc_next_tick(double period, double phase, double t)
{
    if (!(period > 0)) return std::numeric_limits<double>::quiet_NaN();
    return guarded_value(std::numeric_limits<double>::quiet_NaN(),
                         [&] { return ricochet::every(period, phase).next(t); });
}

double rc_next_listed(const double* times, size_t count, double t)
{
    const double* last = times + count;
    const double* next = std::upper_bound(times, last, t);
    return next == last ? std::numeric_limits<double>::infinity() : *next;
}

void rc_system_free(rc_system* system)
{
    if (!system) return;
    static_cast<void>(guarded([&] {
        check_handle(system, Kind::system);
        system->system.reset();
        retire(system, [](Handle* handle) { delete static_cast<rc_system*>(handle); });
    }));
}
}
