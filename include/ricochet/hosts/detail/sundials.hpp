// Internal: the declarations of this header may change without notice.
//
// The common part of the hosts for SUNDIALS: steps taken one by one, with dense output.
#pragma once

#include <sundials/sundials_nvector.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "ricochet/hosts/detail/run.hpp"
#include "ricochet/hosts/detail/step_ends.hpp"

namespace ricochet::hosts::detail {

static_assert(std::is_same_v<realtype, double>, "ricochet: SUNDIALS computes in another precision");

/// Host for an integrator of SUNDIALS. `Calls` has its functions set_stop(t), evolve(t_stop, t, x),
/// dky(t, k, x), reinit(t, x) and rate(t, x, dxdt), which return flags, and, if it varies, order(),
/// the order of the dense output in the last step.
template <class Calls>
class SundialsHost : public StepEnds {
public:
    /// Initialises the integrator again, at (t, x).
    /// @param scale  [s] length of the first step, roughly
    SundialsHost(Calls calls, double t, N_Vector x, double scale)
        : StepEnds(t, {N_VGetArrayPointer(x), static_cast<std::size_t>(N_VGetLength(x))}, scale),
          calls_(calls),
          x_(N_VCloneEmpty(x), N_VDestroy),
          dxdt_(N_VCloneEmpty(x), N_VDestroy)
    {
        go_on_from(t, x1_, true);
    }

    /// Takes a step or, after a cut that has changed nothing, shows the rest of the last one.
    void step(double t_stop)
    {
        begin_step();
        if (end_ > t0_) {
            t1_ = end_;
            require(calls_.dky(t1_, 0, view(x_, x1_)));
        } else if (t_stop - t0_ <= room_for_a_step(t_stop)) {
            for (std::size_t i = 0; i < x1_.size(); ++i) x1_[i] += (t_stop - t0_) * rate0_[i];
            start_anew(t_stop);
            cubic_ = true;
            return;
        } else {
            if (std::exchange(stop_, t_stop) != t_stop) require(calls_.set_stop(t_stop));
            do {  // a step may be too short to be seen in the time
                require(calls_.evolve(t_stop, t1_, view(x_, x1_)));
            } while (t1_ == t0_);
            end_ = t1_;
            scale_ = h();
            cubic_ = std::exchange(first_, false);
            if constexpr (requires { calls_.order(); }) cubic_ = cubic_ || calls_.order() <= 3;
        }
        require(calls_.dky(t1_, 1, view(x_, rate1_)));
    }

    /// The state at offset s by the dense output, or by the cubic through both ends where the dense
    /// output has no higher order and in the first step, so short that t0 + s loses last digits.
    void interpolate(double s, std::span<double> x) const
    {
        cubic_ ? cubic().interpolate(s, x) : output(s, 0, x);
    }
    void interpolate_rate(double s, std::span<double> dxdt) const
    {
        cubic_ ? cubic().interpolate_rate(s, dxdt) : output(s, 1, dxdt);
    }

    /// Continues from x at time t. The integrator is initialised again only if `changed`.
    /// @throws std::invalid_argument for another dimension
    void go_on_from(double t, std::span<const double> x, bool changed)
    {
        if (x.size() != x1_.size()) {
            throw std::invalid_argument(std::string(Calls::name) + ": cannot change the dimension");
        }
        go_to(t, x);
        if (!changed) return require(calls_.dky(t, 1, view(x_, rate1_)));
        start_anew(t);
    }

private:
    /// Initialises the integrator at t and the state at the end of the step.
    void start_anew(double t)
    {
        t1_ = end_ = t;
        first_ = true;
        stop_ = std::numeric_limits<double>::quiet_NaN();
        require(calls_.reinit(t, view(x_, x1_)));
        require(calls_.rate(t, view(x_, x1_), view(dxdt_, rate1_)));
    }
    /// [s] The integrators refuse a first step of two roundings of the time.
    [[nodiscard]] double room_for_a_step(double t_stop) const
    {
        return 4 * std::numeric_limits<double>::epsilon() *
               std::max(std::fabs(t0_), std::fabs(t_stop));
    }

    using View = std::shared_ptr<std::remove_pointer_t<N_Vector>>;

    [[nodiscard]] static N_Vector view(const View& vector, std::span<double> of)
    {
        N_VSetArrayPointer(of.data(), vector.get());
        return vector.get();
    }
    [[nodiscard]] HermiteStep cubic() const { return {{t0_, 0}, h(), x0_, x1_, rate0_, rate1_}; }
    void output(double s, int k, std::span<double> x) const
    {
        require(calls_.dky(t0_ + s < end_ ? t0_ + s : end_, k, view(x_, x)));
    }
    /// @throws std::runtime_error if `flag` is an error
    static void require(int flag)
    {
        if (flag >= 0) return;
        throw std::runtime_error(std::string(Calls::name) + ": returned " + std::to_string(flag));
    }

    Calls calls_;
    View x_, dxdt_;
    double stop_ = std::numeric_limits<double>::quiet_NaN();  ///< [s] stop time last set
    double end_ = 0;      ///< [s] end of the last step of the integrator
    bool first_ = true;   ///< the next step is the first since the method started
    bool cubic_ = false;  ///< the last step is shown as a cubic
};

}  // namespace ricochet::hosts::detail
