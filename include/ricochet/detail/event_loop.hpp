// Internal: the declarations of this header may change without notice.
//
// Flights of a contact motion: a simulation, whatever its system and stepper.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "ricochet/integrate/simulation.hpp"

namespace ricochet::detail {

/// Whether events follow each other so closely that locating them does not pay: 200 of them
/// within `span` [s].
class ChatterWatch {
public:
    ChatterWatch(double t, double span) noexcept : marked_(t), span_(span) {}

    /// Called at time t, after `events` events of the phase.
    [[nodiscard]] bool operator()(double t, std::uint64_t events) noexcept
    {
        if (events < mark_ + most_events) return false;
        const bool chatters = t - marked_ < span_;
        mark_ = events;
        marked_ = t;
        return chatters;
    }

private:
    static constexpr std::uint64_t most_events = 200;
    double marked_;
    double span_;
    std::uint64_t mark_ = 0;
};

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

}  // namespace ricochet::detail
