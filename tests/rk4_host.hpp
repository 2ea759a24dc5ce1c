// A host: the classical Runge-Kutta method with fixed steps, without any notion of events.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "ricochet/monitor.hpp"

namespace ricochet::test {

template <class System, std::size_t n>
class Rk4Host {
public:
    using X = std::array<double, n>;

    /// A step taken by the host; it can be repeated with another length.
    class Step {
    public:
        Step(const Rk4Host& host, double h) : host_(host), h_(h), rate0_(host.rate(host.x_))
        {
            place(h, x1_);
            rate1_ = host.rate(x1_);
        }

        [[nodiscard]] const Instant& t0() const { return host_.t_; }
        [[nodiscard]] double h() const { return h_; }
        [[nodiscard]] std::span<const double> x0() const { return host_.x_; }
        [[nodiscard]] std::span<const double> x1() const { return x1_; }
        [[nodiscard]] std::span<const double> rate0() const { return rate0_; }
        [[nodiscard]] std::span<const double> rate1() const { return rate1_; }
        void interpolate(double s, std::span<double> x) const
        {
            HermiteStep(t0(), h_, x0(), x1_, rate0_, rate1_).interpolate(s, x);
        }
        void interpolate_rate(double s, std::span<double> dxdt) const
        {
            HermiteStep(t0(), h_, x0(), x1_, rate0_, rate1_).interpolate_rate(s, dxdt);
        }
        void restep(double s, std::span<double> x) const
        {
            X at;
            place(s, at);
            std::copy(at.begin(), at.end(), x.begin());
        }

    private:
        void place(double s, X& x) const
        {
            const X& x0 = host_.x_;
            const auto moved = [&](double by, const X& k) {
                X at;
                for (std::size_t i = 0; i < n; ++i) at[i] = x0[i] + by * k[i];
                return at;
            };
            const X k2 = host_.rate(moved(s / 2, rate0_));
            const X k3 = host_.rate(moved(s / 2, k2));
            const X k4 = host_.rate(moved(s, k3));
            for (std::size_t i = 0; i < n; ++i) {
                // Exact where the rate is constant.
                x[i] = x0[i] + s * ((rate0_[i] + 2 * (k2[i] + k3[i]) + k4[i]) / 6);
            }
        }

        const Rk4Host& host_;
        double h_;
        X rate0_, x1_{}, rate1_{};
    };

    Rk4Host(const System& system, double t, const X& x, Mode mode = 0)
        : system_(system), t_{t, 0}, x_(x), mode_(mode)
    {
    }

    [[nodiscard]] double t() const { return t_.value; }
    [[nodiscard]] double until(double t) const { return t_.until(t); }
    [[nodiscard]] const X& x() const { return x_; }
    [[nodiscard]] Mode mode() const { return mode_; }
    [[nodiscard]] X rate(const X& x) const
    {
        X dxdt{};
        detail::call_flow(system_, mode_, t_.value, x, dxdt);
        return dxdt;
    }
    [[nodiscard]] X rate() const { return rate(x_); }
    void accept(const Step& step)
    {
        t_ = t_.after(step.h());
        std::copy(step.x1().begin(), step.x1().end(), x_.begin());
    }
    void restart(const Instant& t, std::span<const double> x, Mode mode)
    {
        t_ = t;
        std::copy(x.begin(), x.end(), x_.begin());
        mode_ = mode;
    }

private:
    const System& system_;
    Instant t_;
    X x_;
    Mode mode_;
};

/// Result of a host's run.
template <class State>
struct HostRun {
    Verdict verdict = Verdict::stands;
    Outcome outcome = Outcome::reached_end;
    double t = 0;
    State x{};
    Mode mode = 0;
    std::vector<Cut<State>> cuts;
    std::vector<Event<State>> events;
    Statistics statistics;
};

/// Shows the steps of a host, and the rate after an event, unchanged.
struct AsItIs {
    [[nodiscard]] const auto& step(const auto& taken) const { return taken; }
    [[nodiscard]] auto rate(const auto& dxdt) const { return dxdt; }
};

/// Drives a host to `t_end` in steps of h [s], with a monitor that has not been started.
template <class System, std::size_t n, class Monitor, class Shown = AsItIs>
auto drive(const System& system, Monitor& monitor, const std::array<double, n>& x0, double t_end,
           double h, Mode mode = 0, const Shown& shown = {})
{
    Rk4Host<System, n> host(system, 0, x0, mode);
    HostRun<typename Monitor::State> run;
    Verdict verdict = monitor.start(Instant{0}, x0, shown.rate(host.rate()), h, mode);
    for (;;) {
        while (verdict == Verdict::cut) {
            run.cuts.push_back(monitor.cut());
            host.restart(monitor.cut().t, monitor.cut().after, monitor.cut().mode_after);
            verdict = monitor.resume(shown.rate(host.rate()), h);
        }
        if (verdict == Verdict::rests && monitor.must_stop_at() <= t_end) {
            verdict = monitor.hold(monitor.must_stop_at());
            continue;
        }
        if (verdict != Verdict::stands || host.t() >= t_end) break;
        const double ahead = host.until(std::min(t_end, monitor.must_stop_at()));
        typename Rk4Host<System, n>::Step step(host, h * (1 + 1e-9) < ahead ? h : ahead);
        verdict = monitor.examine(shown.step(step));
        if (verdict == Verdict::stands) host.accept(step);
    }
    run.verdict = verdict;
    run.outcome = monitor.outcome();
    run.t = monitor.t().value;
    std::copy(monitor.x().begin(), monitor.x().end(), run.x.begin());
    run.mode = monitor.mode();
    run.events.assign(monitor.events().begin(), monitor.events().end());
    run.statistics = monitor.statistics();
    return run;
}

}  // namespace ricochet::test
