// Random automata on a line beside an exact oracle: the same automaton whose modes are left a
// little late, by a hysteresis h, in integers. What two small h agree about is what h = 0 means.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/monitor.hpp"
#include "rk4_host.hpp"

namespace ricochet {
namespace {

constexpr int mode_total = 4;
constexpr std::int64_t unit = 96'000;  // of one: h, halves and halved rates are integers
constexpr std::int64_t span = 4 * unit;

/// x' = rate[m]; the guard facing[m] x + h falls through zero and leads to next[m]; a tick to
/// ticked[m]. With `parted`, x and -x are guards of their own, each enabled where it faces.
struct Automaton {
    using State = std::array<double, 1>;
    std::array<int, mode_total> rate{}, facing{}, next{}, ticked{};
    std::vector<double> ticks;
    bool parted = false;
    double x0 = 0;

    [[nodiscard]] std::size_t guard_count() const { return parted ? 2 : 1; }
    [[nodiscard]] std::size_t mode_count() const { return mode_total; }
    void flow(Mode m, double, const State&, State& dxdt) const { dxdt[0] = rate[m]; }
    [[nodiscard]] double guard(std::size_t i, Mode m, double, const State& x) const
    {
        return (parted ? sign_of(i) : facing[m]) * x[0];
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode m) const
    {
        return !parted || facing[m] == sign_of(i);
    }
    Mode reset(std::size_t, Mode m, double, State&) const { return static_cast<Mode>(next[m]); }
    [[nodiscard]] double next_time_event(double t) const
    {
        for (const double tick : ticks) {
            if (tick > t) return tick;
        }
        return std::numeric_limits<double>::infinity();
    }
    Mode time_reset(Mode m, double, State&) const { return static_cast<Mode>(ticked[m]); }

    static int sign_of(std::size_t i) { return i == 0 ? 1 : -1; }
};

Automaton random_automaton(std::mt19937& random)
{
    const auto one_of = [&](const auto& values) {
        return values[std::uniform_int_distribution<std::size_t>(0, values.size() - 1)(random)];
    };
    Automaton a;
    for (int m = 0; m < mode_total; ++m) {
        a.rate[m] = one_of(std::array{-2, -1, -1, 0, 1, 1, 2});
        a.facing[m] = one_of(std::array{-1, 1});
        a.next[m] = (m + one_of(std::array{1, 2, 3})) % mode_total;
        a.ticked[m] = one_of(std::array{0, 1, 2, 3});
    }
    a.ticks = one_of(std::array<std::vector<double>, 4>{{{}, {1}, {1, 2}, {1.5}}});
    a.parted = std::uniform_real_distribution<>(0, 1)(random) < 0.3;
    a.x0 = one_of(std::array{0.5, 1.0, 1.5}) * a.facing[0];
    return a;
}

struct End {
    bool endless = false;
    int mode = 0;
    double x = 0;
    std::size_t events = 0;
    bool tied = false;  ///< a tick or the end found the state on a surface: h decides
};

int sign(std::int64_t v)
{
    return v > 0 ? 1 : v < 0 ? -1 : 0;
}

/// Events of one chain come late by up to this many h.
constexpr std::int64_t lateness = 40;

/// The run with the hysteresis h, in units; more than 40 events in four seconds are endless.
End late_run(const Automaton& a, std::int64_t h)
{
    std::int64_t x = std::llround(a.x0 * unit), t = 0;
    int m = 0;
    std::size_t next_tick = 0;
    End end;
    const auto value = [&] { return a.facing[m] * x + h; };
    const auto slope = [&] { return a.facing[m] * a.rate[m]; };
    const auto side_of = [&] { return value() != 0 ? sign(value()) : sign(slope()); };
    const auto finished = [&] {
        end.mode = m;
        end.x = static_cast<double>(x) / unit;
        return end;
    };
    int side = side_of();
    for (;;) {
        const bool ticking = next_tick < a.ticks.size();
        const std::int64_t rest = (ticking ? std::llround(a.ticks[next_tick] * unit) : span) - t;
        const std::int64_t distance = std::abs(value());
        const bool meets = side != 0 && sign(value()) == side && sign(slope()) == -side &&
                           distance < rest * std::abs(slope());
        const std::int64_t wait = meets ? distance / std::abs(slope()) : rest;
        EXPECT_TRUE(!meets || distance % slope() == 0);
        x += a.rate[m] * wait;
        t += wait;
        end.tied = end.tied || (!meets && std::abs(x) <= lateness * h);
        if (!meets && !ticking) return finished();
        if (meets && side < 0) {  // against the event's direction
            side = 1;
            continue;
        }
        if (!meets) ++next_tick;
        int to = meets ? a.next[m] : a.ticked[m];
        for (bool fires = meets;;) {
            if (fires && ++end.events > 40) {
                end.endless = true;
                return finished();
            }
            const bool another = a.parted && a.facing[to] != a.facing[m];  // its guard, enabled now
            const int before = side;
            m = to;
            side = side_of();
            fires = another ? value() == 0 && slope() < 0 : !fires && before > 0 && side < 0;
            if (!fires) break;
            to = a.next[m];
        }
    }
}

std::string named(const Automaton& a)
{
    std::string text = a.parted ? "parted" : "one guard";
    for (int m = 0; m < mode_total; ++m) {
        text += " | " + std::to_string(a.rate[m]) + " faces " + std::to_string(a.facing[m]) +
                " next " + std::to_string(a.next[m]) + " ticked " + std::to_string(a.ticked[m]);
    }
    for (const double tick : a.ticks) text += ", tick " + std::to_string(tick);
    return text + ", from " + std::to_string(a.x0);
}

/// A room whose reset reads the temperature again: x' = rate (target - x) between two bounds.
struct ReadingRoom {
    using State = std::array<double, 1>;
    static constexpr std::size_t mode_count = 2;
    double rate = 1, low = 0, high = 1, cold = -1, hot = 2;

    void flow(Mode on, double, const State& x, State& dxdt) const
    {
        dxdt[0] = rate * ((on ? hot : cold) - x[0]);
    }
    [[nodiscard]] double guard(Mode on, double, const State& x) const
    {
        return on ? high - x[0] : x[0] - low;
    }
    Mode reset(Mode m, double, State& x) const { return x[0] <= low ? 1 : x[0] >= high ? 0 : m; }
};

TEST(Automata, RoomsInAHostThatReadTheirTemperatureNeverStick)
{
    // Five cycles of 2000 rooms, each with steps of several lengths. The host's method is of order
    // 4: ten events in time, of which none hangs by its error, at most 1e-3 of a cycle.
    std::mt19937 random(7);
    const auto uniform = [&](double lo, double hi) {
        return std::uniform_real_distribution<>(lo, hi)(random);
    };
    int wrong = 0;
    for (int k = 0; k < 2000; ++k) {
        const double scale = std::pow(10.0, uniform(-3, 3));
        ReadingRoom room;
        room.low = scale * uniform(-1, 1);
        room.high = room.low + scale * uniform(0.01, 1);
        room.cold = room.low - scale * uniform(0.1, 2);
        room.hot = room.high + scale * uniform(0.1, 2);
        room.rate = uniform(0.1, 3);
        const double cooling =
            std::log((room.high - room.cold) / (room.low - room.cold)) / room.rate;
        const double heating = std::log((room.hot - room.low) / (room.hot - room.high)) / room.rate;
        for (const double part : {0.31, 0.07}) {
            EventMonitor monitor(room, ReadingRoom::State{});
            const auto run = test::drive(room, monitor, ReadingRoom::State{room.high},
                                         5 * (cooling + heating) + 0.5 * cooling,
                                         part * std::min(cooling, 1 / room.rate));
            wrong += run.verdict != Verdict::stands || run.events.size() != 10 || run.mode != 0;
        }
    }
    EXPECT_EQ(wrong, 0);
}

/// Whether a run of h = 0 ended as the late run: at the same place in the same mode, or endlessly.
template <class Run>
bool agree(const End& late, const Run& run)
{
    if (late.endless) return run.outcome == Outcome::endless_cascade;
    return run.outcome == Outcome::reached_end && static_cast<int>(run.mode) == late.mode &&
           std::abs(run.x[0] - late.x) < 0.05;
}

TEST(Automata, TwelveThousandMeanWhatALittleHysteresisMeans)
{
    std::mt19937 random(3);
    int decided = 0, endless = 0, tied = 0, wrong = 0, wrong_fixed = 0, wrong_host = 0;
    for (int k = 0; k < 12'000; ++k) {
        const Automaton a = random_automaton(random);
        const End late = late_run(a, unit / 3000);
        const auto run = integrate(a, {a.x0}, {.t_end = 4});
        if (late.tied) {  // h decides: at h = 0 one set, whose members may conflict
            ++tied;
            EXPECT_TRUE(run.outcome == Outcome::reached_end ||
                        run.outcome == Outcome::endless_cascade ||
                        run.outcome == Outcome::conflicting_resets)
                << named(a);
            continue;
        }
        ++decided;
        endless += late.endless;
        if (!agree(late, run) && ++wrong < 5) ADD_FAILURE() << named(a);
        wrong_fixed += !agree(late, integrate(a, {a.x0}, {.t_end = 4, .step = 0.37},
                                              FixedStep<Rk4>{}, Ends{}, Bisection{}));
        EventMonitor monitor(a, Automaton::State{});
        wrong_host += !agree(late, test::drive(a, monitor, Automaton::State{a.x0}, 4, 0.37));
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(wrong_fixed, 0);
    EXPECT_EQ(wrong_host, 0);
    EXPECT_GT(decided, 9000);
    EXPECT_GT(endless, 300);
    EXPECT_GT(tied, 1000);
}

}  // namespace
}  // namespace ricochet
