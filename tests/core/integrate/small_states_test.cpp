// States of one to four doubles share one loop, with zeros behind the last: every size has the bits
// of a vector of that size, and no one outside the loop sees the zeros.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/rosenbrock.hpp"

namespace ricochet::small_states_test {
namespace {

/// Components that decay and drive one another in a ring. The mean of all of them falls to a tenth
/// of its start, and is thrown back; a mean over zeros behind the last would be another guard.
struct Ring {
    static constexpr bool unchecked_names = true;

    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        const auto n = x.size();
        for (std::size_t i = 0; i < n; ++i) {
            dxdt[i] =
                -(1 + 0.25 * static_cast<double>(i)) * x[i] + 0.1 * x[(i + 1) % n] * std::cos(t);
        }
    }
    template <class X>
    double guard(double, const X& x) const
    {
        double sum = 0;
        for (std::size_t i = 0; i < static_cast<std::size_t>(x.size()); ++i) sum += x[i];
        return sum / static_cast<double>(x.size()) - 0.1;
    }
    template <class X>
    void reset(double, X& x) const
    {
        for (std::size_t i = 0; i < x.size(); ++i) x[i] *= 9;
    }
};

template <std::size_t n>
std::array<double, n> start()
{
    std::array<double, n> x;
    std::iota(x.begin(), x.end(), 1.0);
    return x;
}

template <class X>
std::vector<double> plain(const X& x)
{
    return {x.begin(), x.end()};
}

template <class A, class B>
void expect_same_run(const Run<A>& ours, const Run<B>& theirs)
{
    ASSERT_EQ(ours.events.size(), theirs.events.size());
    ASSERT_GT(ours.events.size(), 3u);
    for (std::size_t i = 0; i < ours.events.size(); ++i) {
        EXPECT_EQ(ours.events[i].t, theirs.events[i].t);
        EXPECT_EQ(plain(ours.events[i].before), plain(theirs.events[i].before));
        EXPECT_EQ(plain(ours.events[i].after), plain(theirs.events[i].after));
    }
    EXPECT_EQ(plain(ours.x), plain(theirs.x));
    ASSERT_EQ(ours.trajectory.x.size(), theirs.trajectory.x.size());
    for (std::size_t i = 0; i < ours.trajectory.x.size(); ++i) {
        EXPECT_EQ(plain(ours.trajectory.x[i]), plain(theirs.trajectory.x[i]));
    }
    EXPECT_EQ(ours.statistics.steps, theirs.statistics.steps);
    EXPECT_EQ(ours.statistics.flow_calls, theirs.statistics.flow_calls);
}

template <class Size>
class SmallStates : public testing::Test {
};

template <std::size_t n>
using Of = std::integral_constant<std::size_t, n>;
using Sizes = testing::Types<Of<1>, Of<2>, Of<3>, Of<4>>;
TYPED_TEST_SUITE(SmallStates, Sizes);

TYPED_TEST(SmallStates, HaveTheBitsOfAVectorByEveryMethod)
{
    const auto x = start<TypeParam::value>();
    const std::vector<double> vector(x.begin(), x.end());
    const Ring ring;
    const Options options{.t_end = 12, .sample_times = {0.5, 3, 11.5}};
    const auto expect_same = [&](const auto& stepping, const Options& with) {
        expect_same_run(integrate(ring, x, with, stepping),
                        integrate(ring, vector, with, stepping));
    };
    for (const MethodName name :
         {MethodName::cash_karp54, MethodName::dopri5, MethodName::fehlberg78}) {
        expect_same(ErrorControlled<MethodByName>{{name}}, options);
    }
    expect_same(ErrorControlled<Rosenbrock4>{}, options);
    Options fixed = options;
    fixed.step = 0.01;
    expect_same(FixedStep<MethodByName>{{MethodName::rk4}}, fixed);
}

TYPED_TEST(SmallStates, HaveOneToleranceForEachOfTheirComponents)
{
    constexpr std::size_t n = TypeParam::value;
    const auto x = start<n>();
    const Ring ring;
    Options options{.t_end = 12, .component_atol = std::vector<double>(n, 1e-6)};
    options.component_atol.back() = 1e-12;
    const std::vector<double> vector(x.begin(), x.end());
    expect_same_run(integrate(ring, x, options), integrate(ring, vector, options));

    options.component_atol.push_back(1e-6);
    try {
        static_cast<void>(integrate(ring, x, options));
        FAIL();
    } catch (const std::invalid_argument& refusal) {
        const std::string wanted = "each of the " + std::to_string(n) + " components";
        EXPECT_NE(std::string(refusal.what()).find(wanted), std::string::npos) << refusal.what();
    }
}

TYPED_TEST(SmallStates, AreSavedWithTheirComponentsAlone)
{
    constexpr std::size_t n = TypeParam::value;
    const auto x = start<n>();
    const std::vector<double> vector(x.begin(), x.end());
    const Ring ring;
    const Options options{.t_end = 12};
    Simulation ours(ring, x, options);
    Simulation theirs(ring, vector, options);
    ASSERT_TRUE(ours.advance() && theirs.advance());
    const Snapshot snapshot = ours.save();
    EXPECT_EQ(snapshot.numbers, theirs.save().numbers);
    EXPECT_EQ(snapshot.counts, theirs.save().counts);

    Simulation restored(ring, x, options);
    restored.restore(snapshot);
    restored.run_to_end([](const auto&) {});
    theirs.run_to_end([](const auto&) {});
    EXPECT_EQ(plain(restored.x()), theirs.x());

    std::array<double, n % 4 + 1> other{};
    other.fill(1);
    Simulation of_other_size(ring, other, options);
    EXPECT_THROW(of_other_size.restore(snapshot), std::invalid_argument);
}

TYPED_TEST(SmallStates, ShowARunThatIsKeptUpToDate)
{
    // References to the state and to the records, taken once, follow the run.
    const Ring ring;
    const auto x0 = start<TypeParam::value>();
    Simulation simulation(ring, x0, {.t_end = 12});
    const auto& x = simulation.x();
    const auto& run = simulation.run();
    ASSERT_TRUE(simulation.advance());
    EXPECT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.statistics.events, 1u);
    EXPECT_EQ(x, run.events[0].after);
    while (simulation.step()) {
    }
    EXPECT_EQ(run.statistics.events, run.events.size());
    EXPECT_GT(run.events.size(), 3u);
    EXPECT_EQ(x, simulation.x());
    EXPECT_EQ(plain(x), plain(simulation.take().x));
}

/// A host's step along a straight line, with arrays of exactly n doubles on the heap: an address
/// sanitizer sees any access beyond them.
struct StraightStep {
    Instant begin;
    double length;
    std::unique_ptr<double[]> from, to, rate;
    std::size_t n;

    StraightStep(double t, double h, const std::vector<double>& x, const std::vector<double>& v)
        : begin{t, 0},
          length(h),
          from(new double[x.size()]),
          to(new double[x.size()]),
          rate(new double[x.size()]),
          n(x.size())
    {
        for (std::size_t i = 0; i < n; ++i) {
            from[i] = x[i];
            rate[i] = v[i];
            to[i] = x[i] + h * v[i];
        }
    }
    [[nodiscard]] const Instant& t0() const { return begin; }
    [[nodiscard]] double h() const { return length; }
    [[nodiscard]] std::span<const double> x0() const { return {from.get(), n}; }
    [[nodiscard]] std::span<const double> x1() const { return {to.get(), n}; }
    [[nodiscard]] std::span<const double> rate0() const { return {rate.get(), n}; }
    [[nodiscard]] std::span<const double> rate1() const { return {rate.get(), n}; }
    void interpolate(double s, std::span<double> x) const
    {
        ASSERT_EQ(x.size(), n);
        for (std::size_t i = 0; i < n; ++i) x[i] = from[i] + s * rate[i];
    }
};

TYPED_TEST(SmallStates, AreShownToAMonitorInArraysOfTheirSize)
{
    // All components fall at 1 from their start: the mean, (n + 1) / 2, reaches a tenth after
    // (n + 1) / 2 - 0.1 seconds.
    constexpr std::size_t n = TypeParam::value;
    const Ring ring;
    EventMonitor monitor(ring, start<n>());
    const std::vector<double> x = plain(start<n>()), rate(n, -1.0);
    ASSERT_EQ(monitor.start(Instant{0}, x, rate, 1), Verdict::stands);
    const StraightStep step(0, 4, x, rate);
    ASSERT_EQ(monitor.examine(step), Verdict::cut);
    const double t = 0.5 * (n + 1) - 0.1;
    const auto& cut = monitor.cut();
    EXPECT_NEAR(cut.t.value, t, 4e-15);  // an ulp of the mean and one of the time
    static_assert(std::is_same_v<std::remove_cvref_t<decltype(cut.after)>, std::array<double, n>>);
    for (std::size_t i = 0; i < n; ++i) {
        EXPECT_NEAR(cut.before[i], x[i] - t, 4e-15);
        EXPECT_EQ(cut.after[i], 9 * cut.before[i]);
    }
    ASSERT_EQ(monitor.events().size(), 1u);
    EXPECT_EQ(monitor.events()[0].after, cut.after);
    EXPECT_EQ(monitor.x().size(), n);
    EXPECT_THROW(monitor.start(Instant{5}, std::vector<double>(n + 1, 1.0), 1),
                 std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::small_states_test
