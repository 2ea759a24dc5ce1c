// `simulate` and `compare` of differential inclusions.

#include <algorithm>
#include <string>

#include "app.hpp"

namespace ricochet {
namespace {

constexpr double reaching_time = 0.093315472931294579027;

TEST_F(App, SimulateSlidingModeHandsOverByDefault)
{
    const nlohmann::json run = json({"simulate", "sliding-mode", "--json"});
    EXPECT_EQ(run["outcome"], "reached_end");
    EXPECT_EQ(run["integrator"], "handover");
    EXPECT_EQ(run["t"], 0.5);
    EXPECT_EQ(run["state"][0], 0.0);
    ASSERT_EQ(run["events"].size(), 1U);
    EXPECT_EQ(run["events"][0]["kind"], "stick");
    EXPECT_EQ(run["events"][0]["mode_after"], "held");
    // rtol 1e-10 of a quantity of 0.15 that meets zero at a rate of 3.75.
    EXPECT_NEAR(run["events"][0]["t"].get<double>(), reaching_time, 1e-10);
}

TEST_F(App, SimulateDiodeCircuitShowsEveryChangeOfMode)
{
    const nlohmann::json run = json({"simulate", "diode-circuit", "--json", "--samples", "11"});
    EXPECT_EQ(run["outcome"], "reached_end");
    ASSERT_EQ(run["events"].size(), 12U);
    EXPECT_EQ(run["events"][0]["kind"], "mode");
    EXPECT_EQ(run["events"][1]["kind"], "stick");
    EXPECT_EQ(run["events"][2]["kind"], "slip");
    EXPECT_NEAR(run["events"][11]["t"].get<double>(), 7.0099961453836677972, 1e-8);
    EXPECT_EQ(run["mode"], "held");
    EXPECT_EQ(run["state"][0], 0.0);
    EXPECT_EQ(run["trajectory"]["t"].size(), 11U);
    EXPECT_EQ(run["phases"].size(), 1U);
}

TEST_F(App, SimulateTakesEveryIntegratorAndController)
{
    for (const char* integrator : {"handover", "event", "bathe", "time-stepping"}) {
        Words words{"simulate", "diode-circuit", "--json", "--integrator", integrator};
        if (integrator != std::string("event")) words.insert(words.end(), {"--step", "0.001"});
        const nlohmann::json run = json(words);
        EXPECT_EQ(run["outcome"], "reached_end") << integrator;
        EXPECT_EQ(run["integrator"], integrator);
        // Backward Euler damps the circuit so much that it may never slip a last time.
        EXPECT_GE(run["events"].size(), 11U) << integrator;
    }
    for (const char* controller : {"constant", "heuristic", "pi", "filter"}) {
        const nlohmann::json run = json({"simulate", "sliding-mode", "--json", "--integrator",
                                         "bathe", "--controller", controller});
        EXPECT_EQ(run["outcome"], "reached_end") << controller;
        EXPECT_EQ(run["controller"], controller);
        EXPECT_GT(run["set_valued_statistics"]["solves"].get<int>(), 50) << controller;
        ASSERT_GE(run["events"].size(), 1U) << controller;
        // Within a step of at most 0.0125 s.
        EXPECT_NEAR(run["events"][0]["t"].get<double>(), reaching_time, 0.0125) << controller;
    }
}

TEST_F(App, CompareShowsTrueErrorsOfInclusions)
{
    for (const char* system : {"sliding-mode", "diode-circuit"}) {
        const nlohmann::json all = json({"compare", system, "--json"});
        double best_of_steps = 1;
        double best = 1;
        for (const auto& row : all["methods"]) {
            EXPECT_TRUE(row["reached_end"].get<bool>()) << row["method"];
            const double error = row["relative"].get<double>();
            const bool handed = row["method"].get<std::string>().starts_with("hand-over");
            (handed ? best : best_of_steps) = std::min(handed ? best : best_of_steps, error);
        }
        // Ten digits and more by events; steps of order two at best in the thousands.
        EXPECT_LT(best, 1e-10);
        EXPECT_GT(best_of_steps, 1e-6);
        EXPECT_LT(best_of_steps, 1e-2);
        EXPECT_EQ(all["published"].size(), 4U);
    }
    EXPECT_NE(run({"compare", "sliding-mode"}).out.find("hand-over"), std::string::npos);
}

TEST_F(App, RefusesWhatInclusionsHaveNot)
{
    expect_refused({"simulate", "pendulum", "--integrator", "bathe"}, {"bathe", "pendulum"});
    expect_refused({"simulate", "pendulum", "--controller", "pi"}, {"--controller"});
    expect_refused({"simulate", "sliding-mode", "--integrator", "euler"}, {"euler", "handover"});
    expect_refused({"simulate", "sliding-mode", "--integrator", "bathe", "--controller", "best"},
                   {"best", "heuristic"});
    expect_refused({"simulate", "sliding-mode", "--controller", "pi"}, {"--integrator bathe"});
    expect_refused({"simulate", "sliding-mode", "--detector", "ends"}, {"extremum"});
    expect_refused({"simulate", "sliding-mode", "--integrator", "bathe", "--step", "0"},
                   {"--step", "positive"});
    expect_refused({"simulate", "sliding-mode", "--t-end", "-1"}, {"--t-end"});
    expect_refused({"simulate", "diode-circuit", "--set", "resistance=0"}, {"resistance"});
}

}  // namespace
}  // namespace ricochet
