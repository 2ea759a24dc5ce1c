#include "ricochet/nonsmooth/hand_over.hpp"

#include <fmt/format.h>

#include "base/require.hpp"
#include "ricochet/detail/refusals.hpp"

namespace ricochet {

HandOverOptions hand_over_options(const Options& options)
{
    constexpr detail::Refuse refuse{"integrate"};
    if (options.stop_at_event) refuse("a run that may be handed over has no stop_at_event");
    if (options.record_steps) refuse("a run that may be handed over has no record_steps");
    if (!options.component_atol.empty()) {
        refuse("a run that may be handed over has one atol for all components");
    }
    if (options.t_end < options.t_start) {
        refuse("a run that may be handed over has no backward direction");
    }
    HandOverOptions out;
    out.t_start = options.t_start;
    out.t_end = options.t_end;
    out.rtol = options.rtol;
    out.atol = options.atol;
    out.h_max = options.h_max;
    out.event_tolerance = options.event_tolerance;
    out.sample_times = options.sample_times;
    out.max_steps = std::min(options.max_steps, out.max_steps);
    out.stall_steps = options.stall_steps;
    out.cancelled = options.cancelled;
    if (std::isinf(options.t_end)) {
        const bool limited = std::isfinite(options.h_max);
        out.set_valued.step = limited ? options.h_max : options.step;
        if (out.set_valued.step == 0) {
            refuse(
                "found an infinite t_end and no h_max beside set-valued motion, whose steps are "
                "then no thousandth of the run; expected h_max, their length [s]");
        }
    }
    detail::check(out, refuse.who);
    return out;
}

namespace detail {

HandOverOptions inclusion_options(const Options& options)
{
    const Options unset{};
    const auto unused = [](bool given, std::string_view name) {
        if (given) {
            Refuse{"integrate"}(fmt::format("a run of an inclusion alone has no {}", name));
        }
    };
    unused(options.mode != unset.mode, "mode");
    unused(options.step != unset.step, "step");
    unused(options.h_min != unset.h_min, "h_min");
    unused(options.event_rtol != unset.event_rtol, "event_rtol");
    unused(options.event_window != unset.event_window, "event_window");
    unused(options.check_inside != unset.check_inside, "check_inside");
    const bool may_end = options.max_steps != unset.max_steps || options.cancelled != nullptr;
    if (std::isinf(options.t_end) && !may_end) throw_endless(options.t_end);
    return hand_over_options(options);
}

void check(const HandOverOptions& options, std::string_view who)
{
    const Require require{who};
    require(std::isfinite(options.t_start), "t_start must be finite", options.t_start);
    require(options.t_end >= options.t_start, "t_end must be no earlier than t_start",
            options.t_end);
    require(options.rtol >= 0 && options.rtol < 1, "rtol must lie in [0, 1)", options.rtol);
    require(options.atol >= 0 && std::isfinite(options.atol), "atol must be zero or positive",
            options.atol);
    require(options.atol + options.rtol > 0, "one of atol and rtol must be positive",
            options.atol + options.rtol);
    require(options.h_max > 0, "h_max must be positive", options.h_max);
    require(options.event_tolerance >= 0, "event_tolerance must be zero or positive",
            options.event_tolerance);
    const double step = options.set_valued.step;
    require(step >= 0 && std::isfinite(step),
            "set_valued.step must be zero or positive, and finite", step);
    double last = options.t_start;
    for (const double t : options.sample_times) {
        require(!(t > options.t_end), "sample_times must not lie beyond t_end", t);
        require(t >= last, "sample_times must ascend from t_start to t_end", t);
        last = t;
    }
}

HandOverOptions completed(HandOverOptions options, bool locate)
{
    check(options, "HandOverOptions");
    const double span = options.t_end - options.t_start;
    SetValuedOptions& steps = options.set_valued;
    steps.t_start = options.t_start;
    if (std::isinf(span)) {
        if (steps.step == 0) {
            throw std::invalid_argument(
                "HandOverOptions: found an infinite t_end and no set_valued.step, which is then no "
                "thousandth of the run; expected the length [s] of the set-valued steps");
        }
        if (steps.h_min == 0) steps.h_min = 1e-9 * steps.step;
        steps.t_end = std::numeric_limits<double>::max();
    } else {
        if (steps.step == 0) steps.step = span > 0 ? 1e-3 * span : 1;
        steps.t_end = options.t_end;
    }
    options.set_valued.max_attempts = std::min(options.set_valued.max_attempts, options.max_steps);
    if (!locate) return options;
    options.set_valued.switches = Switches::located;
    const bool constant = std::holds_alternative<ConstantStep>(options.set_valued.controller);
    if (!constant || options.set_valued.estimate != ErrorEstimate::none) {
        Refuse{"HandOverOptions"}(
            "found a set_valued.controller or an estimate beside branches, whose set-valued steps "
            "have constant length; expected neither, or a SetValuedMotion");
    }
    return options;
}

HandOverOptions with_part_of_steps(HandOverOptions options, bool locate, double part)
{
    SetValuedOptions& steps = options.set_valued;
    steps.step = part * completed(options, locate).set_valued.step;
    if (!std::holds_alternative<ConstantStep>(steps.controller)) {
        steps.rtol *= part * part;
        steps.atol *= part * part;
        for (ErrorField& field : steps.fields) field.rtol *= part * part;
    }
    constexpr std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
    options.max_steps = options.max_steps <= most / 16 ? 16 * options.max_steps : most;
    return options;
}

std::optional<PhaseCause> cause_after(Outcome outcome) noexcept
{
    switch (outcome) {
        case Outcome::zeno: return PhaseCause::accumulation;
        case Outcome::outside_mode:
        case Outcome::endless_cascade:
        case Outcome::conflicting_resets:
        case Outcome::step_underflow:
        case Outcome::stalled: return PhaseCause::stuck;
        default: return std::nullopt;
    }
}

}  // namespace detail

}  // namespace ricochet
