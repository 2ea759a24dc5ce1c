// Savings and misses of trained gates. Guard calls are counted, not waited for: a guard of 50 us
// costs its calls times 50 us, compared with which the steps (0.1 us) and the networks (0.2 us a
// call) are negligible; the time of the gates is printed.
#include "measure_gates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "problems/least_eigenvalue.hpp"
#include "problems/opaque.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/learn/train.hpp"

namespace ricochet::bench {

namespace {

using learn::GateTraining;
using learn::GateTrial;
using learn::Random;
using learn::RunStart;

constexpr double step = 1e-3;  // [s]

double per_step(const GateTrial& t)
{
    return static_cast<double>(t.gated_calls) / static_cast<double>(t.steps);
}

std::string row(const std::string& what, const GateTrial& t)
{
    return fmt::format(
        "{:<22} {:>6} events, {:>3} missed (<= {:.1e}), {:.4f} calls/step, {:5.2f}x, {:.3f} asked "
        "of the gate, {:.3f} steps repeated",
        what, t.events, t.misses, t.miss_bound(), per_step(t), t.gain(),
        static_cast<double>(t.network_calls) / static_cast<double>(t.steps),
        static_cast<double>(t.repeated) / static_cast<double>(t.steps));
}

/// Runs of 100 s of the arm from rest, at any phase of its drives.
template <std::size_t N>
learn::Starts<typename PlanarArm<N>::State> arm_starts(const PlanarArm<N>& arm)
{
    using X = typename PlanarArm<N>::State;
    const X start = arm.start();
    return [start](Random& random) { return RunStart<X>{.t = random.uniform(0, 1e4), .x = start}; };
}

GateTraining arm_training(std::size_t events)
{
    GateTraining training;
    training.recipe = gate_recipe("chain");
    training.levels = learn::horizons(step, {2, 4, 8, 16, 32, 64});
    training.step_min = training.step_max = step;
    training.run_length = 100;
    training.hidden = {64, 64};
    training.events = 20'000;
    training.validation_events = 10'000;
    training.iterations = 6000;
    training.fresh_events = events;
    // Contacts of four to seven steps, two of 30 000, are practically invisible from a distance:
    // margins of 0.25 and of 3 clear steps before them.
    training.logit_margin = 10;
    return training;
}

/// The fewest checks of `EveryK` that miss no more than `misses` of the same number of events.
struct Rival {
    GateTrial trial;
    std::size_t steps = 0;
};

/// A gate and its rivals on one arm, seen through `Wrapped`.
template <class Wrapped, std::size_t N>
Measured compare_on_arm(std::size_t obstacles, std::size_t events, std::vector<std::size_t> every,
                        bool slopes)
{
    using X = typename PlanarArm<N>::State;
    const PlanarArm<N> arm({.obstacles = obstacles});
    const Wrapped system(arm, 0);
    const GateTraining training = arm_training(events);
    learn::GateRuns<Wrapped, X, FixedStep<Rk4>> runs(system, arm_starts<N>(arm), {}, training);
    constexpr std::uint64_t seed = 99;

    Measured out;
    const learn::TrainedGate trained =
        learn::train_gate(system, arm_starts<N>(arm), FixedStep<Rk4>{}, {}, training);
    const GateTrial gate = runs.compare(Calibrated(gates::Gate(trained.model)), events, seed);
    out.details.push_back(row("gate", gate));
    out.details.push_back(row("gate, its calibration", trained.report.trial));
    Rival best;
    for (const std::size_t k : every) {
        const GateTrial trial = runs.compare(EveryK(k), events, seed);
        out.details.push_back(row(fmt::format("every {}", k), trial));
        if (trial.misses <= gate.misses && (best.steps == 0 || trial.gain() > best.trial.gain())) {
            best = {.trial = trial, .steps = k};
        }
    }
    double slope_gain = 0;
    if (slopes) {
        for (const double fraction : {0.1, 0.25, 0.5}) {
            const GateTrial trial = runs.compare(SlopeSkip(fraction, 64), events, seed);
            out.details.push_back(row(fmt::format("slope {}", fraction), trial));
            if (trial.misses <= gate.misses) slope_gain = std::max(slope_gain, trial.gain());
        }
    }
    out.details.push_back(fmt::format(
        "trained in {:.0f} s on runs with {} events, {} fatal states; {} - 64 - 64 - {}",
        trained.report.seconds, trained.report.events, trained.report.fatal_states,
        trained.model.offset.size(), trained.model.levels.size()));
    const double rival = std::max(best.trial.gain(), slope_gain);
    out.pass =
        gate.misses == 0 && gate.events >= events && gate.gain() >= 4 && gate.gain() >= 1.5 * rival;
    out.text = fmt::format(
        "{:.1f}x fewer calls than at every step, {} of {} events missed; every {} steps {:.1f}x at "
        "{} missed{}",
        gate.gain(), gate.misses, gate.events, best.steps, best.trial.gain(), best.trial.misses,
        slopes ? fmt::format("; slopes {:.1f}x", slope_gain) : std::string());
    return out;
}

/// The loads of the structure at time t: q = amplitude sin(w t + p) is its own rate a quarter
/// of a period before, over w.
class Loads {
public:
    explicit Loads(const LeastEigenvalue& system) : system_(&system)
    {
        const LeastEigenvalue::State q = system.start();
        LeastEigenvalue::State ahead{};
        LeastEigenvalue::State behind{};
        constexpr double delta = 1e-3;
        system.flow(delta, q, ahead);
        system.flow(-delta, q, behind);
        for (std::size_t k = 0; k < 4; ++k) {
            frequency_[k] = std::sqrt(std::fabs((ahead[k] - behind[k]) / (2 * delta) / q[k]));
        }
    }
    [[nodiscard]] LeastEigenvalue::State at(double t) const
    {
        LeastEigenvalue::State q{};
        for (std::size_t k = 0; k < 4; ++k) {
            LeastEigenvalue::State rate{};
            system_->flow(t - 0.5 * std::numbers::pi / frequency_[k], q, rate);
            q[k] = rate[k] / frequency_[k];
        }
        return q;
    }

private:
    const LeastEigenvalue* system_;
    std::array<double, 4> frequency_{};
};

}  // namespace

Measured gate_black_box_4(std::size_t events)
{
    return compare_on_arm<BlackBox<PlanarArm<4>>, 4>(8, events, {2, 3, 4, 5, 6, 8, 16}, false);
}

Measured gate_black_box_6(std::size_t events)
{
    return compare_on_arm<BlackBox<PlanarArm<6>>, 6>(40, events, {2, 3, 4, 6, 8}, false);
}

Measured gate_without_bounds(std::size_t events)
{
    return compare_on_arm<Hidden<PlanarArm<4>>, 4>(8, events, {2, 4, 8}, true);
}

Measured gate_eigenvalue(double level, double seconds)
{
    using X = LeastEigenvalue::State;
    const LeastEigenvalue system({.level = level});
    const Loads loads(system);
    GateTraining training;
    training.kind = learn::GateKind::level;
    training.recipe = gate_recipe("state");
    training.levels = {0.01, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3};
    training.step_min = training.step_max = step;
    training.run_length = 5 * step;  // states from all over the motion
    training.hidden = {64, 64};
    training.states = 400'000;
    training.events = training.validation_events = training.hard_events = 1'000'000;  // all states
    training.fresh_events = 0;
    training.iterations = 12'000;
    training.patience = 20;
    training.rate = 5e-3;
    training.quantile = 0.9;
    training.logit_margin = 0.1;
    training.neighbours = 0;
    const learn::Starts<X> starts = [&](Random& random) {
        const double t = random.uniform(0, 1e4);
        return RunStart<X>{.t = t, .x = loads.at(t)};
    };
    const learn::TrainedGate trained =
        learn::train_gate(system, starts, FixedStep<Rk4>{}, {}, training);
    training.run_length = 10;
    training.most_steps = static_cast<std::size_t>(seconds / step);
    learn::GateRuns<LeastEigenvalue, X, FixedStep<Rk4>> runs(system, starts, {}, training);
    constexpr std::uint64_t seed = 99;
    constexpr std::size_t all = 1'000'000;
    const PlannerOptions planning{.check_bounds = false};
    const GateTrial plan = runs.compare(Planned(planning), all, seed);
    const GateTrial gate =
        runs.compare(CalibratedBounds(gates::Gate(trained.model), planning), all, seed);
    Measured out;
    out.details = {row("two-ended cover", plan), row("with the level gate", gate)};
    for (const GateLevel& l : trained.model.levels) {
        out.details.push_back(fmt::format("guard above {:.3f} where the logit is below {:.4f}",
                                          l.value, l.threshold));
    }
    const double gain =
        static_cast<double>(plan.gated_calls) / static_cast<double>(gate.gated_calls);
    out.pass = gate.misses == 0 && gate.events > 0 && gain >= 1.5;
    out.text = fmt::format(
        "{:.2f}x fewer calls than the two-ended cover, {} of {} events missed "
        "(calibrated, not proved)",
        gain, gate.misses, gate.events);
    return out;
}

}  // namespace ricochet::bench
