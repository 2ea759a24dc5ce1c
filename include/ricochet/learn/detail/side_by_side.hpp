// Internal: the declarations of this header may change without notice.
//
// A run with the exact detector and one with a gate, event by event.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <stdexcept>

#include "ricochet/detail/components.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::learn::detail {

enum class Agreement {
    to_the_bit,
    to_the_error,  ///< up to the error of locating it, from other brackets
    none,
};

/// Both runs, from one state; they are set on the exact run's state where they differ.
template <class System, class X, class Stepping, class Detector>
class SideBySide {
    using Exact = Simulation<System, X, Stepping>;
    using Gated = Simulation<System, X, Stepping, Detector>;

public:
    /// Keeps references to system and detector.
    SideBySide(const System& system, const Detector& detector, Exact exact, const Options& options)
        : system_(&system), detector_(&detector), options_(options), exact_(std::move(exact))
    {
        gated_.emplace(*system_, exact_->x(), options_, Stepping{}, *detector_);
    }

    [[nodiscard]] const Exact& exact() const noexcept { return *exact_; }
    [[nodiscard]] const Options& options() const noexcept { return options_; }

    /// Advances both runs to their next event, as long as `goes_on(events so far)`.
    template <class GoesOn>
    [[nodiscard]] Agreement take_next_event(const GoesOn& goes_on)
    {
        const std::size_t before = exact_->run().events.size();
        while (exact_->run().events.size() == before && exact_->step()) {
            if (!goes_on(before)) return Agreement::none;
        }
        while (gated_->run().events.size() == before && gated_->advance()) {
        }
        const auto& a = exact_->run().events;
        const auto& b = gated_->run().events;
        if (a.size() != b.size()) return Agreement::none;
        if (a.size() == before) return Agreement::to_the_bit;
        const double apart = std::fabs(a.back().t - b.back().t);
        // The errors of location, and those of rounding each time to a double.
        const double allowed = a.back().error + b.back().error +
                               std::numeric_limits<double>::epsilon() * std::fabs(a.back().t);
        if (a.back().guard != b.back().guard || !(apart <= allowed)) return Agreement::none;
        // States that differ by rounding at one and the same time separate chaotic runs, too.
        const bool same =
            apart == 0 && ricochet::detail::same_state(a.back().after, b.back().after);
        return same ? Agreement::to_the_bit : Agreement::to_the_error;
    }

    /// Ends both runs and adds what they cost.
    void finish(GateTrial& trial)
    {
        const Statistics a = exact_->finish().statistics;
        const Statistics b = gated_->finish().statistics;
        trial.events += a.events;
        trial.steps += a.steps;
        trial.exact_calls += a.guard_calls;
        trial.gated_calls += b.guard_calls;
        trial.network_calls += b.network_calls;
        trial.outside += b.outside_domain;
        trial.repeated += b.repeated_steps;
    }

    /// Continues both runs from this state of the exact one. False: they cannot continue.
    [[nodiscard]] bool restart(double t, Mode mode, const X& x)
    {
        options_.t_start = t;
        options_.mode = mode;
        try {
            exact_.emplace(*system_, x, options_);
            gated_.emplace(*system_, x, options_, Stepping{}, *detector_);
            return true;
        } catch (const std::invalid_argument&) {
            return false;
        }
    }

private:
    const System* system_;
    const Detector* detector_;
    Options options_;
    std::optional<Exact> exact_;
    std::optional<Gated> gated_;
};

}  // namespace ricochet::learn::detail
