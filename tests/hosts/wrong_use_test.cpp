// Wrong use of the monitor by a host is reported, with a description of the right use.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "hosts/host_systems.hpp"
#include "hosts/sundials_setup.hpp"

namespace ricochet::hosts_test::wrong_use_test {

namespace {

template <class Error>
void expect_refusal(const std::function<void()>& use, const std::string& part)
{
    try {
        use();
        ADD_FAILURE() << "nothing was thrown; expected '" << part << "'";
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
}

/// CVODE with a ball, and a monitor that has been started.
template <class System = BouncingBall>
struct Started {
    System system{};
    Mode mode = 0;
    CvodeOf<System, CV_ADAMS> made;
    EventMonitor<System, typename System::State> monitor;

    explicit Started(const typename System::State& x0)
        : made(system, mode, x0, {}), monitor(system, x0)
    {
        EXPECT_EQ(monitor.start({0}, x0, 1e-3), Verdict::stands);
    }
    hosts::Cvode& host() { return made.host(); }

    void go_to_cut()
    {
        do {
            host().step(100);
        } while (monitor.examine(host()) == Verdict::stands);
    }
};

TEST(WrongUse, AStepThatIsNotShownIsMissed)
{
    Started started({10, 0});
    started.host().step(1);
    started.host().step(1);
    expect_refusal<std::logic_error>([&] { (void)started.monitor.examine(started.host()); },
                                     "found a step");
}

TEST(WrongUse, AStepShownTwiceIsRefused)
{
    Started started({10, 0});
    started.host().step(1);
    EXPECT_EQ(started.monitor.examine(started.host()), Verdict::stands);
    EXPECT_THROW((void)started.monitor.examine(started.host()), std::logic_error);
    // Nothing has changed: the run continues.
    started.host().step(1);
    EXPECT_EQ(started.monitor.examine(started.host()), Verdict::stands);
}

TEST(WrongUse, ACutWantsToBeResumed)
{
    Started started({10, 0});
    started.go_to_cut();
    expect_refusal<std::logic_error>([&] { (void)started.monitor.examine(started.host()); },
                                     "resume");
    EXPECT_THROW((void)started.monitor.save(), std::logic_error);
}

TEST(WrongUse, AHostThatGoesOnAfterACutIsRefused)
{
    // The step after the cut begins at the end of the step that was cut short.
    Started started({10, 0});
    started.go_to_cut();
    EXPECT_EQ(started.monitor.resume(1e-3), Verdict::stands);
    started.host().step(100);
    EXPECT_THROW((void)started.monitor.examine(started.host()), std::logic_error);
}

TEST(WrongUse, AStepBeyondATimeEventIsRefused)
{
    Started<Dosed> started({1});
    EXPECT_EQ(started.monitor.must_stop_at(), 1);
    const auto drive = [&] {
        while (started.host().t() < 2) {
            started.host().step(2);
            (void)started.monitor.examine(started.host());
        }
    };
    expect_refusal<std::logic_error>(drive, "time event");
}

TEST(WrongUse, ResumeWithoutACutIsRefused)
{
    Started started({10, 0});
    EXPECT_THROW((void)started.monitor.resume(1e-3), std::logic_error);
    EXPECT_THROW((void)started.monitor.hold(1), std::logic_error);
}

TEST(WrongUse, AnotherDimensionIsRefused)
{
    Started started({10, 0});
    Started<Dosed> other({1});
    other.host().step(0.5);
    EXPECT_THROW((void)started.monitor.examine(other.host()), std::invalid_argument);
    expect_refusal<std::invalid_argument>(
        [&] { started.host().go_on_from(0, std::array{1.0}, true); }, "dimension");
}

TEST(WrongUse, AnEndThatAHostCannotReachIsRefused)
{
    Started started({10, 0});
    (void)hosts::run(started.host(), started.monitor, 1);
    EXPECT_EQ(started.host().t(), 1);
    const double infinity = std::numeric_limits<double>::infinity();
    for (const double t_end : {0.5, -1.0, infinity, std::nan("")}) {
        expect_refusal<std::invalid_argument>(
            [&] { (void)hosts::run(started.host(), started.monitor, t_end); }, "t_end must be");
    }
    EXPECT_EQ(hosts::run(started.host(), started.monitor, 1), Verdict::stands);
}

TEST(WrongUse, AFailingIntegratorIsNamed)
{
    Started started({10, 0});
    // The first step goes back.
    CVodeSetErrFile(started.made.memory(), nullptr);
    CVodeSetInitStep(started.made.memory(), -1);
    expect_refusal<std::runtime_error>([&] { started.host().step(1); }, "CVODE: returned -");
}

}  // namespace

}  // namespace ricochet::hosts_test::wrong_use_test
