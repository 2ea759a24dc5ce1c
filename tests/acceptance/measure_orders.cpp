// The order of every stepper, observed through events.
//
// The spiral is smooth, nonlinear and solved in closed form. An event cuts its step
// short, so that the error is not a smooth function of the step; a line fitted
// through several halvings evens this out.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "score.hpp"

namespace ricochet::bench {

namespace {

/// Largest error of an event time [s] or of the final state. Infinite if events
/// are missed or invented.
template <class Method>
double error_at(double step)
{
    const auto problem = spiral();
    const auto run = integrate(problem.system, problem.x0, {.t_end = problem.t_end, .step = step},
                               FixedStep<Method>{}, Extremum{});
    std::vector<double> times;
    for (const auto& event : run.events) times.push_back(event.t);
    const Score result = score(times, problem.events);
    if (!result.complete()) return std::numeric_limits<double>::infinity();
    const auto exact = Spiral::solution(problem.t_end);
    return std::max({result.error, std::fabs(run.x[0] - exact[0]), std::fabs(run.x[1] - exact[1])});
}

/// Slope of the least-squares line through (log h, log error).
template <class Method>
void observe(std::string_view name, double coarsest, int halvings, double expected,
             Measured& measured)
{
    double mean_x = 0;
    double mean_y = 0;
    std::vector<double> x;
    std::vector<double> y;
    std::string errors;
    for (int i = 0; i <= halvings; ++i) {
        const double h = std::ldexp(coarsest, -i);
        const double error = error_at<Method>(h);
        x.push_back(std::log(h));
        y.push_back(std::log(error));
        mean_x += x.back() / (halvings + 1);
        mean_y += y.back() / (halvings + 1);
        errors += fmt::format(" {:.1e}", error);
    }
    double xy = 0;
    double xx = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xy += (x[i] - mean_x) * (y[i] - mean_y);
        xx += (x[i] - mean_x) * (x[i] - mean_x);
    }
    const double order = xy / xx;
    measured.pass = measured.pass && order >= expected - 0.25;
    measured.text += fmt::format("{}{} {:.2f}", measured.text.empty() ? "" : ", ", name, order);
    measured.details.push_back(fmt::format("{:<11} order {:.2f}, errors at steps {:g} / 2^k:{}",
                                           name, order, coarsest, errors));
}

}  // namespace

Measured observe_orders()
{
    Measured measured{.pass = true, .text = {}};
    observe<Euler>("euler", 0.004, 5, 1, measured);
    observe<Rk4>("rk4", 0.1, 5, 4, measured);
    observe<CashKarp54>("cash-karp", 0.1, 5, 5, measured);
    observe<Dopri5>("dopri5", 0.1, 5, 5, measured);
    observe<Fehlberg78>("fehlberg78", 0.4, 3, 8, measured);
    return measured;
}

}  // namespace ricochet::bench
