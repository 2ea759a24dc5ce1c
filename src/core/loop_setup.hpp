// Validation of a run's set-up, and the properties that identify a run.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline const Options& Loop<X, single>::checked(const RunBindings<X>& setup, const Options& options,
                                               const X& x0)
{
    validate_but_for_end(options, !setup.error_controlled, "integrate");
    if (x0.size() == 0) throw_start_empty("integrate");
    for_each_component(x0, [&](auto i) {
        if (!std::isfinite(x0[i])) {
            throw_start_not_finite("integrate", static_cast<std::size_t>(i), x0[i]);
        }
    });
    const std::size_t tolerances = options.component_atol.size();
    const auto components = static_cast<std::size_t>(x0.size());
    if (setup.error_controlled && tolerances > 0 && tolerances != components) {
        throw_wrong_tolerances(components, tolerances);
    }
    return options;
}

template <class X, bool single>
inline std::vector<RunProperty> Loop<X, single>::properties() const
{
    const int order = setup_.method_by_name ? setup_.kernel->order : setup_.order;
    const std::string of_order = order > 0 ? " of order " + std::to_string(order) : "";
    return properties_of_run({.system = system()->name(system().adapter()),
                              .stepping = plain_type_name(setup_.stepping) + of_order,
                              .detector = plain_type_name(engine_.finders().detector.type),
                              .locator = plain_type_name(engine_.finders().locator.type),
                              .components = components_,
                              .guards = engine_.guards().size(),
                              .error_controlled = error_controlled_},
                             options());
}

template <class X, bool single>
inline void Loop<X, single>::refuse_bad_place() const
{
    const auto require = [](bool fulfilled, std::string_view what) {
        if (!fulfilled) throw_snapshot_is_no_state(what);
    };
    const auto components = static_cast<std::size_t>(place_.x.size());
    const bool may_shrink =
        (system()->moded || system()->changes_dimension) && !system()->fixed_dimension;
    require((system()->fixed_dimension ? components == components_
                                       : components >= (may_shrink ? 1 : components_)) &&
                place_.remainder.size() == place_.x.size() && place_.rate.size() == place_.x.size(),
            "the number of components");
    if (lies_before(options().t_end, place_.t.value)) {
        throw_snapshot_later(place_.t.value, options().t_end);
    }
    const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(place_.t.value);
    require(std::isfinite(place_.t.value) && std::fabs(place_.t.remainder) <= ulp &&
                !lies_before(place_.t.value, options().t_start),
            "the time");
    require(has_ended() ||
                (all_finite(place_.x) && all_finite(place_.remainder) && all_finite(place_.rate)),
            "the state");
    require(!timed_ || std::isinf(last_of_flow_) || !lies_before(last_of_flow_, place_.t.value),
            "the last time of the flow");
    require(h_next() > 0 && std::isfinite(h_next()) &&
                (!error_controlled_ || h_next() <= options().h_max),
            "the next step");
    require(first_step_ > 0 && std::isfinite(first_step_), "the first step");
    require(std::isfinite(flight_start_) && longest_step_ >= 0 && std::isfinite(longest_step_),
            "the last event");
    // It may be due: an event within the rounding of its time comes before it.
    require(has_ended() || !lies_before(time_event(), place_.t.value) || !timed_,
            "the next time event");
    const std::size_t modes = engine_.modes();
    require(modes == 0 || place_.mode < modes, "the mode");
    require(engine_.holds().fit(components), "what a rest holds");
    const auto is_guard = [this](std::size_t i) {
        return i == no_guard || i < engine_.guards().size();
    };
    require(is_guard(result().guard) &&
                (is_guard(result().other_guard) || result().other_guard == time_event_reset) &&
                (!result().wrong_bound || is_guard(result().wrong_bound->guard)),
            "the guard that ended the run");
}

}  // namespace ricochet::detail
