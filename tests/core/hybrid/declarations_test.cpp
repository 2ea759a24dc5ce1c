// Every wrong declaration of a system is distinguished from the right one. `check_declarations`
// refuses those that are neither `absent` nor `fits` here.

#include "ricochet/detail/declarations.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "ricochet/bounds.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::declarations_test {
namespace {

using detail::Declaration;
using X = std::array<double, 2>;

enum Phase : Mode { off, on };

/// A falling point: only a flow.
struct Falling {
    using State = X;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
};

struct FallingOntoFloor : Falling {
    static constexpr bool resets = false;
    double guard(double, const X& x) const { return x[0]; }
};

struct TwoFloors : Falling {
    static constexpr bool resets = false;
    static constexpr std::size_t guard_count = 2;
    double guard(std::size_t which, double, const X& x) const { return x[which]; }
};

/// Two floors, and modes.
struct TwoPhases : TwoFloors {
    static constexpr std::size_t mode_count = 2;
};

// --- correct declarations are accepted ---

struct RightInEveryWord : Falling {
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;
    template <class V>
    double guard(std::size_t which, Mode, double, const V& x) const
    {
        return x[which];
    }
    template <class V, class D>
    auto guard_rate(std::size_t which, Mode, double, const V&, const D& dxdt) const
    {
        return dxdt[which];
    }
    Phase reset(std::size_t, Mode, double, X& x) const
    {
        x[1] = -x[1];
        return on;
    }
    Mode rest(std::size_t, Mode mode, double, X&) const { return mode; }
    GuardInfo guard_info(std::size_t) const { return {}; }
    bool enabled(std::size_t, Mode) const { return true; }
    bool enabled(std::size_t, double, const X&) const { return true; }
    double next_time_event(double t) const { return t + 1; }
    double previous_time_event(double t) const { return t - 1; }
    Mode time_reset(Mode mode, double, X&) const { return mode; }
};

TEST(Declarations, EveryRightFormFits)
{
    using S = RightInEveryWord;
    EXPECT_EQ((detail::flow_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::guard_count_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::mode_count_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::guard_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::guard_rate_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::guard_info_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::reset_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::rest_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::enabled_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::next_time_event_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::previous_time_event_declaration<S, X>()), Declaration::fits);
    EXPECT_EQ((detail::time_reset_declaration<S, X>()), Declaration::fits);
}

TEST(Declarations, WhatIsNotThereIsAbsent)
{
    using S = Falling;
    EXPECT_EQ((detail::guard_count_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::mode_count_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::crossing_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::unilateral_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::guard_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::guards_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::guard_rate_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::guard_rates_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::guard_info_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::reset_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::rest_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::enabled_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::next_time_event_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::previous_time_event_declaration<S, X>()), Declaration::absent);
    EXPECT_EQ((detail::time_reset_declaration<S, X>()), Declaration::absent);
}

/// A wrapper that has the members of the wrapped system.
template <bool has>
struct Wrapper : Falling {
    double guard(double, const X& x) const requires has { return x[0]; }
    void reset(double, X&) const requires has {}
};

struct PrivateParts : Falling {
private:
    [[maybe_unused]] double guard(int) const { return 0; }
};

struct Final final : Falling {
    double guard(double, const X& x) { return x[0]; }
};

struct Spring : FallingOntoFloor {
    double rest = 0.3;  // [m] length
};

struct EnabledOfNothing : Falling {
    bool enabled(std::size_t, Mode) const { return true; }
};

/// `crossing` has another meaning here.
struct Junction : FallingOntoFloor {
    double crossing(double width) const { return width; }
};

struct Callable : Falling {
    std::function<double(double, const X&)> guard;
};

TEST(Declarations, MembersOfAnotherPurposeAreLeftAlone)
{
    EXPECT_EQ((detail::guard_declaration<Wrapper<false>, X>()), Declaration::absent);
    EXPECT_EQ((detail::reset_declaration<Wrapper<false>, X>()), Declaration::absent);
    EXPECT_EQ((detail::guard_declaration<Wrapper<true>, X>()), Declaration::fits);
    EXPECT_EQ((detail::guard_declaration<PrivateParts, X>()), Declaration::absent);
    EXPECT_EQ((detail::rest_declaration<Spring, X>()), Declaration::absent);
    EXPECT_EQ((detail::crossing_declaration<Junction, X>()), Declaration::absent);
    EXPECT_EQ((detail::enabled_declaration<EnabledOfNothing, X>()), Declaration::absent);
    EXPECT_EQ((detail::guard_declaration<Callable, X>()), Declaration::fits);
    EXPECT_EQ((detail::guard_declaration<Final, X>()), Declaration::not_const);
}

// --- flow ---

struct FlowOfOdeint {
    void flow(const X& x, X& dxdt, double) const { dxdt = x; }
};
struct FlowNotConst {
    template <class V>
    void flow(double, const V& x, V& dxdt)
    {
        dxdt = x;
    }
};
struct FlowIntoCopy {
    void flow(double, const X&, X) const {}
};
struct FlowOfPhase {
    void flow(Phase, double, const X& x, X& dxdt) const { dxdt = x; }
};
struct FlowReturned {
    X flow(double, const X& x) const { return x; }
};

TEST(Declarations, AFlowThatDoesNotFitIsKnown)
{
    EXPECT_EQ((detail::flow_declaration<FlowOfOdeint, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::flow_declaration<FlowNotConst, X>()), Declaration::not_const);
    EXPECT_EQ((detail::flow_declaration<FlowIntoCopy, X>()), Declaration::by_value);
    EXPECT_EQ((detail::flow_declaration<FlowOfPhase, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::flow_declaration<FlowReturned, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::flow_declaration<X, X>()), Declaration::absent);
}

// --- guards ---

struct GuardNotConst : Falling {
    template <class V>
    double guard(double, const V& x)
    {
        return x[0];
    }
};
struct GuardOfPhase : Falling {
    template <class V>
    double guard(Phase, double, const V& x) const
    {
        return x[0];
    }
};
struct GuardOfWhichAlone : Falling {
    double guard(std::size_t which, double, const X& x) const { return x[which]; }
};
struct GuardOfModeAmongTwo : Falling {
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;
    double guard(Mode, double, const X& x) const { return x[0]; }
};
struct RateOfModeAmongTwo : TwoPhases {
    double guard_rate(Mode, double, const X&, const X& dxdt) const { return dxdt[0]; }
};
struct RateWithoutWhich : TwoFloors {
    template <class V, class D>
    double guard_rate(double, const V&, const D& dxdt) const
    {
        return dxdt[0];
    }
};
struct GuardsWithoutCount : Falling {
    void guards(double, const X& x, std::span<double> g) const { g[0] = x[0]; }
};
struct RatesWithoutCount : FallingOntoFloor {
    void guard_rates(double, const X&, const X& dxdt, std::span<double> g) const { g[0] = dxdt[0]; }
};

TEST(Declarations, AGuardThatDoesNotFitIsKnown)
{
    EXPECT_EQ((detail::guard_declaration<GuardNotConst, X>()), Declaration::not_const);
    EXPECT_EQ((detail::guard_declaration<GuardOfPhase, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::guard_declaration<GuardOfWhichAlone, X>()),
              Declaration::which_without_count);
    EXPECT_EQ((detail::guard_declaration<GuardOfModeAmongTwo, X>()), Declaration::mode_for_which);
    EXPECT_EQ((detail::guard_rate_declaration<RateOfModeAmongTwo, X>()),
              Declaration::mode_for_which);
    EXPECT_EQ((detail::guard_rate_declaration<RateWithoutWhich, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::guards_declaration<GuardsWithoutCount, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::guard_rates_declaration<RatesWithoutCount, X>()), Declaration::does_not_fit);
}

// --- resets and rest ---

struct ResetOfWholeWhereCounted : TwoFloors {
    template <class V>
    void reset(double, V& x) const
    {
        x[1] = -x[1];
    }
};
struct ResetWithoutMode : FallingOntoFloor {
    template <class V>
    void reset(Mode, double, V& x) const
    {
        x[1] = -x[1];
    }
};
struct ResetOfModeAmongTwo : TwoPhases {
    template <class V>
    void reset(Mode, double, V& x) const
    {
        x[1] = -x[1];
    }
};
struct ResetOfPhase : FallingOntoFloor {
    template <class V>
    Mode reset(Phase, double, V& x) const
    {
        x[1] = -x[1];
        return on;
    }
};
struct ResetToScopedEnum : FallingOntoFloor {
    enum class Next { off };
    template <class V>
    Next reset(Mode, double, V&) const
    {
        return Next::off;
    }
};
struct ResetOfCopy : FallingOntoFloor {
    void reset(double, X) const {}
};
struct ModedResetOfCopy : TwoFloors {
    Mode reset(std::size_t, Mode mode, double, const X&) const { return mode; }
};
struct ResetOfNothing : Falling {
    template <class V>
    void reset(double, V&) const
    {
    }
};
struct RestWithoutWhich : TwoFloors {
    template <class V>
    void rest(double, V& x) const
    {
        x[1] = 0;
    }
};
struct RestWithoutMode : FallingOntoFloor {
    template <class V>
    void rest(Mode, double, V& x) const
    {
        x[1] = 0;
    }
};
struct RestWithoutReset : FallingOntoFloor {
    template <class V>
    void rest(double, V& x) const
    {
        x[1] = 0;
    }
};
struct RestOfCopy : FallingOntoFloor {
    void rest(double, X) const {}
};

TEST(Declarations, AResetThatDoesNotFitIsKnown)
{
    EXPECT_EQ((detail::reset_declaration<ResetOfWholeWhereCounted, X>()),
              Declaration::does_not_fit);
    EXPECT_EQ((detail::reset_declaration<ResetWithoutMode, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::reset_declaration<ResetOfModeAmongTwo, X>()), Declaration::mode_for_which);
    EXPECT_EQ((detail::reset_declaration<ResetOfPhase, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::reset_declaration<ResetToScopedEnum, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::reset_declaration<ResetOfCopy, X>()), Declaration::by_value);
    EXPECT_EQ((detail::reset_declaration<ModedResetOfCopy, X>()), Declaration::by_value);
    EXPECT_EQ((detail::reset_declaration<ResetOfNothing, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::rest_declaration<RestWithoutWhich, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::rest_declaration<RestWithoutMode, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::rest_declaration<RestWithoutReset, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::rest_declaration<RestOfCopy, X>()), Declaration::by_value);
}

// --- declarations of guards ---

struct InfoNotConst : TwoFloors {
    GuardInfo guard_info(std::size_t) { return {}; }
};
struct InfoWithoutWhich : TwoFloors {
    GuardInfo guard_info() const { return {}; }
};
struct InfoOfName : FallingOntoFloor {
    GuardInfo guard_info(const char*) const { return {}; }
};
struct EnabledWithoutWhich : TwoFloors {
    bool enabled(double, const X&) const { return true; }
};
struct EnabledOfPhase : TwoFloors {
    bool enabled(std::size_t, Phase) const { return true; }
};
struct EnabledOfModeAmongTwo : TwoPhases {
    bool enabled(Mode, double, const X&) const { return true; }
};
struct EnabledValue : FallingOntoFloor {
    bool enabled = false;
};
struct CrossingOfNumber : FallingOntoFloor {
    static constexpr int crossing = 1;
};
struct UnilateralFunction : FallingOntoFloor {
    bool unilateral() const { return true; }
};
struct CountNotConst : Falling {
    std::size_t guard_count() { return 2; }
};
struct CountOfModesNotConst : Falling {
    std::size_t mode_count() { return 2; }
};

TEST(Declarations, WhatIsSaidOfGuardsMustFit)
{
    EXPECT_EQ((detail::guard_info_declaration<InfoNotConst, X>()), Declaration::not_const);
    EXPECT_EQ((detail::guard_info_declaration<InfoWithoutWhich, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::guard_info_declaration<InfoOfName, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::enabled_declaration<EnabledWithoutWhich, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::enabled_declaration<EnabledOfPhase, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::enabled_declaration<EnabledOfModeAmongTwo, X>()),
              Declaration::mode_for_which);
    EXPECT_EQ((detail::enabled_declaration<EnabledValue, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::crossing_declaration<CrossingOfNumber, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::unilateral_declaration<UnilateralFunction, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::guard_count_declaration<CountNotConst, X>()), Declaration::not_const);
    EXPECT_EQ((detail::mode_count_declaration<CountOfModesNotConst, X>()), Declaration::not_const);
}

// --- times ---

struct NextNotConst : Falling {
    double next_time_event(double t) { return t + 1; }
};
struct EverySecond : Falling {
    double next_time_event(double t) const { return t + 1; }
};
struct TimeResetWithoutTime : EverySecond {
    void time_reset(X&) const {}
};
struct TimeResetWithoutMode : EverySecond {
    template <class V>
    void time_reset(Mode, double, V&) const
    {
    }
};
struct TimeResetOfCopy : EverySecond {
    void time_reset(double, X) const {}
};
struct TimeResetOfNothing : Falling {
    void time_reset(double, X&) const {}
};
struct PreviousWithoutTime : EverySecond {
    double previous_time_event() const { return 0; }
};

TEST(Declarations, TimeEventsMustFit)
{
    EXPECT_EQ((detail::next_time_event_declaration<NextNotConst, X>()), Declaration::not_const);
    EXPECT_EQ((detail::time_reset_declaration<TimeResetWithoutTime, X>()),
              Declaration::does_not_fit);
    EXPECT_EQ((detail::time_reset_declaration<TimeResetWithoutMode, X>()),
              Declaration::does_not_fit);
    EXPECT_EQ((detail::time_reset_declaration<TimeResetOfCopy, X>()), Declaration::by_value);
    EXPECT_EQ((detail::time_reset_declaration<TimeResetOfNothing, X>()), Declaration::does_not_fit);
    EXPECT_EQ((detail::previous_time_event_declaration<PreviousWithoutTime, X>()),
              Declaration::does_not_fit);
}

// --- guard_info of a single guard ---

struct NamedFloor : FallingOntoFloor {
    GuardInfo guard_info() const { return {.name = "floor", .crossing = Crossing::rising}; }
};

TEST(Declarations, ASingleGuardMayHaveInfo)
{
    EXPECT_EQ((detail::guard_info_declaration<NamedFloor, X>()), Declaration::fits);
    EXPECT_EQ(guard_info_of<X>(NamedFloor{}, 0).name, "floor");
    // Thrown up from below at 2 m/s under 1 m/s²: through 0 on the way up after 2 - sqrt 2 s.
    const auto run = integrate(NamedFloor{}, X{-1, 2}, {.t_end = 10});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 2 - std::sqrt(2.0), 1e-14);
}

// --- what the compiler cannot see ---

/// Time events at 1 and 2, and then one that is not ahead.
struct StandsStill : Falling {
    double first = 1;
    double last = 2;
    double next_time_event(double t) const { return t < 1 ? first : t < 2 ? 2 : last; }
    double previous_time_event(double) const { return first; }
};

std::string thrown_by(const auto& system, const X& x0, const Options& options)
{
    try {
        (void)integrate(system, x0, options);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "nothing";
}

TEST(Declarations, TheFirstTimeEventMustBeAhead)
{
    for (const double wrong : {0.0, -1.0, std::nan("")}) {
        EXPECT_NE(thrown_by(StandsStill{{}, wrong}, {0, 0}, {.t_end = 5})
                      .find("next_time_event(t) must return a time after t"),
                  std::string::npos)
            << wrong;
    }
    EXPECT_NE(thrown_by(StandsStill{{}, 1.0}, {0, 0}, {.t_start = 1, .t_end = 0})
                  .find("previous_time_event(t) must return a time before t"),
              std::string::npos);
}

TEST(Declarations, ALaterTimeEventThatIsNotAheadEndsTheRun)
{
    for (const double wrong : {2.0, 1.0, std::nan("")}) {
        const auto run = integrate(StandsStill{{}, 1, wrong}, X{0, 0}, {.t_end = 5});
        EXPECT_EQ(run.outcome, Outcome::time_event_not_ahead) << wrong;
        EXPECT_EQ(run.t, 2);
        EXPECT_EQ(run.events.size(), 2u);
    }
    const double never = std::numeric_limits<double>::infinity();
    const auto run = integrate(StandsStill{{}, 1, never}, X{0, 0}, {.t_end = 5});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 2u);
}

struct Trapdoor : FallingOntoFloor {
    GuardInfo info;
    GuardInfo guard_info() const { return info; }
    void reset(double, X& x) const { x[1] = -x[1]; }
};

TEST(Declarations, ExceptionsCallAGuardByItsName)
{
    const Trapdoor bounding{{}, {.name = "trapdoor", .unilateral = true}};
    EXPECT_NE(thrown_by(bounding, {-1, 0}, {.t_end = 1}).find("guard 0 (trapdoor), which bounds"),
              std::string::npos);
    EXPECT_NE(thrown_by(Trapdoor{{}, {.name = "trapdoor", .resets = false, .unilateral = true}},
                        {1, 0}, {.t_end = 1})
                  .find("guard 0 (trapdoor) is unilateral and needs a reset"),
              std::string::npos);
    EXPECT_NE(
        thrown_by(
            Trapdoor{{}, {.name = "trapdoor", .crossing = Crossing::either, .unilateral = true}},
            {1, 0}, {.t_end = 1})
            .find("guard 0 (trapdoor) is unilateral, so its crossing must be falling"),
        std::string::npos);
    EXPECT_NE(thrown_by(Trapdoor{{}, {.unilateral = true}}, {-1, 0}, {.t_end = 1})
                  .find("behind guard 0, which bounds"),
              std::string::npos);
    for (const double touch : {-1e-9, std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity()}) {
        EXPECT_NE(
            thrown_by(Trapdoor{{}, {.name = "trapdoor", .touch = touch}}, {1, 0}, {.t_end = 1})
                .find("guard 0 (trapdoor) needs a touch that is finite and not negative, got"),
            std::string::npos);
    }
}

}  // namespace
}  // namespace ricochet::declarations_test
