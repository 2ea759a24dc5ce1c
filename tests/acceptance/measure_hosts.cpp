// Cost of the monitor in a host, and its events there: CVODE beside its own root finding.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "hosts/host_systems.hpp"
#include "hosts/stiff_systems.hpp"
#include "hosts/sundials_setup.hpp"
#include "measure.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/rosenbrock.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

using namespace hosts_test;

// --- CVODE with its own root finding ---

template <class System>
int roots(double t, N_Vector x, double* g, void* flow)
{
    const auto& of = *static_cast<const FlowOf<System>*>(flow);
    *g = of.system->guard(t, N_VGetArrayPointer(x));
    return 0;
}

/// The times at which CVODE finds a root; where it is an event of a ball, it bounces.
template <class System, bool resets>
std::vector<double> cvode_roots(const System& system, const typename System::State& x0,
                                double t_end, const Tolerances& tolerances)
{
    const Mode mode = 0;
    CvodeOf<System, CV_ADAMS> made(system, mode, x0, tolerances);
    void* memory = made.memory();
    CVodeRootInit(memory, 1, roots<System>);
    int falling = -1;
    if (resets) CVodeSetRootDirection(memory, &falling);
    std::vector<double> times;
    SundialsParts at(x0);
    for (double t = 0; CVode(memory, t_end, at.x, &t, CV_NORMAL) == CV_ROOT_RETURN;) {
        times.push_back(t);
        if constexpr (resets) {
            system.reset(t, *reinterpret_cast<typename System::State*>(N_VGetArrayPointer(at.x)));
            CVodeReInit(memory, t, at.x);
        }
    }
    return times;
}

template <class System, int method = CV_ADAMS>
std::vector<double> monitored(const System& system, const typename System::State& x0, double t_end,
                              const Tolerances& tolerances)
{
    const Mode mode = 0;
    CvodeOf<System, method> made(system, mode, x0, tolerances);
    EventMonitor monitor(system, x0, {.event_states = false});
    hosts::run(made.host(), monitor, t_end);
    std::vector<double> times;
    for (const auto& event : monitor.events()) times.push_back(event.t);
    return times;
}

Measured time_impacts()
{
    const BouncingBall ball;
    const BouncingBall::State x0{10, 0};
    const Tolerances tolerances{1e-10, 1e-13};
    const auto ours = [=] { return monitored(ball, x0, 20.5, tolerances); };
    const auto theirs = [=] { return cvode_roots<BouncingBall, true>(ball, x0, 20.5, tolerances); };
    const auto worst = [&](const std::vector<double>& times) {
        if (times.size() != 13) return std::numeric_limits<double>::infinity();
        double error = 0;
        for (int k = 0; k < 13; ++k) {
            const double found = times[static_cast<std::size_t>(k)];
            error = std::max(error, std::fabs(found - ball.impact_time(k, 10)));
        }
        return error;
    };
    const auto timings = time_in_turns(std::vector<Work>{repeated(ours), repeated(theirs)},
                                       {.budget = 2, .fewest = 21, .most = 501});
    const double ratio = timings[0].median / timings[1].median;
    return {.pass = worst(ours()) <= 1e-13 && ratio <= 1,
            .text = fmt::format("{:.1e} s in {:.0f} us; CVodeRootInit {:.1e} s in {:.0f} us",
                                worst(ours()), 1e6 * timings[0].median, worst(theirs()),
                                1e6 * timings[1].median)};
}

Measured count_crests()
{
    Measured out{.pass = true, .text = {}};
    std::size_t found_by_us = 0;
    std::size_t found_by_cvode = 0;
    std::size_t all = 0;
    for (int k = 2; k <= 10; ++k) {
        const Crests system{std::pow(10, -k)};
        const Tolerances tolerances{1e-13, 1e-15};
        const std::size_t ours = monitored(system, {0, 1}, 18, tolerances).size();
        const std::size_t theirs =
            cvode_roots<Crests, false>(system, {0, 1}, 18, tolerances).size();
        all += 3;
        found_by_us += ours / 2;
        found_by_cvode += theirs / 2;
        out.details.push_back(
            fmt::format("depth 1e-{}: {} crossings of 6, CVodeRootInit {}", k, ours, theirs));
        out.pass = out.pass && ours == 6;
    }
    out.text = fmt::format("{} pairs of {}, CVodeRootInit {}", found_by_us, all, found_by_cvode);
    return out;
}

// --- the cost of a step without an event ---

/// A rotation, as a host program at no cost: exact, by a constant matrix.
template <class X>
class RotatingHost {
public:
    explicit RotatingHost(const X& x) : x0_(x), x1_(x), rate0_(x), rate1_(x) { rate(x1_, rate1_); }

    void step(double /*t_stop*/)
    {
        t0_ += h();
        std::swap(x0_, x1_);
        std::swap(rate0_, rate1_);
        x1_[0] = cos_ * x0_[0] + sin_ * x0_[1];
        x1_[1] = cos_ * x0_[1] - sin_ * x0_[0];
        rate(x1_, rate1_);
    }
    static constexpr bool is_cubic = true;
    [[nodiscard]] double t0() const noexcept { return t0_; }
    [[nodiscard]] double h() const noexcept { return 0.01; }
    [[nodiscard]] const X& x0() const noexcept { return x0_; }
    [[nodiscard]] const X& x1() const noexcept { return x1_; }
    [[nodiscard]] const X& rate0() const noexcept { return rate0_; }
    [[nodiscard]] const X& rate1() const noexcept { return rate1_; }
    void interpolate(double s, std::span<double> x) const noexcept { path().interpolate(s, x); }
    void interpolate_rate(double s, std::span<double> dxdt) const noexcept
    {
        path().interpolate_rate(s, dxdt);
    }

private:
    static void rate(const X& x, X& dxdt) noexcept
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    [[nodiscard]] HermiteStep path() const noexcept
    {
        return {{t0_, 0}, h(), x0_, x1_, rate0_, rate1_};
    }

    double cos_ = std::cos(0.01), sin_ = std::sin(0.01);
    double t0_ = -0.01;
    X x0_, x1_, rate0_, rate1_;
};

template <class X>
struct FarGuards {
    using State = X;
    std::size_t guard_count;

    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    void guards(double /*t*/, const X& x, std::span<double> g) const
    {
        for (std::size_t i = 0; i < g.size(); ++i) g[i] = 2 + static_cast<double>(i) - x[0];
    }
    void guard_rates(double /*t*/, const X& /*x*/, const X& dxdt, std::span<double> rates) const
    {
        for (double& rate : rates) rate = -dxdt[0];
    }
};

struct FarGuard {
    using State = std::array<double, 2>;

    [[nodiscard]] static GuardInfo guard_info(std::size_t /*which*/) { return {.degree = 1}; }
    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const
    {
        return 2 - x[0];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return -dxdt[0];
    }
};

/// [s] of `examine`, on the reference machine.
template <class System>
double examine_time(const System& system, const typename System::State& x0, bool check_inside)
{
    RotatingHost host(x0);
    RotatingHost plain(x0);
    EventMonitor monitor(system, x0, {.check_inside = check_inside});
    (void)monitor.start({0}, x0, host.h());
    const Work watched = [&](std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) {
            host.step(0);
            Verdict verdict = monitor.examine(host);
            keep(verdict);
        }
    };
    const Work alone = [&plain](std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) {
            plain.step(0);
            keep(plain);
        }
    };
    const auto timings = time_in_turns(std::vector<Work>{yardstick(), alone, watched},
                                       {.budget = 1, .fewest = 51, .most = 1001});
    return scaled(timings[2].median - timings[1].median, timings[0]);
}

Measured time_examine()
{
    const double one = examine_time(FarGuard{}, {1, 0}, true);
    const double hundred =
        examine_time(FarGuards<std::vector<double>>{100}, std::vector<double>{1, 0}, true);
    Measured out{.pass = one <= 12e-9 && hundred <= 310e-9,
                 .text = fmt::format("{:.1f} ns, 100 guards {:.0f} ns", 1e9 * one, 1e9 * hundred)};
    out.details.push_back(fmt::format(
        "without the look inside the step {:.1f} ns, 100 guards {:.0f} ns",
        1e9 * examine_time(FarGuard{}, {1, 0}, false),
        1e9 * examine_time(FarGuards<std::vector<double>>{100}, std::vector<double>{1, 0}, false)));
    return out;
}

// --- stiff systems ---

struct Stiff {
    std::vector<double> times;
    std::array<double, 3> end{};
    long flows = 0;
};

template <class System>
Stiff by_bdf(const System& system, const std::array<double, 3>& x0, Mode mode, double t_end,
             const Tolerances& tolerances)
{
    CvodeOf<System, CV_BDF> made(system, mode, x0, tolerances);
    EventMonitor monitor(system, x0);
    Stiff run;
    const auto add = [&] {
        long flows = 0;
        CVodeGetNumRhsEvals(made.memory(), &flows);
        run.flows += flows;
        CVodeGetNumLinRhsEvals(made.memory(), &flows);
        run.flows += flows;
    };
    const auto at_cut = [&](const auto& cut) {
        add();
        mode = cut.mode_after;
        run.times.push_back(cut.t.value);
    };
    hosts::run(made.host(), monitor, t_end, at_cut, mode);
    add();
    std::ranges::copy(made.host().x(), run.end.begin());
    return run;
}

template <class System>
void compare_stiff(const char* name, const System& system, const std::array<double, 3>& x0,
                   Mode mode, double t_end, double atol, Measured& out)
{
    const double rtol = 1e-6;
    const auto ours = [=] { return by_bdf(system, x0, mode, t_end, {rtol, atol}); };
    const Stiff run = ours();
    const Stiff exact = by_bdf(system, x0, mode, t_end, {1e-3 * rtol, 1e-2 * atol});
    double error = run.times.size() == exact.times.size() ? 0 : 1;
    for (std::size_t k = 0; k < run.times.size() && error < 1; ++k) {
        error = std::max(error, std::fabs(run.times[k] - exact.times[k]) / t_end);
    }
    for (std::size_t i = 0; i < 3; ++i) {
        error = std::max(error, std::fabs(run.end[i] / exact.end[i] - 1));
    }
    const Timing time = time_alone(repeated(ours), {.budget = 0.5, .fewest = 3, .most = 21});
    const auto explicitly = [=] {
        return integrate(system, x0, {.t_end = t_end, .mode = mode, .rtol = rtol, .atol = atol});
    };
    const auto other = explicitly();
    const Timing other_time =
        time_alone(repeated(explicitly), {.budget = 0.1, .fewest = 1, .most = 3});
    out.details.push_back(fmt::format(
        "{}: {} cuts, error {:.1e}, {} flow calls, {:.2f} ms; dopri5 {} flow calls, {:.0f} ms, {}",
        name, run.times.size(), error, run.flows, 1e3 * time.median, other.statistics.flow_calls,
        1e3 * other_time.median, describe(other.outcome)));
    out.pass = out.pass && error <= 100 * rtol;
    out.text +=
        fmt::format("{}{} {:.1e} in {:.1f} ms, dopri5 {:.0f} ms", out.text.empty() ? "" : "; ",
                    name, error, 1e3 * time.median, 1e3 * other_time.median);
}

Measured run_stiff_systems()
{
    Measured out{.pass = true, .text = {}};
    compare_stiff("Robertson with a valve", RobertsonValve{}, {1, 0, 0}, RobertsonValve::closed,
                  2000, 1e-10, out);
    compare_stiff("buck converter", BuckConverter{}, {0, 0, 0}, BuckConverter::switched_on,
                  25.5 * BuckConverter::half_period, 1e-5, out);
    return out;
}

/// Events of the implicit method and of CVODE's BDF with the monitor, at the same tolerances,
/// timed in turns.
template <class System>
void compare_implicit(const char* name, const System& system, const std::array<double, 3>& x0,
                      Mode mode, double t_end, double atol, Measured& out)
{
    const double rtol = 1e-6;
    const auto run_to = [=](double relative, double absolute) {
        return integrate(system, x0,
                         {.t_end = t_end, .mode = mode, .rtol = relative, .atol = absolute},
                         ErrorControlled<Rosenbrock4>{});
    };
    const auto times_of = [](const auto& run) {
        std::vector<double> times;
        for (const auto& event : run.events) times.push_back(event.t);
        return times;
    };
    const std::vector<double> exact = times_of(run_to(1e-4 * rtol, 1e-4 * atol));
    const auto error_of = [&](const std::vector<double>& times) {
        if (times.size() != exact.size()) return std::numeric_limits<double>::infinity();
        double error = 0;
        for (std::size_t k = 0; k < times.size(); ++k) {
            error = std::max(error, std::fabs(times[k] / exact[k] - 1));
        }
        return error;
    };
    const auto ours = [=] { return run_to(rtol, atol); };
    const auto theirs = [=] { return by_bdf(system, x0, mode, t_end, {rtol, atol}); };
    const auto run = ours();
    const Stiff other = theirs();
    const double error = error_of(times_of(run));
    const auto timings = time_in_turns(std::vector<Work>{repeated(ours), repeated(theirs)},
                                       {.budget = 1, .fewest = 11, .most = 201});
    const double ratio = timings[0].median / timings[1].median;
    out.details.push_back(fmt::format(
        "{}: {} events, error {:.1e}, {} steps, {} flow calls, {:.0f} us; BDF {} events, error "
        "{:.1e}, {} flow calls, {:.0f} us",
        name, run.events.size(), error, run.statistics.steps, run.statistics.flow_calls,
        1e6 * timings[0].median, other.times.size(), error_of(other.times), other.flows,
        1e6 * timings[1].median));
    out.pass = out.pass && error <= rtol && ratio <= 1;
    out.text += fmt::format("{}{} {:.1e} in {:.2f} of BDF's time", out.text.empty() ? "" : "; ",
                            name, error, ratio);
}

Measured run_implicit_method()
{
    Measured out{.pass = true, .text = {}};
    compare_implicit("Robertson with a valve", RobertsonValve{}, {1, 0, 0}, RobertsonValve::closed,
                     2000, 1e-10, out);
    compare_implicit("buck converter", BuckConverter{}, {0, 0, 0}, BuckConverter::switched_on,
                     25.5 * BuckConverter::half_period, 1e-5, out);
    return out;
}

// --- adapters ---

/// Lines of code, without comments, includes and empty ones.
Measured count_adapter_lines()
{
    Measured out{.pass = true, .text = {}};
    for (const char* name : {"cvode", "arkode", "gsl", "ode", "bullet"}) {
        std::ifstream file(fmt::format("{}/{}.hpp", RICOCHET_HOSTS, name));
        int lines = 0;
        for (std::string line; std::getline(file, line);) {
            const std::size_t first = line.find_first_not_of(' ');
            lines += first != std::string::npos && line[first] != '#' &&
                     line.compare(first, 2, "//") != 0;
        }
        out.pass = out.pass && lines > 0 && lines <= 60;
        out.text += fmt::format("{}{} {}", out.text.empty() ? "" : ", ", name, lines);
    }
    return out;
}

}  // namespace

std::vector<Check> host_checks()
{
    return {
        {.topic = "hosts",
         .id = "cvode-impacts",
         .sentence = "13 impacts of the ball in CVODE (Adams, rtol 1e-10): largest error and time, "
                     "beside its own root finding",
         .target = "<= 1e-13 s, no more time",
         .run = time_impacts},
        {.topic = "hosts",
         .id = "cvode-crests",
         .sentence = "pairs of crossings around a crest in CVODE, depth 1e-2 to 1e-10",
         .target = "all",
         .run = count_crests},
        {.topic = "hosts",
         .id = "examine",
         .sentence = "time of `examine` for a step without an event, one guard and 100",
         .target = "<= 12 ns, <= 10 ns + 3 ns a guard",
         .run = time_examine},
        {.topic = "hosts",
         .id = "cvode-stiff",
         .sentence =
             "stiff hybrid systems by CVODE's BDF at rtol 1e-6: error, and time beside dopri5",
         .target = "error <= 1e-4",
         .run = run_stiff_systems},
        {.topic = "hosts",
         .id = "rosenbrock",
         .sentence =
             "stiff hybrid systems by Rosenbrock4 at rtol 1e-6: relative error of an event, "
             "and time beside CVODE's BDF with the monitor",
         .target = "<= 1e-6, no more time",
         .run = run_implicit_method},
        {.topic = "hosts",
         .id = "adapter-lines",
         .sentence = "lines of code of each adapter",
         .target = "<= 60",
         .run = count_adapter_lines},
    };
}

}  // namespace ricochet::bench
