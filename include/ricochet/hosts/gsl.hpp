// The one-step methods of GSL (gsl_odeiv2) as a host: events are located on the method itself, by
// a second stepper that starts where the step did.
//
//     gsl_odeiv2_driver* driver = gsl_odeiv2_driver_alloc_y_new(&flow, gsl_odeiv2_step_rk8pd, ...);
//     hosts::Gsl host(*driver, t, x);
//
// GSL is under the GPL, and so is a program that includes this header.
#pragma once

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>

#include "ricochet/hosts/detail/run.hpp"
#include "ricochet/hosts/detail/step_ends.hpp"

namespace ricochet::hosts {

/// A host for a driver of GSL, which it does not own.
class Gsl : public detail::StepEnds {
public:
    /// @throws std::invalid_argument for a multistep method, which cannot take its step again
    Gsl(gsl_odeiv2_driver& driver, double t, std::span<const double> x)
        : StepEnds(t, x, driver.h),
          driver_(driver),
          again_(gsl_odeiv2_step_alloc(driver.s->type, x.size()), gsl_odeiv2_step_free)
    {
        const std::string name = gsl_odeiv2_step_name(driver.s);
        if (name.starts_with("ms")) {
            throw std::invalid_argument("GSL: found " + name + "; expected a one-step method");
        }
        require(gsl_odeiv2_step_set_driver(again_.get(), &driver));
        go_on_from(t, x1_, true);
    }

    void step(double t_stop)
    {
        begin_step();
        // The bounds of the driver, which `gsl_odeiv2_driver_apply` keeps.
        driver_.h = std::min(driver_.h, driver_.hmax);
        if (driver_.h < driver_.hmin) require(GSL_ENOPROG);
        require(gsl_odeiv2_evolve_apply(driver_.e, driver_.c, driver_.s, driver_.sys, &t1_, t_stop,
                                        &driver_.h, x1_.data()));
        flow(t1_, x1_, rate1_);
        scale_ = driver_.h;
    }

    void interpolate(double s, std::span<double> x) const { restep(s, x); }
    void interpolate_rate(double s, std::span<double> dxdt) const
    {
        restep(s, at_);
        flow(t0_ + s, at_, dxdt);
    }
    void restep(double s, std::span<double> x) const
    {
        std::copy(x0_.begin(), x0_.end(), x.begin());
        require(gsl_odeiv2_step_reset(again_.get()));
        const double* rate = again_->type->can_use_dydt_in ? rate0_.data() : nullptr;
        require(gsl_odeiv2_step_apply(again_.get(), t0_, s, x.data(), error_.data(), rate, nullptr,
                                      driver_.sys));
    }

    void go_on_from(double t, std::span<const double> x, bool /*changed*/)
    {
        go_to(t, x);
        require(gsl_odeiv2_driver_reset(&driver_));
        flow(t1_, x1_, rate1_);
    }

private:
    void flow(double t, std::span<const double> x, std::span<double> dxdt) const
    {
        require(GSL_ODEIV_FN_EVAL(driver_.sys, t, x.data(), dxdt.data()));
    }
    /// @throws std::runtime_error if GSL reports an error
    static void require(int flag)
    {
        if (flag != GSL_SUCCESS)
            throw std::runtime_error(std::string("GSL: ") + gsl_strerror(flag));
    }

    gsl_odeiv2_driver& driver_;
    std::shared_ptr<gsl_odeiv2_step> again_;
    mutable std::vector<double> error_ = x1_, at_ = x1_;
};

}  // namespace ricochet::hosts
