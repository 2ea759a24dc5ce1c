#include "ricochet/nonsmooth/detail/phased_run.hpp"

#include <algorithm>
#include <cmath>

#include "phased_system.hpp"
#include "ricochet/detail/lending_loop.hpp"

namespace ricochet::detail {

namespace {

template <class C>
class PhasedRunOf final : public PhasedRun<C> {
public:
    PhasedRunOf(PhasedSetup<C>&& setup, const C& x0, const Options& options)
        : setup_(setup.user),
          system_(std::move(setup), x0,
                  phase_options(options, setup_.error_controlled, setup.alone))
    {
        setup_.system = &system_.table();
        setup_.adapter = &system_;
        setup_.quiet = nullptr;
        setup_.quiet_on_series = false;
        const bool alone = system_.rules().options().alone.has_value();
        C x = x0;
        Options inner = options;
        inner.mode = system_.enter(options.mode, options.t_start, x);
        // A run of an inclusion alone is not continued after exceptions.
        loop_ = alone ? Owner<AnyLoop<C>>(make_lending_loop(setup_, x, inner).release())
                      : make_loop(setup_, x, inner);
    }

    [[nodiscard]] AnyLoop<C>& loop() noexcept override { return *loop_; }
    [[nodiscard]] EndInBranches end_in_branches() const override
    {
        return system_.rules().end_in_branches(loop_->t(), loop_->x().data());
    }

private:
    [[nodiscard]] static PhaseOptions phase_options(const Options& options, bool error_controlled,
                                                    const std::optional<AloneOptions>& alone)
    {
        PhaseOptions out{.t_start = options.t_start,
                         .t_end = options.t_end,
                         .rtol = options.rtol,
                         .atol = options.atol,
                         .alone = alone};
        if (alone) {
            out.step = alone->step;
            return out;
        }
        const HandOverOptions of = completed(options_of_phases(options), false);
        out.atol = of.atol;
        out.step = error_controlled ? of.set_valued.step : options.step;
        out.fixed = !error_controlled;
        return out;
    }

    RunBindings<C> setup_;
    PhasedSystem<C> system_;
    Owner<AnyLoop<C>> loop_;
};

template <class C>
void refuse_bad_start(const C& x0)
{
    for (std::size_t i = 0; i < static_cast<std::size_t>(x0.size()); ++i) {
        if (!std::isfinite(x0[i])) throw_start_not_finite("integrate", i, x0[i]);
    }
}

}  // namespace

HandOverOptions options_of_phases(const Options& options)
{
    Options supported = options;
    supported.stop_at_event = supported.record_steps = false;
    if (!options.component_atol.empty()) {
        supported.atol =
            *std::max_element(options.component_atol.begin(), options.component_atol.end());
        supported.component_atol.clear();
    }
    return hand_over_options(supported);
}

BranchPhasesOptions branch_options(const Options& options)
{
    return branch_options(completed(options_of_phases(options), false));
}

BranchPhasesOptions branch_options(const HandOverOptions& completed)
{
    return {.scheme = completed.set_valued.scheme,
            .step = completed.set_valued.step,
            .event_tolerance = completed.event_tolerance};
}

Options loop_options(const HandOverOptions& completed)
{
    Options out{.t_start = completed.t_start,
                .t_end = completed.t_end,
                .rtol = completed.rtol,
                .atol = completed.atol,
                .h_max = completed.h_max,
                .event_tolerance = completed.event_tolerance};
    out.sample_times = completed.sample_times;
    out.max_steps = completed.max_steps;
    out.stall_steps = completed.stall_steps;
    out.cancelled = completed.cancelled;
    return out;
}

template <>
Owner<PhasedRun<SmallState>> make_phased_run(PhasedSetup<SmallState>&& setup, const SmallState& x0,
                                             const Options& options)
{
    refuse_bad_start(x0);
    return Owner<PhasedRun<SmallState>>(new PhasedRunOf<SmallState>(std::move(setup), x0, options));
}

template <>
Owner<PhasedRun<std::vector<double>>> make_phased_run(PhasedSetup<std::vector<double>>&& setup,
                                                      const std::vector<double>& x0,
                                                      const Options& options)
{
    refuse_bad_start(x0);
    return Owner<PhasedRun<std::vector<double>>>(
        new PhasedRunOf<std::vector<double>>(std::move(setup), x0, options));
}

}  // namespace ricochet::detail
