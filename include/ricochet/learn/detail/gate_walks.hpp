// Internal: the declarations of this header may change without notice.
//
// A gate along runs that are checked at every step: what it would have cost, and missed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "ricochet/learn/classifier.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn::detail {

/// Checks and misses of a gate whose thresholds are lowered by `shift`.
struct GateWalk {
    double shift = 0;
    std::uint64_t checks = 0;  ///< of the guard, without those inside the step of an event
    std::uint64_t misses = 0;  ///< events after which the guard has returned before the next check
};

/// Follows exact runs as a horizon gate would, with several thresholds at once: which states it is
/// asked at, and which events the guard's next check would have come too late for. As `Calibrated`,
/// it is asked where the last horizon that it cleared ends, and outside of its domain at every
/// step.
class GateWalks {
public:
    /// @throws std::invalid_argument as `Classifier`.
    GateWalks(Model model, const std::vector<double>& shifts);

    /// Begins another run.
    void restart();

    /// A state at which a step begins. Returns whether the first of the walks asks the gate there.
    bool visit(double t, const double* features);

    /// An event at time `event` [s], after which the guard, without its reset, is first seen on its
    /// side again at `back` [s].
    void meet(double event, double back);

    [[nodiscard]] const std::vector<GateWalk>& walks() const noexcept { return walks_; }
    [[nodiscard]] std::uint64_t events() const noexcept { return events_; }

private:
    [[nodiscard]] double cleared(double shift) const noexcept;

    Classifier classifier_;
    std::vector<GateWalk> walks_;
    std::vector<double> asked_;  ///< [s] when each walk last asked
    std::vector<double> next_;   ///< [s] when each walk checks next
    std::vector<double> logits_;
    double earliest_ = 0;  ///< of `next_`
    std::uint64_t events_ = 0;
};

/// Shifts of all thresholds among which a calibration chooses, ascending.
[[nodiscard]] std::vector<double> calibration_shifts();

/// Events of the calibration: those that were asked for, or else as many as bound the rate of
/// misses by `miss_rate` with 95 % confidence if three are missed.
[[nodiscard]] std::size_t calibration_events(const GateTraining& training);

/// Lowers the thresholds of the model by the shift with the fewest checks among those whose misses
/// are bounded by `rate`; by the largest if there is none.
[[nodiscard]] GateCalibration lower_thresholds(Model& model, const GateWalks& walks, double rate);

/// Options of the runs of a survey.
/// @throws std::invalid_argument if the aim is outside its range.
[[nodiscard]] GateTraining surveying(const GateAim& aim);

}  // namespace ricochet::learn::detail
