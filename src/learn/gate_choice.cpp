// What a trainer of gates chooses by itself.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/require.hpp"
#include "ricochet/learn/assessment.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/detail/gate_walks.hpp"
#include "ricochet/learn/detail/rivals.hpp"

namespace ricochet::learn {

namespace {

constexpr ricochet::detail::Refuse refuse_aim{"train_gate"};

double median(std::vector<double> values)
{
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// The widths of three layers, the widest whose network costs no more than the guard.
std::vector<std::size_t> widths_for(double guard_seconds)
{
    // Multiplications of three layers and about ten outputs, and the time of one in single
    // precision with AVX2: 64-64-64 took 0.9 us. A guess suffices, since the widths are far apart.
    constexpr double multiplication = 1e-10;  // [s]
    for (const std::size_t width : {64U, 32U}) {
        const auto w = static_cast<double>(width);
        if ((2 * w * w + 14 * w) * multiplication <= guard_seconds) return {width, width, width};
    }
    return {16, 16, 16};
}

std::size_t per_miss_rate(double factor, double rate)
{
    return static_cast<std::size_t>(std::ceil(factor / rate));
}

void check(const GateAim& aim)
{
    if (!(aim.miss_rate > 0 && aim.miss_rate <= 0.1)) {
        refuse_aim(fmt::format("miss_rate must lie in (0, 0.1], got {}", aim.miss_rate));
    }
    if (!(aim.guard_seconds >= 0 && std::isfinite(aim.guard_seconds))) {
        refuse_aim(
            fmt::format("guard_seconds must be zero or positive, got {}", aim.guard_seconds));
    }
}

}  // namespace

double GateSurvey::interval() const
{
    return median(intervals);
}

double GateSurvey::dwell() const
{
    return median(dwells);
}

double GateCalibration::miss_bound() const
{
    return learn::miss_bound(misses, events);
}

void GateReport::add(const GateSurvey& survey, const GateAim& aim)
{
    guard_calls += survey.guard_calls;
    guard_seconds = survey.guard_seconds;
    price = aim.guard_seconds;
}

TrainedGate interrupted_gate()
{
    TrainedGate nothing;
    nothing.report.outcome = TrainingOutcome::stopped;
    return nothing;
}

GateTraining choose(const GateAim& aim, const GateSurvey& survey)
{
    check(aim);
    if (survey.intervals.empty()) {
        refuse_aim("the first runs hold no event; start elsewhere, or make the runs longer");
    }
    GateTraining training;
    training.recipe = aim.recipe;
    training.step_min = training.step_max = aim.step;
    training.run_length = aim.run_length;
    const double interval = survey.interval();
    for (double steps = 2; training.levels.size() < 2 || steps <= interval; steps *= 2) {
        if (training.levels.size() == 16) break;
        training.levels.push_back(steps * survey.step);
    }
    training.hidden = widths_for(aim.guard_seconds > 0 ? aim.guard_seconds : survey.guard_seconds);
    training.logarithmic = true;
    training.events = std::max<std::size_t>(1000, per_miss_rate(4, aim.miss_rate));
    training.validation_events = training.events / 4;
    training.states = 30 * training.events;
    training.miss_rate = aim.miss_rate;
    training.fresh_events = per_miss_rate(5, aim.miss_rate);
    training.batch = 1024;
    // Every state is drawn about ten times.
    training.iterations = std::max<std::size_t>(500, 10 * training.states / training.batch);
    training.evaluate_every = training.iterations / 8;
    training.patience = training.iterations;
    training.rate = 2e-3;
    training.final_rate = 1e-5;
    training.rounds = 3;
    training.seed = aim.seed;
    training.checkpoint = aim.checkpoint;
    training.resume = aim.resume;
    training.cancelled = aim.cancelled;
    return training;
}

std::string describe(const GateSurvey& survey, const GateTraining& chosen)
{
    std::string widths;
    for (const std::size_t width : chosen.hidden) {
        widths += (widths.empty() ? "" : "-") + std::to_string(width);
    }
    return fmt::format(
        "an event every {:.3g} steps and {:.2g} steps beyond its surface (medians), a call of the "
        "guard takes {:.2g} us: {} horizons up to {:.0f} steps, a network {}, {} events to train "
        "and {} to calibrate",
        survey.interval(), survey.dwell(), 1e6 * survey.guard_seconds, chosen.levels.size(),
        chosen.levels.back() / survey.step, widths, chosen.events + chosen.validation_events,
        detail::calibration_events(chosen));
}

namespace detail {

std::vector<double> calibration_shifts()
{
    std::vector<double> shifts;
    for (int i = -8; i <= 48; ++i) shifts.push_back(0.125 * i);
    return shifts;
}

std::size_t calibration_events(const GateTraining& training)
{
    if (training.calibration_events > 0) return training.calibration_events;
    if (!(training.miss_rate > 0)) return 0;
    std::size_t events = per_miss_rate(3, training.miss_rate);
    while (miss_bound(3, events) > training.miss_rate) events += 1 + events / 100;
    return events;
}

GateCalibration lower_thresholds(Model& model, const GateWalks& walks, double rate)
{
    const GateWalk* best = &walks.walks().back();
    for (const GateWalk& walk : walks.walks()) {
        if (miss_bound(walk.misses, walks.events()) <= rate && walk.checks < best->checks) {
            best = &walk;
        }
    }
    for (GateLevel& level : model.levels) level.threshold -= best->shift;
    model.threshold = model.levels.front().threshold;
    return {
        .events = walks.events(),
        .misses = best->misses,
        .checks_per_event = static_cast<double>(best->checks) / static_cast<double>(walks.events()),
        .shift = best->shift};
}

GateTraining surveying(const GateAim& aim)
{
    check(aim);
    GateTraining training;
    training.recipe = aim.recipe;
    training.step_min = training.step_max = aim.step;
    training.run_length = aim.run_length;
    training.events = 400;
    // Time after an event for which its dwell is followed.
    training.levels = {aim.step > 0 ? 256 * aim.step : aim.run_length / 16};
    return training;
}

}  // namespace detail

}  // namespace ricochet::learn
