// Cost of features: the bouncing ball with one feature added. The program is compiled once per
// feature, so that its size and its allocations show the cost of that feature.
//
// It prints one line of JSON: seconds of a run, allocations in a run, events.
#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>

#include "allocations.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"

#if defined(RICOCHET_PAYS_planning)
#include "ricochet/planned.hpp"
#elif defined(RICOCHET_PAYS_network)
#include "ricochet/gates.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#elif defined(RICOCHET_PAYS_friction)
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#elif defined(RICOCHET_PAYS_sensitivities)
#include "ricochet/sensitivity/sensitivities.hpp"
#elif defined(RICOCHET_PAYS_taylor)
#include "ricochet/taylor/taylor.hpp"
#endif

namespace {

using namespace ricochet;
using Two = std::array<double, 2>;

struct Ball {
    using State = Two;

    template <class T, class X>
    constexpr void flow(const T& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.81;
    }
#if !defined(RICOCHET_PAYS_flow)
    static constexpr bool unilateral = true;
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(const T& /*t*/, const X& x) const
    {
        return x[0];
    }
    template <class X>
    void reset(double /*t*/, X& x) const
    {
        x[0] = 0;
        x[1] *= -0.9;
    }
#endif
#if defined(RICOCHET_PAYS_planning)
    /// 14 m/s is the speed of the first impact.
    [[nodiscard]] double speed_bound(double /*t*/, const Two& /*x*/) const
    {
        return 15;
    }
#endif
};

/// The ball with moving up and moving down as modes; it changes from up to down at velocity zero.
struct BallWithModes {
    using State = Two;
    enum : Mode { down, up };
    enum : std::size_t { floor, crest };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode)
    {
        return (which == crest) == (mode == up);
    }
    void flow(Mode /*mode*/, double /*t*/, const Two& x, Two& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(std::size_t which, Mode /*mode*/, double /*t*/, const Two& x) const
    {
        return which == floor ? x[0] : x[1];
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode /*mode*/, double /*t*/, Two& x) const
    {
        if (which == crest) return down;
        x = {0, -0.9 * x[1]};
        return up;
    }
};

std::size_t solve()
{
    [[maybe_unused]] const Two start{10, 0};
    Options options{.t_end = 20.5, .rtol = 1e-10, .atol = 1e-10};
#if defined(RICOCHET_PAYS_modes)
    return integrate(BallWithModes{}, start, options).events.size();
#elif defined(RICOCHET_PAYS_recording)
    options.record_steps = true;
    for (int k = 0; k < 200; ++k) options.sample_times.push_back(0.1 * k);
    return integrate(Ball{}, start, options).events.size();
#elif defined(RICOCHET_PAYS_planning)
    return integrate(Ball{}, start, options, ErrorControlled<Dopri5>{}, Planned<Extremum>{})
        .events.size();
#elif defined(RICOCHET_PAYS_network)
    static const Verified<> detector{
        BareNetwork(load_model(RICOCHET_MODELS "/bouncing-ball.safetensors"))};
    static const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    return integrate(ball, start, options, ErrorControlled<Dopri5>{}, detector).events.size();
#elif defined(RICOCHET_PAYS_friction)
    const auto run = hand_over(FrictionInclusion{}, FrictionInclusion::Vector(2, 0),
                               {.t_end = 20.5, .rtol = 1e-10, .atol = 1e-10});
    return run.events.size();
#elif defined(RICOCHET_PAYS_sensitivities)
    return sensitivities(Ball{}, start, {}, options).events.size();
#elif defined(RICOCHET_PAYS_taylor)
    return integrate(Ball{}, start, options, ErrorControlled<Taylor>{}).events.size();
#else
    return integrate(Ball{}, start, options).events.size();
#endif
}

double now()
{
    std::timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

int main()
{
    std::size_t events = solve();
    const std::uint64_t before = testing_support::allocations();
    events = solve();
    const std::uint64_t allocations = testing_support::allocations() - before;
    double best = 1;
    for (int sample = 0; sample < 41; ++sample) {
        constexpr int runs = 100;
        const double start = now();
        for (int k = 0; k < runs; ++k) events = solve();
        best = std::min(best, (now() - start) / runs);
    }
    std::printf("{\"seconds\": %.4g, \"allocations\": %llu, \"events\": %zu}\n", best,
                static_cast<unsigned long long>(allocations), events);
}
