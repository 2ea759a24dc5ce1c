// The papers' tables and figures that take moments, and the refusals of their commands.
#include <map>
#include <string>

#include "exhibits.hpp"

namespace ricochet::figures_test {
namespace {

TEST_F(Exhibits, ListNamesEveryTableAndFigureOfThePapers)
{
    const nlohmann::json list = json({"list", "--json"});
    std::map<std::string, std::size_t> count;
    for (const auto& each : list) {
        ++count[each["paper"].get<std::string>() + ' ' + each["kind"].get<std::string>()];
        EXPECT_EQ(each["computed"], !each.contains("why")) << each.dump();
    }
    const std::map<std::string, std::size_t> expected{
        {"event-detection figure", 1}, {"event-detection table", 1}, {"step-control figure", 10},
        {"step-control table", 5},     {"potentials figure", 8},     {"potentials table", 4}};
    EXPECT_EQ(count, expected);
    const Result text = run({"list"});
    EXPECT_EQ(text.status, 0);
    EXPECT_EQ(count_of(text.out, "\n"), list.size() + 3);  // and a line for each paper
}

TEST_F(Exhibits, TablesOfParametersAreThePapers)
{
    for (int number = 1; number <= 5; ++number) expect_table("step-control", number);
}

TEST_F(Exhibits, EventTimesAreThePapersToItsTolerance)
{
    expect_table("event-detection", 1);
    const nlohmann::json table = json({"table", "event-detection", "1", "--json"});
    EXPECT_EQ(table["rows"].size(), 13U);
}

TEST_F(Exhibits, FiguresOfMomentsAreDrawn)
{
    expect_figure("event-detection", 1);
    expect_figure("step-control", 2);
    expect_figure("step-control", 3);
    for (const int number : {2, 3, 4, 6}) expect_figure("potentials", number);
}

TEST_F(Exhibits, TextSaysWhetherOursAgree)
{
    const Result result = run({"table", "step-control", "5"});
    EXPECT_EQ(result.status, 0);
    EXPECT_NE(result.out.find("slip distance [mm]: ours 100, paper 100"), std::string::npos)
        << result.out;
    EXPECT_EQ(result.out.find(": NO"), std::string::npos) << result.out;
}

TEST_F(Exhibits, RefusesWhatThereIsNot)
{
    expect_refused({"table", "step", "1"}, {"step", "event-detection", "potentials"});
    expect_refused({"table", "potentials", "5"}, {"5", "potentials", "known are 1, 2, 3, 4"});
    expect_refused({"figure", "step-control", "11", "--json"}, {"11", "known are 1, 2, 3"});
    expect_refused({"figure", "step-control", "two", "--json"}, {"two", "known are"});
    expect_refused({"figure", "step-control", "4", "--json"},
                   {"figure 4", "not computed", "drawing"});
    expect_refused({"figure", "event-detection", "1"}, {"--out"});
    expect_refused({"figure", "event-detection", "1", "--out", "a.txt"}, {".svg or .png", "a.txt"});
    expect_refused({"figure", "event-detection", "1", "--out", "none/a.svg"}, {"none"});
    expect_refused({"compare", "bouncing-ball"}, {"bouncing-ball"});
}

}  // namespace
}  // namespace ricochet::figures_test
