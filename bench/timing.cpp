#include "timing.hpp"

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <cmath>
#include <ctime>

namespace ricochet::bench {

namespace {

/// [s] Processor time of this thread.
double now()
{
    std::timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double seconds_of(const Work& work, std::size_t n)
{
    const double start = now();
    work(n);
    return now() - start;
}

/// The number of repetitions that fills a sample, found by doubling.
std::size_t calibrate(const Work& work, double sample)
{
    for (std::size_t n = 1;; n *= 2) {
        const double elapsed = seconds_of(work, n);
        if (elapsed >= sample) return n;
        if (elapsed > sample / 8) {
            const double needed = static_cast<double>(n) * sample / elapsed;
            return static_cast<std::size_t>(std::ceil(needed));
        }
    }
}

/// Value below which the fraction `p` of the sorted samples lies.
double quantile(const std::vector<double>& sorted, double p)
{
    const auto last = static_cast<double>(sorted.size() - 1);
    return sorted[static_cast<std::size_t>(std::lround(p * last))];
}

}  // namespace

std::vector<Timing> time_in_turns(std::span<const Work> works, const TimingOptions& options)
{
    std::vector<Timing> timings(works.size());
    std::vector<std::vector<double>> samples(works.size());
    std::size_t rounds = 0;
    for (std::size_t i = 0; i < works.size(); ++i) {
        const std::size_t n = calibrate(works[i], options.sample);
        const double sample = seconds_of(works[i], n);
        const auto affordable = static_cast<std::size_t>(options.budget / sample);
        timings[i].repetitions = n;
        timings[i].samples = std::clamp(affordable, options.fewest, options.most);
        samples[i].reserve(timings[i].samples);
        rounds = std::max(rounds, timings[i].samples);
    }
    for (std::size_t round = 0; round < rounds; ++round) {
        for (std::size_t i = 0; i < works.size(); ++i) {
            if (round >= timings[i].samples) continue;
            const std::size_t n = timings[i].repetitions;
            samples[i].push_back(seconds_of(works[i], n) / static_cast<double>(n));
        }
    }
    for (std::size_t i = 0; i < works.size(); ++i) {
        std::sort(samples[i].begin(), samples[i].end());
        timings[i].median = quantile(samples[i], 0.5);
        timings[i].p10 = quantile(samples[i], 0.1);
        timings[i].p90 = quantile(samples[i], 0.9);
    }
    return timings;
}

Timing time_alone(const Work& work, const TimingOptions& options)
{
    return time_in_turns({&work, 1}, options).front();
}

Work yardstick()
{
    return [](std::size_t n) {
        using State = std::array<double, 2>;
        const auto flow = [](const State& x, State& dxdt, double /*t*/) {
            dxdt[0] = x[1];
            dxdt[1] = -9.81;
        };
        boost::numeric::odeint::runge_kutta4<State> stepper;
        State x{10, 0};
        double t = 0;
        for (std::size_t i = 0; i < n; ++i) {
            stepper.do_step(flow, x, t, 0.01);
            t += 0.01;
            keep(x);
        }
    };
}

}  // namespace ricochet::bench
