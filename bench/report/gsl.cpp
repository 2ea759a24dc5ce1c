// GSL's odeiv2 with the pair of Dormand and Prince of order 8 (rk8pd). GSL locates no events: after
// each step the signs are checked, and a crossing is bisected on the step's own map, from the state
// before it, as its users do.
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gsl/gsl_version.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "cells.hpp"
#include "seen.hpp"

namespace ricochet::report {

namespace {

template <class S>
int flow_of(double t, const double x[], double dxdt[], void* user)
{
    static_cast<Seen<S>*>(user)->flow(t, const_cast<double*>(x), dxdt);
    return GSL_SUCCESS;
}

template <class T, void (*release)(T*)>
struct Release {
    void operator()(T* pointer) const { release(pointer); }
};
using Step = std::unique_ptr<gsl_odeiv2_step, Release<gsl_odeiv2_step, gsl_odeiv2_step_free>>;
using Control =
    std::unique_ptr<gsl_odeiv2_control, Release<gsl_odeiv2_control, gsl_odeiv2_control_free>>;
using Evolve =
    std::unique_ptr<gsl_odeiv2_evolve, Release<gsl_odeiv2_evolve, gsl_odeiv2_evolve_free>>;

template <class S>
class Solver {
public:
    Solver(Task<S> task, double tolerance)
        : task_(std::move(task)),
          system_(task_.system),
          n_(task_.x0.size()),
          step_(gsl_odeiv2_step_alloc(gsl_odeiv2_step_rk8pd, n_)),
          probe_(gsl_odeiv2_step_alloc(gsl_odeiv2_step_rk8pd, n_)),
          control_(gsl_odeiv2_control_y_new(tolerance, tolerance)),
          evolve_(gsl_odeiv2_evolve_alloc(n_)),
          before_(system_.guards()),
          after_(system_.guards()),
          start_(n_),
          at_(n_),
          error_(n_)
    {
    }

    bool run(Answer& answer, std::size_t offset)
    {
        gsl_odeiv2_system callbacks{flow_of<S>, nullptr, n_, &system_};
        system_.mode = 0;
        system_.flow_calls = system_.guard_calls = 0;
        std::vector<double> x(task_.x0.begin(), task_.x0.end());
        double t = 0;
        double h = task_.first_step;
        restart(t, x);
        while (t < task_.t_end) {
            start_ = x;
            const double t0 = t;
            if (gsl_odeiv2_evolve_apply(evolve_.get(), control_.get(), step_.get(), &callbacks, &t,
                                        task_.t_end, &h, x.data()) != GSL_SUCCESS) {
                answer.note = "gsl_odeiv2_evolve_apply failed";
                return false;
            }
            ++*answer.steps;
            look(t, x, after_);
            find(callbacks, t0, t - t0);
            if (hits_.empty()) {
                before_.swap(after_);
                continue;
            }
            if constexpr (Seen<S>::acts) {
                const auto [s, which] = hits_.front();
                state_at(callbacks, t0, s, x);
                t = t0 + s;
                answer.add(t, which + offset);
                double* memory = x.data();
                system_.reset(which, t, memory);
                restart(t, x);
                before_[which] = std::max(before_[which], 1e-300);
            } else {
                for (const auto& [s, which] : hits_) answer.add(t0 + s, which + offset);
                before_.swap(after_);
            }
        }
        note_energy(task_, x, answer);
        *answer.flow_calls += system_.flow_calls;
        *answer.guard_calls += system_.guard_calls;
        return true;
    }

private:
    void look(double t, const std::vector<double>& x, std::vector<double>& g)
    {
        const double* memory = x.data();
        for (std::size_t i = 0; i < g.size(); ++i) g[i] = system_.guard(i, t, memory);
    }
    void restart(double t, const std::vector<double>& x)
    {
        gsl_odeiv2_step_reset(step_.get());
        gsl_odeiv2_evolve_reset(evolve_.get());
        look(t, x, before_);
    }
    void state_at(const gsl_odeiv2_system& callbacks, double t0, double s, std::vector<double>& x)
    {
        x = start_;
        if (s > 0) {
            gsl_odeiv2_step_apply(probe_.get(), t0, s, x.data(), error_.data(), nullptr, nullptr,
                                  &callbacks);
        }
    }
    double value(const gsl_odeiv2_system& callbacks, std::size_t which, double t0, double s)
    {
        state_at(callbacks, t0, s, at_);
        const double* memory = at_.data();
        return system_.guard(which, t0 + s, memory);
    }

    /// Finds the crossings in the step, in order; only the first if the system has resets.
    void find(const gsl_odeiv2_system& callbacks, double t0, double length)
    {
        hits_.clear();
        double end = length;
        for (std::size_t i = 0; i < after_.size(); ++i) {
            if (!Seen<S>::crossed(before_[i], after_[i])) continue;
            if (Seen<S>::acts && end < length) {
                if (!Seen<S>::crossed(before_[i], value(callbacks, i, t0, end))) continue;
                hits_.clear();
            }
            double low = 0;
            double high = end;
            for (;;) {
                const double middle = low + (high - low) / 2;
                if (!(middle > low) || !(middle < high) || t0 + middle == t0 + high) break;
                const bool over = Seen<S>::crossed(before_[i], value(callbacks, i, t0, middle));
                (over ? high : low) = middle;
            }
            hits_.emplace_back(high, i);
            if (Seen<S>::acts) end = high;
        }
        std::sort(hits_.begin(), hits_.end());
    }

    Task<S> task_;
    Seen<S> system_;
    std::size_t n_;
    Step step_, probe_;
    Control control_;
    Evolve evolve_;
    std::vector<double> before_, after_, start_, at_, error_;
    std::vector<std::pair<double, std::size_t>> hits_;
};

}  // namespace

void add_gsl(Cells& cells)
{
    gsl_set_error_handler_off();
    cells.add_version("GSL", gsl_version);
    for_each_problem([&](const std::string& name, const std::string& /*title*/, const auto& make) {
        using S = decltype(make().front().system);
        for (const double tolerance : tolerances_of(name)) {
            cells.add({name, "GSL", "rk8pd, bisection", tolerance, [make, tolerance] {
                           std::vector<std::shared_ptr<Solver<S>>> solvers;
                           for (auto& task : make()) {
                               solvers.push_back(std::make_shared<Solver<S>>(task, tolerance));
                           }
                           return [solvers] {
                               Answer answer{
                                   .finished = true, .steps = 0, .flow_calls = 0, .guard_calls = 0};
                               for (std::size_t k = 0; k < solvers.size(); ++k) {
                                   answer.finished &= solvers[k]->run(answer, guards_of_a_run * k);
                               }
                               return answer;
                           };
                       }});
        }
    });
}

}  // namespace ricochet::report
