// The table of what a guard does where it is armed: that every row decides something, and what a
// run makes of each. Rates are powers of two, so that steps are exact.

#include "core/guard_life.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

#include "ricochet/ricochet.hpp"

namespace ricochet {
namespace {

namespace life = detail::life;
using life::Cause;

TEST(GuardLife, EveryRowDecidesSomething)
{
    std::array<unsigned, life::rows.size()> decided{};
    for (std::size_t cause = 0; cause < life::causes; ++cause) {
        for (unsigned known = 0; known < life::facts; ++known) {
            ++decided[life::row_of(static_cast<Cause>(cause), known)];
        }
    }
    for (std::size_t row = 0; row < decided.size(); ++row) {
        EXPECT_GT(decided[row], 0u) << life::rows[row].promise;
    }
}

TEST(GuardLife, NoRowNeedsWhatItForbids)
{
    for (const auto& row : life::rows) {
        EXPECT_EQ(row.needs & row.forbids, 0u) << row.promise;
        EXPECT_NE(row.causes, 0u) << row.promise;
    }
}

TEST(GuardLife, APlateauAwaitsTheDepartureThatCounts)
{
    using life::awaited_side;
    const GuardInfo falling, rising{.crossing = Crossing::rising}, floor{.unilateral = true};
    EXPECT_EQ(awaited_side(Cause::stood, floor, Side::below), Side::above);
    EXPECT_EQ(awaited_side(Cause::fired, falling, Side::above), Side::plateau);
    EXPECT_EQ(awaited_side(Cause::stood, falling, Side::below), Side::below);
    EXPECT_EQ(awaited_side(Cause::enabled, falling, Side::below), Side::above);
    EXPECT_EQ(awaited_side(Cause::enabled, rising, Side::above), Side::below);
}

/// Two components that move at constant rates in each of three modes, and guards on them.
struct Lines {
    using State = std::array<double, 2>;
    struct Line {
        std::size_t component = 0;
        double level = 0;  ///< the guard is x[component] - level
        GuardInfo info{};
        std::function<Mode(Mode, State&)> reset{};
        unsigned modes = 7;  ///< bit m: enabled in mode m
    };

    std::array<State, 3> rates{};
    std::vector<Line> lines{};

    [[nodiscard]] std::size_t mode_count() const { return 3; }
    [[nodiscard]] std::size_t guard_count() const { return lines.size(); }
    void flow(Mode mode, double, const State&, State& dxdt) const { dxdt = rates[mode]; }
    [[nodiscard]] double guard(std::size_t i, Mode, double, const State& x) const
    {
        return x[lines[i].component] - lines[i].level;
    }
    Mode reset(std::size_t i, Mode mode, double, State& x) const
    {
        return lines[i].reset ? lines[i].reset(mode, x) : mode;
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const
    {
        return (lines[i].modes >> mode & 1) != 0;
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return lines[i].info; }
};

Mode end_in_2(Mode, Lines::State&)
{
    return 2;
}

auto run_of(const Lines& lines, const Lines::State& x0)
{
    return integrate(lines, x0, {.t_end = 2});
}

/// Guards of the events, and the times at which they were, of which the location may be a few units
/// in the last place off: they are rounded to a millionth.
template <class R>
std::vector<std::pair<std::size_t, double>> events_of(const R& run)
{
    std::vector<std::pair<std::size_t, double>> events;
    for (const auto& event : run.events) {
        events.emplace_back(event.guard, std::round(event.t * 0x1p20) * 0x1p-20);
        EXPECT_NEAR(event.t, events.back().second, 1e-15);
    }
    return events;
}
using Events = std::vector<std::pair<std::size_t, double>>;

TEST(GuardLife, AFlowThatASetHasChangedFiresAGuardThatItPressesOn)
{
    const auto to_1 = [](Mode, Lines::State&) -> Mode { return 1; };
    const Lines lines{
        .rates = {{{1, 1}, {1, -1}, {0, 0}}},
        .lines = {{0, 0.5, {.crossing = Crossing::rising}, to_1}, {1, 0, {}, end_in_2}}};
    EXPECT_EQ(events_of(run_of(lines, {0, -0.5})), (Events{{0, 0.5}, {1, 0.5}}));
}

TEST(GuardLife, BeyondItsSurfaceItFiresOnlyWhereItIsAskedTo)
{
    for (const bool asked : {false, true}) {
        const Lines lines{.rates = {{{-1, 0}}}, .lines = {{0, 0, {.at_start = asked}, end_in_2}}};
        EXPECT_EQ(events_of(run_of(lines, {-1, 0})), asked ? Events({{0, 0.0}}) : Events{});
    }
}

TEST(GuardLife, AModeAsksItToFireAtItsEntry)
{
    for (const bool asked : {false, true}) {
        const auto to_1 = [](Mode, Lines::State&) -> Mode { return 1; };
        const Lines lines{.rates = {{{1, 0}, {1, 0}}},
                          .lines = {{0, 0.5, {.crossing = Crossing::rising}, to_1},
                                    {1, 0, {.at_entry = asked}, end_in_2, 2}}};
        EXPECT_EQ(events_of(run_of(lines, {0, -1})),
                  asked ? Events({{0, 0.5}, {1, 0.5}}) : Events({{0, 0.5}}));
    }
}

TEST(GuardLife, NothingLeavesTheMotionBehindASurfaceThatBoundsIt)
{
    const auto behind = [](Mode mode, Lines::State& x) {
        x[0] = -1;
        return mode;
    };
    const Lines lines{.rates = {{{-1, 0}}}, .lines = {{0, 0, {.unilateral = true}, behind}}};
    EXPECT_EQ(run_of(lines, {0.5, 0}).outcome, Outcome::outside_mode);
    EXPECT_THROW(static_cast<void>(run_of(lines, {-1, 0})), std::invalid_argument);
}

TEST(GuardLife, AMotionThatPressesOnASurfaceThatBoundsItFiresAgain)
{
    const Lines lines{.rates = {{{-1, 0}}}, .lines = {{0, 0, {.unilateral = true}, {}}}};
    const auto run = run_of(lines, {0, 0});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.t, 0);
}

TEST(GuardLife, AResetThatCarriesAGuardAcrossFiresItInItsDirectionOnly)
{
    const auto down = [](Mode mode, Lines::State& x) {
        x[1] = -1;
        return mode;
    };
    for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
        const Lines lines{.rates = {{{1, 0}}},
                          .lines = {{0, 0.5, {.crossing = Crossing::rising}, down},
                                    {1, 0, {.crossing = crossing}, end_in_2}}};
        EXPECT_EQ(events_of(run_of(lines, {0, 1})),
                  crossing == Crossing::rising ? Events({{0, 0.5}}) : Events({{0, 0.5}, {1, 0.5}}));
    }
}

TEST(GuardLife, CarriedBackByTheResetOfAnotherItFiresAgain)
{
    const auto back = [](Mode mode, Lines::State& x) {
        x[0] = 0;
        return mode;
    };
    const GuardInfo counter{.crossing = Crossing::either, .resets = false, .stop_after = 3};
    const Lines lines{
        .rates = {{{1, 0}}},
        .lines = {{0, 0.5, {.crossing = Crossing::rising}, back}, {0, 0.5, counter, {}}}};
    EXPECT_EQ(events_of(run_of(lines, {0, 0})),
              (Events{{0, 0.5}, {1, 0.5}, {1, 0.5}, {0, 1}, {1, 1}}));
}

TEST(GuardLife, AModeThatBeginsOnItsSurfaceWhileItCrossesFiresIt)
{
    for (const double rate : {-1.0, 1.0}) {
        const auto to_1 = [](Mode, Lines::State& x) -> Mode {
            x[1] = 0;
            return 1;
        };
        const Lines lines{
            .rates = {{{1, 0}, {1, rate}}},
            .lines = {{0, 0.5, {.crossing = Crossing::rising}, to_1}, {1, 0, {}, end_in_2, 2}}};
        EXPECT_EQ(events_of(run_of(lines, {0, 1})),
                  rate < 0 ? Events({{0, 0.5}, {1, 0.5}}) : Events({{0, 0.5}}));
    }
}

TEST(GuardLife, ARecordedOneHasTheEventsOfOneThatActs)
{
    const auto events = [](Lines lines, const Lines::State& x0, GuardInfo info) {
        info.resets = false;
        std::array<Events, 2> found;
        for (const std::uint32_t stop_after : {0U, 100U}) {
            info.stop_after = stop_after;
            lines.lines.back().info = info;
            found[stop_after > 0] = events_of(run_of(lines, x0));
            std::sort(found[stop_after > 0].begin(), found[stop_after > 0].end());
        }
        EXPECT_EQ(found[0], found[1]);
        return std::count_if(found[0].begin(), found[0].end(), [&](const auto& event) {
            return event.first + 1 == lines.lines.size();
        });
    };
    const auto to_1 = [](Mode, Lines::State&) -> Mode { return 1; };
    const Lines::Line clock{0, 0.5, {.crossing = Crossing::rising}, to_1};
    // Its mode begins on its surface, while it crosses.
    EXPECT_EQ(events({{{{1, -1}, {1, -1}}}, {clock, {1, 0, {}, {}, 2}}}, {0, 0.5}, {}), 1);
    // Its mode begins while it stands there, and is carried across later.
    const auto down = [](Mode mode, Lines::State& x) {
        x[1] = -1;
        return mode;
    };
    const Lines::Line later{0, 1, {.crossing = Crossing::rising}, down};
    EXPECT_EQ(events({{{{1, 0}, {1, 0}}}, {clock, later, {1, 0, {}, {}, 2}}}, {0, 0}, {}), 1);
    // Another guard turns the motion back on the surface.
    const Lines::Line floor{1, 0, {}, to_1};
    for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
        EXPECT_EQ(events({{{{1, -1}, {1, 1}}}, {floor, {1, 0}}}, {0, 0.5}, {.crossing = crossing}),
                  1);
    }
}

}  // namespace
}  // namespace ricochet
