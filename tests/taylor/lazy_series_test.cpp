// Taylor series of flows whose operations the compiler cannot know.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::lazy_series_test {
namespace {

using Two = std::array<double, 2>;
using Vector = std::vector<double>;
constexpr double pi = std::numbers::pi;
using ByTaylor = ErrorControlled<Taylor>;

/// A system that the compiler cannot construct: its operations are recorded at run time.
template <class System>
struct Unknown : System {
    explicit Unknown(const System& system) : System(system) {}
};

template <class Expected, class Found>
void expect_same_events(const Expected& expected, const Found& found, double tolerance)
{
    ASSERT_EQ(found.outcome, expected.outcome);
    ASSERT_EQ(found.events.size(), expected.events.size());
    for (std::size_t i = 0; i < found.events.size(); ++i) {
        EXPECT_EQ(found.events[i].guard, expected.events[i].guard);
        EXPECT_NEAR(found.events[i].t, expected.events[i].t, tolerance) << i;
    }
    EXPECT_EQ(found.statistics.evidence.proved > 0, expected.statistics.evidence.proved > 0);
}

TEST(LazySeries, RunsAreThoseOfTheUnrolledSeriesToTheRoundingOfTheTime)
{
    const Options options{.t_end = 60, .rtol = 1e-13, .atol = 1e-13};
    const ImpactOscillator impact({.frequency = 0.8, .wall = 1.2});
    const auto compiled = integrate(impact, Two{0, 0}, options, ByTaylor{});
    const auto lazy = integrate(Unknown(impact), Two{0, 0}, options, ByTaylor{});
    ASSERT_GT(compiled.events.size(), 5U);
    // Two units in the last place of 60 for each of the impacts.
    expect_same_events(compiled, lazy, 1e-13);
    EXPECT_EQ(lazy.statistics.steps, compiled.statistics.steps);

    const Thermostat thermostat({.rate = 0.2});
    expect_same_events(integrate(thermostat, Thermostat::start, options, ByTaylor{}),
                       integrate(Unknown(thermostat), Thermostat::start, options, ByTaylor{}),
                       1e-13);
}

/// A pendulum whose damping is omitted where it is zero, with a function that is not constexpr.
struct Damped {
    using State = Two;
    static constexpr bool resets = false;
    double damping = 0;

    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -sin(x[0]);
        if (damping != 0) dxdt[1] -= damping * x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
};
/// The same operations for any damping.
struct AlwaysDamped : Damped {
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -sin(x[0]) - damping * x[1];
    }
};

TEST(LazySeries, ABranchOnAParameterIsThatOfTheObject)
{
    const Options options{.t_end = 30, .rtol = 1e-14, .atol = 1e-14};
    const auto branching = integrate(Damped{0.1}, Two{1, 0}, options, ByTaylor{});
    const auto always = integrate(AlwaysDamped{{0.1}}, Two{1, 0}, options, ByTaylor{});
    ASSERT_GT(always.events.size(), 4U);
    expect_same_events(always, branching, 1e-13);
    // An object like the one that the compiler knows is not slowed down by the other one.
    const detail::StepperAdapter<Damped, Two, Taylor> plain(Damped{}, Two{});
    EXPECT_TRUE(plain.as_compiled());
    const detail::StepperAdapter<Damped, Two, Taylor> damped(Damped{0.1}, Two{});
    EXPECT_FALSE(damped.as_compiled());
}

/// Sixteen pendulums in a chain: more operations than the compiler unrolls.
struct Chain {
    static constexpr std::size_t n = 32;
    using State = std::array<double, n>;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, n>& x, std::array<S, n>& dxdt) const
    {
        using std::exp, std::sin;
        for (std::size_t i = 0; i < n; i += 2) {
            const S before = x[(i + n - 2) % n] - x[i], after = x[(i + 2) % n] - x[i];
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = exp(after) - exp(-before) - 2.0 * sin(x[i]) + 0.1 * x[i] * x[i + 1];
        }
    }
};

TEST(LazySeries, FlowsOfMoreOperationsThanAreCompiledAgreeWithFehlberg78)
{
    EXPECT_FALSE((detail::StepperAdapter<Chain, Chain::State, Taylor>(Chain{}, {}).as_compiled()));
    Chain::State start{};
    for (std::size_t i = 0; i < Chain::n; i += 2) start[i] = 0.1 * std::sin(static_cast<double>(i));
    const Options options{.t_end = 5, .rtol = 1e-13, .atol = 1e-13};
    const auto run = integrate(Chain{}, start, options, ByTaylor{});
    const auto other = integrate(Chain{}, start, options, ErrorControlled<Fehlberg78>{});
    // 1e-13 in each of some hundred steps, which the motion does not amplify much in 5 s.
    for (std::size_t i = 0; i < Chain::n; ++i) EXPECT_NEAR(run.x[i], other.x[i], 1e-10) << i;
}

/// Oscillators in a row, beside each other, as many as there are frequencies.
struct Row {
    using State = Vector;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::falling;
    Vector frequencies;

    template <class S>
    void flow(const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        for (std::size_t i = 0; i < frequencies.size(); ++i) {
            dxdt[2 * i] = frequencies[i] * x[2 * i + 1];
            dxdt[2 * i + 1] = -frequencies[i] * x[2 * i];
        }
    }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::vector<S>& x) const
    {
        return x[0];
    }
};

[[nodiscard]] Vector row_start(std::size_t oscillators)
{
    Vector x(2 * oscillators);
    for (std::size_t i = 0; i < oscillators; ++i) x[2 * i] = 1;
    return x;
}

TEST(LazySeries, StatesSizedAtRunTimeAreIntegratedRecordedAndProved)
{
    for (const std::size_t oscillators : {1, 3, 30}) {
        Row row;
        for (std::size_t i = 0; i < oscillators; ++i) {
            row.frequencies.push_back(2.25 - 0.05 * static_cast<double>(i));
        }
        const auto run = integrate(
            row, row_start(oscillators),
            {.t_end = 10, .rtol = 1e-14, .atol = 1e-14, .record_steps = true}, ByTaylor{});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        for (const double t : {0.0, 0.1, 3.3, 7.7, 10.0}) {
            const Vector x = run.solution(t);
            for (std::size_t i = 0; i < oscillators; ++i) {
                EXPECT_NEAR(x[2 * i], std::cos(row.frequencies[i] * t), 1e-13) << t;
                EXPECT_NEAR(x[2 * i + 1], -std::sin(row.frequencies[i] * t), 1e-13) << t;
            }
        }
        // cos(2.25 t) falls through 0 at (pi / 2 + 2 pi k) / 2.25.
        ASSERT_EQ(run.events.size(), 4U);
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_NEAR(run.events[k].t, (pi / 2 + 2 * pi * static_cast<double>(k)) / 2.25, 1e-13);
        }
        EXPECT_GT(run.statistics.evidence.proved, 5U);
    }
}

TEST(LazySeries, VectorsBackwardSavedAndInSingleStepsHaveTheBitsOfARunInAPiece)
{
    const Row row{.frequencies = {1.1, 0.7}};
    const Options options{.t_end = 25, .rtol = 1e-13, .atol = 1e-13};
    const auto whole = integrate(row, row_start(2), options, ByTaylor{});
    Simulation first(row, row_start(2), options, ByTaylor{});
    for (int i = 0; i < 5; ++i) first.step();
    const Snapshot saved = first.save();
    Simulation second(row, row_start(2), options, ByTaylor{});
    second.restore(saved);
    while (second.step()) {
    }
    EXPECT_EQ(second.take().x, whole.x);
    Options back = options;
    back.t_start = 25;
    back.t_end = 0;
    const auto home = integrate(row, whole.x, back, ByTaylor{});
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(home.x[i], row_start(2)[i], 1e-11);
}

/// A weight on each of two springs, the second of which falls off at the first rise through zero.
struct Dropping {
    using State = Vector;
    static constexpr bool changes_dimension = true;

    template <class S>
    void flow(const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -x[i];
        }
    }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::vector<S>& x) const
    {
        return x[0];
    }
    void reset(double /*t*/, Vector& x) const
    {
        if (x.size() > 2) x.resize(2);
        x[1] = -x[1];
    }
};

TEST(LazySeries, AResetMayChangeTheSizeOfTheState)
{
    const auto run = integrate(Dropping{}, Vector{1, 0, 0.5, 0.5},
                               {.t_end = 5, .rtol = 1e-14, .atol = 1e-14}, ByTaylor{});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_NEAR(run.events[0].t, pi / 2, 1e-14);
    EXPECT_NEAR(run.events[1].t, 3 * pi / 2, 1e-14 * 4);
    ASSERT_EQ(run.x.size(), 2U);
    EXPECT_NEAR(run.x[0], std::fabs(std::cos(5.0)), 1e-13);
}

/// A weight that falls and hangs by a spring in turn: the spring adds its length, and each mode has
/// a guard of its own. Functions are called with the state of their mode alone.
struct Hanging {
    using State = Vector;
    enum : Mode { falls, hangs };
    static constexpr bool changes_dimension = true;
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;

    static void expect(std::size_t found, Mode mode)
    {
        if (found != (mode == falls ? 1U : 2U)) throw std::logic_error("the state of another mode");
    }
    template <class S>
    void flow(Mode mode, const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        expect(x.size(), mode);
        expect(dxdt.size(), mode);
        if (mode == falls) {
            dxdt[0] = -1.0;
        } else {
            dxdt[0] = x[1];
            dxdt[1] = -x[0];
        }
    }
    [[nodiscard]] static bool enabled(std::size_t which, Mode mode) { return which == mode; }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, Mode mode, const S& /*t*/,
                          const std::vector<S>& x) const
    {
        expect(x.size(), mode);
        return which == falls ? x[0] : -x[0];
    }
    Mode reset(std::size_t /*which*/, Mode mode, double /*t*/, Vector& x) const
    {
        expect(x.size(), mode);
        x = mode == falls ? Vector{0, -1} : Vector{1};
        return mode == falls ? hangs : falls;
    }
};

TEST(LazySeries, AModeIsRecordedWithItsOwnSizeWhenItIsEntered)
{
    // Falls from 1 to 0 in 1, then -sin until it is back at 0 after pi.
    for (const auto& [start, mode] :
         {std::pair(Vector{1}, Hanging::falls), std::pair(Vector{0, -1}, Hanging::hangs)}) {
        const auto run =
            integrate(Hanging{}, start, {.t_end = 10, .mode = mode, .rtol = 1e-14, .atol = 1e-14},
                      ByTaylor{});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        double t = 0;
        Mode at = mode;
        for (const auto& event : run.events) {
            t += at == Hanging::falls ? 1 : pi;
            at = at == Hanging::falls ? Hanging::hangs : Hanging::falls;
            EXPECT_NEAR(event.t, t, 4e-14);
        }
        EXPECT_EQ(run.events.size(), mode == Hanging::falls ? 5U : 4U);
        EXPECT_EQ(run.x.size(), at == Hanging::falls ? 1U : 2U);
    }
}

/// Gears whose number is known at run time.
struct Gears {
    using State = Vector;
    Vector rates;

    [[nodiscard]] std::size_t mode_count() const { return rates.size(); }
    [[nodiscard]] static constexpr std::size_t guard_count() { return 1; }
    template <class S>
    void flow(Mode mode, const S& t, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        dxdt[0] = rates[mode] * x[0];
        dxdt[1] = 3.0 * t * t;
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t /*which*/, Mode mode, const S& /*t*/,
                          const std::vector<S>& x) const
    {
        return (2.0 + static_cast<double>(mode)) - x[0];
    }
    Mode reset(std::size_t /*which*/, Mode mode, double /*t*/, Vector& /*x*/) const
    {
        return mode + 1 < rates.size() ? mode + 1 : mode;
    }
};

TEST(LazySeries, EachModeIsRecordedByItself)
{
    // From 1 to 2 in log 2 / 1, to 3 in log(3 / 2) / 2, to 4 in log(4 / 3) / 4.
    const Gears gears{.rates = {1, 2, 4, -1}};
    const auto run =
        integrate(gears, Vector{1, 0}, {.t_end = 1.5, .rtol = 1e-14, .atol = 1e-14}, ByTaylor{});
    ASSERT_EQ(run.events.size(), 3U);
    double t = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const auto from = static_cast<double>(i + 1);
        t += std::log((from + 1) / from) / gears.rates[i];
        EXPECT_NEAR(run.events[i].t, t, 1e-14);
    }
    EXPECT_EQ(run.mode, 3U);
    EXPECT_NEAR(run.x[0], 4 * std::exp(-(1.5 - t)), 1e-13);
    EXPECT_NEAR(run.x[1], 1.5 * 1.5 * 1.5, 1e-14 * 4);
}

/// A motion of degree 2, whose steps end only at events.
struct Thrown {
    using State = Vector;
    double gravity = 9.81;
    template <class S>
    void flow(const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::vector<S>& x) const
    {
        return x[0];
    }
    void reset(double /*t*/, Vector& x) const
    {
        x[0] = 0;
        x[1] *= -0.9;
    }
};

/// Pairs that do not depend on each other. The kinds have, together, every function that is
/// computed from sums of products.
struct Pairs {
    using State = Vector;
    int kind = 0;

    template <class S>
    void flow(const S& t, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); i += 2) {
            rates(t, x[i], x[i + 1], dxdt[i], dxdt[i + 1]);
        }
    }

private:
    template <class S>
    void rates(const S& t, const S& a, const S& b, S& first, S& second) const
    {
        using std::cos, std::exp, std::sin, std::sinh, std::sqrt, std::tan, std::tanh;
        switch (kind) {
            case 0:
                first = exp(-a) * sin(b);
                second = a * b - 2.5 * a;
                break;
            case 1:
                first = sqrt(2.0 + a * a) / (3.0 + b);
                second = 0.1 * t - b;
                break;
            case 2:
                first = -1.0 / (2.0 + cos(b));
                second = a - 1.0;
                break;
            default: first = tanh(a) - tan(0.1 * b); second = 0.25 * sinh(-b);
        }
    }
};

/// Coefficients up to order 20 of so many pairs, of equal starts.
std::vector<double> series_of_pairs(int kind, std::size_t pairs, bool short_tape)
{
    const std::size_t n = 2 * pairs;
    detail::Recording recording;
    std::vector<int> outputs(n);
    record_into(Pairs{kind}, 0, recording, std::vector<detail::Recorded>(n), outputs);
    detail::LazyTape tape(n, recording, outputs);
    // Up to 10 operations are computed one by one.
    EXPECT_EQ(tape.operations() <= 10, short_tape) << tape.operations();
    Vector x(n);
    for (std::size_t i = 0; i < n; ++i) x[i] = i % 2 == 0 ? 0.3 : -0.7;
    std::vector<double> out(21 * n);
    EXPECT_EQ(tape.compute(0.5, x.data(), {20, out.data(), nullptr}), 20);
    return out;
}

TEST(LazySeries, AShortTapeHasTheBitsOfOperationsSideBySide)
{
    for (const int kind : {0, 1, 2, 3}) {
        const auto one = series_of_pairs(kind, 1, true);
        const auto four = series_of_pairs(kind, 4, false);
        for (std::size_t k = 0; k <= 20; ++k) {
            for (std::size_t i = 0; i < 8; ++i) {
                EXPECT_EQ(four[8 * k + i], one[2 * k + i % 2])
                    << "kind " << kind << ", order " << k << ", component " << i;
            }
        }
        EXPECT_TRUE(std::isfinite(one[40]) && one[40] != 0) << kind;
    }
}

TEST(LazySeries, PolynomialsInTimeAreKnownAsSuch)
{
    const auto run = integrate(Thrown{}, Vector{10, 0}, {.t_end = 20.5, .rtol = 1e-12}, ByTaylor{});
    ASSERT_EQ(run.events.size(), 13U);
    EXPECT_LE(run.statistics.steps, 18U);
    const double fall = std::sqrt(20 / 9.81);
    double t = fall, flight = 2 * fall;
    for (const auto& event : run.events) {
        EXPECT_NEAR(event.t, t, 2e-14);
        t += flight *= 0.9;
    }
}

/// As many guards as walls.
struct Walled {
    using State = Vector;
    static constexpr bool resets = false;
    Vector walls;
    [[nodiscard]] std::size_t guard_count() const { return walls.size(); }
    template <class S>
    void flow(const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, const S& /*t*/, const std::vector<S>& x) const
    {
        return walls[which] - x[0];
    }
};

TEST(LazySeries, GuardsMayBeAsManyAsARunHasOrNone)
{
    const Options options{.t_end = 2 * pi, .rtol = 1e-14, .atol = 1e-14};
    for (const Vector& walls : {Vector{}, Vector{0.5}, Vector{0.5, 0.9, 2}}) {
        const auto run = integrate(Walled{walls}, Vector{0, 1}, options, ByTaylor{});
        EXPECT_NEAR(run.x[1], 1, 1e-13);
        ASSERT_EQ(run.events.size(), std::min(walls.size(), std::size_t{2}));
        for (std::size_t i = 0; i < run.events.size(); ++i) {
            EXPECT_NEAR(run.events[i].t, std::asin(walls[i]), 1e-14);
        }
    }
}

/// Gives a rate of the wrong size.
struct Misshapen {
    using State = Vector;
    template <class S>
    void flow(const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        dxdt.assign(x.size() + 1, S(0.0));
    }
};

TEST(LazySeries, WhatCannotBeExpandedIsRefusedBeforeTheRun)
{
    const auto message = [](const auto& system) -> std::string {
        try {
            static_cast<void>(integrate(system, Vector{1, 0}, {.t_end = 1}, ByTaylor{}));
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "nothing is refused";
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NE(message(Thrown{nan}).find("not finite"), std::string::npos);
    EXPECT_NE(message(Row{.frequencies = {nan}}).find("not finite"), std::string::npos);
    EXPECT_NE(message(Misshapen{}).find("3 components, expected 2"), std::string::npos)
        << message(Misshapen{});
}

}  // namespace
}  // namespace ricochet::lazy_series_test
