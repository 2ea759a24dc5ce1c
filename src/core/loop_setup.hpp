// What a run refuses, and how its guards are armed at its start.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline const Options& Loop<X, single>::checked(const Options& options, const X& x0) const
{
    validate(options, !error_controlled_);
    if (x0.size() == 0) throw_start_empty();
    for_each_component(x0, [&](auto i) {
        if (!std::isfinite(x0[i])) {
            throw_start_not_finite(static_cast<std::size_t>(i), x0[i]);
        }
    });
    return options;
}

template <class X, bool single>
inline std::vector<RunProperty> Loop<X, single>::properties() const
{
    const std::string by_name =
        setup_.method_by_name ? " of order " + std::to_string(step_.order()) : "";
    return properties_of_run({.system = system_->name(system_.door()),
                              .stepping = plain_type_name(setup_.stepping) + by_name,
                              .detector = plain_type_name(finders_.detector.type),
                              .locator = plain_type_name(finders_.locator.type),
                              .components = components_,
                              .guards = bank_.size(),
                              .error_controlled = error_controlled_},
                             options_);
}

template <class X, bool single>
inline void Loop<X, single>::refuse_bad_place() const
{
    const auto require = [](bool fulfilled, std::string_view what) {
        if (!fulfilled) throw_snapshot_is_no_state(what);
    };
    const auto components = static_cast<std::size_t>(place_.x.size());
    const bool may_shrink =
        (system_->moded || system_->changes_dimension) && !system_->fixed_dimension;
    require((system_->fixed_dimension ? components == components_
                                      : components >= (may_shrink ? 1 : components_)) &&
                place_.remainder.size() == place_.x.size() && place_.rate.size() == place_.x.size(),
            "the number of components");
    const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(place_.t.value);
    require(std::isfinite(place_.t.value) && std::fabs(place_.t.remainder) <= ulp &&
                !lies_before(options_.t_end, place_.t.value) &&
                !lies_before(place_.t.value, options_.t_start),
            "the time");
    require(
        ended_ || (all_finite(place_.x) && all_finite(place_.remainder) && all_finite(place_.rate)),
        "the state");
    require(
        h_next_ > 0 && std::isfinite(h_next_) && (!error_controlled_ || h_next_ <= options_.h_max),
        "the next step");
    require(first_step_ > 0 && std::isfinite(first_step_), "the first step");
    require(std::isfinite(flight_start_) && longest_step_ >= 0 && std::isfinite(longest_step_),
            "the last event");
    require(ended_ || lies_before(place_.t.value, time_event_) || !timed_, "the next time event");
    const std::size_t modes = system_.modes();
    require(modes == 0 || place_.mode < modes, "the mode");
}

template <class X, bool single>
inline void Loop<X, single>::refuse_bad_guards()
{
    for (std::size_t i = 0; i < bank_.size(); ++i) {
        GuardRecord& record = bank_[i];
        const GuardInfo& info = record.info;
        record.acting =
            (resets_any_ && info.resets) || info.stop_after > 0 || options_.stop_at_event;
        if (info.unilateral && !(resets_any_ && info.resets)) {
            throw_no_reset(i, info.name);
        }
        if (info.unilateral && info.crossing != Crossing::falling) {
            throw_unilateral_not_falling(i, info.name);
        }
    }
}

template <class X, bool single>
inline void Loop<X, single>::arm_at_start()
{
    enable_guards();
    newly_armed_ = true;
    last_h_ = h_next_;
    bank_.begin_phase(step_.time(0));
    bank_.sample_start(step_, calls(), h_next_);
    for (std::size_t i = 0; i < bank_.size(); ++i) {
        const GuardRecord& record = bank_[i];
        const double g = bank_.g0(i);
        if (!record.enabled) continue;
        if (!std::isfinite(g)) {
            throw_start_guard_not_finite(i, record.info.name, options_.t_start, g);
        }
        const bool on_surface = g == 0 || (record.info.unilateral && g < 0 && -g <= rounding_of(i));
        if (record.info.unilateral && g < 0 && !on_surface) {
            throw_start_outside_mode(i, record.info.name, options_.t_start, g);
        }
        if (on_surface) bank_[i].band = std::fabs(g);
        bank_[i].departs = on_surface;
        bank_.arm(i, on_surface ? heading(i) : side_of(g));
        if (record.side == Side::plateau) {
            bank_.await(i, record.info.unilateral ? Side::above : Side::plateau);
        }
        if (record.info.unilateral && record.side == Side::below) {
            search_.members().push_back(i);
        }
    }
    cascade();
}

template <class X, bool single>
inline double Loop<X, single>::rounding_of(std::size_t i)
{
    constexpr double nudge = 8 * std::numeric_limits<double>::epsilon();
    const auto guard = bank_.view(i, step_.mode(), calls());
    const double t = step_.time(0);
    const double g = guard.value(t, step_.x0());
    double rounding = std::fabs(guard.value(t * (1 + nudge), step_.x0()) - g);
    X near = step_.x0();
    for_each_component(near, [&](auto c) {
        const double kept = near[c];
        if (kept == 0) return;
        near[c] = kept * (1 + nudge);
        rounding += std::fabs(guard.value(t, near) - g);
        near[c] = kept;
    });
    return rounding;
}

}  // namespace ricochet::detail
