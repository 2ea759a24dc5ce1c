// Internal: the declarations of this header may change without notice.
//
// The step of a physics engine that moves a body by v(s) = v0 + s a, x(s) = x0 + s v(s).
#pragma once

#include <algorithm>

#include "ricochet/hosts/detail/run.hpp"
#include "ricochet/hosts/detail/step_ends.hpp"

namespace ricochet::hosts::detail {

/// Host with the state x = (position [m], velocity [m/s]) of the body's centre, 6 components. Rates
/// belong to the engine's map, x' = v(s) + s a, which the body follows.
///
/// An engine has a type `Body` for the whole state of the body, with these six components in `x`,
/// and the functions read(), write(body), advance(s) and gravity(i).
template <class Engine>
class BodyStep : public StepEnds {
public:
    /// @param length  [s] of a step
    BodyStep(const Engine& engine, double t, double length)
        : StepEnds(t, engine.read().x, length), engine_(engine)
    {
        go_on_from(t, x1_, true);
    }

    void step(double t_stop)
    {
        begin_step();
        start_ = engine_.read();
        std::ranges::copy(start_.x, x0_.begin());
        t1_ = std::min(t_stop, t0_ + scale_);
        engine_.advance(h());
        end_ = engine_.read();
        std::ranges::copy(end_.x, x1_.begin());
        for (std::size_t i = 0; i < 3; ++i) {
            const double a = (x1_[3 + i] - x0_[3 + i]) / h();
            rate0_[i] = x0_[3 + i];
            rate1_[i] = x1_[3 + i] + h() * a;
            rate0_[3 + i] = rate1_[3 + i] = a;
        }
    }

    void interpolate(double s, std::span<double> x) const
    {
        for (std::size_t i = 0; i < 3; ++i) {
            x[3 + i] = x0_[3 + i] + s * rate0_[3 + i];
            x[i] = x0_[i] + s * x[3 + i];
        }
    }
    void restep(double s, std::span<double> x) const
    {
        engine_.write(start_);
        if (s > 0) engine_.advance(s);
        std::ranges::copy(engine_.read().x, x.begin());
        engine_.write(end_);
    }
    void interpolate_rate(double s, std::span<double> dxdt) const
    {
        for (std::size_t i = 0; i < 3; ++i) {
            dxdt[i] = x0_[3 + i] + 2 * s * rate0_[3 + i];
            dxdt[3 + i] = rate0_[3 + i];
        }
    }

    /// Moves the rest of the body's state to t, and sets x. The rate is that of free fall.
    void go_on_from(double t, std::span<const double> x, bool /*changed*/)
    {
        if (t < t1_) {
            engine_.write(start_);
            if (t > t0_) engine_.advance(t - t0_);
            end_ = engine_.read();
        }
        std::ranges::copy(x, end_.x.begin());
        engine_.write(end_);
        start_ = end_ = engine_.read();
        go_to(t, end_.x);
        for (std::size_t i = 0; i < 3; ++i) {
            rate1_[i] = x1_[3 + i];
            rate1_[3 + i] = engine_.gravity(i);
        }
    }

private:
    Engine engine_;
    typename Engine::Body start_ = engine_.read(), end_ = start_;
};

}  // namespace ricochet::hosts::detail
