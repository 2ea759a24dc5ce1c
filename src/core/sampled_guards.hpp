// All guards of a system, evaluated at a state.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "base/wide.hpp"
#include "core/guard_record.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/guard_view.hpp"

namespace ricochet::detail {

/// Where guards and their rates are sampled.
template <class X>
struct SamplePoint {
    Along<X> motion;
    double scale;  ///< [s] over which the motion is taken as smooth
};

template <class X, bool single>
class SampledGuards {
protected:
    using Doubles = PerGuard<double, single>;

    SampledGuards(const SystemAt<X>& system, const GuardRules& rules, bool backward)
        : system_(system), rules_(rules), backward_(backward)
    {
        const std::size_t count = system->guard_count(system.adapter());
        if (count == 0) return;
        behind_.resize(count);
        records_.resize(count);
        at_rest_.resize(count);
        for (std::size_t i = 0; i < count; ++i) {
            records_[i].info = system->info(system.adapter(), i);
        }
        heed_enabled();
    }

public:
    [[nodiscard]] std::size_t size() const noexcept { return single ? 1 : records_.size(); }
    /// Guard i, which is not at rest from now on.
    [[nodiscard]] GuardRecord& operator[](std::size_t i) noexcept
    {
        if constexpr (!single) at_rest_[i] = 0;
        return records_[i];
    }
    [[nodiscard]] const GuardRecord& operator[](std::size_t i) const noexcept
    {
        return records_[i];
    }

    [[nodiscard]] CoreGuard<X> view(std::size_t i, Mode mode, std::uint64_t& calls) const noexcept
    {
        return {system_, calls, {i, mode, backward_}, records_[i].info};
    }

    /// The rate of guard i, as `sample` computes it.
    [[nodiscard]] double rate_of(std::size_t i, const SamplePoint<X>& at, std::uint64_t& calls)
    {
        if (records_[i].info.boolean || !rules_.uses_rates) return 0;
        if (!system_->rates) return rate_alone(i, at, calls);
        rates_together(at, behind_);
        return std::isfinite(behind_[i]) ? behind_[i] : rate_alone(i, at, calls);
    }

    /// Updates which guards are enabled.
    void heed_enabled() noexcept
    {
        selective_ = false;
        idle_ = true;
        for (std::size_t i = 0; i < size(); ++i) {
            selective_ = selective_ || records_[i].info.boolean || !records_[i].enabled;
            idle_ = idle_ && !records_[i].enabled;
        }
    }
    /// Whether there is no guard, or none is enabled.
    [[nodiscard]] bool is_idle() const noexcept { return idle_; }

protected:
    void sample(const SamplePoint<X>& at, std::uint64_t& calls, Doubles& g, Doubles& rates)
    {
        if (single && system_->point && rules_.uses_rates && !selective_) {
            const GuardPoint both = view(0, at.motion.mode, calls)
                                        .point(at.motion.t, at.motion.x, at.motion.s, at.scale);
            g[0] = both.value;
            rates[0] = both.rate;
            return;
        }
        sample_values(at.motion.mode, at.motion.t, at.motion.x, calls, g);
        sample_rates(at, calls, rates, &g);
    }

    void sample_values(Mode mode, double t, const X& x, std::uint64_t& calls, Doubles& g)
    {
        if (size() == 0) return;
        system_->guards(system_.adapter(), mode, t, x, all(g));
        calls += size();
    }

    /// @param g  the values there, or null
    void sample_rates(const SamplePoint<X>& at, std::uint64_t& calls, Doubles& rates,
                      const Doubles* g = nullptr)
    {
        if (!rules_.uses_rates || size() == 0) return;
        if (system_->rates) {
            rates_together(at, rates);
        } else if (system_->each_rate && !selective_ && !backward_) {
            system_->each_rate(system_.adapter(), at.motion, all(rates));
        } else if (!system_->each_rate && !system_->guard_alone) {
            const bool is_cut =
                system_.is_near_end(at.motion.t, tolerances::of_difference * at.scale);
            if (is_cut) {
                if (g) {
                    for (std::size_t i = 0; i < size(); ++i) rates[i] = (*g)[i];
                } else {
                    sample_values(at.motion.mode, at.motion.t, at.motion.x, calls, rates);
                }
                difference_inside(at, rates);
            } else {
                difference(at, rates);
            }
            calls += 2 * size();
        } else if (shares_states(at)) {
            difference_each(at, calls, rates);
            return;
        } else {
            for (std::size_t i = 0; i < size(); ++i) {
                const double known = g ? (*g)[i] : std::numeric_limits<double>::quiet_NaN();
                rates[i] = is_rateless(i) ? 0 : rate_alone(i, at, calls, known);
            }
            return;
        }
        if (!all_finite(rates)) replace_lost(at, calls, rates);
    }

    [[nodiscard]] double rate_alone(std::size_t i, const SamplePoint<X>& at, std::uint64_t& calls,
                                    double g = std::numeric_limits<double>::quiet_NaN())
    {
        return view(i, at.motion.mode, calls)
            .rate(at.motion.t, at.motion.x, at.motion.s, at.scale, g);
    }

    /// Rates of all guards from the system in one call.
    void rates_together(const SamplePoint<X>& at, Doubles& rates)
    {
        void* const adapter = system_.adapter();
        if (!backward_) return system_->rates(adapter, at.motion, all(rates));
        system_->rates(adapter, {at.motion.mode, at.motion.t, at.motion.x, negated(at.motion.s)},
                       all(rates));
        for (std::size_t i = 0; i < size(); ++i) rates[i] = -rates[i];
    }

    /// Rates of all guards by the central difference along the flow, in two calls.
    void difference(const SamplePoint<X>& at, Doubles& rates)
    {
        const double delta = tolerances::of_difference * at.scale;
        const double ahead = backward_ ? -delta : delta;
        if (there_.size() != at.motion.x.size()) there_ = at.motion.x;
        detail::move(there_, at.motion.x, delta, at.motion.s);
        system_->guards(system_.adapter(), at.motion.mode, at.motion.t + ahead, there_, all(rates));
        detail::move(there_, at.motion.x, -delta, at.motion.s);
        system_->guards(system_.adapter(), at.motion.mode, at.motion.t - ahead, there_,
                        all(behind_));
        for (std::size_t i = 0; i < size(); ++i) {
            rates[i] = records_[i].info.boolean ? 0 : (rates[i] - behind_[i]) / (2 * delta);
        }
    }

    /// Rates of all guards at an end of the run, by the differences of `CoreGuard::rate_inside`,
    /// from the values there in `rates`.
    void difference_inside(const SamplePoint<X>& at, Doubles& rates)
    {
        const double delta =
            system_.span()->inward(at.motion.t, tolerances::of_difference * at.scale);
        if (there_.size() != at.motion.x.size()) there_ = at.motion.x;
        const auto guards = [&](double later, Doubles& g) {
            detail::move(there_, at.motion.x, backward_ ? -later : later, at.motion.s);
            system_->guards(system_.adapter(), at.motion.mode, at.motion.t + later, there_, all(g));
        };
        guards(delta, behind_);
        for (std::size_t i = 0; i < size(); ++i) rates[i] = 4 * behind_[i] - 3 * rates[i];
        guards(2 * delta, behind_);
        for (std::size_t i = 0; i < size(); ++i) {
            const double slope = (rates[i] - behind_[i]) / (2 * delta);
            rates[i] = records_[i].info.boolean ? 0 : backward_ ? -slope : slope;
        }
    }

    /// Whether each guard would move a whole large state for its difference.
    [[nodiscard]] bool shares_states(const SamplePoint<X>& at) const noexcept
    {
        if constexpr (single || is_small<X>) return false;
        return size() > 1 && !system_->each_rate && !system_->rated && !system_->guard_on &&
               system_->calls_of_rate == 2 &&
               !system_.is_near_end(at.motion.t, tolerances::of_difference * at.scale);
    }

    /// Differences of guards that are evaluated one by one, at the same two states.
    void difference_each(const SamplePoint<X>& at, std::uint64_t& calls, Doubles& rates)
    {
        const double delta = tolerances::of_difference * at.scale;
        const double ahead = backward_ ? -delta : delta;
        if (there_.size() != at.motion.x.size()) there_ = at.motion.x;
        const auto sample = [&](double s, double later, Doubles& g) {
            detail::move(there_, at.motion.x, s, at.motion.s);
            for (std::size_t i = 0; i < size(); ++i) {
                if (is_rateless(i)) continue;
                g[i] = system_->guard(system_.adapter(), i, at.motion.mode, at.motion.t + later,
                                      there_);
            }
        };
        sample(delta, ahead, rates);
        sample(-delta, -ahead, behind_);
        for (std::size_t i = 0; i < size(); ++i) {
            if (is_rateless(i)) {
                rates[i] = 0;
                continue;
            }
            rates[i] = (rates[i] - behind_[i]) / (2 * delta);
            if (is_finite(rates[i])) {
                calls += 2;
            } else {
                rates[i] = rate_alone(i, at, calls);
            }
        }
    }

    SystemAt<X> system_;
    GuardRules rules_;
    bool backward_;
    bool selective_ = false;  ///< whether any guard is disabled or has no rate
    bool idle_ = true;
    PerGuard<GuardRecord, single> records_{};
    /// 1 for a guard whose record is that of a guard armed away from its surface, with no part in
    /// the last set: nothing of it changes while it stays on its side. Else 0.
    Doubles at_rest_{};

private:
    [[nodiscard]] bool is_rateless(std::size_t i) const noexcept
    {
        return records_[i].info.boolean || !records_[i].enabled;
    }

    [[nodiscard]] static bool is_finite(double rate) noexcept
    {
        return std::fabs(rate) <= std::numeric_limits<double>::max();
    }
    [[nodiscard]] bool all_finite(const Doubles& rates) const noexcept
    {
        if (size() >= 8) return all_of_many_finite(rates.data());
        for (std::size_t i = 0; i < size(); ++i) {
            if (!is_finite(rates[i])) return false;
        }
        return true;
    }
    RICOCHET_WIDE bool all_of_many_finite(const double* rates) const noexcept
    {
        double any = 0;  // a double, so that the loop is vectorised
        const std::size_t count = size();
        for (std::size_t i = 0; i < count; ++i) any = is_finite(rates[i]) ? any : 1.0;
        return any == 0;
    }

    /// Evaluates guard by guard the rates that are not finite, since no conclusion follows from
    /// them.
    [[gnu::cold, gnu::noinline]] void replace_lost(const SamplePoint<X>& at, std::uint64_t& calls,
                                                   Doubles& rates)
    {
        for (std::size_t i = 0; i < size(); ++i) {
            if (std::isfinite(rates[i]) || is_rateless(i)) continue;
            rates[i] = rate_alone(i, at, calls);
        }
    }

    [[nodiscard]] std::span<double> all(Doubles& numbers) const noexcept
    {
        return {numbers.data(), size()};
    }

    Doubles behind_{};
    X there_{};
};

}  // namespace ricochet::detail
