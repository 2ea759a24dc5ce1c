// Exceptions from the functions of a system, and the runs that continue after them.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "clearing_gate.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::exceptions_test {
namespace {

struct Interrupted {
    std::size_t call;
};

/// A ball on a floor whose functions throw at one call, counted over all of them.
struct Interruptible {
    using State = std::array<double, 2>;
    std::size_t* calls;
    std::size_t throws_at;  ///< 0: never

    void visit() const
    {
        if (++*calls == throws_at) throw Interrupted{throws_at};
    }
    void flow(double, const State& x, State& dxdt) const
    {
        visit();
        dxdt = {x[1], -9.81 - 0.1 * x[1]};
    }
    [[nodiscard]] double guard(double, const State& x) const
    {
        visit();
        return x[0];
    }
    void reset(double, State& x) const
    {
        visit();
        x = {0, -0.8 * x[1]};
    }
    void rest(double, State& x) const
    {
        visit();
        x = {0, 0};
    }
};

/// The same ball with bounds of its guards, the second of which marks a height on the way up; an
/// impact below a speed of 2 m/s takes all of it, and a wind from below lifts the ball again.
struct Bounded {
    using State = Interruptible::State;
    std::size_t* calls;
    std::size_t throws_at;
    static constexpr std::size_t guard_count = 2;

    void visit() const { Interruptible{calls, throws_at}.visit(); }
    void flow(double t, const State& x, State& dxdt) const
    {
        visit();
        dxdt = {x[1], -6 + 9 * std::sin(4 * t)};
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 0 ? Crossing::falling : Crossing::either,
                .resets = which == 0};
    }
    [[nodiscard]] double guard(std::size_t which, double, const State& x) const
    {
        visit();
        return which == 0 ? x[0] : x[0] - 1;
    }
    [[nodiscard]] bool enabled(std::size_t which, double, const State& x) const
    {
        visit();
        return which == 0 || x[1] > 0;
    }
    void reset(std::size_t, double, State& x) const
    {
        visit();
        x = {0, x[1] < -2 ? -0.8 * x[1] : 0};
    }
    [[nodiscard]] double speed_bound(double, const State& x) const
    {
        visit();
        return std::fabs(x[1]);
    }
    [[nodiscard]] double acceleration_bound(double, const State&) const { return 15; }
};

struct Finished {
    Outcome outcome{};
    std::array<double, 2> x{};
    std::vector<double> impacts;
    std::uint64_t steps = 0;
    std::uint64_t rejected = 0;
    std::uint64_t disabled = 0;

    bool operator==(const Finished&) const = default;
};

/// Runs to the end by `go`, repeatedly after each exception.
template <class Ball, class Detector, class Go>
Finished finish(const Ball& ball, const Detector& detector, std::size_t& exceptions, const Go& go)
{
    const Options options{.t_end = 6, .h_max = 0.05};
    const auto start = [&] {
        for (;;) {
            try {
                return Simulation(ball, Interruptible::State{4, 0}, options,
                                  ErrorControlled<Dopri5>{}, detector);
            } catch (const Interrupted&) {
                ++exceptions;
            }
        }
    };
    Simulation simulation = start();
    for (;;) {
        const double t = simulation.t();
        try {
            const Run<Interruptible::State> run = go(simulation);
            const Statistics& counts = run.statistics;
            Finished finished{run.outcome,  run.x,           {},
                              counts.steps, counts.rejected, counts.disabled};
            for (const auto& event : run.events) finished.impacts.push_back(event.t);
            return finished;
        } catch (const Interrupted& interrupted) {
            EXPECT_EQ(interrupted.call, ball.throws_at);
            EXPECT_GE(simulation.t(), t);
            ++exceptions;
        }
    }
}

template <class Ball = Interruptible, class Go, class Detector = Extremum>
void expect_same_whichever_call_throws(const Go& go, const Detector& detector = {})
{
    std::size_t calls = 0;
    std::size_t exceptions = 0;
    const Finished expected = finish(Ball{&calls, 0}, detector, exceptions, go);
    ASSERT_GE(expected.impacts.size(), 4U);
    const std::size_t all = calls;
    for (std::size_t k = 1; k <= all; ++k) {
        calls = exceptions = 0;
        const Finished found = finish(Ball{&calls, k}, detector, exceptions, go);
        ASSERT_EQ(exceptions, 1U) << "call " << k;
        ASSERT_EQ(found, expected) << "call " << k;
    }
}

// Every call of flow, guard, reset and rest of a run throws once; the run then continues with the
// next step from the last complete one, with the bits of a run in which nothing was thrown.
TEST(Exceptions, AStepThatThrowsIsTakenAgainWithTheSameBits)
{
    expect_same_whichever_call_throws([](auto& simulation) {
        while (simulation.step()) {
        }
        return simulation.finish();
    });
}

TEST(Exceptions, AnAdvanceThatThrowsGoesOnWithTheSameBits)
{
    expect_same_whichever_call_throws([](auto& simulation) {
        while (simulation.advance()) {
        }
        return simulation.finish();
    });
}

// Between impacts there are quiet runs, whose steps are taken in one function.
TEST(Exceptions, ARunThatThrowsGoesOnWithTheSameBits)
{
    expect_same_whichever_call_throws([](auto& simulation) { return simulation.take(); });
}

// Where checks are deferred, the deadlines of guards are found again.
TEST(Exceptions, RunsThatDeferChecksGoOnWithTheSameBits)
{
    const auto step = [](auto& simulation) {
        while (simulation.step()) {
        }
        return simulation.finish();
    };
    const auto advance = [](auto& simulation) {
        while (simulation.advance()) {
        }
        return simulation.finish();
    };
    const auto take = [](auto& simulation) { return simulation.take(); };
    const auto expect_same = [&](const auto& detector) {
        expect_same_whichever_call_throws<Bounded>(step, detector);
        expect_same_whichever_call_throws<Bounded>(advance, detector);
        expect_same_whichever_call_throws<Bounded>(take, detector);
    };
    const Foreseen<> foreseen(test::clearing_gate(0.1));
    expect_same(Planned<>());
    expect_same(foreseen);
    expect_same(Metered(foreseen, {.decision = MeterOptions::Decision::every_step}));
    // With short pieces it changes between planning and checking every step.
    for (const std::uint64_t piece : {1U, 2U, 5U}) {
        expect_same(Metered(foreseen, {.decision = MeterOptions::Decision::counted,
                                       .guard = 1e-7,
                                       .network = 1e-7,
                                       .step = 1e-7,
                                       .trials = 1,
                                       .piece = piece}));
    }
}

TEST(Exceptions, AWholeRunLetsAnExceptionPassUnchanged)
{
    std::size_t calls = 0;
    const Interruptible ball{&calls, 300};
    try {
        static_cast<void>(integrate(ball, Interruptible::State{4, 0}, {.t_end = 6, .h_max = 0.05}));
        FAIL() << "nothing was thrown";
    } catch (const Interrupted& interrupted) {
        EXPECT_EQ(interrupted.call, 300U);
    }
}

}  // namespace
}  // namespace ricochet::exceptions_test
