#include "ricochet/bernstein.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "clustered_systems.hpp"
#include "host_step.hpp"
#include "problems/hidden_pair.hpp"
#include "problems/near_tangent.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"

namespace ricochet::bernstein_test {
namespace {

using detail::counts;
using detail::Finding;
using detail::opposite;
using detail::Watch;

using std::numbers::pi;
using test::HostStep;
using test::look;

constexpr double epsilon = std::numeric_limits<double>::epsilon();

template <class State>
std::vector<double> times(const Run<State>& run)
{
    std::vector<double> result;
    for (const auto& event : run.events) result.push_back(event.t);
    return result;
}

template <class State>
bool all_of_kind(const Run<State>& run, EventKind kind)
{
    return std::all_of(run.events.begin(), run.events.end(),
                       [&](const auto& event) { return event.kind == kind; });
}

/// A guard of time alone, beside x' = 1 from x = t.
struct Timed {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;

    std::function<double(double)> function;
    Crossing crossing = Crossing::either;
    int degree = 0;

    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = crossing, .degree = degree};
    }
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = 1;
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return function(x[0]);
    }
};

/// From 0 to 1 in steps of `step`, examined by Bernstein.
Run<Timed::State> run_timed(const Timed& system, double step)
{
    return integrate(system, {0.0}, {.t_end = 1, .step = step}, FixedStep<Rk4>{}, Bernstein{});
}

/// Largest difference of two lists, infinite if they differ in length.
double distance(const std::vector<double>& a, const std::vector<double>& b)
{
    if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
    double largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        largest = std::max(largest, std::fabs(a[i] - b[i]));
    }
    return largest;
}

// --- several roots in one step ---

template <class Method>
void expect_three_roots(bool squared, double shift)
{
    // The state is exact to one unit in the last place, and the factor that vanishes at a
    // root is the difference of two doubles: the root is off by a few of them.
    const test::ThreeRoots system{.squared = squared, .shift = shift};
    const auto run =
        integrate(system, {shift}, {.t_end = 1, .step = 1}, FixedStep<Method>{}, Bernstein{});
    const std::vector<double> expected{system.time(0), system.time(1), system.time(2)};
    EXPECT_EQ(run.statistics.steps, 1u);
    EXPECT_LE(distance(times(run), expected), 4 * epsilon);
    EXPECT_TRUE(all_of_kind(run, EventKind::crossing));
}

TEST(Bernstein, ThreeRootsInOneStepAreFoundInOrder)
{
    for (const double shift : {0.0, 0.1}) {
        for (const bool squared : {false, true}) {
            // Of the degrees 9 to 42, the last too high to be recovered.
            expect_three_roots<Rk4>(squared, shift);
            expect_three_roots<Dopri5>(squared, shift);
            expect_three_roots<CashKarp54>(squared, shift);
            expect_three_roots<Fehlberg78>(squared, shift);
        }
    }
}

TEST(Bernstein, ARootThatAResetMovesBackIsNotFoundTwice)
{
    // Each of the events defers the later ones by the slip, which is less than the
    // window of 1e-12 s.
    for (const bool squared : {false, true}) {
        const test::ThreeRoots system{.squared = squared, .slip = 1e-14};
        const auto run = integrate(system, {0.0}, {.t_end = 1, .step = 1, .event_tolerance = 1e-12},
                                   FixedStep<Rk4>{}, Bernstein{});
        const std::vector<double> expected{system.time(0), system.time(1), system.time(2)};
        EXPECT_LE(distance(times(run), expected), 1e-12);
    }
}

TEST(Bernstein, ClusteredGuardsFireInTheOrderOfTime)
{
    const test::Clustered system;
    const std::vector<double> offsets(system.offsets.begin(), system.offsets.end());
    const auto ahead = integrate(system, {-1.0}, {.t_start = -1, .t_end = 1, .step = 2},
                                 FixedStep<Rk4>{}, Bernstein{});
    ASSERT_EQ(ahead.events.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(ahead.events[i].guard, i);
    EXPECT_LE(distance(times(ahead), offsets), 2 * epsilon);  // offsets from t = -1

    const auto back = integrate(system, {1.0}, {.t_start = 1, .t_end = -1, .step = 2},
                                FixedStep<Rk4>{}, Bernstein{});
    ASSERT_EQ(back.events.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(back.events[i].guard, 3 - i);
    EXPECT_LE(distance(times(back), {offsets.rbegin(), offsets.rend()}), 2 * epsilon);
}

template <class Method>
void expect_hidden_pair()
{
    // Values reach 120 and the least slope at a zero is 16: rounding of some units in the
    // last place of 120 moves a zero by 1e-14.
    const HiddenPair system;
    const auto& zeros = HiddenPair::zeros;
    const auto ahead = integrate(system, HiddenPair::start, {.t_start = -8, .t_end = 4, .step = 12},
                                 FixedStep<Method>{}, Bernstein{});
    EXPECT_EQ(ahead.statistics.steps, 1u);
    EXPECT_LE(distance(times(ahead), {zeros.begin(), zeros.end()}), 4e-14);
    const auto back = integrate(system, {120.0}, {.t_start = 4, .t_end = -8, .step = 12},
                                FixedStep<Method>{}, Bernstein{});
    EXPECT_LE(distance(times(back), {zeros.rbegin(), zeros.rend()}), 4e-14);
}

TEST(Bernstein, TheHiddenPairIsFoundInOneGiantStepEitherWay)
{
    expect_hidden_pair<Rk4>();
    expect_hidden_pair<Dopri5>();
    expect_hidden_pair<CashKarp54>();
    expect_hidden_pair<Fehlberg78>();
}

TEST(Bernstein, AllRootsOfAFastGuardAreFoundInOrderInOneStep)
{
    // sin(40 t) is rounded to 1e-16 and has the slope 40 at its zeros.
    const Timed fast{[](double t) { return std::sin(40 * t); }};
    std::vector<double> expected;
    for (int n = 1; n <= 12; ++n) expected.push_back(n * pi / 40);
    const auto run = run_timed(fast, 1);
    EXPECT_EQ(run.statistics.steps, 1u);
    EXPECT_LE(distance(times(run), expected), 4 * epsilon);
}

TEST(Bernstein, TwoRootsOneInAMillionApartAreBothFound)
{
    // The dip between them is 2.5e-13 deep, and 64 units in the last place of the guard's
    // size, 0.25, are 3.6e-15. Rounding of 1e-16 / slope 1e-6 moves a root by 1e-10.
    for (const int degree : {0, 2}) {
        const Timed dip{[](double t) { return (t - 0.5) * (t - (0.5 + 1e-6)); }, Crossing::either,
                        degree};
        const auto run = run_timed(dip, 1);
        EXPECT_LE(distance(times(run), {0.5, 0.5 + 1e-6}), 1e-9);
    }
}

TEST(Bernstein, RootsThatRoundingCannotTellApartAreOne)
{
    // Between roots 1e-8 apart the guard stays below 64 units in the last place of its
    // size: an even number of them is a touch, an odd one a crossing.
    const auto clear_of = [](int roots) {
        return [=](double t) {
            double product = 1;
            for (int i = 0; i < roots; ++i) product *= t - (0.5 + i * 1e-8);
            return product;
        };
    };
    for (const bool declared : {false, true}) {
        const auto two = run_timed(Timed{clear_of(2), Crossing::either, declared ? 2 : 0}, 1);
        EXPECT_LE(distance(times(two), {0.5}), 2e-8);
        EXPECT_TRUE(all_of_kind(two, EventKind::touch));
        // Flat to rounding over (3.6e-15 / 1)^(1/3) = 1.5e-5.
        const auto three = run_timed(Timed{clear_of(3), Crossing::either, declared ? 3 : 0}, 1);
        EXPECT_LE(distance(times(three), {0.5}), 2e-5);
        EXPECT_TRUE(all_of_kind(three, EventKind::crossing));
    }
}

// --- near-tangent passages ---

/// The run of Fehlberg78 at 1e-14 for a level `depth` below the crest.
Run<NearTangent::State> near_tangent(const NearTangent& system)
{
    return integrate(system, system.start(), {.t_end = 20, .rtol = 1e-14, .atol = 1e-14},
                     ErrorControlled<Fehlberg78>{}, Bernstein{});
}

TEST(Bernstein, NearTangentPassagesAreFoundDownToADepthOf1em13)
{
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> phases(0.5, 5.5);
    for (const double depth : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13}) {
        for (int i = 0; i < 5; ++i) {
            const NearTangent system({.depth = depth, .phase = phases(random)});
            const auto run = near_tangent(system);
            // The crest is off by the error of the run, taken as 2e-14, and the level is
            // crossed with a slope of sqrt(2 depth).
            EXPECT_LE(distance(times(run), system.events(20)), 2e-14 / std::sqrt(2 * depth) + 2e-13)
                << "depth " << depth;
            EXPECT_TRUE(all_of_kind(run, EventKind::crossing)) << "depth " << depth;
        }
    }
}

TEST(Bernstein, ATouchIsReportedAsATouch)
{
    const NearTangent system({.depth = 0, .touch = 1e-12});
    const auto run = near_tangent(system);
    // The crest is located by the zero of the rate, which is off by the error of the run.
    EXPECT_LE(distance(times(run), system.events(20)), 1e-12);
    EXPECT_TRUE(all_of_kind(run, EventKind::touch));
}

TEST(Bernstein, ANearMissIsProvedToBeNone)
{
    for (const double depth : {-1e-6, -1e-12}) {
        const auto run = near_tangent(NearTangent({.depth = depth}));
        EXPECT_TRUE(run.events.empty()) << "depth " << depth;
        EXPECT_EQ(run.statistics.evidence.proved, run.statistics.steps);
    }
}

TEST(Bernstein, HowNearIsATouchIsTheSystemsToSay)
{
    const auto events = [](double depth) {
        const NearTangent system({.depth = depth, .touch = 1e-3});
        return near_tangent(system).events;
    };
    EXPECT_EQ(events(-1.1e-3).size(), 0u);
    for (const double depth : {-0.9e-3, 0.9e-3}) {
        const auto touches = events(depth);
        ASSERT_EQ(touches.size(), 3u) << depth;
        for (const auto& event : touches) EXPECT_EQ(event.kind, EventKind::touch) << depth;
    }
    const auto crossings = events(1.1e-3);
    ASSERT_EQ(crossings.size(), 6u);
    for (const auto& event : crossings) EXPECT_EQ(event.kind, EventKind::crossing);
}

// --- multiple roots ---

/// sin t to a power, from the state or from the time.
struct SinePower {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;

    int power = 2;
    bool from_state = true;
    bool declares_degree = true;
    static constexpr State start{0.8414709848078965, 0.5403023058681398};  ///< at t = 1

    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = Crossing::either, .degree = from_state && declares_degree ? power : 0};
    }
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    template <class X>
    [[nodiscard]] double guard(double t, const X& x) const
    {
        return std::pow(from_state ? x[0] : std::sin(t), power);
    }
};

template <class Method>
void expect_each_once(const SinePower& system, double step, double tolerance)
{
    const auto run = integrate(system, SinePower::start, {.t_start = 1, .t_end = 10, .step = step},
                               FixedStep<Method>{}, Bernstein{});
    const EventKind kind = system.power % 2 == 0 ? EventKind::touch : EventKind::crossing;
    EXPECT_LE(distance(times(run), {pi, 2 * pi, 3 * pi}), tolerance)
        << "power " << system.power << ", step " << step << ", from state " << system.from_state;
    EXPECT_TRUE(all_of_kind(run, kind)) << "power " << system.power << ", step " << step;
}

TEST(Bernstein, MultipleRootsAreReportedOnceWhereverTheStepsFall)
{
    // Within 64 units in the last place of 1, 1.4e-14, a guard is on its surface. A double
    // root is located by its rate, far better; one of order p only to that to the power
    // 1 / p, 2.4e-5 and 3.5e-4 for 3 and 4. The motion itself, at steps of 0.25, is off by
    // h^5 / 1000.
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> steps(0.02, 0.25);
    for (int i = 0; i < 60; ++i) {
        const double step = steps(random);
        for (const int power : {1, 2, 3, 4}) {
            const double tolerance = power <= 2 ? 2e-6 : 1e-3;
            expect_each_once<Dopri5>({.power = power}, step, tolerance);
            expect_each_once<Dopri5>({.power = power, .declares_degree = false}, step, tolerance);
            expect_each_once<Rk4>({.power = power, .from_state = false}, step, tolerance);
        }
    }
}

TEST(Bernstein, MultipleRootsOnTheBoundaryOfTwoStepsAreReportedOnce)
{
    // The steps end at 1/2, exactly, or next to it.
    for (const double root : {0.5, std::nextafter(0.5, 0), std::nextafter(0.5, 1), 0.5 - 1e-13,
                              0.5 + 1e-13, 0.5 - 1e-9, 0.5 + 1e-9}) {
        for (const int power : {1, 2, 3, 4}) {
            for (const bool declared : {false, true}) {
                const Timed system{[=](double t) { return std::pow(t - root, power); },
                                   Crossing::either, declared ? power : 0};
                const auto run = run_timed(system, 0.25);
                // 64 units in the last place of 0.1 to the power 1 / 4.
                EXPECT_LE(distance(times(run), {root}), 2e-4)
                    << "power " << power << ", root 0.5 + " << root - 0.5 << ", " << declared;
                EXPECT_TRUE(
                    all_of_kind(run, power % 2 == 0 ? EventKind::touch : EventKind::crossing));
            }
        }
    }
}

TEST(Bernstein, ATouchInADirectionThatDoesNotCountIsNone)
{
    const auto parabola = [](double t) { return (t - 0.3) * (t - 0.3); };
    EXPECT_EQ(run_timed(Timed{parabola, Crossing::falling, 2}, 1).events.size(), 1u);
    EXPECT_EQ(run_timed(Timed{parabola, Crossing::rising, 2}, 1).events.size(), 0u);
}

/// A polynomial by its roots and their multiplicities.
struct Product {
    using State = std::array<double, 1>;
    struct Root {
        double at;
        int multiplicity;
    };

    std::vector<Root> roots;  ///< ascending, distinct
    double scale = 1;
    Crossing crossing = Crossing::either;
    int degree = 0;
    bool acts = false;  ///< it has a reset that changes nothing
    static constexpr std::size_t guard_count = 1;

    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = crossing, .resets = acts, .degree = degree};
    }
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = 1;
    }
    template <class Number>
    [[nodiscard]] Number value(Number u) const
    {
        Number product = static_cast<Number>(scale);
        for (const Root& root : roots) {
            for (int i = 0; i < root.multiplicity; ++i) product *= u - static_cast<Number>(root.at);
        }
        return product;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t, double, const X& x) const
    {
        return value<double>(x[0]);
    }
    template <class X>
    void reset(std::size_t, double, X&) const
    {
    }
};

/// Up to seven roots around [0, 1], some of them multiple or close together.
Product random_product(std::mt19937_64& random)
{
    std::uniform_real_distribution<double> unit(0, 1);
    Product product;
    const int degree = 1 + static_cast<int>(random() % 7);
    while (product.degree < degree) {
        const double where = unit(random);
        Product::Root root{unit(random), 1};
        if (where < 0.15) root.at -= 1;
        if (where > 0.85) root.at += 1;
        if (where > 0.4 && where < 0.6 && !product.roots.empty()) {
            root.at = product.roots.back().at + std::pow(10, -5 * unit(random));
        }
        if (unit(random) < 0.25) root.multiplicity = 2 + static_cast<int>(random() % 3);
        root.multiplicity = std::min(root.multiplicity, 7 - product.degree);
        product.degree += root.multiplicity;
        product.roots.push_back(root);
    }
    std::sort(product.roots.begin(), product.roots.end(),
              [](const auto& a, const auto& b) { return a.at < b.at; });
    product.scale = (random() % 2 == 0 ? 1 : -1) * std::pow(10, 6 * unit(random) - 3);
    product.crossing =
        std::array{Crossing::falling, Crossing::rising, Crossing::either}[random() % 3];
    product.acts = random() % 2 == 0;
    return product;
}

double largest_value(const Product& product)
{
    double largest = 0;
    for (int i = 0; i <= 200; ++i) {
        largest = std::max(largest, std::fabs(product.value(i / 200.0)));
    }
    return largest;
}

/// Whether the guard is a hundred times farther from its surface than the tolerance, between any
/// two of its roots and at both ends.
bool is_unambiguous(const Product& product)
{
    const long double clear = 100 * 64 * epsilon * static_cast<long double>(largest_value(product));
    if (std::fabs(product.value(0.0L)) < clear || std::fabs(product.value(1.0L)) < clear) {
        return false;
    }
    for (std::size_t k = 0; k + 1 < product.roots.size(); ++k) {
        const long double from = product.roots[k].at;
        const long double to = product.roots[k + 1].at;
        long double peak = 0;
        for (int i = 1; i < 32; ++i) {
            peak = std::max(peak, std::fabs(product.value(from + (to - from) * i / 32)));
        }
        if (to > 0 && from < 1 && peak < clear) return false;
    }
    return true;
}

struct Expected {
    double t;
    EventKind kind;
    double tolerance;
};

/// Width of the interval in which the guard counts as on the surface.
double width_of(const Product& product, const Product::Root& root)
{
    double lead = std::fabs(product.scale);
    for (const Product::Root& other : product.roots) {
        if (other.at == root.at) continue;
        lead *= std::pow(std::fabs(root.at - other.at), other.multiplicity);
    }
    const double band = 64 * epsilon * largest_value(product);
    return std::pow(band / lead, 1.0 / root.multiplicity) + 1e-14;
}

std::vector<Expected> expected_events(const Product& product, bool backward)
{
    std::vector<Product::Root> roots = product.roots;
    if (backward) std::reverse(roots.begin(), roots.end());
    Side side = product.value(backward ? 1.0 : 0.0) > 0 ? Side::above : Side::below;
    std::vector<Expected> events;
    for (const Product::Root& root : roots) {
        if (!(root.at > 0 && root.at < 1)) continue;
        const bool touches = root.multiplicity % 2 == 0;
        if (counts(side, product.crossing)) {
            events.push_back({root.at, touches ? EventKind::touch : EventKind::crossing,
                              width_of(product, root)});
        }
        if (!touches) side = opposite(side);
    }
    return events;
}

void expect_all_found(Product product, std::mt19937_64& random, int which)
{
    std::uniform_real_distribution<double> unit(0, 1);
    const bool backward = random() % 4 == 0;
    const double t_start = backward ? 1 : 0;
    const double step = random() % 2 == 0 ? 1 : 0.05 + unit(random);
    if (random() % 2 == 0) product.degree = 0;
    const auto run =
        integrate(product, {t_start}, {.t_start = t_start, .t_end = 1 - t_start, .step = step},
                  FixedStep<Rk4>{}, Bernstein{});
    const auto expected = expected_events(product, backward);
    ASSERT_EQ(run.events.size(), expected.size()) << "polynomial " << which;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_EQ(run.events[i].kind, expected[i].kind) << "polynomial " << which;
        EXPECT_NEAR(run.events[i].t, expected[i].t, expected[i].tolerance)
            << "polynomial " << which;
    }
}

TEST(Bernstein, OfTwentyThousandRandomPolynomialsNoRootIsMissedOrDoubled)
{
    std::mt19937_64 random(2024);
    int tried = 0;
    for (int drawn = 0; tried < 20000; ++drawn) {
        ASSERT_LT(drawn, 30000) << "hardly a polynomial is fit to be tried";
        const Product product = random_product(random);
        if (!is_unambiguous(product)) continue;
        expect_all_found(product, random, drawn);
        ++tried;
    }
}

// --- evidence ---

/// Number of times that `stays_on_side` claims so for a polynomial with a root in (0, 1].
int false_proofs(int degree, std::mt19937_64& random)
{
    std::uniform_real_distribution<double> unit(0, 1);
    int proofs = 0;
    for (int i = 0; i < 1000; ++i) {
        // A parabola that touches or barely crosses, times factors that are positive.
        const double root = unit(random);
        const double depth = std::pow(10, -20 + 10 * unit(random)) * (i % 2);
        std::array<double, 32> others;
        for (double& other : others) other = -0.1 - unit(random);
        std::array<double, 33> values;
        for (int j = 0; j <= degree; ++j) {
            const double u = detail::bernstein_nodes(degree)[j];
            double value = degree == 1 ? root - u : (u - root) * (u - root) - depth;
            for (int k = 2; k < degree; ++k) value *= u - others[static_cast<std::size_t>(k)];
            values[static_cast<std::size_t>(j)] = value;
        }
        const auto last = static_cast<std::size_t>(degree);
        const Watch watch{.side = Side::above,
                          .start = {.s = 0, .value = values[0], .rate = -1},
                          .end = {.s = 1, .value = values[last], .rate = 1}};
        proofs += detail::stays_on_side({.degree = degree}, watch, values.data());
    }
    return proofs;
}

TEST(Bernstein, NoBoundIsClaimedWhereThereIsARoot)
{
    std::mt19937_64 random(3);
    for (int degree = 1; degree <= 32; ++degree) {
        EXPECT_EQ(false_proofs(degree, random), 0) << "degree " << degree;
    }
}

TEST(Bernstein, APositivePolynomialIsProvedToBeSo)
{
    // (u - 1/2)^2 + 1/4, whose coefficients in degree n are all 1/4 or more for n >= 3.
    for (int degree = 3; degree <= 24; ++degree) {
        std::array<double, 33> values;
        for (int j = 0; j <= degree; ++j) {
            const double u = detail::bernstein_nodes(degree)[j];
            values[static_cast<std::size_t>(j)] = (u - 0.5) * (u - 0.5) + 0.25;
        }
        const Watch watch{.side = Side::above,
                          .start = {.s = 0, .value = 0.5, .rate = -1},
                          .end = {.s = 1, .value = 0.5, .rate = 1}};
        EXPECT_TRUE(detail::stays_on_side({.degree = degree}, watch, values.data())) << degree;
    }
}

/// cos t + 2.
struct Cosine : SinePower {
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return x[1] + 2;
    }
};

TEST(Bernstein, StepsAreProvedOfPolynomialGuardsAndCheckedOfOthers)
{
    // No root of cos t + 2 in any of the steps.
    const Options options{.t_start = 1, .t_end = 11, .step = 0.1};
    Cosine polynomial;
    polynomial.power = 1;
    const auto proved =
        integrate(polynomial, SinePower::start, options, FixedStep<Dopri5>{}, Bernstein{});
    EXPECT_EQ(proved.statistics.evidence.proved, proved.statistics.steps);
    EXPECT_EQ(proved.statistics.evidence.checked, 0u);

    Cosine general;
    general.declares_degree = false;
    const auto checked =
        integrate(general, SinePower::start, options, FixedStep<Dopri5>{}, Bernstein{});
    EXPECT_EQ(checked.statistics.evidence.checked, checked.statistics.steps);
    EXPECT_EQ(checked.statistics.evidence.proved, 0u);
}

TEST(Bernstein, AFlightFromTheFloorIsProvedToBeOne)
{
    // The guard is zero at the start, and that root divides out.
    const ImpactOscillator system;
    const auto run = integrate(system, {1.0, -0.5}, {.t_end = 0.5, .step = 0.25},
                               FixedStep<Dopri5>{}, Bernstein{});
    ASSERT_TRUE(run.events.empty());
    EXPECT_EQ(run.statistics.evidence.proved, 2u);
}

TEST(Bernstein, AGuardOfAHigherDegreeThanDeclaredIsNoticedNearItsSurface)
{
    // Declared linear, it is treated as a cubic on the step of rk4, until the end of the
    // step, cos 9 < 0, requires a closer examination.
    const Timed system{[](double t) { return std::cos(9 * t); }, Crossing::either, 1};
    EXPECT_LE(distance(times(run_timed(system, 1)), {pi / 18, pi / 6, 5 * pi / 18}), 4 * epsilon);
}

// --- the same answers as Extremum ---

/// The detectors hand different brackets to the locator, which finds the root to neighbouring
/// doubles from each: an ulp of the time, times a velocity, in every impact. `apart` allows for
/// what that grows to.
template <class System, class State>
void expect_same_events(const System& system, const State& start, const Options& options,
                        double apart)
{
    const auto run = integrate(system, start, options, ErrorControlled<Dopri5>{}, Bernstein{});
    const auto other = integrate(system, start, options, ErrorControlled<Dopri5>{}, Extremum{});
    EXPECT_EQ(run.outcome, other.outcome);
    ASSERT_EQ(run.events.size(), other.events.size());
    EXPECT_GT(run.events.size(), 10u);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_NEAR(run.events[i].t, other.events[i].t, apart) << "event " << i;
        for (std::size_t k = 0; k < start.size(); ++k) {
            EXPECT_NEAR(run.events[i].after[k], other.events[i].after[k], 10 * apart) << i;
        }
    }
}

TEST(Bernstein, ABouncingBallBouncesAsWithExtremum)
{
    expect_same_events(BouncingBall(), std::array{10.0, 0.0}, {.t_end = 20.5}, 1e-13);
}

TEST(Bernstein, AnImpactOscillatorHitsItsWallAsWithExtremum)
{
    for (const double frequency : {0.7, 0.8, 1.2}) {
        const ImpactOscillator system({.frequency = frequency});
        expect_same_events(system, ImpactOscillator::start, {.t_end = 50 * system.period()}, 1e-11);
    }
}

TEST(Bernstein, StatesSizedAtRunTimeGiveTheSameEvents)
{
    const NearTangent system({.depth = 1e-6});
    const Options options{.t_end = 20, .rtol = 1e-12, .atol = 1e-12};
    const auto start = system.start();
    const auto fixed = integrate(system, start, options, ErrorControlled<Dopri5>{}, Bernstein{});
    const auto vector = integrate(system, std::vector<double>(start.begin(), start.end()), options,
                                  ErrorControlled<Dopri5>{}, Bernstein{});
    const Eigen::VectorXd dynamic = Eigen::Map<const Eigen::VectorXd>(start.data(), 2);
    const auto eigen = integrate(system, dynamic, options, ErrorControlled<Dopri5>{}, Bernstein{});
    EXPECT_EQ(fixed.events.size(), 6u);
    EXPECT_EQ(times(vector), times(fixed));
    EXPECT_EQ(times(eigen), times(fixed));
}

// --- one check of a step ---

TEST(Bernstein, TheBracketOfAnOnlyRootIsTheWholeStep)
{
    const HostStep fall(
        1.0, [](double s) { return 0.5 - s + 0.1 * s * s; }, [](double s) { return 0.2 * s - 1; });
    const Finding finding = look(Bernstein{}, fall, Side::above, Crossing::falling);
    ASSERT_TRUE(finding.hit);
    EXPECT_EQ(finding.lo.s, 0);
    EXPECT_EQ(finding.hi.s, 1);
}

TEST(Bernstein, TheBracketHoldsOneRootOfSeveral)
{
    const HostStep wave(
        1.0, [](double s) { return std::cos(9 * s); },
        [](double s) { return -9 * std::sin(9 * s); });
    const Finding finding = look(Bernstein{}, wave, Side::above, Crossing::falling);
    ASSERT_TRUE(finding.hit);  // roots at pi/18, pi/6, 5 pi/18
    EXPECT_EQ(finding.side, Side::above);
    EXPECT_LT(finding.lo.s, pi / 18);
    EXPECT_GT(finding.hi.s, pi / 18);
    EXPECT_LT(finding.hi.s, pi / 6);
    EXPECT_LT(finding.hi.value, 0);

    const Finding rising = look(Bernstein{}, wave, Side::above, Crossing::rising);
    ASSERT_TRUE(rising.hit);
    EXPECT_EQ(rising.side, Side::below);
    EXPECT_GT(rising.lo.s, pi / 18);
    EXPECT_LT(rising.lo.s, pi / 6);
    EXPECT_GT(rising.hi.s, pi / 6);
    EXPECT_LT(rising.hi.s, 5 * pi / 18);
}

TEST(Bernstein, AKinkBelowTheSurfaceIsFoundWhereverItIs)
{
    // Two roots, 2e-2 to 1e-6 apart, which no polynomial over the step shows.
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < 20000; ++i) {
        const double at = 0.02 + 0.96 * unit(random);
        const double depth = 0.2 * std::pow(10, -1.7 - 4 * unit(random));
        const double before = 0.2 + unit(random);
        const double after = 0.2 + unit(random);
        const auto g = [=](double s) {
            return (s < at ? before : after) * std::fabs(s - at) - depth;
        };
        if (!(g(0) > 0 && g(1) > 0)) continue;
        const HostStep kink(1.0, g, [=](double s) { return s < at ? -before : after; });
        const Finding finding = look(Bernstein{}, kink, Side::above, Crossing::falling);
        ASSERT_TRUE(finding.hit) << at << ' ' << depth;
        EXPECT_LE(finding.hi.value, 0);
    }
}

TEST(Bernstein, AKinkBelowTheSurfaceIsFoundAfterAStartOnItToo)
{
    const HostStep kink(
        1.0, [](double s) { return std::min(5 * s, std::fabs(s - 0.52) - 1e-3); },
        [](double s) { return s < 0.0865 ? 5.0
                              : s < 0.52 ? -1.0
                                         : 1.0; });
    const Finding finding = look(Bernstein{}, kink, Side::above, Crossing::falling);
    ASSERT_TRUE(finding.hit);
    EXPECT_NEAR(finding.hi.s, 0.52, 1e-3);
}

TEST(Bernstein, NotANumberInsideAStepHidesNothingElse)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const auto hole = [=](double from, double to) {
        return HostStep(
            1.0, [=](double s) { return s > from && s < to ? nan : std::cos(9 * s); },
            [](double s) { return -9 * std::sin(9 * s); });
    };
    // cos 9 s falls at pi/18 = 0.175, rises at 0.524 and falls at 0.873.
    const Finding before = look(Bernstein{}, hole(0.3, 0.4), Side::above, Crossing::falling);
    ASSERT_TRUE(before.hit);
    EXPECT_LT(before.hi.s, 0.3);
    const Finding after = look(Bernstein{}, hole(0.3, 0.4), Side::above, Crossing::rising);
    ASSERT_TRUE(after.hit);
    EXPECT_LT(after.lo.s, 0.524);
    EXPECT_GT(after.hi.s, 0.523);
    const Finding none = look(Bernstein{}, hole(0.0, 1.0), Side::above, Crossing::either);
    EXPECT_TRUE(none.hit);  // its ends differ
}

TEST(Bernstein, WhereTheGuardIsNotANumberNothingIsCheckedOnlyAssumed)
{
    const auto hole = [](double s) {
        return s > 0.3 && s < 0.4 ? std::numeric_limits<double>::quiet_NaN() : 2 + std::cos(s);
    };
    const HostStep step(1.0, hole, [](double s) { return -std::sin(s); });
    const Finding finding = look(Bernstein{}, step, Side::above, Crossing::falling);
    EXPECT_FALSE(finding.hit);
    EXPECT_EQ(finding.evidence, Evidence::assumed);
}

/// A spiral whose coordinates are zero in turn, four times in a turn.
struct Spiral {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    double decay = 0;
    void flow(double, const State& x, State& dxdt) const
    {
        dxdt = {-decay * x[0] - x[1], x[0] - decay * x[1]};
    }
    template <class V>
    [[nodiscard]] double guard(double, const V& x) const
    {
        return x[0] * x[1];
    }
    [[nodiscard]] GuardInfo guard_info() const
    {
        return {.crossing = Crossing::either, .resets = false};
    }
};

TEST(Bernstein, CrossingsOfAGuardThatDecaysAreNoTouches)
{
    // At the strongest decay it falls to 1e-104.
    for (const double decay : {0.01, 0.1, 0.3}) {
        for (const double rtol : {1e-6, 1e-9}) {
            const Options options{.t_end = 255 * pi / 2, .rtol = rtol, .atol = 0};
            const auto run = integrate(Spiral{decay}, {1.0, 0.1}, options,
                                       ErrorControlled<Dopri5>{}, Bernstein{});
            ASSERT_EQ(run.events.size(), 255u) << decay;
            const double first = pi / 2 - std::atan(0.1);
            for (std::size_t k = 0; k < run.events.size(); ++k) {
                EXPECT_EQ(run.events[k].kind, EventKind::crossing);
                // The phase drifts by less than the tolerance in every radian.
                EXPECT_NEAR(run.events[k].t, first + static_cast<double>(k) * pi / 2, 400 * rtol);
            }
        }
    }
}

TEST(Bernstein, NotANumberAtTheEndOfAStepEndsTheRun)
{
    const Timed system{[](double t) { return std::sqrt(0.55 - t); }};
    const auto run = run_timed(system, 0.1);
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_NEAR(run.t, 0.55, 1e-14);  // the last step is taken again, shorter
}

}  // namespace
}  // namespace ricochet::bernstein_test
