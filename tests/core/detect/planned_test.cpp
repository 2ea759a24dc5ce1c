#include "ricochet/planned.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::planned_test {
namespace {

using X = std::array<double, 4>;  // position [m], velocity [m/s]
using PlanRun = ricochet::Run<X>;
using Controlled = ErrorControlled<Dopri5>;
using Fixed = FixedStep<Rk4>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

bool same_bits(double a, double b)
{
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

bool same_bits(const X& a, const X& b)
{
    return std::equal(a.begin(), a.end(), b.begin(),
                      [](double p, double q) { return same_bits(p, q); });
}

/// All results of a run about the motion, to the last bit.
void expect_same(const PlanRun& exact, const PlanRun& planned)
{
    EXPECT_EQ(exact.outcome, planned.outcome) << name(planned.outcome);
    EXPECT_EQ(exact.guard, planned.guard);
    EXPECT_EQ(exact.mode, planned.mode);
    EXPECT_TRUE(same_bits(exact.t, planned.t)) << exact.t << ' ' << planned.t;
    EXPECT_TRUE(same_bits(exact.x, planned.x));
    ASSERT_EQ(exact.events.size(), planned.events.size());
    for (std::size_t k = 0; k < exact.events.size(); ++k) {
        const auto& a = exact.events[k];
        const auto& b = planned.events[k];
        ASSERT_EQ(a.kind, b.kind) << k;
        ASSERT_EQ(a.guard, b.guard) << k;
        ASSERT_TRUE(same_bits(a.t, b.t)) << k << ": " << a.t << ' ' << b.t;
        ASSERT_TRUE(same_bits(a.before, b.before) && same_bits(a.after, b.after)) << k;
        ASSERT_TRUE(same_bits(a.bracket.lo, b.bracket.lo) && same_bits(a.bracket.hi, b.bracket.hi));
        ASSERT_TRUE(same_bits(a.slope, b.slope) && same_bits(a.error, b.error)) << k;
        ASSERT_EQ(a.mode_after, b.mode_after) << k;
    }
    ASSERT_EQ(exact.trajectory.t, planned.trajectory.t);
    for (std::size_t k = 0; k < exact.trajectory.x.size(); ++k) {
        ASSERT_TRUE(same_bits(exact.trajectory.x[k], planned.trajectory.x[k])) << k;
    }
    ASSERT_EQ(exact.solution.size(), planned.solution.size());
    if (!exact.solution.empty()) {
        for (double u = 0; u <= 1; u += 1.0 / 64) {
            ASSERT_TRUE(same_bits(exact.solution(u * exact.t), planned.solution(u * exact.t)));
        }
    }
    const Statistics& a = exact.statistics;
    const Statistics& b = planned.statistics;
    EXPECT_EQ(a.steps, b.steps);
    EXPECT_EQ(a.rejected, b.rejected);
    EXPECT_EQ(a.events, b.events);
    EXPECT_EQ(a.suppressed, b.suppressed);
    EXPECT_EQ(a.disabled, b.disabled);
    // Every step without an event has its evidence.
    const auto total = [](const EvidenceCounts& counts) {
        return counts.proved + counts.checked + counts.gated + counts.assumed;
    };
    EXPECT_EQ(total(a.evidence), total(b.evidence));
}

/// Runs with the exact detector, and planned with and without looking ahead. Returns the
/// planned run that looks ahead.
template <class Stepping, class Exact = Extremum, class System>
PlanRun expect_planned_same(const System& system, const X& start, const Options& options,
                            bool check_bounds = true)
{
    auto exact = integrate(system, start, options, Stepping{}, Exact{});
    for (const std::size_t longest : {1u, 3u, 64u}) {
        SCOPED_TRACE(longest);
        PlannerOptions plan;
        plan.longest_interval = longest;
        plan.two_ended = longest > 1;
        plan.check_bounds = check_bounds;
        auto planned = integrate(system, start, options, Stepping{}, Planned<Exact>(plan, Exact{}));
        expect_same(exact, planned);
        if (longest == 64) return planned;
    }
    return exact;
}

struct Disc {
    double x, y, r;
};

/// A point among discs in a circular room, under gravity, reflected by discs and wall. The
/// guard is its distance from the nearest of them.
struct Room {
    using State = X;
    double gravity = 1;
    double restitution = 1;
    double radius = 3;
    std::vector<Disc> discs;

    void flow(double, const X& x, X& dxdt) const { dxdt = {x[2], x[3], 0, -gravity}; }

    template <class V>
    [[nodiscard]] double guard(double, const V& x) const
    {
        double nearest = radius - std::hypot(x[0], x[1]);
        for (const Disc& disc : discs) {
            nearest = std::min(nearest, std::hypot(x[0] - disc.x, x[1] - disc.y) - disc.r);
        }
        return nearest;
    }

    void reset(double, X& x) const
    {
        double nearest = radius - std::hypot(x[0], x[1]);
        Disc from{0, 0, -1};
        for (const Disc& disc : discs) {
            const double d = std::hypot(x[0] - disc.x, x[1] - disc.y) - disc.r;
            if (d < nearest) from = disc;
            nearest = std::min(nearest, d);
        }
        reflect(from, restitution, x);
    }

    static void reflect(const Disc& disc, double restitution, X& x)
    {
        const double outward = disc.r < 0 ? -1 : 1;
        const double distance = std::hypot(x[0] - disc.x, x[1] - disc.y);
        const double nx = outward * (x[0] - disc.x) / distance;
        const double ny = outward * (x[1] - disc.y) / distance;
        const double speed = x[2] * nx + x[3] * ny;
        if (speed >= 0) return;
        x[2] -= (1 + restitution) * speed * nx;
        x[3] -= (1 + restitution) * speed * ny;
    }

    [[nodiscard]] double speed_bound(double, const X& x) const { return std::hypot(x[2], x[3]); }
    [[nodiscard]] double acceleration_bound(double, const X&) const { return gravity; }
};

Room random_room(std::mt19937_64& random, X& start)
{
    std::uniform_real_distribution<double> uniform(-1, 1);
    Room room;
    room.gravity = uniform(random) < -0.5 ? 0 : std::exp(uniform(random));
    room.restitution = uniform(random) < 0 ? 1 : 0.9;
    for (int k = 0; k < 6; ++k) {
        room.discs.push_back(
            {2 * uniform(random), 2 * uniform(random), 0.3 + 0.2 * uniform(random)});
    }
    do {
        start = {2 * uniform(random), 2 * uniform(random), 2 * uniform(random),
                 2 * uniform(random)};
    } while (room.guard(0, start) <= 0.01);
    return room;
}

/// Whether the exact detector loses an event of the room in its long steps; then the planned runs
/// find it where short steps do.
bool loses_an_event(const Room& room, const X& start, const Options& options)
{
    const auto exact = integrate(room, start, options, Controlled{});
    const auto planned = integrate(room, start, options, Controlled{}, Planned{});
    std::size_t k = 0;
    const std::size_t shared = std::min(exact.events.size(), planned.events.size());
    while (k < shared && same_bits(exact.events[k].t, planned.events[k].t)) ++k;
    if (k == planned.events.size()) return false;
    Options fine = options;
    fine.h_max = 1e-3;
    fine.max_steps = 10'000;
    const auto found = integrate(room, start, fine, Controlled{}).events;
    EXPECT_GT(found.size(), k);
    if (k >= found.size()) return true;
    // The runs have errors of 1e-8 a step, which impacts multiply.
    EXPECT_NEAR(found[k].t, planned.events[k].t, 1e-5);
    if (k < exact.events.size()) {
        EXPECT_GT(exact.events[k].t, planned.events[k].t);
    }
    return true;
}

TEST(Planned, RandomRoomsHaveTheEventsOfTheExactDetector)
{
    std::mt19937_64 random(20);
    std::uint64_t events = 0;
    std::uint64_t proved = 0;
    std::uint64_t steps = 0;
    std::uint64_t rollbacks = 0;
    int lost = 0;
    for (int i = 0; i < 1000 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        const Room room = random_room(random, start);
        const double step = i % 3 == 0 ? 0.05 : 0.01;
        const auto fixed =
            expect_planned_same<Fixed>(room, start, {.t_end = 3, .step = step, .max_steps = 200});
        const Options options{
            .t_end = 3, .rtol = 1e-8, .h_max = i % 2 ? 0.03 : 10, .max_steps = 200};
        if (loses_an_event(room, start, options)) {
            ++lost;
            continue;
        }
        const auto controlled = expect_planned_same<Controlled>(room, start, options);
        for (const PlanRun* run : {&fixed, &controlled}) {
            events += run->statistics.events;
            proved += run->statistics.evidence.proved;
            steps += run->statistics.steps;
            rollbacks += run->statistics.rollbacks;
        }
    }
    // The bounds did most of the work, and the fallbacks were exercised.
    EXPECT_GT(events, 2000u);
    EXPECT_GT(proved, steps * 8 / 10);
    EXPECT_GT(rollbacks, 100u);
    // Long steps pass some discs, in one room of ten.
    EXPECT_GT(lost, 0);
    EXPECT_LT(lost, 200);
}

TEST(Planned, SamplesAndSolutionAreThoseOfTheExactRun)
{
    std::mt19937_64 random(21);
    std::uniform_real_distribution<double> uniform(0, 6);
    for (int i = 0; i < 40 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        const Room room = random_room(random, start);
        Options options{.t_end = 6, .step = 0.01, .record_steps = true};
        for (int k = 0; k < 50; ++k) options.sample_times.push_back(uniform(random));
        std::sort(options.sample_times.begin(), options.sample_times.end());
        expect_planned_same<Fixed>(room, start, options);
        options.step = 0;
        options.h_max = 0.05;
        expect_planned_same<Controlled>(room, start, options);
    }
}

TEST(Planned, BackwardRunsHaveTheEventsOfTheExactDetector)
{
    std::mt19937_64 random(22);
    std::uint64_t events = 0;
    for (int i = 0; i < 60 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        Room room = random_room(random, start);
        room.restitution = 1;
        // Backward in time the velocity after an event is the one that leads away from it.
        struct Backward : Room {
            void reset(double t, X& x) const
            {
                x[2] = -x[2];
                x[3] = -x[3];
                Room::reset(t, x);
                x[2] = -x[2];
                x[3] = -x[3];
            }
        };
        const Backward backward{room};
        const auto run = expect_planned_same<Controlled>(backward, start,
                                                         {.t_start = 5, .t_end = 0, .h_max = 0.05});
        events += run.statistics.events;
    }
    EXPECT_GT(events, 100u);
}

TEST(Planned, EndsAsTheExactDetectorKeepsItsEvents)
{
    std::mt19937_64 random(23);
    for (int i = 0; i < 60 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        const Room room = random_room(random, start);
        expect_planned_same<Fixed, Ends>(room, start, {.t_end = 5, .step = 0.01});
    }
}

TEST(Planned, BernsteinAsTheExactDetectorKeepsItsEvents)
{
    std::mt19937_64 random(31);
    for (int i = 0; i < 10 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        const Room room = random_room(random, start);
        expect_planned_same<Fixed, Bernstein>(room, start, {.t_end = 2, .step = 0.01});
    }
}

/// Every disc is a guard: some reflect, others only record that their zone was entered or left.
struct ManyDiscs {
    using State = X;
    std::vector<Disc> discs;
    std::vector<bool> zone;
    double gravity = 0.5;
    double radius = 6;

    [[nodiscard]] std::size_t guard_count() const { return discs.size() + 1; }
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[2], x[3], 0, -gravity}; }

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        GuardInfo info;
        if (which < discs.size() && zone[which]) {
            info.crossing = Crossing::either;
            info.resets = false;
        }
        return info;
    }

    template <class V>
    [[nodiscard]] double guard(std::size_t which, double, const V& x) const
    {
        if (which == discs.size()) return radius - std::hypot(x[0], x[1]);
        return std::hypot(x[0] - discs[which].x, x[1] - discs[which].y) - discs[which].r;
    }

    void reset(std::size_t which, double, X& x) const
    {
        Room::reflect(which == discs.size() ? Disc{0, 0, -1} : discs[which], 1, x);
    }

    [[nodiscard]] double speed_bound(double, const X& x) const { return std::hypot(x[2], x[3]); }
    [[nodiscard]] double acceleration_bound(double, const X&) const { return gravity; }
};

TEST(Planned, ManyGuardsInAnyOrderHaveTheEventsOfTheExactDetector)
{
    std::mt19937_64 random(24);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::uint64_t events = 0;
    for (int i = 0; i < 24 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        ManyDiscs many;
        const X start{0, 0, 2 * uniform(random), 2 * uniform(random)};
        while (many.discs.size() < 63) {
            const Disc disc{6 * uniform(random), 6 * uniform(random), 0.2 + 0.1 * uniform(random)};
            if (std::hypot(disc.x, disc.y) < disc.r + 0.1) continue;
            many.discs.push_back(disc);
            many.zone.push_back(uniform(random) < 0);
        }
        const auto fixed = expect_planned_same<Fixed>(many, start, {.t_end = 10, .step = 0.01});
        const auto controlled =
            expect_planned_same<Controlled>(many, start, {.t_end = 10, .h_max = 0.1});
        events += fixed.statistics.events + controlled.statistics.events;

        // Permuted guards: the same times, and the same discs by another number.
        std::vector<std::size_t> order(many.discs.size());
        std::iota(order.begin(), order.end(), 0u);
        std::shuffle(order.begin(), order.end(), random);
        ManyDiscs permuted = many;
        for (std::size_t k = 0; k < order.size(); ++k) {
            permuted.discs[k] = many.discs[order[k]];
            permuted.zone[k] = many.zone[order[k]];
        }
        const auto again =
            integrate(permuted, start, {.t_end = 10, .step = 0.01}, Fixed{}, Planned{});
        ASSERT_EQ(again.events.size(), fixed.events.size());
        for (std::size_t k = 0; k < again.events.size(); ++k) {
            const std::size_t guard = again.events[k].guard;
            EXPECT_EQ(guard < order.size() ? order[guard] : guard, fixed.events[k].guard);
            EXPECT_TRUE(same_bits(again.events[k].t, fixed.events[k].t));
        }
    }
    EXPECT_GT(events, 200u);
}

/// The same system, which gives its guards and their rates only all together.
struct TogetherDiscs {
    using State = X;
    ManyDiscs many;

    [[nodiscard]] std::size_t guard_count() const { return many.guard_count(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return many.guard_info(which); }
    void flow(double t, const X& x, X& dxdt) const { many.flow(t, x, dxdt); }
    void guards(double t, const X& x, std::span<double> g) const
    {
        for (std::size_t i = 0; i < g.size(); ++i) g[i] = many.guard(i, t, x);
    }
    void guard_rates(double, const X& x, const X& dxdt, std::span<double> rates) const
    {
        for (std::size_t i = 0; i < rates.size(); ++i) {
            const bool room = i == many.discs.size();
            const double dx = room ? x[0] : x[0] - many.discs[i].x;
            const double dy = room ? x[1] : x[1] - many.discs[i].y;
            const double rate = (dx * dxdt[0] + dy * dxdt[1]) / std::hypot(dx, dy);
            rates[i] = room ? -rate : rate;
        }
    }
    void reset(std::size_t which, double t, X& x) const { many.reset(which, t, x); }
    [[nodiscard]] double lipschitz() const { return 1; }
    [[nodiscard]] double speed_bound(std::size_t, double t, const X& x) const
    {
        return many.speed_bound(t, x);
    }
    [[nodiscard]] double acceleration_bound(double t, const X& x) const
    {
        return many.acceleration_bound(t, x);
    }
};

TEST(Planned, GuardsThatComeTogetherHaveTheEventsOfTheExactDetector)
{
    std::mt19937_64 random(32);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 20 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        TogetherDiscs together;
        const X start{0, 0, 2 * uniform(random), 2 * uniform(random)};
        while (together.many.discs.size() < 11) {
            const Disc disc{4 * uniform(random), 4 * uniform(random), 0.4};
            if (std::hypot(disc.x, disc.y) < disc.r + 0.1) continue;
            together.many.discs.push_back(disc);
            together.many.zone.push_back(uniform(random) < 0);
        }
        const Options options{.t_end = i % 2 ? 8.0 : -8.0, .step = 0.01};
        expect_planned_same<Fixed>(together, start, options);
    }
}

/// A point that circles an origin at the speed `rate`, and a wall that it never reaches.
struct Far {
    using State = X;
    static constexpr bool resets = false;
    double rate = 2;
    double distance = 5;  ///< of the wall from the origin
    bool tabulated = false;

    void flow(double, const X& x, X& dxdt) const { dxdt = {-rate * x[1], rate * x[0], 0, 0}; }
    [[nodiscard]] double guard(double, const X& x) const { return distance - x[0]; }
    [[nodiscard]] double speed_bound(double, const X& x) const
    {
        return rate * std::hypot(x[0], x[1]);
    }
};

TEST(Planned, AGuardThatIsNeverApproachedIsHardlyCalled)
{
    // On a circle of radius 1 the speed is 2 and the distance at least 4: every check covers
    // 4 / (1.01 * 2) s or more, 100 s need 51 of them, and one is made at the start.
    const double t_end = 100;
    for (const bool two_ended : {false, true}) {
        const auto run = integrate(Far{}, X{1, 0, 0, 0}, {.t_end = t_end, .step = 0.01}, Fixed{},
                                   Planned({.two_ended = two_ended}));
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_LE(run.statistics.guard_calls, 52u);
        EXPECT_EQ(run.statistics.evidence.proved, run.statistics.steps);
        EXPECT_EQ(run.statistics.checks_deferred, run.statistics.steps);
        EXPECT_EQ(run.statistics.rollbacks, 0u);
    }
}

TEST(Planned, LookingAheadSavesChecks)
{
    // When the point moves away from a wall at the full speed, two values cover any interval; one
    // covers a distance equal to that to the wall, which takes log2(1000) checks from 0.01 to 10.
    struct Leaving {
        static constexpr bool resets() { return false; }
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0, 0, 0}; }
        double guard(double, const X& x) const { return x[0]; }
        double speed_bound(double, const X&) const { return 1; }
    };
    const auto calls = [](bool two_ended) {
        const PlannerOptions plan{.two_ended = two_ended, .longest_interval = 100000};
        return integrate(Leaving{}, X{0.01, 0, 0, 0}, {.t_end = 10, .step = 0.001}, Fixed{},
                         Planned(plan))
            .statistics.guard_calls;
    };
    EXPECT_LE(calls(true), 5u);
    EXPECT_GE(calls(false), 10u);
}

TEST(Planned, AStartOnTheSurfaceIsNotAnEvent)
{
    Room room;
    room.discs = {{0, -1, 1}};
    for (const double up : {0.5, 0.0}) {  // up, or off along the top of the disc
        const X start{0, 0, 0.7, up};
        const auto run = expect_planned_same<Fixed>(room, start, {.t_end = 5, .step = 0.01});
        EXPECT_GT(run.statistics.events, 0u);
        expect_planned_same<Controlled>(room, start, {.t_end = 5, .h_max = 0.1});
    }
}

TEST(Planned, TouchesAreThoseOfTheExactDetector)
{
    Room room;
    room.gravity = 0;
    room.discs = {{0, -1, 1}};
    for (const double height : {0.0, 1e-15, -1e-15, 1e-13, -1e-13, 1e-9, -1e-9, 1e-4, -1e-4}) {
        SCOPED_TRACE(height);
        const X start{-1, height, 0.9, 0};
        expect_planned_same<Fixed>(room, start, {.t_end = 2, .step = 0.013});
        expect_planned_same<Controlled>(room, start, {.t_end = 2, .h_max = 0.2});
    }
}

/// The room, with gravity that turns by a quarter at every impact, and kicks at known times.
struct TurningRoom : Room {
    std::size_t mode_count = 4;

    [[nodiscard]] X field(Mode mode, const X& x) const
    {
        constexpr std::array<double, 4> gx = {0, 1, 0, -1};
        constexpr std::array<double, 4> gy = {-1, 0, 1, 0};
        return {x[2], x[3], gravity * gx[mode], gravity * gy[mode]};
    }
    void flow(Mode mode, double, const X& x, X& dxdt) const { dxdt = field(mode, x); }
    template <class V>
    [[nodiscard]] double guard(Mode, double t, const V& x) const
    {
        return Room::guard(t, x);
    }
    Mode reset(Mode mode, double t, X& x) const
    {
        Room::reset(t, x);
        return (mode + 1) % 4;
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return 0.75 * (std::floor(t / 0.75) + 1);
    }
    Mode time_reset(Mode mode, double, X& x) const
    {
        x[2] = -x[2];
        return mode;
    }
    [[nodiscard]] double speed_bound(Mode, double, const X& x) const
    {
        return std::hypot(x[2], x[3]);
    }
    [[nodiscard]] double acceleration_bound(Mode, double, const X&) const { return gravity; }
};

TEST(Planned, ModesAndTimeEventsAreThoseOfTheExactDetector)
{
    std::mt19937_64 random(25);
    for (int i = 0; i < 60 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        TurningRoom room{random_room(random, start)};
        room.restitution = 1;
        const auto run = expect_planned_same<Fixed>(room, start, {.t_end = 5, .step = 0.01});
        EXPECT_GE(run.statistics.events, 6u);  // the kicks
        expect_planned_same<Controlled>(room, start, {.t_end = 5, .h_max = 0.04});
    }
}

/// The room, with bounds set by the test.
struct HostileRoom : Room {
    double speed = nan;
    double acceleration = nan;
    double below = nan;

    [[nodiscard]] double speed_bound(double, const X&) const { return speed; }
    [[nodiscard]] double acceleration_bound(double, const X&) const { return acceleration; }
    [[nodiscard]] double lower_bound(double, const X&) const { return below; }
};

TEST(Planned, BoundsThatAreNoneCoverNothing)
{
    std::mt19937_64 random(26);
    X start;
    const Room room = random_room(random, start);
    for (const double bad : {nan, inf, -inf, -1.0}) {
        for (const double below : {nan, -inf, -1.0, 0.0}) {
            SCOPED_TRACE(bad);
            HostileRoom hostile{room};
            hostile.speed = bad;
            hostile.acceleration = room.gravity;
            hostile.below = below;
            auto run =
                expect_planned_same<Fixed>(hostile, start, {.t_end = 3, .step = 0.01}, false);
            EXPECT_EQ(run.statistics.evidence.proved, 0u);
            hostile.speed = 10;
            hostile.acceleration = bad;
            run = expect_planned_same<Fixed>(hostile, start, {.t_end = 3, .step = 0.01}, false);
            EXPECT_EQ(run.statistics.evidence.proved, 0u);
        }
    }
}

TEST(Planned, AWrongSpeedBoundIsNamed)
{
    Room room;
    room.gravity = 0;
    HostileRoom slow{room};
    slow.speed = 0.4;  // the ball flies at 1
    slow.acceleration = 0;
    const X start{-2.5, 0, 1, 0};
    const Options options{.t_end = 10, .step = 0.01};
    for (const bool check : {true, false}) {
        const auto run = integrate(slow, start, options, Fixed{},
                                   Planned({.two_ended = false, .check_bounds = check}));
        // Without checks the violation is found where the ball is beyond the wall.
        ASSERT_EQ(run.outcome, Outcome::wrong_bound);
        EXPECT_EQ(run.guard, 0u);
        ASSERT_TRUE(run.wrong_bound);
        const auto& wrong = *run.wrong_bound;
        EXPECT_FALSE(wrong.lower_bound);
        EXPECT_TRUE(same_bits(wrong.value, room.guard(0, wrong.x)));
        EXPECT_GT(std::fabs(wrong.value - wrong.value_then), wrong.allowed);
        EXPECT_GT(wrong.t, wrong.since);
        // The allowed value is that of the bound, with its margin of one per cent.
        EXPECT_NEAR(wrong.allowed, 1.01 * 0.4 * (wrong.t - wrong.since), 1e-9);
    }
}

TEST(Planned, AWrongLowerBoundIsNamed)
{
    Room room;
    HostileRoom high{room};
    high.speed = 4;
    high.acceleration = 1;
    high.below = 0.5;  // also where the wall is nearer
    const auto run = integrate(high, X{0, 0, 1, 0}, {.t_end = 10, .step = 0.01}, Fixed{},
                               Planned({.check_bounds = true}));
    ASSERT_EQ(run.outcome, Outcome::wrong_bound);
    ASSERT_TRUE(run.wrong_bound);
    EXPECT_EQ(run.wrong_bound->allowed, 0.5);
    EXPECT_LT(run.wrong_bound->value, 0.5);
    EXPECT_TRUE(run.wrong_bound->lower_bound);
}

/// x0 oscillates; the guard is armed below its surface at the start.
struct Outside {
    using State = X;
    static constexpr bool resets = false;
    double above = 0;  ///< added to the guard in its claimed upper bound

    static constexpr GuardInfo guard_info(std::size_t)
    {
        return {.name = "section", .crossing = Crossing::either};
    }
    void flow(double t, const X&, X& dxdt) const { dxdt = {std::cos(t), -std::sin(0.7 * t), 0, 0}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0] + 0.3 * x[1] - 0.5; }
    [[nodiscard]] double speed_bound(double, const X&) const { return 1.3; }
};
struct OutsideWithBound : Outside {
    [[nodiscard]] double upper_bound(double t, const X& x) const { return guard(t, x) + above; }
};

TEST(Planned, AnUpperBoundSavesChecksBelowTheSurfaceAndKeepsTheEvents)
{
    const X start{-0.4, 0.1, 0, 0};
    const Options options{.t_end = 60, .step = 0.01};
    OutsideWithBound bounded;
    bounded.above = 0.02;
    const auto run = expect_planned_same<Fixed>(bounded, start, options, false);
    EXPECT_GT(run.events.size(), 4u);
    const auto without = integrate(Outside{}, start, options, Fixed{}, Planned{});
    ASSERT_EQ(run.events.size(), without.events.size());
    EXPECT_LT(run.statistics.guard_calls, without.statistics.guard_calls);
}

TEST(Planned, AWrongUpperBoundIsNamed)
{
    OutsideWithBound low;
    low.above = -0.1;  // claims that the guard is lower than it is
    const auto run = integrate(low, X{-0.4, 0.1, 0, 0}, {.t_end = 60, .step = 0.01}, Fixed{},
                               Planned({.check_bounds = true}));
    ASSERT_EQ(run.outcome, Outcome::wrong_bound);
    ASSERT_TRUE(run.wrong_bound);
    EXPECT_TRUE(run.wrong_bound->upper_bound);
    EXPECT_FALSE(run.wrong_bound->lower_bound);
    EXPECT_NEAR(run.wrong_bound->value - run.wrong_bound->allowed, 0.1, 1e-12);
}

/// The distance to the room's wall is a lower bound of the distance to the nearest obstacle, minus
/// the largest protrusion of a disc into the room.
struct TabulatedRoom : Room {
    [[nodiscard]] double lower_bound(double t, const X& x) const
    {
        const double cell = 0.05;
        const X centre{cell * std::round(x[0] / cell), cell * std::round(x[1] / cell), 0, 0};
        return guard(t, centre) - cell * std::sqrt(0.5);
    }
};

TEST(Planned, ALowerBoundSavesChecksAndKeepsTheEvents)
{
    std::mt19937_64 random(27);
    std::uint64_t with = 0;
    std::uint64_t without = 0;
    for (int i = 0; i < 60 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        const Room room = random_room(random, start);
        const Options options{.t_end = 5, .step = 0.002};
        const auto run = expect_planned_same<Fixed>(TabulatedRoom{room}, start, options, false);
        EXPECT_GT(run.statistics.bound_calls, 0u);
        with += run.statistics.guard_calls;
        without += integrate(room, start, options, Fixed{}, Planned{}).statistics.guard_calls;
    }
    EXPECT_LT(with, without);
}

/// A guard that is not a number beyond x = 1.
struct Hole : Room {
    [[nodiscard]] double guard(double t, const X& x) const
    {
        return x[0] > 1 ? nan : Room::guard(t, x);
    }
};

TEST(Planned, AGuardThatIsNotANumberEndsTheRunWhereItDid)
{
    Room room;
    room.gravity = 0;
    const X start{-0.5, 2.6, 0.3, 0};
    const Options options{.t_end = 10, .step = 0.01};
    // A bound that covers no step leaves every step to the exact detector.
    struct FastHole : Hole {
        double speed_bound(double, const X&) const { return 1e6; }
    };
    const auto run = expect_planned_same<Fixed>(FastHole{{room}}, start, options);
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    // A guard with a bound is promised to be a number; its hole is found where it is evaluated.
    const auto planned = integrate(Hole{room}, start, options, Fixed{}, Planned{});
    EXPECT_EQ(planned.outcome, Outcome::non_finite);
    EXPECT_GE(planned.t, run.t);
}

TEST(Planned, AFlowThatFailsBeyondAnEventIsNotBlamed)
{
    // Beyond the wall at x = 1 the square root has a negative argument.
    struct Edge {
        void flow(double, const X& x, X& dxdt) const
        {
            dxdt = {x[2], x[3], -0.1 * std::sqrt(1.0005 - x[0]), 0};
        }
        double guard(double, const X& x) const { return 1 - x[0]; }
        void reset(double, X& x) const { x[2] = -0.5 * std::fabs(x[2]); }
        double speed_bound(double, const X&) const { return 2; }
    };
    const auto run =
        expect_planned_same<Fixed>(Edge{}, X{0, 0, 1, 0}, {.t_end = 4, .step = 0.0004});
    EXPECT_EQ(run.statistics.events, 1u);
}

TEST(Planned, ASavedRunGoesOnToTheSameBits)
{
    std::mt19937_64 random(28);
    for (int i = 0; i < 20 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        X start;
        const Room room = random_room(random, start);
        const Options options{.t_end = 4, .step = 0.01};
        const auto whole = integrate(room, start, options, Fixed{}, Planned{});
        using Planning = Simulation<Room, X, Fixed, Planned<>>;
        Planning first(room, start, options);
        for (int k = 0; k < 100 + 7 * i; ++k) first.step();
        const Snapshot snapshot = first.save();
        Planning second(room, start, options);
        second.restore(snapshot);
        const auto a = first.take();
        const auto b = second.take();
        EXPECT_TRUE(same_bits(a.x, b.x) && same_bits(a.x, whole.x));
        EXPECT_EQ(a.events.size(), whole.events.size());
        ASSERT_LE(b.events.size(), a.events.size());
        const std::size_t before = a.events.size() - b.events.size();
        for (std::size_t k = 0; k < b.events.size(); ++k) {
            EXPECT_TRUE(same_bits(a.events[before + k].t, b.events[k].t));
        }
    }
}

TEST(Planned, NothingIsShownThatIsNotFinal)
{
    std::mt19937_64 random(29);
    X start;
    const Room room = random_room(random, start);
    Options options{.t_end = 5, .step = 0.01};
    for (double t = 0.3; t < 5; t += 0.9) options.sample_times.push_back(t);
    using Planning = Simulation<Room, X, Fixed, Planned<>>;
    const auto exact = integrate(room, start, options, Fixed{});

    // Every step once, in the order of time.
    std::uint64_t steps = 0;
    double last = 0;
    Planning watched(room, start, options);
    watched.run_to_end([&](const Planning& simulation) {
        if (simulation.t() > last) ++steps;
        EXPECT_GE(simulation.t(), last);
        last = simulation.t();
    });
    EXPECT_EQ(steps, exact.statistics.steps);
    expect_same(exact, watched.finish());

    // Events, looking ahead.
    std::size_t seen = 0;
    Planning listened(room, start, options);
    listened.run_to_end([&](const Event<X>& event) {
        EXPECT_TRUE(same_bits(event.t, exact.events[seen].t));
        ++seen;
    });
    EXPECT_EQ(seen, exact.events.size());

    // `advance` stops at the step with the sample or the event, as it does without a plan.
    Planning advanced(room, start, options);
    Simulation<Room, X, Fixed> plain(room, start, options);
    for (bool more = true; more && !HasFailure();) {
        more = plain.advance();
        EXPECT_EQ(advanced.advance(), more);
        EXPECT_TRUE(same_bits(advanced.t(), plain.t())) << plain.t();
        EXPECT_TRUE(same_bits(advanced.x(), plain.x()));
    }
}

TEST(Planned, ARunThatIsCutShortEndsWhereItDid)
{
    std::mt19937_64 random(30);
    X start;
    const Room room = random_room(random, start);
    for (const std::uint64_t most : {1u, 17u, 100u, 101u}) {
        const auto run =
            expect_planned_same<Fixed>(room, start, {.t_end = 5, .step = 0.01, .max_steps = most});
        EXPECT_EQ(run.outcome, Outcome::step_limit);
    }
    expect_planned_same<Fixed>(room, start, {.t_end = 5, .step = 0.01, .stop_at_event = true});

    // Cancelled within an interval: all returned results are final.
    std::atomic<bool> cancelled = false;
    Options options{.t_end = 5, .step = 0.01};
    options.cancelled = &cancelled;
    Simulation<Room, X, Fixed, Planned<>> simulation(room, start, options);
    simulation.step();
    cancelled = true;
    const auto run = simulation.take();
    EXPECT_EQ(run.outcome, Outcome::cancelled);
    EXPECT_EQ(run.statistics.steps, 1u);
}

TEST(Planned, StatesSizedAtRunTimeHaveTheEventsOfTheExactDetector)
{
    struct Ball {
        using State = std::vector<double>;
        void flow(double, const State& x, State& dxdt) const
        {
            dxdt[0] = x[1];
            dxdt[1] = -9.81;
        }
        double guard(double, const State& x) const { return x[0]; }
        double guard_rate(double, const State&, const State& dxdt) const { return dxdt[0]; }
        void reset(double, State& x) const { x[1] = -0.9 * x[1]; }
        double speed_bound(double, const State& x) const { return std::fabs(x[1]); }
        double acceleration_bound(double, const State&) const { return 9.81; }
    };
    const std::vector<double> start{10, 0};
    const Options options{.t_end = 15, .step = 0.001};
    const auto exact = integrate(Ball{}, start, options, Fixed{});
    const auto planned = integrate(Ball{}, start, options, Fixed{}, Planned{});
    ASSERT_EQ(exact.events.size(), planned.events.size());
    EXPECT_GT(exact.events.size(), 5u);
    for (std::size_t k = 0; k < exact.events.size(); ++k) {
        EXPECT_TRUE(same_bits(exact.events[k].t, planned.events[k].t));
        EXPECT_EQ(exact.events[k].after, planned.events[k].after);
    }
    EXPECT_EQ(exact.x, planned.x);
    // 15 000 steps, and about ten events with a few checks each to approach and to leave.
    EXPECT_LT(planned.statistics.guard_calls, 30 * exact.events.size());
}

TEST(Planned, AnEventTakesSixExactCallsOnAverage)
{
    // A guard that declares its rate. After the checks at the ends of the step with the event there
    // is one evaluation at each sample of Newton's method, two that close the bracket, one of the
    // condition of the event, and one that arms the guard again.
    Room room;
    room.gravity = 0;
    struct Rated : Room {
        double guard_rate(double, const X& x, const X& dxdt) const
        {
            return -(x[0] * dxdt[0] + x[1] * dxdt[1]) / std::hypot(x[0], x[1]);
        }
    };
    const X start{0.5, 0, 1, 0.7};
    const Options options{.t_end = 200, .step = 0.01};
    const auto run = expect_planned_same<Fixed>(Rated{room}, start, options);
    const auto checked = integrate(Rated{room}, start, options, Fixed{});
    // Without a plan every step has one call; the remaining calls belong to the events.
    const auto extra =
        static_cast<double>(checked.statistics.guard_calls - checked.statistics.steps);
    EXPECT_GT(run.statistics.events, 30u);
    EXPECT_LE(extra / static_cast<double>(run.statistics.events), 6);
}

/// A point that turns about the origin, whose guard also moves with time, for any scalar.
struct Turning {
    using State = X;
    bool acts = true;
    template <class S>
    void flow(const S&, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0];
        dxdt[3] = -2.0 * x[1];
    }
    [[nodiscard]] GuardInfo guard_info() const
    {
        return {.crossing = Crossing::either, .resets = acts};
    }
    double guard(double t, const X& x) const
    {
        return 0.3 + 0.2 * std::sin(3 * t) + 0.7 * x[0] - 0.5 * x[1];
    }
    void reset(double, X& x) const { x[3] = -0.9 * x[3]; }
    double speed_bound(double t, const X& x) const
    {
        return std::fabs(0.6 * std::cos(3 * t) + 0.7 * x[2] - 0.5 * x[3]);
    }
    double acceleration_bound(double, const X& x) const
    {
        const double energy = x[2] * x[2] + x[0] * x[0] + x[3] * x[3] + 2 * x[1] * x[1];
        return 2 + 1.8 * std::sqrt(energy);
    }
};

TEST(Planned, MethodsThatMakeASeriesHaveTheEventsOfTheExactDetector)
{
    std::mt19937_64 random(41);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::uint64_t events = 0;
    for (int i = 0; i < 30 && !HasFailure(); ++i) {
        SCOPED_TRACE(i);
        const X start{uniform(random), uniform(random), uniform(random), uniform(random)};
        const Turning turning{i % 2 == 0};
        const Options options{.t_end = 10, .rtol = std::pow(10, -6 + 2 * uniform(random))};
        expect_planned_same<ErrorControlled<Taylor>>(turning, start, options);
        const auto run = expect_planned_same<ErrorControlled<Rosenbrock4>>(turning, start, options);
        events += run.statistics.events;
    }
    EXPECT_GT(events, 100u);
}

/// A stiff component that is kicked away from what it follows, and slow ones with guards.
struct Kicked {
    using State = X;
    static constexpr bool resets = false;
    static constexpr std::size_t guard_count = 3;
    double stiffness = 1000;  ///< [1/s]
    double period = 0.7;      ///< [s]

    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = Crossing::either, .resets = false};
    }
    void flow(double t, const X& x, X& dxdt) const
    {
        dxdt = {-stiffness * (x[0] - std::cos(t)), 0.5 * x[0] - x[2], x[1], 0};
    }
    double guard(std::size_t which, double, const X& x) const
    {
        return x[1] + 0.3 * (static_cast<double>(which) - 1);
    }
    double next_time_event(double t) const
    {
        double n = std::floor(t / period);
        while (n * period <= t) ++n;
        return n * period;
    }
    void time_reset(double, X& x) const { x[0] = x[0] > 0 ? -3 : 3; }
    double speed_bound(std::size_t, double, const X& x) const { return 2 + std::fabs(x[2]); }
    double acceleration_bound(std::size_t, double, const X& x) const
    {
        return 2 + std::hypot(x[1], x[2]);
    }
};

TEST(Planned, StepsWithARoughPolynomialAreThoseOfTheExactDetector)
{
    for (const double rtol : {1e-5, 1e-4, 1e-3, 1e-2}) {
        for (const double stiffness : {100.0, 1000.0, 1e4}) {
            SCOPED_TRACE(rtol);
            SCOPED_TRACE(stiffness);
            const auto run = expect_planned_same<ErrorControlled<Rosenbrock4>>(
                Kicked{stiffness}, X{1, 0, 0.5, 0}, {.t_end = 20, .rtol = rtol, .atol = 0.1 * rtol},
                false);
            EXPECT_GT(run.statistics.events, 28u);
        }
    }
}

/// A tank that drains, whose flow is not a number below its outlet, and a second guard.
struct Tank {
    using State = X;
    static constexpr std::size_t guard_count = 2;
    bool refilled = true;

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 0 ? Crossing::falling : Crossing::either,
                .resets = which == 0 && refilled};
    }
    void flow(double, const X& x, X& dxdt) const { dxdt = {-1 - std::sqrt(x[0]), 1, 0, 0}; }
    double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? x[0] : std::sin(2 * x[1]) + 0.3;
    }
    void reset(std::size_t, double, X& x) const { x[0] = 0.8; }
    double speed_bound(std::size_t which, double, const X&) const { return which == 0 ? 2.2 : 2; }
};

TEST(Planned, AFlowThatEndsAtItsSurfaceHasTheEventsOfTheExactDetector)
{
    for (const bool refilled : {true, false}) {
        for (const double h : {0.003, 0.01, 0.07}) {
            SCOPED_TRACE(h);
            const X start{1.1, 0, 0, 0};
            const auto fixed =
                expect_planned_same<Fixed>(Tank{refilled}, start, {.t_end = 3, .step = h});
            EXPECT_EQ(fixed.outcome, refilled ? Outcome::reached_end : Outcome::non_finite);
            const auto controlled = expect_planned_same<Controlled>(Tank{refilled}, start,
                                                                    {.t_end = 3, .rtol = 0.1 * h});
            EXPECT_GE(controlled.events.size(), refilled ? 7u : 1u);
        }
    }
}

/// A guard that is not a number beyond its surface, as far as its bound says nothing.
struct Logarithm {
    using State = X;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0, 0, 0}; }
    double guard(double, const X& x) const { return std::log(2.5 - x[0]); }
    void reset(double, X& x) const { x[0] = 0; }
    double speed_bound(double, const X& x) const { return x[0] < 1 ? 1 : inf; }
};

TEST(Planned, AGuardThatIsNotANumberBeyondItsSurfaceHasTheEventsOfTheExactDetector)
{
    for (const double h : {0.01, 0.3, 1.3, 2.0}) {
        SCOPED_TRACE(h);
        const X start{0, 0, 0, 0};
        const auto run =
            expect_planned_same<Fixed>(Logarithm{}, start, {.t_end = 10, .step = h}, false);
        EXPECT_EQ(run.events.size(), 6u);
        expect_planned_same<Controlled>(Logarithm{}, start, {.t_end = 10, .step = h}, false);
    }
}

TEST(Planned, StepsThatAreTakenBackAreNotCounted)
{
    // The run is cancelled by its own flow, wherever that is.
    struct Cancelling : Room {
        std::atomic<bool>* cancelled = nullptr;
        mutable int calls = 0;
        void flow(double t, const X& x, X& dxdt) const
        {
            if (--calls == 0) *cancelled = true;
            Room::flow(t, x, dxdt);
        }
    };
    std::uint64_t taken_back = 0;
    for (int calls = 100; calls < 3400; calls += 31) {
        std::atomic<bool> cancelled = false;
        Options options{.t_end = 5, .step = 1.0 / 256};
        options.cancelled = &cancelled;
        Cancelling system;
        system.cancelled = &cancelled;
        system.calls = calls;
        const X start{0, 0, 0.5, 1};
        const auto run = integrate(system, start, options, Fixed{}, Planned{});
        EXPECT_EQ(run.outcome, Outcome::cancelled);
        EXPECT_EQ(static_cast<double>(run.statistics.steps), 256 * run.t) << calls;
        taken_back += run.statistics.repeated_steps;
    }
    EXPECT_GT(taken_back, 0u);
}

TEST(Planned, AGuardThatLeavesItsPlateauHasItsEvent)
{
    // It stands on its surface until the force begins.
    struct Waiting {
        double sign = 1;
        void flow(double t, const X& x, X& dxdt) const
        {
            dxdt = {x[2], 0, t < 1 ? 0 : -sign * std::pow(t - 1, 3), 0};
        }
        GuardInfo guard_info() const { return {.unilateral = true}; }
        double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x = {0, x[1] + 1, 1, 0}; }
        double speed_bound(double, const X&) const { return 30; }
    };
    const Options options{.t_end = 2.5, .step = 0.01};
    const auto pressed = expect_planned_same<Fixed>(Waiting{1}, X{0, 0, 0, 0}, options);
    EXPECT_GT(pressed.events.size(), 0u);
    const auto lifted = expect_planned_same<Fixed>(Waiting{-1}, X{0, 0, 0, 0}, options);
    EXPECT_EQ(lifted.events.size(), 0u);
}

template <class Exact>
void expect_no_event_of_rounding()
{
    // The time event puts the guard on its surface, where 0.3 - 0.1 - 0.2 is -3e-17, and rising.
    struct Put {
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[2], 0, 0, 0}; }
        double guard(double, const X& x) const { return x[0] - 0.1 - 0.2; }
        void reset(double, X& x) const { x[1] += 1; }
        double speed_bound(double, const X&) const { return 1; }
        double next_time_event(double t) const { return t < 0.5 ? 0.5 : inf; }
        void time_reset(double, X& x) const { x = {0.3, 0, 1, 0}; }
    };
    const auto run =
        expect_planned_same<Fixed, Exact>(Put{}, X{2, 0, 0.1, 0}, {.t_end = 2, .step = 0.01});
    EXPECT_EQ(run.events.size(), 1u);
}

TEST(Planned, AResetOntoTheSurfaceIsNoCrossing)
{
    expect_no_event_of_rounding<Extremum>();
    expect_no_event_of_rounding<Ends>();
}

TEST(Planned, ATimeEventAtTheEndAccusesNoBound)
{
    // Its reset moves the guard by more than the bound of the flow allows.
    struct Moved {
        static constexpr bool resets() { return false; }
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[2], 0, 0, 0}; }
        double guard(double, const X& x) const { return x[0]; }
        double speed_bound(double, const X&) const { return 1; }
        double next_time_event(double t) const { return t < 0.5 ? 0.5 : inf; }
        void time_reset(double, X& x) const { x[0] = 9; }
    };
    const auto run =
        expect_planned_same<Fixed>(Moved{}, X{2, 0, 0.1, 0}, {.t_end = 0.5, .step = 0.01});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 1u);
}

TEST(Planned, AMotionThatComesToRestInTheLastStepAccusesNoBound)
{
    struct Lump {
        bool unilateral = true;
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[2], 0, -10, 0}; }
        double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x = {0, x[1], -0.1 * x[2], 0}; }
        void rest(double, X& x) const { x = {0, x[1], 0, 0}; }
        double speed_bound(double, const X& x) const { return std::fabs(x[2]); }
        double acceleration_bound(double, const X&) const { return 10; }
    };
    // The impacts end after 0.546 s.
    for (const double end : {0.55, 0.57, 0.59}) {
        const auto run =
            expect_planned_same<Fixed>(Lump{}, X{1, 0, 0, 0}, {.t_end = end, .step = 0.1}, false);
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.events.back().kind, EventKind::accumulation);
    }
}

TEST(Planned, RefusesPlansThatAreNone)
{
    EXPECT_THROW(Planned({.margin = -0.1}), std::invalid_argument);
    EXPECT_THROW(Planned({.margin = nan}), std::invalid_argument);
    EXPECT_THROW(Planned({.longest_interval = 0}), std::invalid_argument);
    EXPECT_THROW(EveryK(0), std::invalid_argument);
    EXPECT_THROW(SlopeSkip(0), std::invalid_argument);
    EXPECT_THROW(SlopeSkip(1.5), std::invalid_argument);
    EXPECT_THROW(SlopeSkip(0.1, 0), std::invalid_argument);
}

TEST(EveryK, FindsWhatLastsLongerThanKSteps)
{
    // A ball that bounces on the floor of a wide room is beyond it until it is reflected: no
    // two crossings lie between two checks, and the events are those of every step.
    Room room;
    room.radius = 1e3;
    room.discs = {{0, -1e3, 1e3}};
    const X start{0, 1, 0.1, 0};
    const Options options{.t_end = 10, .step = 0.01};
    const auto exact = integrate(room, start, options, Fixed{});
    for (const std::size_t k : {1u, 2u, 7u, 50u}) {
        const auto run = integrate(room, start, options, Fixed{}, EveryK(k));
        expect_same(exact, run);
        EXPECT_GT(run.statistics.events, 2u);
    }
    const auto run = integrate(room, start, options, Fixed{}, EveryK(10, Ends{}));
    EXPECT_LT(run.statistics.guard_calls, exact.statistics.guard_calls / 4);
}

TEST(SlopeSkip, FindsWhatIsApproachedSmoothly)
{
    Room room;
    room.radius = 1e3;
    room.discs = {{0, -1e3, 1e3}};
    const X start{0, 1, 0.1, 0};
    const Options options{.t_end = 10, .step = 0.001};
    const auto exact = integrate(room, start, options, Fixed{});
    const auto run = integrate(room, start, options, Fixed{}, SlopeSkip(0.25, 40));
    expect_same(exact, run);
    EXPECT_LT(run.statistics.guard_calls, exact.statistics.guard_calls / 10);
}

// --- bounds that cover the rest of the run ---

/// A ball that falls from 10 m at 9.81 m/s^2, with adjustable promises.
struct Promising {
    using State = std::array<double, 2>;
    double speed = 0;         ///< added to |v|
    double acceleration = 0;  ///< the declared acceleration
    double stretch = 1;       ///< the Lipschitz constant
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -0.9 * x[1]}; }
    [[nodiscard]] double speed_bound(double, const State& x) const
    {
        return std::fabs(x[1]) + speed;
    }
    [[nodiscard]] double acceleration_bound(double, const State&) const { return acceleration; }
    [[nodiscard]] double lipschitz() const { return stretch; }
};

Run<std::array<double, 2>> promised(const Promising& ball, bool check, double t_end = 8)
{
    PlannerOptions options;
    options.check_bounds = check;
    return integrate(ball, {10, 0}, {.t_end = t_end, .step = 0.01}, FixedStep<Rk4>{},
                     Planned<>(options));
}

TEST(PlannedBounds, OneThatCoversTheRestOfTheRunIsNamedAllTheSame)
{
    // At rest and without acceleration the guard would never change. At 8 s the ball, whose fall
    // no check has seen, would be 300 m below the floor.
    for (const bool check : {false, true}) {
        for (const Promising& ball :
             {Promising{}, Promising{.acceleration = 9.81, .stretch = 0},
              Promising{.acceleration = 9.81, .stretch = 1e-3}, Promising{.speed = 0.1}}) {
            const auto run = promised(ball, check);
            EXPECT_EQ(run.outcome, Outcome::wrong_bound) << check;
            ASSERT_TRUE(run.wrong_bound.has_value());
            EXPECT_EQ(run.wrong_bound->guard, 0u);
            EXPECT_GT(run.wrong_bound->value_then - run.wrong_bound->value,
                      run.wrong_bound->allowed);
            // It is sampled in every 64th step, or else checked at the end of the run.
            EXPECT_LT(run.t, check ? 2.5 : 8.1);
        }
        EXPECT_EQ(promised({.acceleration = 9.81}, check).outcome, Outcome::reached_end);
        EXPECT_EQ(promised({.acceleration = 9.81}, check).events.size(), 3u);
    }
}

TEST(PlannedBounds, ThoseThatAreNoBoundsCoverNothingAndAreNamedIfChecked)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const Promising& ball : {Promising{.acceleration = -1}, Promising{.acceleration = nan},
                                  Promising{.speed = nan, .acceleration = 9.81},
                                  Promising{.acceleration = 9.81, .stretch = -1}}) {
        EXPECT_EQ(promised(ball, false).events.size(), 3u);
        EXPECT_EQ(promised(ball, true).outcome, Outcome::wrong_bound);
    }
}

/// The same with only the sign known: bounds do not apply, and are not evaluated.
struct PromisingSign : Promising {
    [[nodiscard]] bool guard(double, const State& x) const { return x[0] > 0; }
};

TEST(PlannedBounds, ThoseOfABooleanGuardAreNotAsked)
{
    for (const bool check : {false, true}) {
        PlannerOptions options;
        options.check_bounds = check;
        PromisingSign ball;
        ball.acceleration = 9.81;
        const auto run = integrate(ball, {10, 0}, {.t_end = 8, .step = 0.01}, FixedStep<Rk4>{},
                                   Planned<>(options));
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.events.size(), 3u);
    }
}

}  // namespace
}  // namespace ricochet::planned_test
