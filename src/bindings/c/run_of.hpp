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

#include "bindings/c/callback_setup.hpp"
#include "bindings/c/phased.hpp"
#include "bindings/c/run.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::c {

template <class X>
class RunOf final : public AnyRun {
public:
    RunOf(std::shared_ptr<const CallbackSystem> system, const X& x0, const RunOptions& options)
        : callbacks_(system, x0, options.finders), like_(x0)
    {
        if (system->inclusion()) {
            phased_ = make_phased(system, setup_of(x0.size(), options), x0, options);
            loop_ = &phased_->loop();
        } else {
            own_ = detail::make_loop(setup_of(x0.size(), options), x0, options.options);
            loop_ = own_.operator->();
        }
    }

    bool step() override { return finished(loop_->step()); }
    bool advance() override { return finished(loop_->advance()); }
    void run_to_end() override
    {
        loop_->show_all();
        loop_->run_to_end();
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

    [[nodiscard]] const std::string& reason() const noexcept override
    {
        return loop_->run().reason;
    }
    [[nodiscard]] std::string description() override { return describe(loop_->bring_up_to_date()); }
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
        return shown(loop_->run().events[i]);
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
    [[nodiscard]] const std::vector<MotionPhase>& phases() const noexcept override
    {
        return loop_->run().phases;
    }
    [[nodiscard]] const std::vector<double>& reaction() override
    {
        return reaction_ = loop_->reaction();
    }
    [[nodiscard]] const std::vector<std::vector<double>>& reactions() const noexcept override
    {
        return loop_->run().reactions;
    }
    [[nodiscard]] std::string save() override { return to_text(loop_->save()); }
    void restore(std::string_view text) override
    {
        loop_->restore(snapshot_from_text(text));
        if (loop_->ended()) loop_->bring_up_to_date();
    }
    void restart(double t, const double* x, Mode mode) override
    {
        X start = like_;
        std::copy_n(x, start.size(), start.begin());
        loop_->restart(t, start, mode);
    }
    void extend(double t_end) override { loop_->extend(t_end); }

private:
    /// Brings the run up to date when it has ended, so that the last samples are there.
    bool finished(bool goes_on)
    {
        if (loop_->ended()) loop_->bring_up_to_date();
        return goes_on;
    }

    [[nodiscard]] detail::RunBindings<X> setup_of(std::size_t size, const RunOptions& options) const
    {
        static const auto steppings = detail::NamedMethods::each([]<class Method>() {
            return std::array{detail::written_type<ErrorControlled<Method>>(),
                              detail::written_type<FixedStep<Method>>()};
        });
        detail::RunBindings<X> setup = callbacks_.setup();
        setup.cancels_by_itself = true;
        const MethodName method = method_of(options.method);
        setup.error_controlled = !options.fixed_step;
        setup.stepping = steppings[static_cast<std::size_t>(method)][options.fixed_step ? 1 : 0];
        setup.kernel = &detail::kernel_by_name<X>(method, size);
        return setup;
    }

    CallbackSetup<X> callbacks_;
    detail::Owner<detail::AnyLoop<X>> own_;  ///< null with set-valued motion
    detail::Owner<detail::PhasedRun<X>> phased_;
    detail::AnyLoop<X>* loop_ = nullptr;  ///< of either
    std::vector<double> reaction_;        ///< that was asked for last
    X like_;
};

/// A run with states of type X, from a start of `dimension` doubles.
template <class X>
[[nodiscard]] std::unique_ptr<AnyRun> make_run_with(std::shared_ptr<const CallbackSystem> system,
                                                    const double* x0, const RunOptions& options)
{
    X start(system->dimension());
    std::copy_n(x0, start.size(), start.begin());
    return std::make_unique<RunOf<X>>(std::move(system), start, options);
}

}  // namespace ricochet::c
