// Events of CVODE's steps.
#include <algorithm>

#include "hosts/host_cases.hpp"
#include "hosts/sundials_setup.hpp"

namespace ricochet::hosts_test::cvode_test {

namespace {

struct Adams {
    template <class System>
    using Of = CvodeOf<System, CV_ADAMS>;
    static constexpr double impact_error = 1e-13;
    static constexpr double finest = 1e-13;
    static constexpr double least_depth = 1e-10;
};
struct Bdf {
    template <class System>
    using Of = CvodeOf<System, CV_BDF>;
    static constexpr double impact_error = 2e-9;
    static constexpr double finest = 1e-13;
    static constexpr double least_depth = 1e-10;
};

using Methods = testing::Types<Adams, Bdf>;
INSTANTIATE_TYPED_TEST_SUITE_P(Cvode, InHost, Methods);

/// Steps of the integrator since it was initialised, and where they end.
struct Trail {
    long steps = 0;
    std::array<double, 2> x{};
    std::size_t cuts = 0;
    std::size_t events = 0;
};

Trail follow(const MonitorOptions& options)
{
    const Crests system{1e-3};
    const Mode mode = 0;
    CvodeOf<Crests, CV_ADAMS> made(system, mode, {0, 1}, {});
    EventMonitor monitor(system, Crests::State{0, 1}, options);
    Trail trail;
    hosts::run(made.host(), monitor, 18, [&](const auto&) { ++trail.cuts; });
    CVodeGetNumSteps(made.memory(), &trail.steps);
    std::ranges::copy(made.host().x(), trail.x.begin());
    trail.events = monitor.events().size();
    return trail;
}

TEST(CvodeHost, ACutThatChangesNothingLeavesTheIntegratorAsItIs)
{
    const Trail stands = follow({});
    const Trail cut = follow({.cut_at_all = true});
    EXPECT_EQ(stands.cuts, 0u);
    EXPECT_EQ(cut.cuts, 6u);
    EXPECT_EQ(cut.events, 6u);
    EXPECT_EQ(cut.steps, stands.steps);
    EXPECT_EQ(cut.x, stands.x);
}

/// A ball that is kicked at two times.
struct KickedBall {
    using State = std::array<double, 2>;
    double first, second;

    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < first ? first : t < second ? second : std::numeric_limits<double>::infinity();
    }
    void time_reset(double /*t*/, State& x) const { x[1] += 1; }
};

TEST(CvodeHost, ATimeEventBesideAnotherLeavesNoRoomForAStep)
{
    // CVODE refuses a first step below two roundings of the time.
    for (int ulps = 1; ulps <= 40; ++ulps) {
        const KickedBall system{1, 1 + ulps * std::numeric_limits<double>::epsilon()};
        const Mode mode = 0;
        CvodeOf<KickedBall, CV_ADAMS> made(system, mode, {10, 0}, {});
        EventMonitor monitor(system, KickedBall::State{10, 0});
        ASSERT_EQ(hosts::run(made.host(), monitor, 1.6), Verdict::stands) << ulps;
        EXPECT_NEAR(made.host().x()[1], 2 - 9.81 * 1.6, 1e-8) << ulps;
        EXPECT_EQ(monitor.events().size(), 2U);
    }
}

}  // namespace

}  // namespace ricochet::hosts_test::cvode_test
