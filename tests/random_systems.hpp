// Random hybrid systems whose motion is a polynomial of degree three or less between
// events, so that every event can be known beforehand (see exact_run.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/system.hpp"

namespace ricochet::test {

/// The effect of a reset on one component.
struct Write {
    enum Kind { keep, put, scale } kind = keep;
    double value = 0;

    [[nodiscard]] bool operator==(const Write&) const = default;
};

/// A random system. State (x_0, x_1, x_2); a mode has drifts b and couplings c.
///
///     flow    x_0' = b_0 + c_01 x_1 + c_02 x_2,  x_1' = b_1 + c_12 x_2,  x_2' = b_2
///     guards  a_k x + of_time_k t - level_k, in some of the modes, each way of crossing,
///             to be recorded or with a reset
///     reset   puts components at known places or scales them, and may change the mode
///
/// and perhaps a clock that resets, too.
struct RandomSystem {
    using State = std::array<double, 3>;

    struct Flow {
        State drift{};
        double c01 = 0, c02 = 0, c12 = 0;
    };
    struct Reset {
        std::array<Write, 3> writes{};
        bool switches = false;
        Mode next = 0;
    };
    struct Guard {
        State a{};
        double of_time = 0;
        double level = 0;
        GuardInfo info{};
        std::uint32_t modes = ~0u;  ///< bit m: examined in mode m
        Reset reset{};
    };
    struct Clock {
        double first = std::numeric_limits<double>::infinity();  ///< [s]
        double period = 1;                                       ///< [s]
        Reset reset{};
    };

    std::vector<Flow> flows;  ///< one for each mode
    std::vector<Guard> guards_of;
    Clock clock;

    [[nodiscard]] std::size_t mode_count() const noexcept { return flows.size(); }
    [[nodiscard]] std::size_t guard_count() const noexcept { return guards_of.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return guards_of[which].info; }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return (guards_of[which].modes >> mode & 1u) != 0;
    }

    template <class X>
    void flow(Mode mode, double /*t*/, const X& x, X& dxdt) const
    {
        const Flow& f = flows[mode];
        dxdt[0] = f.drift[0] + f.c01 * x[1] + f.c02 * x[2];
        dxdt[1] = f.drift[1] + f.c12 * x[2];
        dxdt[2] = f.drift[2];
    }

    template <class X>
    [[nodiscard]] double guard(std::size_t which, double t, const X& x) const
    {
        const Guard& g = guards_of[which];
        return g.a[0] * x[0] + g.a[1] * x[1] + g.a[2] * x[2] + g.of_time * t - g.level;
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double /*t*/, const X& /*x*/,
                                    const D& dxdt) const
    {
        const Guard& g = guards_of[which];
        return g.a[0] * dxdt[0] + g.a[1] * dxdt[1] + g.a[2] * dxdt[2] + g.of_time;
    }

    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double /*t*/, X& x) const
    {
        return apply(guards_of[which].reset, mode, x);
    }

    [[nodiscard]] double next_time_event(double t) const
    {
        if (!(t >= clock.first)) return clock.first;
        double k = std::max(0.0, std::floor((t - clock.first) / clock.period) - 1);
        while (!(tick(k) > t)) ++k;
        return tick(k);
    }

    [[nodiscard]] double previous_time_event(double t) const
    {
        if (!(t > clock.first)) return -std::numeric_limits<double>::infinity();
        double k = std::floor((t - clock.first) / clock.period) + 1;
        while (!(tick(k) < t)) --k;
        return tick(k);
    }

    template <class X>
    [[nodiscard]] Mode time_reset(Mode mode, double /*t*/, X& x) const
    {
        return apply(clock.reset, mode, x);
    }

    template <class X>
    [[nodiscard]] static Mode apply(const Reset& reset, Mode mode, X& x)
    {
        for (std::size_t c = 0; c < 3; ++c) {
            const Write& write = reset.writes[c];
            if (write.kind == Write::put) x[c] = write.value;
            if (write.kind == Write::scale) x[c] *= write.value;
        }
        return reset.switches ? reset.next : mode;
    }

private:
    [[nodiscard]] double tick(double k) const noexcept { return clock.first + k * clock.period; }
};

/// A system with its guards in another order: guard i of it is guard `order[i]` of the
/// one given.
[[nodiscard]] inline RandomSystem reordered(const RandomSystem& system,
                                            const std::vector<std::size_t>& order)
{
    RandomSystem other = system;
    for (std::size_t i = 0; i < order.size(); ++i) other.guards_of[i] = system.guards_of[order[i]];
    return other;
}

/// A system, and the interval of its run.
struct RandomProblem {
    RandomSystem system;
    RandomSystem::State x0{};
    Mode mode = 0;
    double t_start = 0;
    double t_end = 0;  ///< before t_start: backward in time

    [[nodiscard]] bool backward() const noexcept { return t_end < t_start; }
};

class RandomProblems {
public:
    explicit RandomProblems(std::uint64_t seed) : random_(seed) {}

    [[nodiscard]] RandomProblem operator()()
    {
        RandomProblem problem;
        RandomSystem& system = problem.system;
        const std::size_t modes = 1 + random_.below(3);
        for (std::size_t m = 0; m < modes; ++m) system.flows.push_back(flow());
        const std::size_t guards = 1 + random_.below(5);
        for (std::size_t k = 0; k < guards; ++k) system.guards_of.push_back(guard(modes));
        while (random_.chance(0.3)) system.guards_of.push_back(twin(system));
        if (random_.chance(0.25)) {
            system.clock = {.first = random_.uniform(-3, 3),
                            .period = random_.uniform(0.3, 3),
                            .reset = reset(modes)};
        }
        for (double& x : problem.x0) x = random_.uniform(-2, 2);
        problem.mode = static_cast<Mode>(random_.below(modes));
        problem.t_start = random_.chance(0.5) ? 0 : random_.uniform(-5, 5);
        problem.t_end = problem.t_start + (random_.chance(0.2) ? -1 : 1) * random_.uniform(1, 10);
        return problem;
    }

    [[nodiscard]] learn::Random& random() noexcept { return random_; }

private:
    [[nodiscard]] RandomSystem::Flow flow()
    {
        RandomSystem::Flow flow;
        for (double& b : flow.drift) b = random_.chance(0.15) ? 0 : random_.uniform(-2, 2);
        for (double* c : {&flow.c01, &flow.c02, &flow.c12}) {
            *c = random_.chance(0.4) ? 0 : random_.uniform(-2, 2);
        }
        return flow;
    }

    /// A place that guards and resets sometimes share, so that a reset may put
    /// a component on the surface of a guard.
    [[nodiscard]] double place()
    {
        return random_.chance(0.3) ? static_cast<double>(random_.below(5)) / 2 - 1
                                   : random_.uniform(-2, 2);
    }

    [[nodiscard]] RandomSystem::Reset reset(std::size_t modes)
    {
        RandomSystem::Reset reset;
        for (Write& write : reset.writes) {
            if (random_.chance(0.5))
                write = {Write::put, place()};
            else if (random_.chance(0.3))
                write = {Write::scale, random_.uniform(-1, 0.5)};
        }
        reset.switches = modes > 1 && random_.chance(0.5);
        reset.next = static_cast<Mode>(random_.below(modes));
        return reset;
    }

    [[nodiscard]] RandomSystem::Guard guard(std::size_t modes)
    {
        RandomSystem::Guard guard;
        if (random_.chance(0.6)) {
            guard.a[random_.below(3)] = random_.chance(0.5) ? 1 : -1;
        } else {
            for (double& a : guard.a) a = random_.uniform(-1, 1);
        }
        if (random_.chance(0.15)) guard.of_time = random_.uniform(-1, 1);
        guard.level = place();
        guard.info.crossing =
            std::array{Crossing::falling, Crossing::rising, Crossing::either}[random_.below(3)];
        guard.info.resets = random_.chance(0.6);
        guard.info.degree = 1;
        if (random_.chance(0.3)) guard.modes = static_cast<std::uint32_t>(1 + random_.below(7));
        guard.reset = reset(modes);
        return guard;
    }

    /// A guard that crosses at the same instants as another, by a factor that is exact
    /// in binary; both write the same values to common components.
    [[nodiscard]] RandomSystem::Guard twin(const RandomSystem& system)
    {
        const RandomSystem::Guard& other = system.guards_of[random_.below(system.guard_count())];
        RandomSystem::Guard guard = other;
        const double factor = std::array{1.0, 2.0, 0.25, -1.0, -4.0}[random_.below(5)];
        for (double& a : guard.a) a *= factor;
        guard.of_time *= factor;
        guard.level *= factor;
        if (factor < 0 && guard.info.crossing != Crossing::either) {
            guard.info.crossing =
                other.info.crossing == Crossing::falling ? Crossing::rising : Crossing::falling;
        }
        if (random_.chance(0.3)) guard.info.resets = !guard.info.resets;
        for (std::size_t c = 0; c < 3; ++c) {
            if (other.reset.writes[c].kind == Write::keep && random_.chance(0.5)) {
                guard.reset.writes[c] = {Write::put, place()};
            } else if (random_.chance(0.3)) {
                guard.reset.writes[c] = {};
            }
        }
        if (random_.chance(0.3)) guard.reset.switches = false;
        return guard;
    }

    learn::Random random_;
};

}  // namespace ricochet::test
