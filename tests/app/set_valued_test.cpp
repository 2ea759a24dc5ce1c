// `simulate` and `compare` of differential inclusions.

#include <algorithm>
#include <string>

#include "app.hpp"

namespace ricochet::set_valued_test {
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

TEST_F(App, SystemsWithFrictionAndImpactsTakeTheirIntegrators)
{
    // Sticks at -0.2 m after three turns; backward Euler damps it on the way.
    for (const char* integrator : {"event", "handover", "bathe", "time-stepping"}) {
        const nlohmann::json run =
            json({"simulate", "coulomb-oscillator", "--json", "--integrator", integrator});
        EXPECT_EQ(run["outcome"], "reached_end") << integrator;
        EXPECT_EQ(run["mode"], "stick") << integrator;
        EXPECT_NEAR(run["state"][0].get<double>(), -0.2,
                    integrator == std::string("time-stepping") ? 0.06 : 1e-4)
            << integrator;
    }
    const nlohmann::json belt =
        json({"simulate", "friction-inclusion", "--json", "--set", "law=1", "--set", "position=1"});
    EXPECT_EQ(belt["outcome"], "reached_end");
    EXPECT_GE(belt["events"].size(), 4U);
    const nlohmann::json ball = json({"simulate", "rolling-ball", "--json"});
    ASSERT_EQ(ball["events"].size(), 2U);
    // Faster than the plate by 0.9 m/s: 0.9 / (3.5 0.3 g - 2.5 0.001 g / 0.05).
    EXPECT_NEAR(ball["events"][0]["t"].get<double>(), 0.9 / (9.81 * (1.05 - 0.05)), 1e-12);
    EXPECT_EQ(ball["mode"], "at rest on the plate");
    const nlohmann::json twisting = json({"simulate", "super-twisting", "--json"});
    // At rest to the last bit, or where a step's rounding of 1e-4 of its sums has left it.
    EXPECT_EQ(twisting["state"][0], 0.0);
    EXPECT_NEAR(twisting["state"][1].get<double>(), 0, 1e-19);
    const nlohmann::json incline = json({"simulate", "incline-block", "--json"});
    EXPECT_NEAR(incline["state"][0].get<double>(), 0, 1e-10);
    const nlohmann::json block = json({"simulate", "two-contact-block", "--json"});
    EXPECT_EQ(block["outcome"], "reached_end");
    EXPECT_NEAR(block["state"][3].get<double>(), 0, 1e-10);
    EXPECT_EQ(block["phases"].size(), 2U);
    for (const char* integrator : {"handover", "time-stepping"}) {
        const nlohmann::json toy =
            json({"simulate", "woodpecker", "--json", "--integrator", integrator});
        EXPECT_EQ(toy["outcome"], "reached_end") << integrator;
        // About seven cycles of 0.146 s down the pole.
        EXPECT_LT(toy["state"][0].get<double>(), -0.02) << integrator;
        EXPECT_GT(toy["events"].size(), 20U) << integrator;
    }
}

TEST_F(App, IntegratorsThatDoNotFitAreRefused)
{
    EXPECT_NE(run({"simulate", "woodpecker", "--integrator", "bathe"}).status, 0);
    EXPECT_NE(run({"simulate", "coulomb-oscillator", "--integrator", "handover", "--set",
                   "static-friction=0.5"})
                  .status,
              0);
    EXPECT_NE(run({"simulate", "friction-inclusion", "--set", "law=5"}).status, 0);
    EXPECT_NE(run({"simulate", "rolling-ball", "--stepper", "fehlberg78"}).status, 0);
    EXPECT_NE(run({"simulate", "pendulum", "--integrator", "handover"}).status, 0);
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
    expect_refused({"simulate", "stick-slip", "--integrator", "bathe", "--controller", "learned"},
                   {"--controller learned: found no policy for 'stick-slip'; expected one of "
                    "sliding-mode, diode-circuit, fault"});
    expect_refused({"simulate", "sliding-mode", "--detector", "ends"}, {"extremum"});
    expect_refused({"simulate", "sliding-mode", "--integrator", "bathe", "--step", "0"},
                   {"--step", "positive"});
    expect_refused({"simulate", "sliding-mode", "--t-end", "-1"}, {"--t-end"});
    expect_refused({"simulate", "diode-circuit", "--set", "resistance=0"}, {"resistance"});
}

}  // namespace
}  // namespace ricochet::set_valued_test
