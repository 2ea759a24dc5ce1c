// The papers' tables and figures that take seconds.
#include "exhibits.hpp"

namespace ricochet::figures_full_test {
namespace {

TEST_F(Exhibits, FaultsByRulesAreDrawn)
{
    for (const int number : {5, 6, 7, 8, 9, 10}) expect_figure("step-control", number);
}

TEST_F(Exhibits, TrainedPotentialsAreDrawn)
{
    for (const int number : {1, 5, 7, 8}) expect_figure("potentials", number);
}

TEST_F(Exhibits, ErrorsOfFrictionAreBelowThePapers)
{
    expect_table("potentials", 1);
}

TEST_F(Exhibits, ErrorsInsideSlidersAreBelowThePapers)
{
    expect_table("potentials", 2);
}

TEST_F(Exhibits, SlidersFailWhereThePapersDo)
{
    expect_table("potentials", 3);
    expect_table("potentials", 4);
}

}  // namespace
}  // namespace ricochet::figures_full_test
