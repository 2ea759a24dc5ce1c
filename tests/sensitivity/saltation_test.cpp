// Derivatives through a single event, by the saltation by itself: against closed forms, and against
// differences of motions that are known in closed form. The functions of the systems have no
// declared derivatives; their five-point differences are exact up to degree four, so that 1e-10
// holds their rounding.
#include "ricochet/sensitivity/detail/saltation.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace ricochet::saltation_test {
namespace {

using X = std::array<double, 2>;
using detail::LastEvent;
using detail::Motion;
constexpr double rounding = 1e-10;

/// Lines in the plane, each with a reset, and any flow between them.
struct Plane {
    using State = X;
    /// The guard is normal . x + drift t - offset.
    struct Line {
        X normal{};
        double offset = 0;
        std::function<Mode(Mode, double, X&)> reset{};
        double drift = 0;  ///< [1/s]
        GuardInfo info{};
    };

    std::function<X(Mode, const X&)> rate;
    std::vector<Line> lines{};
    X at_rest{};

    void flow(Mode mode, double, const X& x, X& dxdt) const { dxdt = rate(mode, x); }
    [[nodiscard]] std::size_t mode_count() const { return 4; }
    [[nodiscard]] std::size_t guard_count() const { return lines.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return lines[i].info; }
    [[nodiscard]] double guard(std::size_t i, Mode, double t, const X& x) const
    {
        const Line& line = lines[i];
        return line.normal[0] * x[0] + line.normal[1] * x[1] + line.drift * t - line.offset;
    }
    Mode reset(std::size_t i, Mode mode, double t, X& x) const
    {
        return lines[i].reset ? lines[i].reset(mode, t, x) : mode;
    }
    /// The first component rests; the second goes on.
    Mode rest(std::size_t, Mode mode, double, X& x) const
    {
        x[0] = at_rest[0];
        return mode;
    }
};

template <class System>
using Of = detail::Saltation<System, X>;

template <class System>
Of<System> saltation_of(const System& system, const std::vector<Parameter<System>>& parameters = {},
                        const Options& options = {.t_end = 10})
{
    return {{system, parameters, {}, 2}, 2, options};
}

/// A motion whose derivatives are those by its own state.
template <class System>
Motion<X> motion_at(const Of<System>& of, double t, const X& x, Mode mode = 0)
{
    return {mode, t, x, Eigen::MatrixXd::Identity(2, static_cast<Eigen::Index>(of.columns()))};
}

/// No event so far; the motion has started a second before t.
LastEvent none(double t)
{
    return {t - 1, {}, false, t - 1};
}

Eigen::MatrixXd matrix(std::initializer_list<std::initializer_list<double>> rows)
{
    return Eigen::MatrixXd(rows);
}

void expect_near(const Eigen::MatrixXd& found, const Eigen::MatrixXd& exact, double tolerance)
{
    ASSERT_EQ(found.rows(), exact.rows());
    ASSERT_EQ(found.cols(), exact.cols());
    EXPECT_LE((found - exact).cwiseAbs().maxCoeff(), tolerance) << found << "\nnot\n" << exact;
}

/// A ball over a floor: x = (height, velocity).
Plane ball(double restitution, double gravity = 10)
{
    return {.rate =
                [=](Mode, const X& x) {
                    return X{x[1], -gravity};
                },
            .lines = {{.normal = {1, 0}, .reset = [=](Mode mode, double, X& x) {
                           x[1] *= -restitution;
                           return mode;
                       }}}};
}

/// Flows that are constant in each mode, and lines x0 = 0 and x1 = 0, crossing which turns on the
/// bits 1 and 2 of the mode.
Plane quadrants(const std::array<X, 4>& rates)
{
    const auto turn_on = [](Mode bit) {
        return [bit](Mode mode, double, X&) { return mode | bit; };
    };
    return {.rate = [=](Mode mode, const X&) { return rates[mode]; },
            .lines = {{.normal = {1, 0}, .reset = turn_on(1)},
                      {.normal = {0, 1}, .reset = turn_on(2)}}};
}

TEST(Saltation, TheTimeOfACrossingMovesByTheGuardOverItsRate)
{
    // The rate is 3 * 1 + 4 * (-2) + 2 = -3, and dt = -(g_x S + g_p) / rate.
    const auto system = [](double offset) {
        return Plane{.rate =
                         [](Mode, const X&) {
                             return X{1, -2};
                         },
                     .lines = {{.normal = {3, 4}, .offset = offset, .drift = 2}}};
    };
    const auto of = saltation_of(system(7), {{.with = system, .nominal = 7.0}});
    Motion<X> motion = motion_at(of, 1, {3, -1});  // 9 - 4 + 2 = 7
    motion.derivatives << 2, 0, 0, 1, 1, 0;
    const auto time = of.crossing(0, motion, none(1));
    ASSERT_EQ(time.undefined, Undefined::no);
    expect_near(time.dt.transpose(), matrix({{10.0 / 3, 4.0 / 3, -1.0 / 3}}), rounding);
}

TEST(Saltation, OfABallOnAFloorIsItsMatrix)
{
    // With v the velocity before the impact: ((-e, 0), (-(1 + e) gravity / v, -e)), and by e the
    // velocity after it changes by -v. The impact itself does not depend on gravity.
    const double v = -3;
    const double e = 0.5;
    const auto of = saltation_of(
        ball(e), {{.with = [](double value) { return ball(value); }, .nominal = e},
                  {.with = [=](double value) { return ball(e, value); }, .nominal = 10.0}});
    Motion<X> motion = motion_at(of, 2, {0, v});
    const std::size_t floor = 0;
    LastEvent last = none(2);
    const Undefined undefined =
        of.pass_set(FiredGuards(std::span(&floor, 1)), {0, -e * v}, motion, last);
    ASSERT_EQ(undefined, Undefined::no);
    EXPECT_EQ(motion.x, (X{0, -e * v}));
    expect_near(motion.derivatives, matrix({{-e, 0, 0, 0}, {-(1 + e) * 10 / v, -e, -v, 0}}),
                rounding);
    EXPECT_TRUE(last.any);
    EXPECT_EQ(last.t, 2);
    expect_near(last.dt.transpose(), matrix({{-1 / v, 0, 0, 0}}), rounding);
}

/// A motion at a constant rate, from x at t = 0, to a line that moves, and with another rate on
/// from there, up to t = 2.
struct Broken {
    X before{1, -2}, after{-1, 3}, normal{3, 4};
    double drift = 2, offset = 7;

    static void reset(double t, X& x) { x = {x[0] * x[1] + t * t, x[1] - 2 * x[0]}; }
    [[nodiscard]] double crossing(const X& x) const
    {
        const double rate = normal[0] * before[0] + normal[1] * before[1] + drift;
        return (offset - normal[0] * x[0] - normal[1] * x[1]) / rate;
    }
    [[nodiscard]] X end(X x) const
    {
        const double t = crossing(x);
        for (std::size_t c = 0; c < 2; ++c) x[c] += t * before[c];
        reset(t, x);
        for (std::size_t c = 0; c < 2; ++c) x[c] += (2 - t) * after[c];
        return x;
    }
    [[nodiscard]] Plane plane() const
    {
        return {.rate = [*this](Mode mode, const X&) { return mode == 0 ? before : after; },
                .lines = {{.normal = normal,
                           .offset = offset,
                           .reset = [](Mode, double t, X& x) -> Mode {
                               reset(t, x);
                               return 1;
                           },
                           .drift = drift}}};
    }
};

TEST(Saltation, AgreesWithDifferencesOfTheMotion)
{
    // Both rates are constant: derivatives change at the event alone. The third derivatives of the
    // end are less than 100, so central differences over 1e-4 have errors below 1e-6.
    const Broken motion;
    const X start{2, 1};
    const double h = 1e-4;
    Eigen::MatrixXd differences(2, 3);
    for (std::size_t j = 0; j < 3; ++j) {
        const auto moved = [&](double by) {
            X x = start;
            Broken other = motion;
            (j < 2 ? x[j] : other.offset) += by;
            return other.end(x);
        };
        const X more = moved(h), less = moved(-h);
        for (std::size_t c = 0; c < 2; ++c) {
            differences(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(j)) =
                (more[c] - less[c]) / (2 * h);
        }
    }
    const auto with = [&](double offset) {
        Broken other = motion;
        other.offset = offset;
        return other.plane();
    };
    const auto of = saltation_of(motion.plane(), {{.with = with, .nominal = motion.offset}});
    const double t = motion.crossing(start);
    X x{start[0] + t * motion.before[0], start[1] + t * motion.before[1]};
    Motion<X> at = motion_at(of, t, x);
    const auto time = of.crossing(0, at, none(t));
    ASSERT_EQ(time.undefined, Undefined::no);
    of.pass(detail::ResetOf{0}, time.dt, at);
    EXPECT_EQ(at.mode, 1u);
    expect_near(at.derivatives, differences, 1e-6);
}

TEST(Saltation, AChangeOfFlowAddsItsJumpTimesTheChangeOfTime)
{
    // S becomes S + (f before - f after) dt, with dt = (1, 0).
    const auto of = saltation_of(quadrants({{{-1, 2}, {5, -3}, {}, {}}}));
    Motion<X> motion = motion_at(of, 1, {0, 8});
    const auto time = of.crossing(0, motion, none(1));
    ASSERT_EQ(time.undefined, Undefined::no);
    of.pass(detail::ResetOf{0}, time.dt, motion);
    expect_near(motion.derivatives, matrix({{-5, 0}, {5, 1}}), rounding);
}

TEST(Saltation, AGrazingMotionHasNone)
{
    // The ball returns within the blur of its height, 1e-10, below a velocity of 3e-5.
    const auto of = saltation_of(ball(0.5));
    const std::size_t floor = 0;
    const FiredGuards fired(std::span(&floor, 1));
    for (const double v : {0.0, -1e-6, -1e-3}) {
        const Undefined expected = v == -1e-3 ? Undefined::no : Undefined::grazing;
        Motion<X> motion = motion_at(of, 2, {0, v});
        EXPECT_EQ(of.crossing(0, motion, none(2)).undefined, expected) << v;
        LastEvent last = none(2);
        EXPECT_EQ(of.pass_set(fired, {0, -0.5 * v}, motion, last), expected) << v;
    }
}

TEST(Saltation, AGuardAwayFromItsSurfaceOrWithoutValuesHasNone)
{
    Plane system = ball(0.5);
    const auto of = saltation_of(system);
    const Motion<X> above = motion_at(of, 2, {0.1, -1});
    EXPECT_EQ(of.crossing(0, above, none(2)).undefined, Undefined::off_surface);
    // An event of this time has carried it across, and it moves with that.
    const LastEvent carried{2, Eigen::Vector2d{3, 4}, true, 1};
    const auto with_that = of.crossing(0, above, carried);
    EXPECT_EQ(with_that.undefined, Undefined::no);
    EXPECT_EQ(with_that.dt, carried.dt);
    const LastEvent earlier{1.9, Eigen::Vector2d{3, 4}, true, 1};
    EXPECT_EQ(of.crossing(0, above, earlier).undefined, Undefined::off_surface);

    system.lines[0].info.boolean = true;
    const auto boolean = saltation_of(system);
    EXPECT_EQ(boolean.crossing(0, motion_at(boolean, 2, {0, -1}), none(2)).undefined,
              Undefined::boolean_guard);
}

TEST(Saltation, OfTwoEventsAtOnceIsTheProductIfTheirOrderDoesNotMatter)
{
    // Each line turns its own component back.
    const auto of = saltation_of(quadrants({{{-1, -2}, {1, -2}, {-1, 2}, {1, 2}}}));
    const std::array<std::size_t, 2> both{0, 1};
    Motion<X> motion = motion_at(of, 1, {0, 0});
    LastEvent last = none(1);
    EXPECT_EQ(of.pass_set(FiredGuards(both), {0, 0}, motion, last), Undefined::no);
    EXPECT_EQ(motion.mode, 3u);
    expect_near(motion.derivatives, matrix({{-1, 0}, {0, -1}}), rounding);

    // A single one, while the other crosses as well: that neighbours meet the other first does not
    // matter either.
    Motion<X> first = motion_at(of, 1, {0, 0});
    last = none(1);
    EXPECT_EQ(of.pass_set(FiredGuards(std::span(both).first(1)), {0, 0}, first, last),
              Undefined::no);
    expect_near(first.derivatives, matrix({{-1, 0}, {0, 1}}), rounding);
}

TEST(Saltation, TwoEventsAtOnceWhoseOrderMattersHaveNone)
{
    // The first turns on mode 1, in which the second component is faster than in mode 0: met in
    // this order the matrix is ((-1, 0), (-1/2, -1/2)), and in the other ((-1, 0), (0, -1)).
    const auto of = saltation_of(quadrants({{{-1, -1}, {1, -2}, {-1, 1}, {1, 1}}}));
    const std::array<std::size_t, 2> both{0, 1};
    for (const std::size_t fired : {1u, 2u}) {
        Motion<X> motion = motion_at(of, 1, {0, 0});
        LastEvent last = none(1);
        EXPECT_EQ(of.pass_set(FiredGuards(std::span(both).first(fired)), {0, 0}, motion, last),
                  Undefined::simultaneous)
            << fired;
    }
    // Apart, the first has one.
    Motion<X> motion = motion_at(of, 1, {0, 1});
    LastEvent last = none(1);
    EXPECT_EQ(of.pass_set(FiredGuards(std::span(both).first(1)), {0, 1}, motion, last),
              Undefined::no);
    expect_near(motion.derivatives, matrix({{-1, 0}, {1, 1}}), rounding);
}

TEST(Saltation, AResetWithoutADerivativeIsNamed)
{
    // The square root has none at 0; from 1 it is 1/2.
    const Plane system{.rate =
                           [](Mode, const X&) {
                               return X{-1, 0};
                           },
                       .lines = {{.normal = {1, 0}, .reset = [](Mode mode, double, X& x) {
                                      x[1] = std::sqrt(x[1]);
                                      return mode;
                                  }}}};
    const auto of = saltation_of(system);
    const std::size_t line = 0;
    for (const double x1 : {0.0, 1.0}) {
        Motion<X> motion = motion_at(of, 1, {0, x1});
        LastEvent last = none(1);
        const Undefined undefined =
            of.pass_set(FiredGuards(std::span(&line, 1)), {0, x1}, motion, last);
        EXPECT_EQ(undefined, x1 == 0 ? Undefined::non_finite : Undefined::no);
        if (x1 == 1) {
            EXPECT_NEAR(motion.derivatives(1, 1), 0.5, rounding);
        }
    }
}

TEST(Saltation, ComponentsThatARestHoldsStandStill)
{
    // The first component presses on its line and rests there, and the second slides on.
    Plane system{.rate =
                     [](Mode mode, const X&) {
                         return mode == 0 ? X{-1, 5} : X{1, 5};
                     },
                 .lines = {{.normal = {1, 0}}}};
    const auto of = saltation_of(system);
    Motion<X> motion = motion_at(of, 1, {0, 3});
    const std::vector<bool> held = of.held_by_rest(0, motion, {0, 3});
    EXPECT_EQ(held, (std::vector<bool>{true, false}));
    of.pass(detail::RestOf{0}, Eigen::Vector2d{1, 0}, motion, held);
    expect_near(motion.derivatives, matrix({{0, 0}, {0, 1}}), rounding);

    // A motion that leaves the line is not held.
    const Motion<X> leaves = motion_at(of, 1, {0, 3}, 1);
    EXPECT_EQ(of.held_by_rest(0, leaves, {0, 3}), (std::vector<bool>{false, false}));
}

/// Its first line takes 1 from the second component, or sets it to 1; the second is x1 = place.
Plane steps(bool takes, double place)
{
    const auto step = [takes](Mode mode, double, X& x) {
        x = {2, takes ? x[1] - 1 : 1};
        return mode;
    };
    return {.rate =
                [](Mode, const X&) {
                    return X{-1, -1};
                },
            .lines = {{.normal = {1, 0}, .reset = step}, {.normal = {0, 1}, .offset = place}}};
}

TEST(Saltation, AnEventThatPutsOnlySomeNeighboursOnASurfaceIsSeen)
{
    const std::size_t first = 0, second = 1;
    for (const bool takes : {true, false}) {
        for (const double place : {1.0, 0.5}) {
            const auto of = saltation_of(steps(takes, place));
            const Motion<X> before = motion_at(of, 1, {0, 2});
            Motion<X> after = before;
            LastEvent last = none(1);
            ASSERT_EQ(of.pass_set(FiredGuards(std::span(&first, 1)), {2, 1}, after, last),
                      Undefined::no);
            EXPECT_EQ(of.leaves_surface(before, after, last), takes && place == 1);
            if (place != 1) continue;
            // The second line fires there, and moves with the first if all neighbours are on it.
            EXPECT_EQ(of.pass_set(FiredGuards(std::span(&second, 1)), {2, 1}, after, last),
                      takes ? Undefined::simultaneous : Undefined::no);
        }
    }
}

TEST(Saltation, ASetHoldsWhereItsGuardsStayOnTheirSurfaces)
{
    // In mode 0 the motion goes along the line x0 = 0, in mode 1 across it.
    const auto of = saltation_of(quadrants({{{0, 1}, {-1, 1}, {}, {}}}));
    const std::size_t line = 0;
    const FiredGuards fired(std::span(&line, 1));
    EXPECT_TRUE(of.holds(fired, motion_at(of, 1, {0, 3})));
    EXPECT_FALSE(of.holds(fired, motion_at(of, 1, {0, 3}, 1)));
    EXPECT_FALSE(of.holds(fired, motion_at(of, 1, {0.1, 3})));
    EXPECT_FALSE(of.holds(FiredGuards(std::span(&line, 1), true), motion_at(of, 1, {0, 3})));
}

/// x0' = 1 and a clock that doubles it at the multiples of its period; `gap` takes the first of
/// them away if it is any later than 1.
struct Clock {
    using State = X;
    double period = 1;
    bool gap = false;

    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double next_time_event(double t) const
    {
        if (gap && period > 1) return std::numeric_limits<double>::infinity();
        return period * (std::floor(t / period) + 1);
    }
    void time_reset(double, X& x) const { x[0] *= 2; }
};

TEST(Saltation, ATimeEventMovesWithItsParametersAlone)
{
    // The third is at 3 period: it moves by 3, and x0 after it by (2 - 1) times that.
    const auto with = [](double period) { return Clock{period}; };
    const auto of = saltation_of(Clock{}, {{.with = with, .nominal = 1.0}});
    const auto time = of.time_event(3);
    ASSERT_EQ(time.undefined, Undefined::no);
    expect_near(time.dt.transpose(), matrix({{0, 0, 3}}), 1e-9);
    Motion<X> motion = motion_at(of, 3, {3, 0});
    LastEvent last = none(3);
    EXPECT_EQ(of.pass_set(FiredGuards({}, true), {6, 0}, motion, last), Undefined::no);
    expect_near(motion.derivatives, matrix({{2, 0, 3}, {0, 1, 0}}), 1e-9);
}

TEST(Saltation, ATimeEventThatVanishesBesideTheParameterIsNamed)
{
    const auto with = [](double period) { return Clock{period, true}; };
    const auto of = saltation_of(Clock{1, true}, {{.with = with, .nominal = 1.0}});
    EXPECT_EQ(of.time_event(1).undefined, Undefined::time_event_jumps);
}

TEST(Saltation, EventsWithinTheWindowAreAtOneTime)
{
    const auto of = saltation_of(ball(0.5), {}, {.t_end = 10, .event_window = 1e-3});
    EXPECT_TRUE(of.at_one_time(1, 1.0009));
    EXPECT_TRUE(of.at_one_time(1.0009, 1));
    EXPECT_FALSE(of.at_one_time(1, 1.0011));
}

}  // namespace
}  // namespace ricochet::saltation_test
