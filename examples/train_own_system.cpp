// A gate for a system of your own, trained in seconds and used immediately.
//
// A drone flies among columns. Whether it hits one is known only to a slow black box that answers
// yes or no. The gate learns from runs for how long no hit will occur, and the run calls the black
// box only at the end of that time. Skipped checks are not proved to be clear: the miss rate was
// measured, on runs that the gate was not trained on.

#include <array>
#include <cmath>
#include <cstdio>

#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn/train.hpp"

struct Drone {
    // x = (position [m], velocity [m/s]), two components each
    using State = std::array<double, 4>;
    static constexpr const char* name = "drone";

    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = std::cos(0.5 * t) - 0.3 * x[0] - 0.2 * x[2];
        dxdt[3] = std::sin(0.8 * t) - 0.3 * x[1] - 0.2 * x[3];
    }

    // Columns of 0.2 m radius at (1, 1), (1, -1), (-1, 1), (-1, -1).
    template <class X>
    bool guard(double, const X& x) const
    {
        return std::hypot(std::fabs(x[0]) - 1, std::fabs(x[1]) - 1) > 0.2;
    }

    // Bounces off, and is placed a millimetre outside of the column.
    template <class X>
    void reset(double, X& x) const
    {
        const double cx = std::copysign(1.0, x[0]);
        const double cy = std::copysign(1.0, x[1]);
        const double r = std::hypot(x[0] - cx, x[1] - cy);
        const double nx = (x[0] - cx) / r;
        const double ny = (x[1] - cy) / r;
        const double speed = std::fmin(nx * x[2] + ny * x[3], 0.0);
        x[2] -= 1.8 * speed * nx;
        x[3] -= 1.8 * speed * ny;
        x[0] = cx + 0.201 * nx;
        x[1] = cy + 0.201 * ny;
    }
};

int main()
{
    using namespace ricochet;
    constexpr double step = 0.005;  // [s]
    const Drone drone;

    learn::GateTraining training;
    training.recipe = gate_recipe("state");
    training.levels = learn::horizons(step, {2, 4, 8, 16, 32});
    training.step_min = training.step_max = step;
    training.run_length = 50;
    training.events = 2000;
    training.fresh_events = 3000;
    training.iterations = 2000;
    const auto starts =
        learn::from_box(Drone::State{-0.5, -0.5, -1, -1}, Drone::State{0.5, 0.5, 1, 1}, 0, 100);
    const learn::TrainedGate trained =
        learn::train_gate(drone, starts, FixedStep<Rk4>{}, {}, training);
    const learn::GateTrial& trial = trained.report.trial;
    std::printf("trained in %.1f s; of %llu fresh events %llu were missed, at most %.1e of them\n",
                trained.report.seconds, static_cast<unsigned long long>(trial.events),
                static_cast<unsigned long long>(trial.misses), trial.miss_bound());

    const Drone::State start{0, 0, 0.5, 0.2};
    const Options options{.t_end = 200, .step = step};
    const auto exact = integrate(drone, start, options, FixedStep<Rk4>{});
    const auto gated =
        integrate(drone, start, options, FixedStep<Rk4>{}, Calibrated(gates::Gate(trained.model)));
    std::printf("200 s of flight: %zu and %zu collisions, %llu and %llu calls of the black box\n",
                exact.events.size(), gated.events.size(),
                static_cast<unsigned long long>(exact.statistics.guard_calls),
                static_cast<unsigned long long>(gated.statistics.guard_calls));
    return 0;
}
