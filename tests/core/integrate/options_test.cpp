#include "ricochet/options.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

namespace ricochet::options_test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

std::string refusal_of(const Options& options, bool step_required = false)
{
    try {
        validate(options, step_required);
        return "accepted";
    } catch (const std::invalid_argument& reason) {
        return reason.what();
    }
}

TEST(Options, TheEndTimeIsRequired)
{
    EXPECT_EQ(refusal_of({}), "integrate: t_end must be a finite time, got nan");
}

TEST(Options, ATimeSpanThatOverflowsIsRefused)
{
    EXPECT_EQ(refusal_of({.t_start = -1e308, .t_end = 1e308}),
              "integrate: t_end - t_start must be finite, got 1e+308 - -1e+308");
}

TEST(Options, AFixedStepMustBePositive)
{
    for (const double step : {0.0, -0.1, nan, infinity}) {
        EXPECT_NE(refusal_of({.t_end = 1, .step = step}, true), "accepted") << step;
    }
    EXPECT_EQ(refusal_of({.t_end = 1, .step = 0.1}, true), "accepted");
}

TEST(Options, TolerancesMayNotVanishTogether)
{
    EXPECT_NE(refusal_of({.t_end = 1, .rtol = 0, .atol = 0}), "accepted");
    EXPECT_EQ(refusal_of({.t_end = 1, .rtol = 0, .atol = 1e-9}), "accepted");
    EXPECT_NE(refusal_of({.t_end = 1, .rtol = -1}), "accepted");
    EXPECT_NE(refusal_of({.t_end = 1, .atol = nan}), "accepted");
}

TEST(Options, AnEventToleranceMayNotBeNegative)
{
    EXPECT_NE(refusal_of({.t_end = 1, .event_tolerance = -1e-9}), "accepted");
    EXPECT_NE(refusal_of({.t_end = 1, .event_rtol = nan}), "accepted");
}

TEST(Options, EveryNumberIsFiniteAndNotNegative)
{
    for (double Options::*const number :
         {&Options::step, &Options::rtol, &Options::atol, &Options::h_min,
          &Options::event_tolerance, &Options::event_rtol, &Options::event_window}) {
        for (const double value : {nan, infinity, -infinity, -1.0}) {
            Options options{.t_end = 1};
            options.*number = value;
            EXPECT_NE(refusal_of(options), "accepted") << value;
        }
    }
    // Their sum may overflow.
    EXPECT_EQ(refusal_of({.t_end = 1, .rtol = 1e308, .atol = 1e308}), "accepted");
}

TEST(Options, SampleTimesMustAscendWithinTheRun)
{
    EXPECT_EQ(refusal_of({.t_end = 1, .sample_times = {0, 0.5, 0.5, 1}}), "accepted");
    EXPECT_NE(refusal_of({.t_end = 1, .sample_times = {0.5, 0.2}}), "accepted");
    EXPECT_NE(refusal_of({.t_end = 1, .sample_times = {0.5, 1.2}}), "accepted");
    EXPECT_NE(refusal_of({.t_end = 1, .sample_times = {nan}}), "accepted");
}

TEST(Options, ASampleTimeBeyondTheEndIsCalledThat)
{
    EXPECT_EQ(refusal_of({.t_end = 1, .sample_times = {0.5, 1.5}}),
              "integrate: sample time 1.5 lies beyond the end of the run, t_end = 1");
    EXPECT_EQ(refusal_of({.t_end = -1, .sample_times = {-0.5, -1.5}}),
              "integrate: sample time -1.5 lies beyond the end of the run, t_end = -1");
    EXPECT_EQ(refusal_of({.t_end = 1, .sample_times = {0.5, 0.25}}),
              "integrate: sample_times must go from 0 towards 1, got 0.25 after 0.5");
}

}  // namespace
}  // namespace ricochet::options_test
