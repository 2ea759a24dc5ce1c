// Exceptions from the functions of a system, and the runs that continue after them.

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <vector>

#include "ricochet/integrate/integrate.hpp"

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

struct Finished {
    Outcome outcome{};
    std::array<double, 2> x{};
    std::vector<double> impacts;
    std::uint64_t steps = 0;

    bool operator==(const Finished&) const = default;
};

/// Runs to the end by `go`, repeatedly after each exception.
template <class Go>
Finished finish(const Interruptible& ball, std::size_t& exceptions, const Go& go)
{
    const Options options{.t_end = 6, .h_max = 0.05};
    const auto start = [&] {
        for (;;) {
            try {
                return Simulation(ball, Interruptible::State{4, 0}, options);
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
            Finished finished{run.outcome, run.x, {}, run.statistics.steps};
            for (const auto& event : run.events) finished.impacts.push_back(event.t);
            return finished;
        } catch (const Interrupted& interrupted) {
            EXPECT_EQ(interrupted.call, ball.throws_at);
            EXPECT_GE(simulation.t(), t);
            ++exceptions;
        }
    }
}

template <class Go>
void expect_same_whichever_call_throws(const Go& go)
{
    std::size_t calls = 0;
    std::size_t exceptions = 0;
    const Finished expected = finish({&calls, 0}, exceptions, go);
    ASSERT_GE(expected.impacts.size(), 4U);
    const std::size_t all = calls;
    for (std::size_t k = 1; k <= all; ++k) {
        calls = exceptions = 0;
        const Finished found = finish({&calls, k}, exceptions, go);
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
