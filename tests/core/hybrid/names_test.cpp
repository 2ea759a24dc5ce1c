// With all public headers but those of scenes, and `using namespace ricochet`, everyday names
// remain the user's own.

#include <gtest/gtest.h>

#include <array>

#include "public_headers.hpp"  // written by CMake

using namespace ricochet;

// One type for each name, and a use of it, which would be ambiguous if the library had the name.
#define EVERYDAY(name)                                 \
    struct name {                                      \
        double value = 1;                              \
    };                                                 \
    [[maybe_unused]] inline double value_of(name from) \
    {                                                  \
        return from.value;                             \
    }
EVERYDAY(Box)
EVERYDAY(Step)
EVERYDAY(Gate)
EVERYDAY(Stage)
EVERYDAY(Product)
EVERYDAY(Cone)
EVERYDAY(Orthant)
EVERYDAY(Body)
EVERYDAY(Wall)
EVERYDAY(Floor)
EVERYDAY(World)
EVERYDAY(Spring)
EVERYDAY(Mass)
EVERYDAY(Force)
EVERYDAY(Contact)
EVERYDAY(Plant)
EVERYDAY(Tank)
EVERYDAY(Valve)
EVERYDAY(Point)
EVERYDAY(Segment)
EVERYDAY(Mesh)
EVERYDAY(Grid)
EVERYDAY(Tree)
EVERYDAY(Guard)
EVERYDAY(Flow)
EVERYDAY(Clock)
EVERYDAY(Sphere)
EVERYDAY(Line)
EVERYDAY(Table)
EVERYDAY(Cell)
EVERYDAY(Node)
EVERYDAY(Edge)
EVERYDAY(Network)
EVERYDAY(Bounded)
EVERYDAY(Stop)
EVERYDAY(Watch)
EVERYDAY(Finding)
EVERYDAY(Screening)
EVERYDAY(Path)
EVERYDAY(Phase)
EVERYDAY(Interval)
EVERYDAY(Location)
EVERYDAY(Recipe)
EVERYDAY(Spectrum)
EVERYDAY(Metering)

#undef EVERYDAY

// Variables, which the name of a function would hide as well.
constexpr int counts = 1, dimension = 2, features = 3, opposite = 4, triggers = 5, offers = 6;
constexpr int size = 7, state = 8, rate = 9, step = 10;
static_assert(counts + dimension + features + opposite + triggers + offers == 21);
static_assert(size + state + rate + step == 34);

struct Ball {
    using State = std::array<double, 2>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -0.5 * x[1]}; }
};

TEST(Names, EverydayNamesAreTheUsers)
{
    const Ball ball;
    const auto run = integrate(ball, {1, 0}, {.t_end = 0.6});
    EXPECT_EQ(run.events.size(), 1u);
    EXPECT_EQ(value_of(Step{}) + value_of(Box{}) + value_of(Gate{}) + value_of(Stage{}), 4);
}

TEST(Names, AResetEndsTheRunBesideAStopOfTheUser)
{
    struct Line {
        using State = std::array<double, 1>;
        Stop stop{.value = 3};
        static void flow(double, const State&, State& dxdt) { dxdt = {1}; }
        [[nodiscard]] double guard(double, const State& x) const { return stop.value - x[0]; }
        void reset(double, State&) const { throw StopRun("at the stop"); }
    };
    const auto run = integrate(Line{}, {0}, {.t_end = 5});
    EXPECT_DOUBLE_EQ(run.t, value_of(Line{}.stop));
    EXPECT_EQ(run.reason, "at the stop");
}
