// A run of callbacks behind one interface for all types of state.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bindings/c/callback_system.hpp"
#include "bindings/c/options.hpp"
#include "bindings/c/results.hpp"
#include "ricochet/run.hpp"

namespace ricochet::c {

/// A run like `Simulation`, for states of a size known at run time. If one of its functions throws,
/// the run is at the end of its last complete step.
class AnyRun {
public:
    AnyRun() = default;
    AnyRun(const AnyRun&) = delete;
    AnyRun& operator=(const AnyRun&) = delete;
    virtual ~AnyRun() = default;

    virtual bool step() = 0;
    virtual bool advance() = 0;
    virtual void run_to_end() = 0;
    /// Lets a run that was cancelled continue; true if it was.
    virtual bool continue_cancelled() noexcept = 0;

    [[nodiscard]] virtual double t() const noexcept = 0;
    [[nodiscard]] virtual const double* x() const noexcept = 0;
    [[nodiscard]] virtual Mode mode() const noexcept = 0;
    [[nodiscard]] virtual bool ended() const noexcept = 0;
    [[nodiscard]] virtual Outcome outcome() const noexcept = 0;

    [[nodiscard]] virtual const std::string& reason() const noexcept = 0;
    [[nodiscard]] virtual std::string description() = 0;
    [[nodiscard]] virtual Counts counts() = 0;
    [[nodiscard]] virtual std::size_t events() const noexcept = 0;
    [[nodiscard]] virtual ShownEvent event(std::size_t i) const noexcept = 0;
    [[nodiscard]] virtual const std::vector<double>& sample_times() const noexcept = 0;
    [[nodiscard]] virtual const double* sample(std::size_t i) const noexcept = 0;
    [[nodiscard]] virtual bool keeps_steps() const noexcept = 0;
    virtual void solution(double t, bool before, double* x) const = 0;
    [[nodiscard]] virtual Mode solution_mode(double t) const = 0;
    [[nodiscard]] virtual const std::vector<MotionPhase>& phases() const noexcept = 0;
    /// At the present time, until it is asked again.
    [[nodiscard]] virtual const std::vector<double>& reaction() = 0;
    /// One for each sample; none without set-valued motion.
    [[nodiscard]] virtual const std::vector<std::vector<double>>& reactions() const noexcept = 0;
    [[nodiscard]] virtual std::string save() = 0;
    virtual void restore(std::string_view text) = 0;
    virtual void restart(double t, const double* x, Mode mode) = 0;
    virtual void extend(double t_end) = 0;
};

/// A run from x0, whose size is the dimension of the system.
/// @throws std::invalid_argument as `Simulation`; CallbackFailed
[[nodiscard]] std::unique_ptr<AnyRun> make_run(std::shared_ptr<const CallbackSystem> system,
                                               const double* x0, const RunOptions& options);

// One function for each type of state: up to four doubles, and any number.
[[nodiscard]] std::unique_ptr<AnyRun> make_run_of_small(std::shared_ptr<const CallbackSystem>,
                                                        const double*, const RunOptions&);
[[nodiscard]] std::unique_ptr<AnyRun> make_run_of_any(std::shared_ptr<const CallbackSystem>,
                                                      const double*, const RunOptions&);

}  // namespace ricochet::c
