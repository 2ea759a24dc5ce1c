// What an event means at its borders: small systems with exact answers, for every method and
// locator. x⁻ is the state that a reset sees, x⁺ what it leaves.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/planned.hpp"
#include "rk4_host.hpp"

namespace ricochet {
namespace {

/// An automaton put together from functions, with states of any type.
template <class X>
struct Machine {
    using State = X;
    std::size_t guard_count_ = 1;
    Mode mode_count_ = 64;
    std::function<void(Mode, double, const X&, X&)> f;
    std::function<double(std::size_t, Mode, double, const X&)> g;
    std::function<Mode(std::size_t, Mode, double, X&)> r;
    std::function<bool(std::size_t, Mode)> on = [](std::size_t, Mode) { return true; };
    GuardInfo info{};

    [[nodiscard]] std::size_t guard_count() const { return guard_count_; }
    [[nodiscard]] std::size_t mode_count() const { return mode_count_; }
    void flow(Mode m, double t, const X& x, X& dxdt) const { f(m, t, x, dxdt); }
    [[nodiscard]] double guard(std::size_t i, Mode m, double t, const X& x) const
    {
        return g(i, m, t, x);
    }
    Mode reset(std::size_t i, Mode m, double t, X& x) const { return r(i, m, t, x); }
    [[nodiscard]] bool enabled(std::size_t i, Mode m) const { return on(i, m); }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return info; }
};

/// The same with ticks.
template <class X>
struct Ticking : Machine<X> {
    std::vector<double> ticks;
    std::function<Mode(Mode, double, X&)> tick = [](Mode m, double, X&) { return m; };

    [[nodiscard]] double next_time_event(double t) const
    {
        for (const double tick_time : ticks) {
            if (tick_time > t) return tick_time;
        }
        return std::numeric_limits<double>::infinity();
    }
    Mode time_reset(Mode m, double t, X& x) const { return tick(m, t, x); }
};

template <std::size_t n>
using Array = std::array<double, n>;

/// Calls `check(run, label)` for a run by each of several methods and locators.
template <class System, class X, class Check>
void by_all(const System& system, const X& x0, const Options& options, const Check& check)
{
    const auto by = [&](const auto& stepping, const std::string& label, double step) {
        Options own = options;
        own.step = step;
        check(integrate(system, x0, own, stepping, Extremum{}, Newton{}), label + ", newton");
        check(integrate(system, x0, own, stepping, Extremum{}, Bisection{}), label + ", bisection");
        check(integrate(system, x0, own, stepping, Extremum{}, Toms748{}), label + ", toms748");
        check(integrate(system, x0, own, stepping, Ends{}, Newton{}), label + ", ends");
    };
    by(ErrorControlled<Dopri5>{}, "dopri5", 0);
    by(ErrorControlled<Fehlberg78>{}, "fehlberg78", 0);
    by(FixedStep<Rk4>{}, "rk4", 0.0173);
}

// --- at the event the condition holds ---

TEST(Meaning, AThermostatThatReadsItsTemperatureAgainStaysInItsBand)
{
    // Cooling and heating alternate between 15.5 and 17; 48 events to t = 48, the times in closed
    // form: each phase is an exponential towards 0 or 30 with the rate 0.1.
    const auto time_to = [](double from, double to, double target) {
        return 10 * std::log((from - target) / (to - target));
    };
    double t = time_to(15.75, 15.5, 0);
    double last = t;
    int events = 0;
    for (bool on = true; t <= 48; on = !on) {
        last = t;
        ++events;
        t += on ? time_to(15.5, 17, 30) : time_to(17, 15.5, 0);
    }
    Machine<Array<1>> room;
    room.f = [](Mode on, double, const auto& x, auto& dxdt) {
        dxdt[0] = -0.1 * (x[0] - (on ? 30 : 0));
    };
    room.g = [](std::size_t, Mode on, double, const auto& x) {
        return on ? 17 - x[0] : x[0] - 15.5;
    };
    room.r = [](std::size_t, Mode m, double, auto& x) -> Mode {
        return x[0] <= 15.5 ? 1 : x[0] >= 17 ? 0 : m;
    };
    EXPECT_EQ(events, 48);
    by_all(room, Array<1>{15.75}, {.t_end = 48, .rtol = 1e-10, .atol = 1e-12},
           [&](const auto& run, const std::string& label) {
               ASSERT_EQ(run.events.size(), 48U) << label;
               EXPECT_NEAR(run.events.back().t, last, 1e-6) << label;
               EXPECT_NEAR(run.x[0], 16.3558078684, 1e-6) << label;
               EXPECT_EQ(run.mode, 0U) << label;
           });
}

TEST(Meaning, ThousandsOfThermostatsThatReadTheirTemperatureNeverStick)
{
    // x' = r (target - x) between a cold target below the band and a hot one above it: the times
    // are logarithms. 2000 of them, each by twelve ways.
    std::mt19937 random(5);
    const auto uniform = [&](double lo, double hi) {
        return std::uniform_real_distribution<>(lo, hi)(random);
    };
    int wrong = 0, all = 0;
    for (int k = 0; k < 2000; ++k) {
        const double scale = std::pow(10.0, uniform(-3, 3));
        const double low = scale * uniform(-1, 1), high = low + scale * uniform(0.01, 1);
        const double cold = low - scale * uniform(0.1, 2), hot = high + scale * uniform(0.1, 2);
        const double rate = uniform(0.1, 3);
        const double cooling = std::log((high - cold) / (low - cold)) / rate;
        const double heating = std::log((hot - low) / (hot - high)) / rate;
        Machine<Array<1>> room;
        room.f = [=](Mode on, double, const auto& x, auto& dxdt) {
            dxdt[0] = rate * ((on ? hot : cold) - x[0]);
        };
        room.g = [=](std::size_t, Mode on, double, const auto& x) {
            return on ? high - x[0] : x[0] - low;
        };
        room.r = [=](std::size_t, Mode m, double, auto& x) -> Mode {
            return x[0] <= low ? 1 : x[0] >= high ? 0 : m;
        };
        const double t_end = 5 * (cooling + heating) + 0.5 * cooling;  // ten events
        by_all(room, Array<1>{high}, {.t_end = t_end, .rtol = 1e-9, .atol = 1e-12 * scale},
               [&](const auto& run, const std::string&) {
                   ++all;
                   wrong += run.outcome != Outcome::reached_end || run.events.size() != 10 ||
                            run.mode != 0;
               });
    }
    EXPECT_EQ(wrong, 0) << "of " << all;
    EXPECT_EQ(all, 24'000);
}

TEST(Meaning, ABreakawayThatReadsItsLoadAgainSlips)
{
    Machine<Array<1>> block;
    block.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = 0; };
    block.g = [](std::size_t, Mode, double t, const auto&) { return 0.5 - std::sin(t); };
    block.r = [](std::size_t, Mode m, double t, auto&) -> Mode {
        return std::sin(t) >= 0.5 ? 1 : m;
    };
    block.on = [](std::size_t, Mode m) { return m == 0; };
    by_all(block, Array<1>{0}, {.t_end = 1}, [](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 1U) << label;
        EXPECT_NEAR(run.events[0].t, std::numbers::pi / 6, 4e-16) << label;
        EXPECT_EQ(run.mode, 1U) << label;
    });
}

TEST(Meaning, TheStateBeforeHasLeftItsSideAtThousandsOfRandomPlaces)
{
    // Floors at sizes from 1e-6 to 1e6, guards that round in several ways; three events each, by
    // the loop and in the steps of a host, six to ten a flight.
    std::uint64_t wrong = 0, all = 0;
    for (int k = 0; k < 400; ++k) {
        const double size = std::pow(10.0, -6 + 12.0 * k / 400);
        const double floor = size * (1 + 0.3 * std::sin(12.9898 * k));
        for (int form = 0; form < 4; ++form) {
            Machine<Array<2>> ball;
            ball.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[1], -1}; };
            ball.g = [=](std::size_t, Mode, double, const auto& x) {
                switch (form) {
                    case 0: return x[0] - floor;
                    case 1: return x[0] / floor - 1;
                    case 2: return x[0] * x[0] - floor * floor;
                    default: return std::hypot(x[0], floor) - std::numbers::sqrt2 * floor;
                }
            };
            ball.r = [&, g = ball.g](std::size_t i, Mode m, double t, auto& x) -> Mode {
                ++all;
                wrong += !(g(i, m, t, x) <= 0);
                x[1] = -0.5 * x[1];
                return m;
            };
            ball.info.stop_after = 3;
            const auto run = integrate(ball, Array<2>{2 * floor, 0.1 * std::sqrt(floor)},
                                       {.t_end = 100 * std::sqrt(size)});
            EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
            EventMonitor monitor(ball, Array<2>{});
            const double h = 0.3 * std::sqrt(floor);
            const auto host =
                test::drive(ball, monitor, Array<2>{2 * floor, 0.1 * std::sqrt(floor)},
                            100 * std::sqrt(size), h);
            EXPECT_EQ(host.outcome, Outcome::stopped_by_event);
        }
    }
    EXPECT_EQ(wrong, 0U) << "of " << all;
    EXPECT_EQ(all, 9600U);
}

// --- resets that write the same component ---

/// x' = 0 with guards that fall through zero together at t = 1.
Machine<Array<1>> together(std::vector<std::function<double(double)>> resets)
{
    Machine<Array<1>> machine;
    machine.guard_count_ = resets.size();
    machine.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = 0; };
    machine.g = [](std::size_t, Mode, double t, const auto&) { return 1 - t; };
    machine.r = [resets](std::size_t i, Mode m, double, auto& x) {
        x[0] = resets[i](x[0]);
        return m;
    };
    return machine;
}

TEST(Meaning, EqualIncrementsAddAndOtherResetsFollowEachOther)
{
    const auto end_of = [](double x0, std::vector<std::function<double(double)>> resets) {
        const auto run = integrate(together(std::move(resets)), Array<1>{x0}, {.t_end = 2});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        return run.x[0];
    };
    const auto half = [](double x) { return x * 0.5; };
    const auto at_most = [](double most) { return [=](double x) { return std::min(x, most); }; };
    const auto dose = [](double x) { return std::min(x + 2, 10.0); };
    EXPECT_EQ(end_of(8, {half, half}), 2);
    EXPECT_EQ(end_of(3, {at_most(1), at_most(2)}), 1);
    EXPECT_EQ(end_of(3, {at_most(2), at_most(1)}), 1);
    EXPECT_EQ(end_of(7, {dose, dose}), 10);
    EXPECT_EQ(end_of(7, {[](double) { return 5.0; }, [](double) { return 5.0; }}), 5);
    EXPECT_EQ(end_of(0, {[](double x) { return 1 - x; }, [](double x) { return 1 - x; }}), 0);
    const auto more = [](double x) { return x + 2; };
    EXPECT_EQ(end_of(1, {more, more, more}), 7);
    EXPECT_EQ(end_of(1, std::vector<std::function<double(double)>>(200, more)), 401);
}

TEST(Meaning, ResetsWhoseOrderMattersConflictInEitherOrder)
{
    const auto set = [](double) { return -3.5; };
    const auto add = [](double x) { return x + 1; };
    for (const bool swapped : {false, true}) {
        const auto machine = swapped ? together({add, set}) : together({set, add});
        const auto run = integrate(machine, Array<1>{-4.5}, {.t_end = 2});
        EXPECT_EQ(run.outcome, Outcome::conflicting_resets);
        EXPECT_EQ(run.guard + run.other_guard, 1U);
        EXPECT_NEAR(run.t, 1, 1e-15);
    }
}

/// A reset of four components, exact in doubles: small integers and halves.
using Operation = std::function<void(Array<4>&)>;

Operation random_operation(std::mt19937& random)
{
    const auto below = [&](unsigned n) { return static_cast<std::size_t>(random() % n); };
    const std::size_t a = below(4), b = below(4);
    const double k = static_cast<double>(below(9)) - 4;
    switch (below(9)) {
        case 0: return [=](auto& x) { x[a] += k; };
        case 1: return [=](auto& x) { x[a] *= 2; };
        case 2: return [=](auto& x) { x[a] *= 0.5; };
        case 3: return [=](auto& x) { x[a] = k; };
        case 4: return [=](auto& x) { x[a] = std::min(x[a], k); };
        case 5: return [=](auto& x) { x[a] = 1 - x[a]; };
        case 6: return [=](auto& x) { std::swap(x[a], x[b]); };
        case 7: return [=](auto& x) { x[a] += x[b]; };
        default:
            return [=](auto& x) {
                if (x[b] > 0) x[a] += k;
            };
    }
}

TEST(Meaning, FifteenThousandRandomSetsMeanWhatEveryOrderMeans)
{
    // All guards fall at t = 1 and none is turned back, so a set has one meaning where all orders
    // of its resets end alike. Then it has that value; and whatever it is, the declared order does
    // not matter. The first 1000 happen in a host, too.
    std::mt19937 random(17);
    int with_one_meaning = 0, conflicts = 0, in_hosts = 0;
    for (int k = 0; k < 15'000; ++k) {
        std::vector<Operation> resets(2 + random() % 3);
        for (Operation& reset : resets) reset = random_operation(random);
        Array<4> x0;
        for (double& x : x0) x = static_cast<double>(random() % 9) - 4;

        std::vector<std::size_t> order(resets.size());
        std::iota(order.begin(), order.end(), 0);
        std::vector<Array<4>> ends;
        std::vector<std::pair<Outcome, Array<4>>> runs;
        do {
            ends.push_back(x0);
            for (const std::size_t i : order) resets[i](ends.back());
            Machine<Array<4>> machine;
            machine.guard_count_ = resets.size();
            machine.f = [](Mode, double, const auto&, auto& dxdt) { dxdt = {0, 0, 0, 0}; };
            machine.g = [](std::size_t, Mode, double t, const auto&) { return 1 - t; };
            machine.r = [&](std::size_t i, Mode m, double, auto& x) {
                resets[order[i]](x);
                return m;
            };
            const auto run = integrate(machine, x0, {.t_end = 1.5, .step = 1}, FixedStep<Rk4>{});
            runs.emplace_back(run.outcome, run.outcome == Outcome::reached_end ? run.x : x0);
            if (k >= 1000) continue;
            EventMonitor monitor(machine, Array<4>{});
            const auto host = test::drive(machine, monitor, x0, 1.5, 0.7);
            runs.emplace_back(host.outcome, host.outcome == Outcome::reached_end ? host.x : x0);
            ++in_hosts;
        } while (std::next_permutation(order.begin(), order.end()));

        for (const auto& run : runs) ASSERT_EQ(run, runs[0]) << k;
        const bool one_meaning =
            std::all_of(ends.begin(), ends.end(), [&](const auto& end) { return end == ends[0]; });
        with_one_meaning += one_meaning;
        conflicts += runs[0].first == Outcome::conflicting_resets;
        if (!one_meaning) continue;
        ASSERT_EQ(runs[0].first, Outcome::reached_end) << k;
        ASSERT_EQ(runs[0].second, ends[0]) << k;
    }
    EXPECT_GT(in_hosts, 5000);
    EXPECT_GT(with_one_meaning, 5000);
    EXPECT_GT(conflicts, 1000);
}

TEST(Meaning, AddedDosesDecayAsTheyShould)
{
    Machine<Array<1>> drug;
    drug.guard_count_ = 2;
    drug.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt[0] = -x[0]; };
    drug.g = [](std::size_t, Mode, double t, const auto&) { return 2.95 - t; };
    drug.r = [](std::size_t, Mode m, double, auto& x) {
        x[0] += 2;
        return m;
    };
    const double expected = std::exp(-10.0) + 4 * std::exp(-7.05);
    by_all(drug, Array<1>{1}, {.t_end = 10, .rtol = 1e-11, .atol = 1e-13},
           [&](const auto& run, const std::string& label) {
               EXPECT_NEAR(run.x[0], expected, 1e-9) << label;
           });

    Ticking<Array<1>> timed;
    static_cast<Machine<Array<1>>&>(timed) = drug;
    timed.guard_count_ = 1;
    timed.ticks = {2.95};
    timed.tick = [](Mode m, double, auto& x) {
        x[0] += 2;
        return m;
    };
    by_all(timed, Array<1>{1}, {.t_end = 10, .rtol = 1e-11, .atol = 1e-13},
           [&](const auto& run, const std::string& label) {
               EXPECT_NEAR(run.x[0], expected, 1e-9) << label;
           });
}

TEST(Meaning, CoincidentFloorsStrikeOnceAndUnequalOnesConflict)
{
    const auto ball = [](std::array<double, 2> restitution) {
        Machine<Array<3>> machine;
        machine.guard_count_ = 2;
        machine.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[1], -2, 0}; };
        machine.g = [](std::size_t, Mode, double, const auto& x) { return x[0]; };
        machine.r = [restitution](std::size_t i, Mode m, double, auto& x) {
            x[0] = 0;
            x[1] *= -restitution[i];
            x[2] += 1;
            return m;
        };
        return machine;
    };
    by_all(ball({0.5, 0.5}), Array<3>{1, 0, 0}, {.t_end = 1.5},
           [](const auto& run, const std::string& label) {
               ASSERT_EQ(run.events.size(), 2U) << label;
               EXPECT_NEAR(run.events[0].t, 1, 1e-14) << label;
               EXPECT_NEAR(run.events[0].after[1], 1, 1e-13) << label;
               EXPECT_EQ(run.x[2], 2) << label;
           });
    for (const auto& e : {std::array{0.5, 0.8}, std::array{0.8, 0.5}}) {
        by_all(ball(e), Array<3>{1, 0, 0}, {.t_end = 1.5},
               [](const auto& run, const std::string& label) {
                   EXPECT_EQ(run.outcome, Outcome::conflicting_resets) << label;
                   EXPECT_NEAR(run.t, 1, 1e-14) << label;
               });
    }
}

/// A point in the plane that meets two elastic walls through the origin at once.
Machine<Array<4>> corner(std::array<std::array<double, 2>, 2> normals)
{
    Machine<Array<4>> machine;
    machine.guard_count_ = 2;
    machine.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[2], x[3], 0, 0}; };
    machine.g = [normals](std::size_t i, Mode, double, const auto& x) {
        return normals[i][0] * x[0] + normals[i][1] * x[1];
    };
    machine.r = [normals](std::size_t i, Mode m, double, auto& x) {
        const auto [a, b] = normals[i];
        const double speed = a * x[2] + b * x[3];
        x[2] -= 2 * speed * a;
        x[3] -= 2 * speed * b;
        return m;
    };
    return machine;
}

TEST(Meaning, ARightCornerSendsAPointBackAndAWideOneConflicts)
{
    by_all(corner({{{0.6, 0.8}, {-0.8, 0.6}}}), Array<4>{0, 1, 0, -1}, {.t_end = 2},
           [](const auto& run, const std::string& label) {
               EXPECT_EQ(run.outcome, Outcome::reached_end) << label;
               EXPECT_NEAR(run.x[0], 0, 1e-13) << label;
               EXPECT_NEAR(run.x[1], 1, 1e-13) << label;
           });
    const double a = std::sqrt(3.0) / 2;
    by_all(corner({{{a, 0.5}, {-a, 0.5}}}), Array<4>{0, 1, 0, -1}, {.t_end = 2},
           [](const auto& run, const std::string& label) {
               EXPECT_EQ(run.outcome, Outcome::conflicting_resets) << label;
               EXPECT_NEAR(run.t, 1, 1e-14) << label;
           });
}

TEST(Meaning, BitsOfTheModeAreSetTogether)
{
    Machine<Array<2>> machine;
    machine.guard_count_ = 2;
    machine.f = [](Mode, double, const auto&, auto& dxdt) { dxdt = {1, 1}; };
    machine.g = [](std::size_t i, Mode, double, const auto& x) { return 1 - x[i]; };
    machine.on = [](std::size_t i, Mode m) { return (m >> i & 1) == 0; };
    machine.r = [](std::size_t i, Mode m, double, auto&) { return m | Mode{1} << i; };
    by_all(machine, Array<2>{0, 0}, {.t_end = 2}, [](const auto& run, const std::string& label) {
        EXPECT_EQ(run.outcome, Outcome::reached_end) << label;
        EXPECT_EQ(run.mode, 3U) << label;
    });
    machine.on = [](std::size_t, Mode m) { return m == 0; };
    machine.r = [](std::size_t i, Mode, double, auto&) { return static_cast<Mode>(i + 1); };
    const auto run = integrate(machine, Array<2>{0, 0}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::conflicting_resets);
}

// --- a mode that is left at once ---

TEST(Meaning, ARelayIsReportedAndNotPassedOver)
{
    const auto relay = [](double sign) {
        Machine<Array<1>> machine;
        machine.f = [sign](Mode m, double, const auto&, auto& dxdt) {
            dxdt[0] = sign * (m ? 1 : -1);
        };
        machine.g = [sign](std::size_t, Mode m, double, const auto& x) {
            return sign * (m ? -x[0] : x[0]);
        };
        machine.r = [](std::size_t, Mode m, double, auto&) -> Mode { return 1 - m; };
        return machine;
    };
    for (const double sign : {1.0, -1.0}) {
        by_all(relay(sign), Array<1>{sign}, {.t_end = 3},
               [](const auto& run, const std::string& label) {
                   EXPECT_EQ(run.outcome, Outcome::endless_cascade) << label;
                   EXPECT_NEAR(run.t, 1, 1e-14) << label;
                   EXPECT_LE(run.events.size(), 8U) << label;
               });
    }
    // With two guards, and no word about which is enabled.
    Machine<Array<1>> two = relay(1);
    two.guard_count_ = 2;
    two.g = [](std::size_t i, Mode, double, const auto& x) { return i == 0 ? x[0] : -x[0]; };
    two.r = [](std::size_t i, Mode, double, auto&) -> Mode { return i == 0 ? 1 : 0; };
    by_all(two, Array<1>{1}, {.t_end = 3}, [](const auto& run, const std::string& label) {
        EXPECT_EQ(run.outcome, Outcome::endless_cascade) << label;
        EXPECT_NEAR(run.t, 1, 1e-14) << label;
    });
}

TEST(Meaning, ASignInTheStateIsAModeToo)
{
    Machine<Array<2>> machine;
    machine.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt = {-x[1], 0}; };
    machine.g = [](std::size_t, Mode, double, const auto& x) { return x[1] * x[0]; };
    machine.r = [](std::size_t, Mode m, double, auto& x) {
        x[1] = -x[1];
        return m;
    };
    by_all(machine, Array<2>{1, 1}, {.t_end = 3}, [](const auto& run, const std::string& label) {
        EXPECT_EQ(run.outcome, Outcome::endless_cascade) << label;
        EXPECT_NEAR(run.t, 1, 1e-14) << label;
    });
}

TEST(Meaning, ACrossingThatGoesOnInTheNextModeIsOneEvent)
{
    Machine<Array<1>> machine;
    machine.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = -1; };
    machine.g = [](std::size_t, Mode, double, const auto& x) { return x[0] - 1; };
    machine.r = [](std::size_t, Mode m, double, auto&) { return m + 1; };
    by_all(machine, Array<1>{3}, {.t_end = 5}, [](const auto& run, const std::string& label) {
        EXPECT_EQ(run.events.size(), 1U) << label;
        EXPECT_EQ(run.mode, 1U) << label;
        EXPECT_NEAR(run.x[0], -2, 1e-12) << label;
    });
}

TEST(Meaning, AModeThatTakesNoTimeIsPassed)
{
    Machine<Array<1>> machine;
    machine.f = [](Mode m, double, const auto&, auto& dxdt) { dxdt[0] = m == 1 ? 1 : -1; };
    machine.g = [](std::size_t, Mode m, double, const auto& x) { return m == 0 ? x[0] : -x[0]; };
    machine.r = [](std::size_t, Mode m, double, auto&) { return m + 1; };
    by_all(machine, Array<1>{1}, {.t_end = 3}, [](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 2U) << label;
        EXPECT_NEAR(run.events[0].t, 1, 1e-14) << label;
        EXPECT_NEAR(run.events[1].t, 1, 1e-14) << label;
        EXPECT_EQ(run.mode, 2U) << label;
    });
}

TEST(Meaning, ATickThatStartsAMotionIntoASurfaceHasItsEvent)
{
    for (const bool says : {false, true}) {
        Ticking<Array<1>> machine;
        machine.ticks = {1};
        machine.tick = [](Mode, double, auto&) -> Mode { return 1; };
        machine.f = [](Mode m, double, const auto&, auto& dxdt) { dxdt[0] = m ? -1 : 0; };
        machine.g = [](std::size_t, Mode, double, const auto& x) { return x[0]; };
        machine.r = [](std::size_t, Mode, double, auto&) -> Mode { return 0; };
        if (says) machine.on = [](std::size_t, Mode m) { return m == 1; };
        by_all(machine, Array<1>{0}, {.t_end = 3}, [&](const auto& run, const std::string& label) {
            EXPECT_EQ(run.events.size(), 2U) << label << says;
            EXPECT_EQ(run.x[0], 0) << label << says;
            EXPECT_EQ(run.mode, 0U) << label << says;
        });
    }
}

/// x' = v + pull(t), v' = 0 from x = 0 and v = 0 at a guard x that sets v to zero.
Ticking<Array<2>> stopped_at_zero(double* pull)
{
    Ticking<Array<2>> machine;
    machine.mode_count_ = 1;
    machine.ticks = {1};
    machine.f = [pull](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[1] + *pull, 0}; };
    machine.g = [](std::size_t, Mode, double, const auto& x) { return x[0]; };
    machine.r = [pull](std::size_t, Mode, double, auto& x) -> Mode {
        x[1] = *pull = 0;
        return 0;
    };
    return machine;
}

TEST(Meaning, ATickThatMovesAStandingGuardOutwardInTheSameModeHasItsEvent)
{
    double pull = 0;
    auto by_state = stopped_at_zero(&pull);
    by_state.tick = [](Mode m, double, auto& x) {
        x[1] = -1;
        return m;
    };
    auto by_flow = stopped_at_zero(&pull);
    by_flow.tick = [&](Mode m, double, auto&) {
        pull = -1;
        return m;
    };
    auto by_time = stopped_at_zero(&pull);
    by_time.f = [](Mode, double t, const auto& x, auto& dxdt) {
        dxdt = {x[1] - (t > 1 && t <= 2 ? 1 : 0), 0};
    };
    by_time.r = [](std::size_t, Mode, double, auto& x) -> Mode {
        x[1] = 1;
        return 0;
    };
    by_time.ticks = {1, 2};
    for (const auto* machine : {&by_state, &by_flow, &by_time}) {
        pull = 0;
        by_all(*machine, Array<2>{0, 0}, {.t_end = 1.5},
               [&](const auto& run, const std::string& label) {
                   ASSERT_EQ(run.events.size(), 2U) << label;
                   EXPECT_EQ(run.events[1].t, 1) << label;
                   EXPECT_EQ(run.events[1].guard, 0U) << label;
                   EXPECT_EQ(run.x[0], 0) << label;
                   pull = 0;
               });
    }
}

TEST(Meaning, ATickThatDoesNothingToAGuardOnItsSurfaceHasNoEventOfIt)
{
    // It stays where it is, is lifted, goes on outward from a crossing before, or touches from
    // beyond its surface, as x - (t - 1)^2 does.
    const auto expect = [](int events, Array<2> x0, double bend, double kick) {
        Ticking<Array<2>> machine;
        machine.mode_count_ = 1;
        machine.ticks = {1};
        machine.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[1], 0}; };
        machine.g = [=](std::size_t, Mode, double t, const auto& x) {
            return x[0] - bend * (t - 1) * (t - 1);
        };
        machine.r = [](std::size_t, Mode m, double, auto& x) {
            x[1] -= 1e-3;
            return m;
        };
        machine.tick = [=](Mode m, double, auto& x) {
            x[1] += kick;
            return m;
        };
        by_all(machine, x0, {.t_end = 1.5}, [&](const auto& run, const std::string& label) {
            const auto crossings =
                std::count_if(run.events.begin(), run.events.end(),
                              [](const auto& event) { return event.kind == EventKind::crossing; });
            EXPECT_EQ(crossings, events) << label << ' ' << x0[0] << ' ' << bend << ' ' << kick;
        });
    };
    expect(0, {0, 0}, 0, 0);
    expect(0, {0, 0}, 0, 1);
    expect(0, {0, 0}, 1, 0);
    expect(0, {0, 0}, 1, -0.1);
    expect(1, {0.5, -0.5}, 0, -1);
}

TEST(Meaning, AHostsTickThatMovesAStandingGuardOutwardHasItsEvent)
{
    double pull = 0;
    auto machine = stopped_at_zero(&pull);
    machine.tick = [](Mode m, double, auto& x) {
        x[1] = -1;
        return m;
    };
    EventMonitor monitor(machine, Array<2>{});
    const auto host = test::drive(machine, monitor, Array<2>{0, 0}, 1.5, 0.1);
    ASSERT_EQ(host.events.size(), 2U);
    EXPECT_EQ(host.events[1].t, 1);
    EXPECT_EQ(host.x[0], 0);
}

/// A cart x' = v + pull that stands at the guard x, whose reset stops it, and a clock y' = 1 that
/// sets it in motion once a second, by its velocity or by the pull; no modes.
struct PushedCart {
    using State = Array<3>;  // x, v, y
    std::size_t guard_count = 2;
    double* pull;
    bool by_state = true;
    double push = -1;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1] + *pull, 0, 1}; }
    [[nodiscard]] static double guard(std::size_t i, double, const State& x)
    {
        return i == 0 ? x[0] : 1 - x[2];
    }
    void reset(std::size_t i, double, State& x) const
    {
        if (i == 0) {
            x[1] = *pull = 0;
        } else {
            (by_state ? x[1] : *pull) = push;
            x[2] = 0;
        }
    }
};

TEST(Meaning, AnotherGuardThatMovesAStandingOneOutwardGivesItItsEvent)
{
    for (const bool by_state : {true, false}) {
        double pull = 0;
        const PushedCart cart{.pull = &pull, .by_state = by_state};
        by_all(cart, Array<3>{0, 0, 0}, {.t_end = 3.5},
               [&](const auto& run, const std::string& label) {
                   ASSERT_EQ(run.events.size(), 6U) << label << by_state;
                   for (std::size_t k = 0; k < 6; ++k) {
                       EXPECT_EQ(run.events[k].guard, 1 - k % 2) << label;
                       EXPECT_NEAR(run.events[k].t, 1 + static_cast<double>(k / 2), 1e-13) << label;
                   }
                   EXPECT_EQ(run.x[0], 0) << label << by_state;
                   pull = 0;
               });
    }
}

TEST(Meaning, AnotherGuardThatLiftsAStandingOneOrLeavesItAloneGivesItNoEvent)
{
    double pull = 0;
    for (const double push : {0.0, 0.25}) {
        const PushedCart cart{.pull = &pull, .push = push};
        by_all(cart, Array<3>{0, 0, 0}, {.t_end = 2.5},
               [&](const auto& run, const std::string& label) {
                   EXPECT_EQ(run.events.size(), 2U) << label << push;
                   EXPECT_NEAR(run.x[0], 1.5 * push, 1e-13) << label;
               });
    }
}

TEST(Meaning, AHostsGuardThatAnotherOneMovesOutwardHasItsEvent)
{
    double pull = 0;
    const PushedCart cart{.pull = &pull};
    EventMonitor monitor(cart, Array<3>{});
    const auto host = test::drive(cart, monitor, Array<3>{0, 0, 0}, 3.5, 0.1);
    EXPECT_EQ(host.events.size(), 6U);
    EXPECT_EQ(host.x[0], 0);
}

/// x = 0, which a tick, or the guard of the clock y' = 1, sets in motion at 1: by the velocity v,
/// or by a mode whose flow adds `push`. Guard 0 is x.
struct SetInMotion {
    using State = Array<3>;  // x, v, y
    std::size_t guard_count = 2;
    std::size_t mode_count = 2;
    GuardInfo info{};
    double push;
    bool by_tick, by_mode;
    Times time_events{by_tick ? 1.0 : 9.0};

    void flow(Mode mode, double, const State& x, State& dxdt) const
    {
        dxdt = {x[1] + (mode == 1 ? push : 0), 0, 1};
    }
    [[nodiscard]] double guard(std::size_t i, Mode, double, const State& x) const
    {
        return i == 0 ? x[0] : by_tick ? 1 : 1 - x[2];
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return i == 0 ? info : GuardInfo{}; }
    Mode time_reset(Mode mode, double, State& x) const
    {
        if (!by_mode) x[1] = push;
        return by_mode ? 1 : mode;
    }
    Mode reset(std::size_t i, Mode mode, double t, State& x) const
    {
        if (i == 1) return time_reset(mode, t, x);
        x[1] = mode == 1 ? -push : 0;  // it stops
        return mode;
    }
};

TEST(Meaning, AGuardThatIsSetInMotionHasItsEventWhateverItDoesAndWhicheverDirectionCounts)
{
    const auto expect = [](const SetInMotion& system, std::size_t events, const char* what) {
        const std::string which = std::string(what) + (system.by_tick ? " tick" : " guard") +
                                  (system.by_mode ? " mode " : " state ") +
                                  std::to_string(system.push) + " crossing " +
                                  std::to_string(static_cast<int>(system.info.crossing));
        const auto check = [&](const auto& run, const std::string& label) {
            std::size_t found = 0;
            for (const auto& event : run.events) {
                if (event.guard != 0) continue;
                ++found;
                EXPECT_NEAR(event.t, 1, 1e-13) << label << which;
                EXPECT_EQ(event.kind, EventKind::crossing) << label << which;
            }
            EXPECT_EQ(found, events) << label << which;
        };
        by_all(system, Array<3>{0, 0, 0}, {.t_end = 3}, check);
        EventMonitor monitor(system, Array<3>{});
        check(test::drive(system, monitor, Array<3>{0, 0, 0}, 3, 0.1), "host ");
    };
    for (const bool by_tick : {true, false}) {
        for (const bool by_mode : {true, false}) {
            for (const double push : {-1.0, 1.0}) {
                for (const Crossing crossing :
                     {Crossing::falling, Crossing::rising, Crossing::either}) {
                    const bool counts = crossing == Crossing::either ||
                                        (crossing == Crossing::falling) == (push < 0);
                    SetInMotion system{.push = push, .by_tick = by_tick, .by_mode = by_mode};
                    system.info = {.crossing = crossing};
                    expect(system, counts, "reset");
                    system.info = {.crossing = crossing, .resets = false};
                    expect(system, counts, "recorded");
                    system.info = {.crossing = crossing, .resets = false, .stop_after = 1};
                    expect(system, counts, "terminal");
                }
            }
        }
    }
}

TEST(Meaning, BallsThatTouchPassAStrokeOnAtOneInstant)
{
    // Three equal balls in a row, the second and the third in contact at exactly zero. Each contact
    // exchanges velocities: after the stroke at 1 only the third moves.
    struct Cradle {
        using State = Array<6>;  // places of surfaces that face each other, then velocities
        std::size_t guard_count = 2;
        static void flow(double, const State& x, State& dxdt)
        {
            dxdt = {x[3], x[4], x[5], 0, 0, 0};
        }
        [[nodiscard]] static double guard(std::size_t i, double, const State& x)
        {
            return x[i + 1] - x[i];
        }
        static void reset(std::size_t i, double, State& x) { std::swap(x[i + 3], x[i + 4]); }
    };
    by_all(Cradle{}, Array<6>{-1, 0, 0, 1, 0, 0}, {.t_end = 3},
           [](const auto& run, const std::string& label) {
               ASSERT_EQ(run.events.size(), 2U) << label;
               EXPECT_EQ(run.events[1].guard, 1U) << label;
               EXPECT_EQ(run.events[1].t, run.events[0].t) << label;
               EXPECT_NEAR(run.x[0], 0, 1e-13) << label;
               EXPECT_NEAR(run.x[1], 0, 1e-13) << label;
               EXPECT_NEAR(run.x[2], 2, 1e-13) << label;
           });
}

TEST(Meaning, AResetThatLetsACrossingOfItsInstantGoOnAddsNoEventToIt)
{
    // The guard x stops the motion, and a guard of its velocity lets it go on at 0.3.
    struct Passing {
        using State = Array<2>;
        std::size_t guard_count = 2;
        static void flow(double, const State& x, State& dxdt) { dxdt = {x[1], 0}; }
        [[nodiscard]] static double guard(std::size_t i, double, const State& x)
        {
            return i == 0 ? x[0] : -x[1] - 0.25;
        }
        static void reset(std::size_t i, double, State& x) { x[1] = i == 0 ? 0 : -0.3; }
    };
    by_all(Passing{}, Array<2>{0.5, -0.5}, {.t_end = 2},
           [](const auto& run, const std::string& label) {
               ASSERT_EQ(run.events.size(), 2U) << label;
               EXPECT_EQ(run.events[0].guard, 0U) << label;
               EXPECT_EQ(run.events[1].guard, 1U) << label;
               EXPECT_NEAR(run.x[0], -0.3, 1e-13) << label;
           });
}

TEST(Meaning, ATriangleWaveAndAStaircaseOfModesHaveEveryEvent)
{
    Machine<Array<1>> wave;
    wave.f = [](Mode m, double, const auto&, auto& dxdt) { dxdt[0] = m ? 1 : -1; };
    wave.g = [](std::size_t, Mode m, double, const auto& x) { return m ? 1 - x[0] : x[0]; };
    wave.r = [](std::size_t, Mode m, double, auto&) -> Mode { return 1 - m; };
    by_all(wave, Array<1>{0.5}, {.t_end = 4}, [](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 4U) << label;
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_NEAR(run.events[k].t, 0.5 + static_cast<double>(k), 1e-14) << label;
        }
    });
    Machine<Array<1>> stairs;
    stairs.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = -1; };
    stairs.g = [](std::size_t, Mode m, double, const auto& x) {
        return x[0] - std::array{1.0, 0.5, 0.0}[m];
    };
    stairs.r = [](std::size_t, Mode m, double, auto&) { return m + 1; };
    stairs.on = [](std::size_t, Mode m) { return m < 3; };
    by_all(stairs, Array<1>{2}, {.t_end = 3}, [](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 3U) << label;
        EXPECT_NEAR(run.events[1].t, 1.5, 1e-14) << label;
        EXPECT_NEAR(run.events[2].t, 2, 1e-14) << label;
        EXPECT_EQ(run.mode, 3U) << label;
    });
}

TEST(Meaning, FrictionAsAnAutomatonWithOneGuardIsReported)
{
    // The block stops at t = 1; either direction of sliding is left where it begins.
    Machine<Array<1>> block;
    block.f = [](Mode m, double, const auto&, auto& dxdt) { dxdt[0] = m == 0 ? -1 : 1; };
    block.g = [](std::size_t, Mode m, double, const auto& x) { return m == 0 ? x[0] : -x[0]; };
    block.r = [](std::size_t, Mode m, double, auto&) -> Mode { return 1 - m; };
    by_all(block, Array<1>{1}, {.t_end = 3}, [](const auto& run, const std::string& label) {
        EXPECT_EQ(run.outcome, Outcome::endless_cascade) << label;
        EXPECT_NEAR(run.t, 1, 1e-14) << label;
    });
}

TEST(Meaning, AReleaseWhoseForceIsZeroLeavesByItsJerk)
{
    // A block rests on an inclined seat until the load has grown to its weight; then x, x', x'' are
    // zero, and the derivative of the load decides.
    for (const double side : {0.25, -0.25}) {
        Machine<Array<2>> block;
        block.f = [side](Mode m, double t, const auto& x, auto& dxdt) {
            if (m == 0) {
                dxdt = {0, 0};
                return;
            }
            const double s = m == 1 ? side : -side;
            dxdt = {x[1], -std::sin(s - x[0]) + 0.625 * std::sin(t) * std::cos(s - x[0])};
        };
        block.guard_count_ = 3;
        block.on = [](std::size_t i, Mode m) { return i == m; };
        block.g = [](std::size_t i, Mode, double t, const auto& x) {
            return i == 0 ? std::tan(0.25) - 0.625 * std::sin(t) : i == 1 ? x[0] : -x[0];
        };
        block.r = [](std::size_t i, Mode m, double, auto& x) -> Mode {
            if (i == 0) return 1;
            x[1] *= 0.9;
            return 3 - m;
        };
        if (side < 0) continue;
        by_all(block, Array<2>{0, 0}, {.t_end = 1.5},
               [](const auto& run, const std::string& label) {
                   EXPECT_EQ(run.outcome, Outcome::reached_end) << label;
                   EXPECT_EQ(run.events.size(), 1U) << label;
                   EXPECT_EQ(run.mode, 1U) << label;
                   EXPECT_GT(run.x[0], 0) << label;
               });
    }
}

// --- rounding ---

template <class X>
void expect_clock_without_drift(const X& x0)
{
    Machine<X> machine;
    machine.f = [](Mode, double, const auto&, auto& dxdt) {
        dxdt[0] = 1;
        dxdt[1] = 0;
    };
    machine.g = [](std::size_t, Mode, double, const auto& x) { return 0.1 * x[1] - x[0]; };
    machine.r = [](std::size_t, Mode m, double, auto& x) {
        x[1] += 1;
        return m;
    };
    const auto check = [](const auto& run, std::size_t count, const std::string& label) {
        ASSERT_EQ(run.events.size(), count) << label;
        double worst = 0;
        for (std::size_t k = 0; k < count; ++k) {
            const double t = 0.1 * static_cast<double>(k + 1);
            const double ulp = std::nextafter(t, 1e9) - t;
            worst = std::max(worst, std::fabs(run.events[k].t - t) / ulp);
        }
        EXPECT_LE(worst, 2) << label;
    };
    check(integrate(machine, x0, {.t_end = 10000.05}), 100'000, "dopri5");
    by_all(machine, x0, {.t_end = 500.05},
           [&](const auto& run, const std::string& label) { check(run, 5000, label); });
}

TEST(Meaning, TimeDoesNotDriftWhereTheStateIsLeftAlone)
{
    // x' = 1, with an event wherever x has grown by another 0.1: event k at k 0.1, in which the
    // product, the level and the time are each rounded once.
    expect_clock_without_drift(Array<2>{0, 1});
    expect_clock_without_drift(std::vector<double>{0, 1});
}

TEST(Meaning, AResetThatDeclinesOnItsSurfaceIsAskedBeyondIt)
{
    Machine<Array<1>> machine;
    int calls = 0;
    machine.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = -1; };
    machine.g = [](std::size_t, Mode, double, const auto& x) { return x[0]; };
    machine.r = [&calls](std::size_t, Mode m, double, auto& x) -> Mode {
        ++calls;
        return x[0] < 0 ? 7 : m;
    };
    by_all(machine, Array<1>{1}, {.t_end = 2}, [&](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 1U) << label;
        EXPECT_NEAR(run.events[0].t, 1, 2e-15) << label;
        EXPECT_EQ(run.mode, 7U) << label;
        EXPECT_EQ(run.statistics.ineffective_resets, 0U) << label;
        EXPECT_LE(std::exchange(calls, 0), 2) << label;
    });
    machine.r = [](std::size_t, Mode m, double, auto&) { return m; };
    by_all(machine, Array<1>{1}, {.t_end = 2}, [&](const auto& run, const std::string& label) {
        EXPECT_EQ(run.events.size(), 1U) << label;
        EXPECT_EQ(run.statistics.ineffective_resets, 1U) << label;
        EXPECT_EQ(run.statistics.declined_guard, 0U) << label;
        const std::vector<std::string> names{"floor"};
        EXPECT_EQ(describe(run.statistics, names)
                      .find("1 resets changed nothing, the last that "
                            "of floor, which left"),
                  0U)
            << describe(run.statistics, names);
    });
}

TEST(Meaning, ARelayOfAGuardWithEitherIsCountedAndNamed)
{
    // x' = -1 from 1 meets its surface at 1, where the other mode turns it back: no event follows.
    Machine<Array<1>> machine;
    machine.info = {.crossing = Crossing::either};
    machine.f = [](Mode m, double, const auto&, auto& dxdt) { dxdt[0] = m == 0 ? -1 : 1; };
    machine.g = [](std::size_t, Mode, double, const auto& x) { return x[0]; };
    machine.r = [](std::size_t, Mode m, double, auto&) -> Mode { return 1 - m; };
    by_all(machine, Array<1>{1}, {.t_end = 3}, [&](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 1U) << label;
        EXPECT_NEAR(run.x[0], 2, 1e-14) << label;
        EXPECT_EQ(run.statistics.either_relays, 1U) << label;
        EXPECT_EQ(run.statistics.relay_guard, 0U) << label;
        EXPECT_NE(describe(run.statistics)
                      .find("the last time at guard 0; give the guard a "
                            "direction"),
                  std::string::npos)
            << describe(run.statistics);
    });
    // A crossing that goes on in the other mode, and one after which the same mode goes on.
    machine.f = [](Mode m, double, const auto&, auto& dxdt) { dxdt[0] = m == 0 ? -1 : -2; };
    by_all(machine, Array<1>{1}, {.t_end = 3}, [&](const auto& run, const std::string& label) {
        ASSERT_EQ(run.events.size(), 1U) << label;
        EXPECT_EQ(run.statistics.either_relays, 0U) << label;
        EXPECT_EQ(run.statistics.relay_guard, no_guard) << label;
        EXPECT_EQ(describe(run.statistics), "") << label;
    });
}

// --- vetoes ---

/// A parabola that touches its surface at t = 1 and crosses it where it is shifted down.
struct Vetoed {
    using State = Array<1>;
    static constexpr bool resets = false;
    double until = 2;

    void flow(double t, const State&, State& dxdt) const { dxdt[0] = 2 * (t - 1); }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    [[nodiscard]] bool enabled(double t, const State&) const { return t > until; }
    [[nodiscard]] GuardInfo guard_info() const { return {.resets = false, .touch = 1e-12}; }
};

TEST(Meaning, ATouchOfADisabledGuardIsCountedAndNotRecorded)
{
    for (const double until : {0.0, 1.5}) {
        const Vetoed system{.until = until};
        by_all(system, Array<1>{1}, {.t_end = 1.75},
               [&](const auto& run, const std::string& label) {
                   if (label.ends_with("ends")) return;  // which does not look for touches
                   EXPECT_EQ(run.events.size(), until == 0 ? 1U : 0U) << label;
                   EXPECT_EQ(run.statistics.disabled, until == 0 ? 0U : 1U) << label;
                   if (until == 0) {
                       EXPECT_EQ(run.events[0].kind, EventKind::touch) << label;
                   }
               });
    }
}

// --- modes that have been left ---

/// A motion that changes its mode at guard 0, beside guards that are only recorded: their crossings
/// lie before the events, on them, or touch. Counts the calls in another mode than the present one.
struct Leaving {
    using State = Array<2>;
    static constexpr std::size_t guard_count = 5, mode_count = 2;
    Mode* now;
    int* late;

    void see(Mode m) const { *late += m != *now; }
    void flow(Mode m, double t, const State& x, State& dxdt) const
    {
        see(m);
        dxdt = {m == 1 ? x[1] : 0.1 * std::sin(t) - 1, m == 1 ? -1 : 0.3 * std::cos(3 * t)};
    }
    [[nodiscard]] double guard(std::size_t i, Mode m, double t, const State& x) const
    {
        see(m);
        switch (i) {
            case 0: return m == 1 ? x[0] - 0.2 : x[0];
            case 1: return x[0] - 0.05;
            case 2: return x[0] * (1 + 0.1 * x[0]);
            case 3: return x[1] - 0.1;
            default: return 1 - std::cos(4 * std::numbers::pi * t);
        }
    }
    [[nodiscard]] bool enabled(std::size_t, Mode m, double, const State&) const
    {
        see(m);
        return true;
    }
    Mode reset(std::size_t, Mode m, double, State& x) const
    {
        see(m);
        x = m == 0 ? State{0.2, 1} : State{0.5, 0.1};
        return *now = 1 - m;
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return 0.35 * (std::floor(t / 0.35 + 1e-9) + 1);
    }
    Mode time_reset(Mode m, double, State&) const { return m; }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const
    {
        return {.crossing = i == 0 ? Crossing::falling : Crossing::either, .resets = i == 0};
    }
};

/// The same with a bound on how fast its guards change.
struct BoundedLeaving : Leaving {
    [[nodiscard]] double speed_bound(std::size_t, Mode, double, const State&) const { return 40; }
};

TEST(Meaning, NoFunctionIsCalledInAModeThatHasBeenLeft)
{
    Mode now = 0;
    int late = 0;
    const auto expect_none = [&](const auto& run, const std::string& label) {
        EXPECT_EQ(std::exchange(late, 0), 0) << label;
        EXPECT_EQ(run.outcome, Outcome::reached_end) << label;
        EXPECT_GT(run.events.size(), 100U) << label;
        now = 0;
    };
    const Leaving leaving{&now, &late};
    const Leaving::State x0{0.5, 0.1};
    by_all(leaving, x0, {.t_end = 30}, expect_none);
    expect_none(
        integrate(leaving, x0, {.t_end = 30, .record_steps = true}, ErrorControlled<Fehlberg78>{}),
        "recorded steps");
    const BoundedLeaving bounded{{&now, &late}};
    expect_none(
        integrate(bounded, x0, {.t_end = 30}, ErrorControlled<Dopri5>{}, Planned<Extremum>{}),
        "planned");
    EventMonitor monitor(leaving, Leaving::State{});
    expect_none(test::drive(leaving, monitor, x0, 30, 0.05), "host");
}

TEST(Meaning, NoFunctionIsCalledInAModeThatHasBeenLeftByAnEventOfACycle)
{
    // Two tanks, whose events accumulate at t = 2: 20 is where a level has a rounding.
    Mode now = 0;
    int late = 0;
    Machine<Array<2>> tanks;
    tanks.guard_count_ = tanks.mode_count_ = 2;
    tanks.f = [&](Mode m, double, const auto&, auto& dxdt) {
        late += m != now;
        dxdt = {m == 0 ? 2.0 : -2.0, m == 1 ? 1.0 : -3.0};
    };
    tanks.g = [&](std::size_t i, Mode m, double, const auto& x) {
        late += m != now;
        return x[i] - 20;
    };
    tanks.r = [&](std::size_t i, Mode m, double, auto& x) -> Mode {
        late += m != now;
        x[i] = 20;
        return now = static_cast<Mode>(i);
    };
    by_all(tanks, Array<2>{21, 21}, {.t_end = 3}, [&](const auto& run, const std::string& label) {
        EXPECT_EQ(run.outcome, Outcome::zeno) << label;
        EXPECT_NEAR(run.t, 2, 1e-11) << label;
        EXPECT_EQ(std::exchange(late, 0), 0) << label;
        now = 0;
    });
}

TEST(Meaning, EachEventCallsItsResetOnce)
{
    struct Waves {
        using State = Array<1>;
        int* calls;
        static void flow(double, const State&, State& dxdt) { dxdt = {1}; }
        [[nodiscard]] static double guard(double, const State& x) { return std::sin(x[0]); }
        void reset(double, State&) const { ++*calls; }
    };
    int calls = 0;
    // Steps of 1, so that the signs at their ends show every crossing, too.
    by_all(Waves{&calls}, Array<1>{0.5}, {.t_end = 100, .h_max = 1},
           [&](const auto& run, const std::string& label) {
               EXPECT_EQ(run.events.size(), 16U) << label;
               EXPECT_EQ(std::exchange(calls, 0), 16) << label;
           });
}

TEST(Meaning, ACreepingStateSatisfiesItsConditionAtItsEvent)
{
    // 4 units in the last place of 1 at a rate of 1e-15: the event lies within the rounding of x
    // over its rate of 0.888.
    struct Creeping {
        using State = Array<1>;
        static void flow(double, const State&, State& dxdt) { dxdt = {-1e-15}; }
        [[nodiscard]] static double guard(double, const State& x) { return x[0] - 1; }
        static void reset(double, State&) {}
    };
    by_all(Creeping{}, Array<1>{1 + 0x1p-50}, {.t_end = 4},
           [](const auto& run, const std::string& label) {
               ASSERT_EQ(run.events.size(), 1U) << label;
               EXPECT_NEAR(run.events[0].t, 0.888, 0.2) << label;
               EXPECT_LE(run.events[0].before[0], 1) << label;
           });
}

// --- runs that follow each other ---

TEST(Meaning, ARunThatStartsBeforeItsSurfaceByARoundingHasItsEvent)
{
    Machine<Array<1>> ramp;
    ramp.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = 1; };
    ramp.g = [](std::size_t, Mode, double, const auto& x) { return 1 - x[0]; };
    ramp.r = [](std::size_t, Mode, double, auto&) -> Mode { return 1; };
    ramp.on = [](std::size_t, Mode m) { return m == 0; };
    by_all(ramp, Array<1>{1 - 0x1p-53}, {.t_end = 1},
           [](const auto& run, const std::string& label) {
               EXPECT_EQ(run.events.size(), 1U) << label;
           });
}

TEST(Meaning, RunsThatFollowEachOtherLoseAndDoubleNothing)
{
    // x' = 0.07 in runs of one second each: the surfaces 0.07 m lie at their joints, by rounding
    // before them or behind.
    Machine<Array<1>> ramp;
    ramp.guard_count_ = 399;
    ramp.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = 0.07; };
    ramp.g = [](std::size_t i, Mode, double, const auto& x) {
        return 0.07 * static_cast<double>(i + 2) - x[0];
    };
    ramp.r = [](std::size_t, Mode m, double, auto&) { return m; };
    std::vector<int> count(399);
    Array<1> x{0};
    for (int k = 0; k < 402; ++k) {
        const auto run = integrate(ramp, x, {.t_start = 1.0 * k, .t_end = 1.0 * (k + 1)});
        for (const auto& event : run.events) ++count[event.guard];
        x = run.x;
    }
    EXPECT_EQ(std::count(count.begin(), count.end(), 1), 399);
}

TEST(Meaning, ALoopOfRestartsAfterTerminalEventsEnds)
{
    // A ball whose impacts end the run, and are applied outside.
    Machine<Array<2>> ball;
    ball.f = [](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[1], -9.81}; };
    ball.g = [](std::size_t, Mode, double, const auto& x) { return x[0] - 1; };
    ball.r = [](std::size_t, Mode m, double, auto&) { return m; };
    ball.info.stop_after = 1;
    double t = 0;
    Array<2> x{3, 0};
    int restarts = 0;
    while (t < 1500) {
        const auto run = integrate(ball, x, {.t_start = t, .t_end = 1500});
        if (run.outcome == Outcome::reached_end) break;
        ASSERT_EQ(run.outcome, Outcome::stopped_by_event);
        ASSERT_LE(run.x[0], 1);
        ASSERT_GT(run.t, t);
        t = run.t;
        x = {run.x[0], -run.x[1]};
        ASSERT_LT(++restarts, 2000);
    }
    // Flights of 2 sqrt(2 * 2 / g), the first a half.
    const double flight = 2 * std::sqrt(4 / 9.81);
    EXPECT_EQ(restarts, static_cast<int>(std::floor(1500 / flight + 0.5)));
}

// --- cascades ---

/// A row of cells that each pass on more than they can hold, x_0 fed from outside.
struct Row {
    using State = std::vector<double>;
    std::size_t guard_count = 3000;

    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::rising}; }
    void flow(double, const State&, State& dxdt) const
    {
        std::fill(dxdt.begin(), dxdt.end(), 0);
        dxdt[0] = 1;
    }
    void guards(double, const State& x, std::span<double> g) const
    {
        for (std::size_t i = 0; i < x.size(); ++i) g[i] = x[i] - 1;
    }
    void guard_rates(double, const State&, const State& dxdt, std::span<double> rates) const
    {
        std::copy(dxdt.begin(), dxdt.end(), rates.begin());
    }
    void reset(std::size_t i, double, State& x) const
    {
        x[i] = 0;
        if (i + 1 < x.size()) x[i + 1] += 0.6;
    }
};

TEST(Meaning, AnAvalancheThroughThousandsOfGuardsIsLegal)
{
    const Row row;
    const auto run = integrate(row, Row::State(row.guard_count, 0.5), {.t_end = 0.75});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), row.guard_count);
    for (const auto& event : run.events) ASSERT_NEAR(event.t, 0.5, 1e-15);
    EXPECT_NEAR(run.x[0], 0.25, 1e-13);
    for (std::size_t i = 1; i < run.x.size(); ++i) ASSERT_EQ(run.x[i], 0);
}

// --- functions that change outside of the state ---

TEST(Meaning, AResetThatChangesAVariableOfTheFlowCutsTheStep)
{
    // y'' = -k y with k toggled between 1 and 4 wherever y = 0: at y = 0 the flows are equal.
    double k = 1;
    Machine<Array<2>> spring;
    spring.f = [&k](Mode, double, const auto& x, auto& dxdt) { dxdt = {x[1], -k * x[0]}; };
    spring.info.crossing = Crossing::either;
    spring.g = [](std::size_t, Mode, double, const auto& x) { return x[0]; };
    spring.r = [&k](std::size_t, Mode m, double, auto&) {
        k = k == 1 ? 4 : 1;
        return m;
    };
    // A quarter of a period at k = 1 to pi / 2, half of one at k = 4 to pi, and a quarter at k = 1,
    // at the end of which y is 1 again.
    const auto run = integrate(spring, Array<2>{1, 0},
                               {.t_end = 1.5 * std::numbers::pi, .rtol = 1e-10, .atol = 1e-12});
    EXPECT_EQ(run.events.size(), 2U);
    EXPECT_NEAR(run.x[0], 1, 1e-6);
}

TEST(Meaning, AResetThatChangesAVariableOfTheGuardCutsTheStep)
{
    double level = 1;
    Machine<Array<1>> ramp;
    ramp.f = [](Mode, double, const auto&, auto& dxdt) { dxdt[0] = 1; };
    ramp.g = [&level](std::size_t, Mode, double, const auto& x) { return level - x[0]; };
    ramp.r = [&level](std::size_t, Mode m, double, auto&) {
        level += 1;
        return m;
    };
    const auto run = integrate(ramp, Array<1>{0}, {.t_end = 10.5});
    EXPECT_EQ(run.events.size(), 10U);
}

// --- one guard beside the events of another ---

/// x rises to 1/2 at t = 2 and falls again; a guard beside it changes the state at t = `at`.
struct TouchesLater {
    using State = Array<3>;
    double top = 0.5, at = 1.5;
    GuardInfo info{};
    std::size_t guard_count = 2;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -0.5, 0}; }
    [[nodiscard]] double guard(std::size_t i, double t, const State& x) const
    {
        return i == 0 ? top - x[0] : at - t;
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return i == 0 ? info : GuardInfo{}; }
    void reset(std::size_t, double, State& x) const { x[2] += 1; }
};

TEST(Meaning, ATouchBehindAnEventOfTheSameStepIsNoCrossingAtThatEvent)
{
    const auto check = [](const TouchesLater& system, const auto& detector) {
        const auto run =
            integrate(system, {-0.5, 1.0, 0.0}, {.t_end = 4}, ErrorControlled<Dopri5>{}, detector);
        ASSERT_FALSE(run.events.empty());
        EXPECT_EQ(run.events[0].guard, 1U);
        EXPECT_NEAR(run.events[0].t, system.at, 1e-12);
        for (std::size_t k = 1; k < run.events.size(); ++k) {
            EXPECT_EQ(run.events[k].kind, EventKind::touch);
            EXPECT_NEAR(run.events[k].t, 2, 1e-3);
        }
        EXPECT_EQ(run.t, 4);
        EXPECT_EQ(run.x[2], 1);
    };
    for (const double at : {0.3, 1.0, 1.5, 1.7, 1.9}) {
        for (const std::uint32_t stop_after : {0U, 1U}) {
            for (const bool resets : {false, true}) {
                TouchesLater system{.at = at};
                system.info = {.resets = resets, .stop_after = stop_after};
                check(system, Extremum{});
                check(system, Bernstein{});
                system.info.crossing = Crossing::either;
                check(system, Extremum{});
                // 1/2 is passed by 0.01, inside the band of a touch.
                system.top = 0.51;
                system.info.touch = 0.02;
                if (at < 1.7) check(system, Extremum{});
            }
        }
    }
}

TEST(Meaning, ACrossingAtAnEventAtTheEndIsRecordedOnce)
{
    struct Both {
        using State = Array<2>;
        double start, at;
        std::size_t guard_count = 2;
        void flow(double, const State&, State& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(std::size_t i, double t, const State& x) const
        {
            return i == 0 ? start + at - x[0] : at - t;
        }
        [[nodiscard]] GuardInfo guard_info(std::size_t i) const
        {
            GuardInfo info;
            if (i == 0) info.crossing = Crossing::either;
            info.resets = i == 1;
            return info;
        }
        void reset(std::size_t, double, State& x) const { x[1] += 1; }
    };
    for (int j = 1; j < 30; ++j) {
        for (int k = 1; k < 30; ++k) {
            const Both both{0.1 * j, 0.05 * k};
            Simulation simulation(both, {both.start, 0.0}, {.t_end = both.at});
            while (simulation.advance()) {
            }
            EXPECT_EQ(simulation.run().events.size(), 2U) << j << ' ' << k;
            simulation.extend(both.at + 1);
            EXPECT_EQ(simulation.take().events.size(), 2U) << j << ' ' << k;
            EXPECT_EQ(integrate(both, {both.start, 0.0}, {.t_end = both.at}).events.size(), 2U);
        }
    }
}

TEST(Meaning, AGuardThatAnEventOfTheStartMovesInsideDidNotBeginBeyond)
{
    struct Lifted {
        using State = Array<1>;
        Times time_events{0};
        void flow(double, const State&, State& dxdt) const { dxdt = {-1}; }
        [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
        void reset(double, State& x) const { x[0] += 1; }
        void time_reset(double, State& x) const { x[0] = 0.5; }
    };
    for (const double start : {0.0, -1.0}) {
        const auto run = integrate(Lifted{}, {start}, {.t_end = 2.25});
        EXPECT_EQ(run.events.size(), 3U);
        EXPECT_EQ(run.statistics.armed_beyond, 0U);
        EXPECT_EQ(describe(run), describe(Outcome::reached_end));
    }
}

}  // namespace
}  // namespace ricochet
