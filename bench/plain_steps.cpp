// Steps without guards beside odeint's: linear oscillators by a controlled dopri5 and by rk4, the
// time of an attempted step of each, in turns.

#include <fmt/format.h>

#include <array>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <cstddef>
#include <string>
#include <vector>

#include "ricochet/integrate.hpp"
#include "timing.hpp"

namespace {

using namespace ricochet;
namespace odeint = boost::numeric::odeint;

constexpr double tolerance = 1e-8, t_end = 100, step = 0.01;

/// Oscillators of two components each.
template <class X>
struct Oscillators {
    using State = X;
    static void flow(double /*t*/, const X& x, X& dxdt)
    {
        for (std::size_t i = 0; i + 1 < x.size(); i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -x[i];
        }
    }
    void operator()(const X& x, X& dxdt, double t) const { flow(t, x, dxdt); }
};

template <class X>
[[nodiscard]] X start(std::size_t n)
{
    X x{};
    if constexpr (requires { x.resize(n); }) x.resize(n);
    for (std::size_t i = 0; i < n; i += 2) x[i] = 1;
    return x;
}

struct Attempts {
    double x0 = 0;  // so that no result is optimised away
    std::size_t count = 0;
};

template <class X>
[[nodiscard]] Attempts controlled_here(std::size_t n)
{
    const auto run = integrate(Oscillators<X>{}, start<X>(n),
                               {.t_end = t_end, .rtol = tolerance, .atol = tolerance},
                               ErrorControlled<Dopri5>{});
    return {run.x[0], run.statistics.steps + run.statistics.rejected};
}

template <class X>
[[nodiscard]] Attempts controlled_in_odeint(std::size_t n)
{
    auto stepper = odeint::make_controlled(tolerance, tolerance, odeint::runge_kutta_dopri5<X>());
    X x = start<X>(n);
    Attempts done;
    double t = 0, h = step;
    while (t < t_end) {
        if (t + h > t_end) h = t_end - t;
        (void)stepper.try_step(Oscillators<X>{}, x, t, h);
        ++done.count;
    }
    done.x0 = x[0];
    return done;
}

template <class X>
[[nodiscard]] Attempts fixed_here(std::size_t n)
{
    const auto run =
        integrate(Oscillators<X>{}, start<X>(n), {.t_end = t_end, .step = step}, FixedStep<Rk4>{});
    return {run.x[0], run.statistics.steps};
}

template <class X>
[[nodiscard]] Attempts fixed_in_odeint(std::size_t n)
{
    odeint::runge_kutta4<X> stepper;
    X x = start<X>(n);
    constexpr std::size_t steps = static_cast<std::size_t>(t_end / step + 0.5);
    for (std::size_t k = 0; k < steps; ++k) {
        stepper.do_step(Oscillators<X>{}, x, step * static_cast<double>(k), step);
    }
    return {x[0], steps};
}

using Runner = Attempts (*)(std::size_t n);

void compare(const std::string& what, std::size_t n, Runner here, Runner in_odeint)
{
    const std::array<bench::Work, 2> works{bench::repeated([=] { return here(n).x0; }),
                                           bench::repeated([=] { return in_odeint(n).x0; })};
    const auto times = bench::time_in_turns(works, {.budget = 0.5});
    const double ours = times[0].p10 / static_cast<double>(here(n).count);
    const double theirs = times[1].p10 / static_cast<double>(in_odeint(n).count);
    fmt::print("{:30} {:5} {:10.4g} {:10.4g} {:8.3f}\n", what, n, 1e9 * ours, 1e9 * theirs,
               ours / theirs);
}

}  // namespace

int main()
{
    fmt::print("{:30} {:>5} {:>10} {:>10} {:>8}\n", "", "n", "here [ns]", "odeint", "ratio");
    using Two = std::array<double, 2>;
    using Four = std::array<double, 4>;
    using Many = std::vector<double>;
    compare("rk4, array", 2, fixed_here<Two>, fixed_in_odeint<Two>);
    compare("dopri5, array", 2, controlled_here<Two>, controlled_in_odeint<Two>);
    compare("dopri5, array", 4, controlled_here<Four>, controlled_in_odeint<Four>);
    for (const std::size_t n : {2, 4, 20, 200, 2000}) {
        compare("dopri5, vector", n, controlled_here<Many>, controlled_in_odeint<Many>);
    }
}
