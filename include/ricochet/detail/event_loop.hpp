// Internal: the declarations of this header may change without notice.
//
// The event-driven phases of a hand-over: a simulation of the branches, whatever its stepper.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "ricochet/detail/branch_modes.hpp"
#include "ricochet/detail/hand_over_run.hpp"
#include "ricochet/integrate/simulation.hpp"

namespace ricochet::detail {

/// Options of the event-driven phase that begins at t, after `samples` samples and `steps` steps.
[[nodiscard]] Options event_options(const HandOverOptions& options, double t, std::size_t samples,
                                    std::uint64_t steps);

/// Cause of the set-valued phase after an event-driven one with this outcome; nothing if
/// the run is over.
[[nodiscard]] std::optional<PhaseCause> cause_after(Outcome outcome) noexcept;

/// The options with defaults filled in.
/// @throws std::invalid_argument naming the option.
[[nodiscard]] HandOverOptions completed(HandOverOptions options, bool locate);

void add(Statistics& sum, const Statistics& more) noexcept;
void add(SetValuedStatistics& sum, const SetValuedStatistics& more) noexcept;

/// A simulation with N components, for systems and steppers of any type.
template <int N>
class EventLoop {
public:
    using X = std::array<double, static_cast<std::size_t>(N)>;

    virtual ~EventLoop() = default;
    virtual bool step() = 0;
    [[nodiscard]] virtual Run<X> finish() = 0;

    // Values after the last step.
    [[nodiscard]] double t() const noexcept { return t_; }
    [[nodiscard]] const X& x() const noexcept { return *x_; }
    [[nodiscard]] Mode mode() const noexcept { return mode_; }
    [[nodiscard]] const Run<X>& run() const noexcept { return *run_; }

protected:
    double t_ = 0;
    const X* x_ = nullptr;
    Mode mode_ = 0;
    const Run<X>* run_ = nullptr;
};

template <int N, class System, class Stepping>
class EventLoopBy final : public EventLoop<N> {
public:
    using X = typename EventLoop<N>::X;

    EventLoopBy(const System& system, const X& x, const Options& options)
        : simulation_(system, x, options)
    {
        refresh();
    }
    bool step() override
    {
        const bool going = simulation_.step();
        refresh();
        return going;
    }
    [[nodiscard]] Run<X> finish() override { return simulation_.finish(); }

private:
    void refresh()
    {
        this->t_ = simulation_.t();
        this->run_ = &simulation_.run();
        this->x_ = &simulation_.x();
        this->mode_ = simulation_.mode();
    }

    Simulation<System, X, Stepping> simulation_;
};

/// Factory of loops with one stepper.
template <int N, int M>
struct EventStepping {
    std::unique_ptr<EventLoop<N>> (*make)(const AnyModes<N, M>& modes,
                                          const std::array<double, static_cast<std::size_t>(N)>& x,
                                          const Options& options) = nullptr;
    bool error_controlled = true;
};

template <int N, int M, class Stepping>
std::unique_ptr<EventLoop<N>> make_event_loop(
    const AnyModes<N, M>& modes, const std::array<double, static_cast<std::size_t>(N)>& x,
    const Options& options)
{
    return std::make_unique<EventLoopBy<N, AnyModes<N, M>, Stepping>>(modes, x, options);
}

// Defined where solvers are compiled (nonsmooth/solvers.hpp).

/// The same with Dormand and Prince's method; null where there are no modes.
template <int N, int M>
[[nodiscard]] std::unique_ptr<EventLoop<N>> make_dopri5_loop(
    const AnyModes<N, M>& modes, const std::array<double, static_cast<std::size_t>(N)>& x,
    const Options& options);

// The loop of a hand-over (any_hand_over.hpp), and what makes and runs it.

template <int N, int M>
class RICOCHET_ALIGNED AnyHandOver;

template <int N, int M>
[[nodiscard]] std::shared_ptr<AnyHandOver<N, M>> make_hand_over(
    const AnyInclusion<N, M>& inclusion, const Eigen::Matrix<double, N, 1>& w0,
    const HandOverOptions& options, const EventStepping<N, M>& stepping);

template <int N, int M>
[[nodiscard]] std::shared_ptr<AnyHandOver<N, M>> make_hand_over(
    const AnyInclusion<N, M>& inclusion, const StateWithReaction<N, M>& start,
    const HandOverOptions& options, const EventStepping<N, M>& stepping);

template <int N, int M>
[[nodiscard]] AnyHandOverRun<N, M> take_run(AnyHandOver<N, M>& hand_over);

}  // namespace ricochet::detail
