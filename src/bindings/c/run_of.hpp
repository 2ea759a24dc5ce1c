// A run of callbacks with one type of state.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bindings/c/callback_table.hpp"
#include "bindings/c/run.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/calibrated.hpp"
#include "ricochet/detect/ends.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/locate/bisection.hpp"
#include "ricochet/locate/newton.hpp"
#include "ricochet/locate/toms748.hpp"
#include "ricochet/nn/safetensors.hpp"

namespace ricochet::c {

template <class X>
class RunOf final : public AnyRun {
public:
    RunOf(std::shared_ptr<const CallbackSystem> system, const X& x0, const RunOptions& options)
        : system_(std::move(system)),
          door_(*system_, x0),
          table_(CallbackTable<X>::make(*system_)),
          setup_(setup_of(options)),
          loop_(detail::make_loop(setup_, x0, options.options))
    {
    }

    bool step() override { return finished(loop_->step()); }
    bool advance() override { return finished(loop_->advance()); }
    void run_to_end() override
    {
        loop_->show_all();
        while (!loop_->ended()) loop_->advance_once(true);
        loop_->show_all();
        finished(false);
    }
    bool continue_cancelled() noexcept override
    {
        if (!loop_->ended() || loop_->run().outcome != Outcome::cancelled) return false;
        loop_->go_on();
        return true;
    }

    [[nodiscard]] double t() const noexcept override { return loop_->t(); }
    [[nodiscard]] const double* x() const noexcept override { return loop_->x().data(); }
    [[nodiscard]] Mode mode() const noexcept override { return loop_->mode(); }
    [[nodiscard]] bool ended() const noexcept override { return loop_->ended(); }
    [[nodiscard]] Outcome outcome() const noexcept override { return loop_->run().outcome; }

    [[nodiscard]] Counts counts() override
    {
        const Run<X>& run = loop_->bring_up_to_date();
        return {run.statistics, run.guard, run.other_guard};
    }
    [[nodiscard]] std::size_t events() const noexcept override
    {
        return loop_->run().events.size();
    }
    [[nodiscard]] ShownEvent event(std::size_t i) const noexcept override
    {
        const Event<X>& event = loop_->run().events[i];
        return {.t = event.t,
                .kind = event.kind,
                .guard = event.guard,
                .mode_before = event.mode_before,
                .mode_after = event.mode_after,
                .before = event.before.size() > 0 ? event.before.data() : nullptr,
                .after = event.after.size() > 0 ? event.after.data() : nullptr,
                .bracket = event.bracket,
                .slope = event.slope,
                .error = event.error,
                .late = event.late};
    }
    [[nodiscard]] const std::vector<double>& sample_times() const noexcept override
    {
        return loop_->run().trajectory.t;
    }
    [[nodiscard]] const double* sample(std::size_t i) const noexcept override
    {
        return loop_->run().trajectory.x[i].data();
    }
    [[nodiscard]] bool keeps_steps() const noexcept override
    {
        return !loop_->run().solution.empty();
    }
    void solution(double t, bool before, double* x) const override
    {
        const auto& solution = loop_->run().solution;
        const X at = before ? solution.before(t) : solution(t);
        std::copy(at.begin(), at.end(), x);
    }
    [[nodiscard]] Mode solution_mode(double t) const override
    {
        return loop_->run().solution.mode(t);
    }
    [[nodiscard]] std::string save() override { return to_text(loop_->save()); }
    void restore(std::string_view text) override
    {
        loop_->restore(snapshot_from_text(text));
        if (loop_->ended()) loop_->bring_up_to_date();
    }

private:
    /// The last samples are taken when the run has ended.
    bool finished(bool goes_on)
    {
        if (loop_->ended()) loop_->bring_up_to_date();
        return goes_on;
    }

    template <class Method>
    void set_method(detail::RunSetup<X>& setup, bool fixed_step) const
    {
        setup.error_controlled = !fixed_step;
        setup.stepping = fixed_step ? detail::written_type<FixedStep<Method>>()
                                    : detail::written_type<ErrorControlled<Method>>();
        setup.kernel = &detail::kernel_by_name<X>(detail::NameOf<Method>::name);
    }
    void set_method(detail::RunSetup<X>& setup, const RunOptions& options) const
    {
        switch (options.method) {
            case RC_DOPRI5: return set_method<Dopri5>(setup, options.fixed_step);
            case RC_FEHLBERG78: return set_method<Fehlberg78>(setup, options.fixed_step);
            case RC_CASH_KARP54: return set_method<CashKarp54>(setup, options.fixed_step);
            case RC_RK4: return set_method<Rk4>(setup, options.fixed_step);
            case RC_EULER: return set_method<Euler>(setup, options.fixed_step);
        }
    }

    template <class Detector>
    void set_detector(detail::RunSetup<X>& setup, const Detector& detector)
    {
        const auto kept = std::make_shared<const Detector>(detector);
        setup.detector = detail::DetectorTableOf<Detector, CallbackSystem, X>::make(*kept);
        setup.detecting = kept.get();
        // Without what it plans by, a detector is the exact one that it is made around.
        const rc_callbacks& has = system_->callbacks();
        if (has.guard_count == 0 || (setup.detector.needs_bounds && !has.speed_bound)) {
            setup.detector.puts_off = false;
        }
        detector_ = kept;
    }
    void set_detector(detail::RunSetup<X>& setup, const RunOptions& options)
    {
        const auto gate = [&] { return gates::Gate(load_model(options.gate)); };
        switch (options.detector) {
            case RC_EXTREMUM: return set_detector(setup, Extremum());
            case RC_ENDS: return set_detector(setup, Ends());
            case RC_BERNSTEIN: return set_detector(setup, Bernstein());
            case RC_PLANNED: return set_detector(setup, Planned<>());
            case RC_CALIBRATED: return set_detector(setup, Calibrated<>(gate()));
            case RC_CALIBRATED_BOUNDS: return set_detector(setup, CalibratedBounds<>(gate()));
            case RC_FORESEEN: return set_detector(setup, Foreseen<>(gate()));
        }
    }

    template <class Locator>
    static void set_locator(detail::RunSetup<X>& setup)
    {
        static const Locator locator;
        setup.locator = detail::locator_table<Locator>();
        setup.locating = &locator;
    }

    [[nodiscard]] detail::RunSetup<X> setup_of(const RunOptions& options)
    {
        detail::RunSetup<X> setup;
        setup.system = &table_;
        setup.door = static_cast<detail::Door<CallbackSystem, X>*>(&door_);
        set_method(setup, options);
        set_detector(setup, options);
        switch (options.locator) {
            case RC_NEWTON: set_locator<Newton>(setup); break;
            case RC_BISECTION: set_locator<Bisection>(setup); break;
            case RC_TOMS748: set_locator<Toms748>(setup); break;
        }
        return setup;
    }

    std::shared_ptr<const CallbackSystem> system_;
    CallbackDoor<X> door_;
    detail::SystemTable<X> table_;
    std::shared_ptr<const void> detector_;
    detail::RunSetup<X> setup_;
    std::unique_ptr<detail::AnyLoop<X>> loop_;
};

/// A run with states of n doubles; 0: of any number.
template <std::size_t n>
[[nodiscard]] std::unique_ptr<AnyRun> make_run_with(std::shared_ptr<const CallbackSystem> system,
                                                    const double* x0, const RunOptions& options)
{
    if constexpr (n > 0) {
        std::array<double, n> start;
        std::copy_n(x0, n, start.begin());
        return std::make_unique<RunOf<std::array<double, n>>>(std::move(system), start, options);
    } else {
        std::vector<double> start(system->dimension());
        std::copy_n(x0, start.size(), start.begin());
        return std::make_unique<RunOf<std::vector<double>>>(std::move(system), start, options);
    }
}

}  // namespace ricochet::c

#define RICOCHET_C_RUN(suffix, n)                                                                  \
    std::unique_ptr<ricochet::c::AnyRun> ricochet::c::make_run_of_##suffix(                        \
        std::shared_ptr<const CallbackSystem> system, const double* x0, const RunOptions& options) \
    {                                                                                              \
        return make_run_with<n>(std::move(system), x0, options);                                   \
    }
