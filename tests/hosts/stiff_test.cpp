// Stiff hybrid systems by CVODE's BDF, beside a run of much smaller tolerance.
#include "hosts/stiff_systems.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "hosts/host_systems.hpp"
#include "hosts/sundials_setup.hpp"

namespace ricochet::hosts_test::stiff_test {

namespace {

struct Bdf {
    template <class System>
    using Of = CvodeOf<System, CV_BDF>;
};

TEST(StiffHosts, RobertsonsValveOpensAndCloses)
{
    const RobertsonValve system;
    const double rtol = 1e-7;
    const auto run_to = [&](double tolerance) {
        return run<Bdf>(system, {1, 0, 0}, 2000, {tolerance, 1e-4 * tolerance});
    };
    const auto result = run_to(rtol);
    const auto exact = run_to(1e-4 * rtol);
    EXPECT_EQ(result.verdict, Verdict::stands);
    ASSERT_GE(result.cuts.size(), 5u);
    ASSERT_EQ(result.cuts.size(), exact.cuts.size());
    for (std::size_t k = 0; k < result.cuts.size(); ++k) {
        const double t = exact.cuts[k].t.value;
        EXPECT_NEAR(result.cuts[k].t.value, t, 100 * rtol * t);
        EXPECT_EQ(result.cuts[k].mode_after, exact.cuts[k].mode_after);
    }
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(result.end[i], exact.end[i], 100 * rtol * exact.end[i]);
    }
}

TEST(StiffHosts, TheBuckConverterSwitches)
{
    const BuckConverter system;
    const double rtol = 1e-7;
    const auto run_to = [&](double tolerance) {
        return run<Bdf>(system, {0, 0, 0}, 25.5 * BuckConverter::half_period,
                        {tolerance, 10 * tolerance}, BuckConverter::switched_on);
    };
    const auto result = run_to(rtol);
    const auto exact = run_to(1e-2 * rtol);
    EXPECT_EQ(result.verdict, Verdict::stands);
    // 25 switchings, and the diode after each.
    EXPECT_EQ(exact.cuts.size(), 50u);
    ASSERT_EQ(result.cuts.size(), exact.cuts.size());
    for (std::size_t k = 0; k < result.cuts.size(); ++k) {
        EXPECT_NEAR(result.cuts[k].t.value, exact.cuts[k].t.value, rtol * result.t);
        EXPECT_EQ(result.cuts[k].mode_after, exact.cuts[k].mode_after);
    }
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(result.end[i], exact.end[i], 100 * rtol * std::fabs(exact.end[i]));
    }
}

}  // namespace

}  // namespace ricochet::hosts_test::stiff_test
