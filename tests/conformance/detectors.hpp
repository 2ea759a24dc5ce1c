// Conformance suite of detectors, on one step.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "host_step.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::test {

using detail::has_left;
using detail::opposite;
using detail::Screening;
using detail::side_of;

/// A guard over a step from 0 to 1: its values and its rates.
struct Curve {
    std::function<double(double)> value, rate;

    [[nodiscard]] Curve times(double factor) const
    {
        return {[*this, factor](double s) { return factor * value(s); },
                [*this, factor](double s) { return factor * rate(s); }};
    }
    [[nodiscard]] HostStep step(int direction = 1) const { return {1.0, value, rate, direction}; }
};

/// A cubic by its Bernstein coefficients.
struct Cubic {
    double b0, b1, b2, b3;

    [[nodiscard]] double operator()(double s) const
    {
        const double r = 1 - s;
        return b0 * r * r * r + 3 * b1 * s * r * r + 3 * b2 * s * s * r + b3 * s * s * s;
    }
    [[nodiscard]] double rate(double s) const
    {
        const double r = 1 - s;
        return 3 * ((b1 - b0) * r * r + 2 * (b2 - b1) * s * r + (b3 - b2) * s * s);
    }
    [[nodiscard]] Curve curve() const
    {
        return {*this, [*this](double s) { return rate(s); }};
    }
    /// Least value in [0, 1].
    [[nodiscard]] double least() const
    {
        // Where p + q s + r s^2 = 0.
        const double p = b1 - b0, q = 2 * (b2 - 2 * b1 + b0), r = b3 - 3 * b2 + 3 * b1 - b0;
        double least = std::min(b0, b3);
        const double root = std::sqrt(std::max(q * q - 4 * p * r, 0.0));
        for (const double s : {(-q + root) / (2 * r), (-q - root) / (2 * r)}) {
            if (s > 0 && s < 1) least = std::min(least, (*this)(s));
        }
        return least;
    }
};

/// The curve as the guard of a system whose state is the offset: its step is the step of the curve.
struct CurveSystem {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;

    Curve curve;

    void flow(double, const State&, State& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const State& x) const { return curve.value(x[0]); }
    [[nodiscard]] double guard_rate(double, const State& x, const State& dxdt) const
    {
        return curve.rate(x[0]) * dxdt[0];
    }
};

/// A detector behind functions, with its declared and promised properties.
struct DetectorCase {
    std::string name;
    std::function<Finding(const HostStep&, Watch&, Crossing, std::uint64_t*)> look;
    std::function<bool(double sign, const GuardSample& start, const GuardSample& end)> suspects;
    std::function<bool(double sign, const GuardSample&, const GuardSample&, double touch)>
        leaves_plainly;
    Evidence unsuspected{};        ///< of a step that is not suspected
    Evidence claims{};             ///< for a guard of unknown degree, once examined
    std::uint64_t most_calls = 1;  ///< of the guard in one check
    /// Number of events of `CurveSystem` in a run of one step; empty for a network, which predicts
    /// the events of one system only.
    std::function<std::size_t(const Curve&)> events_of_run{};

    /// Whether it must find every pair of crossings in a step and every touch: it must where it
    /// claims more than that there may be some which it does not see.
    [[nodiscard]] bool must_find() const noexcept { return claims != Evidence::assumed; }
};

inline void PrintTo(const DetectorCase& detector, std::ostream* out)
{
    *out << detector.name;
}

template <class Detector>
[[nodiscard]] DetectorCase any_detector(const std::string& name, const Detector& detector)
{
    DetectorCase out{
        .name = name,
        .look = [=](const HostStep& step, Watch& watch, Crossing crossing,
                    std::uint64_t* calls) { return look(detector, step, watch, crossing, calls); },
        .suspects = &Detector::suspects,
        .leaves_plainly = &Detector::leaves_plainly,
        .unsuspected = Detector::evidence};
    using State = CurveSystem::State;
    if constexpr (!detail::DetectorTableOf<Detector, CurveSystem, State>::predicts) {
        out.events_of_run = [=](const Curve& curve) {
            const Options options{.t_end = 1, .step = 1};
            return integrate(CurveSystem{curve}, State{0}, options, FixedStep<Rk4>{}, detector)
                .events.size();
        };
    }
    return out;
}

class DetectorSuite : public testing::TestWithParam<DetectorCase> {
protected:
    /// The finding of the detector for a step, and the side on which it leaves the guard.
    struct Seen : Finding {
        Side side_after = Side::plateau;
        std::uint64_t calls = 0;
    };

    [[nodiscard]] static Seen look(const HostStep& step, Side side, Crossing crossing)
    {
        Watch watch{.side = side, .start = {}, .end = {}};
        Seen seen;
        static_cast<Finding&>(seen) = GetParam().look(step, watch, crossing, &seen.calls);
        seen.side_after = watch.side_after;
        return seen;
    }
    [[nodiscard]] static Seen look(const Curve& curve, Side side, Crossing crossing)
    {
        return look(curve.step(), side, crossing);
    }

    [[nodiscard]] static bool suspects(const Curve& g, double sign)
    {
        return GetParam().suspects(sign, {.s = 0, .value = g.value(0), .rate = g.rate(0)},
                                   {.s = 1, .value = g.value(1), .rate = g.rate(1)});
    }

    /// Expects that nothing is found, with evidence no stronger than the detector has.
    static void expect_clear(const Seen& seen)
    {
        EXPECT_FALSE(seen.hit);
        EXPECT_FALSE(seen.touch);
        EXPECT_EQ(seen.evidence, GetParam().claims);
    }

    /// Expects that `side` of the curve is left between lo and hi.
    static void expect_bracket(const Seen& seen, const Curve& curve, Side side)
    {
        ASSERT_TRUE(seen.hit);
        EXPECT_EQ(seen.side, side);
        EXPECT_LT(seen.lo.s, seen.hi.s);
        EXPECT_GE(seen.lo.s, 0);
        EXPECT_LE(seen.hi.s, 1);
        EXPECT_EQ(seen.lo.value, curve.value(seen.lo.s));
        EXPECT_EQ(seen.hi.value, curve.value(seen.hi.s));
        EXPECT_TRUE(has_left(side, seen.hi.value));
        EXPECT_TRUE(seen.lo.s == 0 || !has_left(side, seen.lo.value));
    }

    /// Expects that a departure of which the detector promises nothing is bracketed, or that
    /// its absence is only assumed.
    static void expect_honest(const Seen& seen, const Curve& curve, Side side)
    {
        if (seen.hit) {
            expect_bracket(seen, curve, side);
        } else {
            EXPECT_EQ(seen.evidence, Evidence::assumed);
        }
    }

    /// Curves of many kinds that begin above the surface.
    [[nodiscard]] static std::vector<Curve> curves()
    {
        std::vector<Curve> out{
            {[](double s) { return std::exp(-s) - 0.5; }, [](double s) { return -std::exp(-s); }},
            {[](double s) { return 0.5 + s * s; }, [](double s) { return 2 * s; }},
            {[](double s) { return (s - 0.5) * (s - 0.5) - 0.01; },
             [](double s) { return 2 * s - 1; }},
            {[](double s) { return (s - 0.5) * (s - 0.5); }, [](double s) { return 2 * s - 1; }},
            {[](double s) { return (s - 0.5) * (s - 0.5) + 1e-12; },
             [](double s) { return 2 * s - 1; }},
            {[](double s) { return std::cos(9 * s); },
             [](double s) { return -9 * std::sin(9 * s); }},
            {[](double s) { return 1 - s; }, [](double) { return -1.0; }},
            {[](double s) { return s; }, [](double) { return 1.0; }},
            {[](double s) { return s * (0.25 - s); }, [](double s) { return 0.25 - 2 * s; }},
            {[](double s) { return std::max(0.0, 0.6 - s); },
             [](double s) { return s < 0.6 ? -1.0 : 0.0; }},
            {[](double s) { return s < 0.7 ? 1.0 : -1.0; }, [](double) { return 0.0; }},
            {[](double s) { return std::fabs(s - 0.3) - 0.01; },
             [](double s) { return s < 0.3 ? -1.0 : 1.0; }},
            {[](double s) { return std::pow(s - 0.3, 4) + 1e-9; },
             [](double s) { return 4 * std::pow(s - 0.3, 3); }}};
        std::mt19937_64 random(3);
        for (int i = 0; i < 40; ++i) out.push_back(cubic(random).curve());
        return out;
    }

    /// A cubic that begins above the surface.
    [[nodiscard]] static Cubic cubic(std::mt19937_64& random)
    {
        std::normal_distribution normal;
        return {std::fabs(normal(random)), normal(random), normal(random), normal(random)};
    }

    /// Expects b to equal a with values times `factor`, and with sides changed if that is negative.
    static void expect_same(const Seen& a, const Seen& b, double factor)
    {
        const auto side = [=](Side s) { return factor < 0 ? opposite(s) : s; };
        EXPECT_EQ(b.hit, a.hit);
        EXPECT_EQ(b.touch, a.touch);
        EXPECT_EQ(b.late, a.late);
        EXPECT_EQ(b.evidence, a.evidence);
        EXPECT_EQ(b.side_after, side(a.side_after));
        EXPECT_EQ(b.calls, a.calls);
        if (!a.hit && !a.touch) return;
        EXPECT_EQ(b.side, side(a.side));
        for (const auto end : {&Finding::lo, &Finding::hi}) {
            EXPECT_EQ((b.*end).s, (a.*end).s);
            EXPECT_EQ((b.*end).value, factor * (a.*end).value);
        }
    }
};

TEST_P(DetectorSuite, ATransversalCrossingIsFoundWithItsSide)
{
    for (const double at : {1e-9, 0.1, 0.5, 0.999999}) {
        for (const double bend : {0.0, 0.4, -0.4}) {
            const Curve fall{[=](double s) { return (at - s) * (1 + bend * s); },
                             [=](double s) { return bend * (at - s) - 1 - bend * s; }};
            for (const Crossing crossing : {Crossing::falling, Crossing::either}) {
                const Seen seen = look(fall, Side::above, crossing);
                expect_bracket(seen, fall, Side::above);
                EXPECT_LE(seen.lo.s, at);
                EXPECT_GE(seen.hi.s, at);
            }
            for (const Crossing crossing : {Crossing::rising, Crossing::either}) {
                expect_bracket(look(fall.times(-1), Side::below, crossing), fall.times(-1),
                               Side::below);
            }
        }
    }
}

TEST_P(DetectorSuite, ACrossingThatDoesNotCountIsRememberedAndNoEvent)
{
    const Curve fall{[](double s) { return 0.4 - s; }, [](double) { return -1.0; }};
    const Seen down = look(fall, Side::above, Crossing::rising);
    expect_clear(down);
    EXPECT_EQ(down.side_after, Side::below);
    const Seen up = look(fall.times(-1), Side::below, Crossing::falling);
    expect_clear(up);
    EXPECT_EQ(up.side_after, Side::above);
}

TEST_P(DetectorSuite, NothingIsFoundWhereTheGuardKeepsClear)
{
    const std::vector<Curve> clear{
        {[](double) { return 1.0; }, [](double) { return 0.0; }},
        {[](double s) { return 1.001 - s; }, [](double) { return -1.0; }},
        {[](double s) { return 1e-3 + s; }, [](double) { return 1.0; }},
        {[](double s) { return 1.1 + std::cos(9 * s); },
         [](double s) { return -9 * std::sin(9 * s); }},
        {[](double s) { return (s - 0.5) * (s - 0.5) + 1e-12; },
         [](double s) { return 2 * s - 1; }},
        {[](double s) { return std::pow(s - 0.3, 4) + 1e-9; },
         [](double s) { return 4 * std::pow(s - 0.3, 3); }},
        {[](double s) { return std::fabs(s - 0.3) + 1e-3; },
         [](double s) { return s < 0.3 ? -1.0 : 1.0; }}};
    for (const Curve& curve : clear) {
        for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
            const Seen above = look(curve, Side::above, crossing);
            expect_clear(above);
            EXPECT_EQ(above.side_after, Side::above);
            const Seen below = look(curve.times(-1), Side::below, crossing);
            expect_clear(below);
            EXPECT_EQ(below.side_after, Side::below);
        }
    }
}

TEST_P(DetectorSuite, TwoCrossingsInOneStepAreFoundOrHonestlyAssumed)
{
    for (const double depth : {1e-1, 1e-2, 1e-4, 1e-8, 1e-12}) {
        const double half = std::sqrt(depth);  // the roots are this far from 1/2
        const Curve dip{[=](double s) { return (s - 0.5) * (s - 0.5) - depth; },
                        [](double s) { return 2 * s - 1; }};
        const Seen first = look(dip, Side::above, Crossing::falling);
        const Seen either = look(dip, Side::above, Crossing::either);
        const Seen bump = look(dip.times(-1), Side::below, Crossing::rising);
        const Seen second = look(dip, Side::above, Crossing::rising);
        if (!GetParam().must_find()) {
            expect_honest(first, dip, Side::above);
            expect_honest(either, dip, Side::above);
            expect_honest(bump, dip.times(-1), Side::below);
            expect_honest(second, dip, Side::below);
            continue;
        }
        expect_bracket(first, dip, Side::above);
        expect_bracket(either, dip, Side::above);
        expect_bracket(bump, dip.times(-1), Side::below);
        EXPECT_LT(first.hi.s, 0.5 + half);  // between the roots
        // A rising crossing is only the second one.
        expect_bracket(second, dip, Side::below);
        EXPECT_GE(second.lo.s, 0.5 - half);
    }
}

TEST_P(DetectorSuite, ATouchIsFoundOrHonestlyAssumed)
{
    const Curve touch{[](double s) { return (s - 0.5) * (s - 0.5); },
                      [](double s) { return 2 * s - 1; }};
    const Seen seen = look(touch, Side::above, Crossing::falling);
    const Seen below = look(touch.times(-1), Side::below, Crossing::rising);
    for (const Seen& one : {seen, below}) {
        EXPECT_FALSE(one.hit);
        EXPECT_TRUE(one.touch || !GetParam().must_find());
        if (one.touch) {
            EXPECT_NEAR(one.hi.s, 0.5, 1e-7);
        } else {
            EXPECT_EQ(one.evidence, Evidence::assumed);
        }
    }
    // A guard above its surface cannot touch it as a rising guard does, nor is that a crossing.
    for (const Seen& one : {look(touch, Side::above, Crossing::rising),
                            look(touch.times(-1), Side::below, Crossing::falling)}) {
        EXPECT_FALSE(one.touch);
        EXPECT_FALSE(one.hit);
    }
}

TEST_P(DetectorSuite, AStartOnTheSurfaceIsJudgedByTheArmedSide)
{
    const Curve up{[](double s) { return s + s * s; }, [](double s) { return 1 + 2 * s; }};
    expect_clear(look(up, Side::above, Crossing::either));
    EXPECT_TRUE(look(up.times(-1), Side::above, Crossing::falling).hit);
    EXPECT_TRUE(look(up, Side::below, Crossing::rising).hit);
    // Starts slightly behind the surface: one that moves out of it, and one that stays behind.
    const Curve out{[](double s) { return s - 1e-12; }, [](double) { return 1.0; }};
    expect_clear(look(out, Side::above, Crossing::either));
    const Curve sunk{[](double s) { return -1e-12 - s * s; }, [](double s) { return -2 * s; }};
    const Seen left = look(sunk, Side::above, Crossing::falling);
    EXPECT_TRUE(left.hit);
    EXPECT_EQ(left.side, Side::above);
    // Off the surface and soon back.
    const Curve flight{[](double s) { return s * (1e-4 - s); },
                       [](double s) { return 1e-4 - 2 * s; }};
    const Seen back = look(flight, Side::above, Crossing::falling);
    expect_bracket(back, flight, Side::above);
    EXPECT_GT(back.hi.s, 1e-4);
}

TEST_P(DetectorSuite, ARootAtTheVeryEndBelongsToTheStep)
{
    const Curve arrival{[](double s) { return 1 - s; }, [](double) { return -1.0; }};
    const Seen seen = look(arrival, Side::above, Crossing::falling);
    expect_bracket(seen, arrival, Side::above);
    EXPECT_EQ(seen.hi.s, 1);
    EXPECT_EQ(seen.hi.value, 0);
    EXPECT_TRUE(look(arrival.times(-1), Side::below, Crossing::rising).hit);
}

TEST_P(DetectorSuite, AStepThatEndsOnAPlateauHasReachedIt)
{
    const Curve landing{[](double s) { return std::max(0.0, 0.6 - s); },
                        [](double s) { return s < 0.6 ? -1.0 : 0.0; }};
    const Seen seen = look(landing, Side::above, Crossing::falling);
    EXPECT_TRUE(seen.hit);
    EXPECT_FALSE(seen.touch);
}

TEST_P(DetectorSuite, AJumpOrAPoleIsASignChange)
{
    const Curve jump{[](double s) { return s < 0.7 ? 1.0 : -1.0; }, [](double) { return 0.0; }};
    EXPECT_TRUE(look(jump, Side::above, Crossing::falling).hit);
    const Curve pole{[](double s) { return 1 / (0.7 - s); },
                     [](double s) { return 1 / ((0.7 - s) * (0.7 - s)); }};
    EXPECT_TRUE(look(pole, Side::above, Crossing::falling).hit);
}

TEST_P(DetectorSuite, AGuardOnAPlateauHasNoSideToLeave)
{
    for (const Curve& curve : curves()) {
        const Seen seen = look(curve, Side::plateau, Crossing::either);
        EXPECT_FALSE(seen.hit || seen.touch);
    }
}

TEST_P(DetectorSuite, TheScaleOfTheGuardChangesNothing)
{
    for (const Curve& curve : curves()) {
        for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
            const Seen plain = look(curve, Side::above, crossing);
            for (const double factor : {0x1p-40, 0x1p-7, 0x1p40}) {
                expect_same(plain, look(curve.times(factor), Side::above, crossing), factor);
            }
        }
    }
}

TEST_P(DetectorSuite, AMirrorImageHasTheMirroredFinding)
{
    for (const Curve& curve : curves()) {
        const auto both = [&](Crossing crossing, Crossing mirrored) {
            expect_same(look(curve, Side::above, crossing),
                        look(curve.times(-1), Side::below, mirrored), -1);
        };
        both(Crossing::falling, Crossing::rising);
        both(Crossing::rising, Crossing::falling);
        both(Crossing::either, Crossing::either);
    }
}

TEST_P(DetectorSuite, TheDirectionOfTimeChangesNothing)
{
    for (const Curve& curve : curves()) {
        for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
            expect_same(look(curve.step(), Side::above, crossing),
                        look(curve.step(-1), Side::above, crossing), 1);
        }
    }
}

TEST_P(DetectorSuite, NotANumberIsNoEvidence)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    // At the end: the step is examined, and never treated as one that only leaves.
    const GuardSample start{.s = 0, .value = 1, .rate = -1};
    const GuardSample lost{.s = 1, .value = nan, .rate = -1};
    EXPECT_TRUE(GetParam().suspects(1, start, lost));
    EXPECT_FALSE(GetParam().leaves_plainly(1, start, lost, 0));
    const Curve ends{[=](double s) { return s < 1 ? 2 - s : nan; }, [](double) { return -1.0; }};
    // Inside, where the guard turns back before it reaches its surface, or does not turn.
    const Curve hole{[=](double s) { return s > 0 && s < 1 ? nan : 1.0; },
                     [](double s) { return 8 * s - 4; }};
    const Curve slope{[=](double s) { return s > 0 && s < 1 ? nan : 1.0; },
                      [=](double s) { return s > 0 && s < 1 ? nan : s - 0.5; }};
    for (const Curve& curve : {ends, hole}) {
        const Seen seen = look(curve, Side::above, Crossing::falling);
        EXPECT_FALSE(seen.hit || seen.touch);
        EXPECT_EQ(seen.evidence, Evidence::assumed);
    }
    EXPECT_FALSE(look(slope, Side::above, Crossing::falling).hit);
    // A departure before the hole is found, and the hole does not hide what the ends show.
    for (const double from : {0.0, 0.3}) {
        const Curve wave{[=](double s) { return s > from && s < 0.4 ? nan : std::cos(8 * s); },
                         [](double s) { return -8 * std::sin(8 * s); }};
        EXPECT_TRUE(look(wave, Side::above, Crossing::falling).hit);
    }
}

TEST_P(DetectorSuite, RandomCubicsAreDecidedByTheirLeastValue)
{
    std::mt19937_64 random(11);
    int pairs = 0;
    for (int i = 0; i < 20000 && !HasFailure(); ++i) {
        const Cubic g = cubic(random);
        const double least = g.least();
        if (std::fabs(least) < 1e-9 || std::fabs(g.b3) < 1e-9 || g.b0 < 1e-9) continue;
        const Seen seen = look(g.curve(), Side::above, Crossing::falling);
        const bool pair = least < 0 && g.b3 > 0;
        pairs += pair;
        if (pair && !GetParam().must_find()) {
            expect_honest(seen, g.curve(), Side::above);
        } else if (least < 0) {
            expect_bracket(seen, g.curve(), Side::above);
        } else {
            expect_clear(seen);
        }
        EXPECT_FALSE(seen.touch);
        if (!seen.hit) {
            EXPECT_EQ(seen.side_after, side_of(g.b3));
        }
    }
    EXPECT_GT(pairs, 1000);
}

TEST_P(DetectorSuite, AStepThatIsNotSuspectedHasNothingToFind)
{
    std::mt19937_64 random(12);
    int unsuspected = 0;
    for (int i = 0; i < 20000 && !HasFailure(); ++i) {
        const Cubic g = cubic(random);
        if (suspects(g.curve(), 1)) continue;
        ++unsuspected;
        EXPECT_FALSE(suspects(g.curve().times(-1), -1));
        EXPECT_GT(g.b3, 0);
        if (GetParam().unsuspected != Evidence::assumed) {
            EXPECT_GT(g.least(), 0);
        }
        expect_clear(look(g.curve(), Side::above, Crossing::either));
    }
    if (GetParam().must_find()) {
        // It turns far from its surface, but the ends do not show its path there.
        EXPECT_TRUE(GetParam().suspects(1, {.s = 0, .value = 1, .rate = -1},
                                        {.s = 1, .value = 1, .rate = 1}));
        EXPECT_TRUE(GetParam().suspects(-1, {.s = 0, .value = -1, .rate = 1},
                                        {.s = 1, .value = -1, .rate = -1}));
    }
    // A detector that suspects every step declares `proved`, which holds for the steps that are
    // left: those without armed guards.
    EXPECT_TRUE(unsuspected > 1000 || GetParam().unsuspected == Evidence::proved);
}

TEST_P(DetectorSuite, ARunAsksTheDetectorAboutTheStepsThatItSuspects)
{
    if (!GetParam().events_of_run) return;
    const Curve fall{[](double s) { return 0.4 - s; }, [](double) { return -1.0; }};
    const Curve dip{[](double s) { return (s - 0.5) * (s - 0.5) - 0.01; },
                    [](double s) { return 2 * s - 1; }};
    // A dip so narrow that neither values nor rates show it at the ends: 1 - 1.5 exp(-u^2).
    const auto u = [](double s) { return (s - 0.5) / 0.1; };
    const Curve narrow{[=](double s) { return 1 - 1.5 * std::exp(-u(s) * u(s)); },
                       [=](double s) { return 30 * u(s) * std::exp(-u(s) * u(s)); }};
    for (const Curve& curve : {fall, dip, narrow}) {
        const Seen seen = look(curve, Side::above, Crossing::falling);
        if (!suspects(curve, 1) || !seen.hit) continue;
        EXPECT_GT(GetParam().events_of_run(curve), 0U)
            << "the detector suspects this step and finds an event in it, and a run does not: a "
               "detector with a `suspects` of its own declares Screening::own";
    }
}

TEST_P(DetectorSuite, WhatLeavesPlainlyIsFoundInTheWholeStep)
{
    std::mt19937_64 random(13);
    for (int i = 0; i < 20000 && !HasFailure(); ++i) {
        const Cubic g = cubic(random);
        const GuardSample start{.s = 0, .value = g(0), .rate = g.rate(0)};
        const GuardSample end{.s = 1, .value = g(1), .rate = g.rate(1)};
        if (!GetParam().leaves_plainly(1, start, end, 0)) continue;
        const Seen seen = look(g.curve(), Side::above, Crossing::falling);
        expect_bracket(seen, g.curve(), Side::above);
        EXPECT_EQ(seen.lo.s, 0);
        EXPECT_EQ(seen.hi.s, 1);
        EXPECT_EQ(seen.side_after, Side::below);
    }
}

TEST_P(DetectorSuite, WorkOnAHopelessGuardIsBounded)
{
    // No polynomial fits it anywhere, and it may be on its surface at any time.
    const Curve noise{[](double s) { return 0.5 + std::sin(1e9 * s); }, [](double) { return 0.0; }};
    EXPECT_LE(look(noise, Side::above, Crossing::rising).calls, GetParam().most_calls);
    for (const Curve& curve : curves()) {
        EXPECT_LE(look(curve, Side::above, Crossing::falling).calls, GetParam().most_calls);
    }
}

}  // namespace ricochet::test
