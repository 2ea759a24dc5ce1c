// `ricochet systems` and `simulate`, and properties common to all commands.
#include "app.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>

#include "ricochet/integrate.hpp"

namespace ricochet::app_test {
namespace {

// --- systems ---

TEST_F(App, SystemsListsTheBallWithDefaultsUnitsAndRanges)
{
    const nlohmann::json all = json({"systems", "--json"});
    const auto ball = std::find_if(all.begin(), all.end(),
                                   [](const auto& s) { return s["name"] == "bouncing-ball"; });
    ASSERT_NE(ball, all.end());
    ASSERT_EQ((*ball)["parameters"].size(), 4U);
    EXPECT_EQ((*ball)["parameters"][0]["name"], "gravity");
    EXPECT_EQ((*ball)["parameters"][0]["default"], 9.81);
    EXPECT_EQ((*ball)["parameters"][0]["unit"], "m/s²");
    EXPECT_EQ((*ball)["parameters"][1]["range"]["upper"], 1.0);
    EXPECT_TRUE((*ball)["parameters"][2]["range"]["upper"].is_null());

    const Result text = run({"systems"});
    EXPECT_EQ(text.status, 0);
    EXPECT_NE(text.out.find("restitution"), std::string::npos);
}

// --- simulate ---

TEST_F(App, SimulatePrintsTheKeysOfARun)
{
    const nlohmann::json run = json(simulate({"--json"}));
    for (const char* key : {"system", "outcome", "t", "state", "events", "statistics", "seconds"}) {
        EXPECT_TRUE(run.contains(key)) << key;
    }
    for (const char* key : {"t", "guards", "kind", "state_before", "state_after", "bracket"}) {
        EXPECT_TRUE(run["events"][0].contains(key)) << key;
    }
    for (const char* key :
         {"steps", "rejected", "flow_calls", "guard_calls", "network_calls", "false_alarms",
          "missed_events", "late_events", "checks_deferred", "checks_put_off", "evidence"}) {
        EXPECT_TRUE(run["statistics"].contains(key)) << key;
    }
    for (const char* key : {"proved", "checked", "gated", "assumed"}) {
        EXPECT_TRUE(run["statistics"]["evidence"].contains(key)) << key;
    }
    EXPECT_EQ(run["system"], "bouncing-ball");
    EXPECT_EQ(run["outcome"], "reached_end");
    EXPECT_EQ(run["t"], 20.5);
    EXPECT_EQ(run["events"][0]["guards"], nlohmann::json::array({"floor"}));
    EXPECT_EQ(run["events"][0]["kind"], "crossing");
    EXPECT_EQ(run["events"][0]["bracket"].size(), 2U);
}

// With error control a flight is one step, whose two cancelling halves of 36 m are
// rounded: at most 1.7e-13 s over 13 impacts (derived in integrate_test.cpp).
constexpr double whole_flight_error = 1.7e-13;

TEST_F(App, EveryStepperDetectorAndLocatorFindsThe13Impacts)
{
    // 2e-14 s is ten units in the last place of the last impact, 19.87 s.
    const Words of_ball = detectors({"network", "verified", "line"});
    for (const std::string& detector : of_ball) {
        for (const std::string& stepper : steppers({"rk4"})) {
            SCOPED_TRACE(detector + ' ' + stepper);
            const Words words = simulate(
                {"--json", "--step", "0.01", "--stepper", stepper, "--detector", detector});
            EXPECT_LE(largest_error(json(words)), 2e-14);
        }
    }
    for (const char* locator : {"newton", "bisection", "toms748"}) {
        SCOPED_TRACE(locator);
        EXPECT_LE(largest_error(json(simulate({"--json", "--locator", locator}))),
                  whole_flight_error);
    }
    for (const std::string& stepper : steppers()) {
        for (const std::string& detector : of_ball) {
            SCOPED_TRACE(detector + ' ' + stepper);
            const Words words = simulate({"--json", "--stepper", stepper, "--detector", detector});
            EXPECT_LE(largest_error(json(words)), 2e-13);
        }
    }
}

TEST_F(App, BernsteinProvesTheStepsOfAPolynomialGuard)
{
    const nlohmann::json run =
        json({"simulate", "hidden-pair", "--json", "--detector", "bernstein"});
    EXPECT_EQ(run["detector"], "bernstein");
    ASSERT_EQ(run["events"].size(), 3U);
    EXPECT_EQ(run["statistics"]["evidence"]["checked"], 0);
    EXPECT_EQ(run["statistics"]["evidence"]["assumed"], 0);
    // The degree of the ball's guard is found from its code.
    const nlohmann::json ball = json(simulate({"--json", "--detector", "bernstein"}));
    EXPECT_EQ(ball["events"].size(), 13U);
    EXPECT_EQ(ball["statistics"]["evidence"]["checked"], 0);
    EXPECT_EQ(ball["statistics"]["evidence"]["assumed"], 0);
}

TEST_F(App, EulerMakesTheErrorsOfEuler)
{
    // The first fall is too short by about half a step.
    const nlohmann::json run = json(simulate({"--json", "--stepper", "euler", "--step", "0.001"}));
    const double exact = BouncingBall().impact_time(0, 10);
    EXPECT_GT(std::fabs(run["events"][0]["t"].get<double>() - exact), 1e-5);
    EXPECT_LT(std::fabs(run["events"][0]["t"].get<double>() - exact), 1e-3);
}

TEST_F(App, ParametersReachTheSystem)
{
    const nlohmann::json run = json(simulate({"--json", "--set", "gravity=1.62", "--set",
                                              "restitution=0.5", "height=2", "--t-end", "3"}));
    const double exact = BouncingBall({.gravity = 1.62, .restitution = 0.5}).impact_time(0, 2);
    EXPECT_NEAR(run["events"][0]["t"].get<double>(), exact, 2e-15);
    EXPECT_EQ(run["t"], 3.0);
}

TEST_F(App, NetworkIsAskedEveryStepAndChecksTheGuardLess)
{
    const nlohmann::json ends = json(simulate({"--json", "--step", "0.01", "--detector", "ends"}));
    const nlohmann::json network =
        json(simulate({"--json", "--step", "0.01", "--detector", "network"}));
    EXPECT_EQ(network["statistics"]["network_calls"], network["statistics"]["steps"]);
    EXPECT_LT(network["statistics"]["guard_calls"].get<int>(),
              ends["statistics"]["guard_calls"].get<int>() / 10);
    EXPECT_NE(network["model"].get<std::string>().find("step-0.01"), std::string::npos);
}

TEST_F(App, NetworkAtAnotherStepOrGravityUsesTheModelForAll)
{
    for (const Words& words :
         {Words{"--step", "0.05"}, Words{"--step", "0.01", "--set", "gravity=1.62"}, Words{}}) {
        Words all{"--json", "--detector", "network"};
        all.insert(all.end(), words.begin(), words.end());
        const nlohmann::json run = json(simulate(all));
        EXPECT_TRUE(run["model"].get<std::string>().ends_with("/bouncing-ball.safetensors"));
        EXPECT_EQ(run["outcome"], "reached_end");
    }
}

TEST_F(App, NetworkPutsChecksOffAndVerifiedDoesNot)
{
    const nlohmann::json bare =
        json(simulate({"--json", "--step", "0.01", "--detector", "network"}))["statistics"];
    EXPECT_GT(bare["checks_deferred"], 2000);
    EXPECT_EQ(bare["missed_events"], 0);

    // The floor declares no bound on its rate: every step keeps its check.
    const nlohmann::json verified =
        json(simulate({"--json", "--step", "0.01", "--detector", "verified"}))["statistics"];
    EXPECT_EQ(verified["checks_deferred"], 0);
    EXPECT_EQ(verified["missed_events"], 0);
    EXPECT_EQ(verified["network_calls"], verified["steps"]);
    EXPECT_EQ(verified["evidence"]["assumed"], 0);
}

TEST_F(App, StepLimitEndsTheRunWithStatusOne)
{
    const nlohmann::json run = json(simulate({"--json", "--step", "0.01", "--max-steps", "50"}), 1);
    EXPECT_EQ(run["outcome"], "step_limit");
    EXPECT_EQ(run["statistics"]["steps"], 50);
    EXPECT_NEAR(run["t"].get<double>(), 0.5, 1e-15);
}

TEST_F(App, NumbersRoundTripToTheBit)
{
    const nlohmann::json run = json(simulate({"--json"}));
    const auto expected = integrate(BouncingBall(), {10, 0}, {.t_end = 20.5});
    ASSERT_EQ(run["events"].size(), expected.events.size());
    for (std::size_t i = 0; i < expected.events.size(); ++i) {
        EXPECT_EQ(run["events"][i]["t"].get<double>(), expected.events[i].t);
        EXPECT_EQ(run["events"][i]["bracket"][0].get<double>(), expected.events[i].bracket.lo);
        EXPECT_EQ(run["events"][i]["state_before"][0].get<double>(), expected.events[i].before[0]);
    }
    EXPECT_EQ(run["state"][1].get<double>(), expected.x[1]);
}

TEST_F(App, ASlopeThatWasNotComputedIsNull)
{
    // Neither the detector nor the locator needs the guard's rate.
    const nlohmann::json run =
        json(simulate({"--json", "--detector", "ends", "--locator", "bisection"}));
    EXPECT_TRUE(run["events"][0]["slope"].is_null());
}

TEST_F(App, RunThatEndsEarlyIsPrintedWithStatusOne)
{
    const nlohmann::json run = json(simulate({"--json", "--max-steps", "10"}), 1);
    EXPECT_EQ(run["outcome"], "step_limit");
    EXPECT_LT(run["t"].get<double>(), 20);
    EXPECT_GT(run["events"].size(), 3U);
}

TEST_F(App, ABallComesToRest)
{
    // Impacts of a ball with restitution 1/2 from 10 m: three first flights in all.
    const nlohmann::json run =
        json(simulate({"--json", "--set", "restitution=0.5", "--t-end", "100"}));
    EXPECT_EQ(run["outcome"], "reached_end");
    const nlohmann::json last = run["events"].back();
    EXPECT_EQ(last["kind"], "accumulation");
    EXPECT_NEAR(last["t"].get<double>(), 3 * std::sqrt(20 / 9.81), 1e-13);
}

TEST_F(App, TextNamesTheOutcomeAndCountsTheEvents)
{
    const Result result = run(simulate({}));
    EXPECT_EQ(result.status, 0);
    EXPECT_NE(result.out.find("reached_end at t = 20.5 s"), std::string::npos) << result.out;
    EXPECT_NE(result.out.find("13 events"), std::string::npos);
    EXPECT_EQ(result.err, "");
}

TEST_F(App, CsvHoldsTheSamplesAndBothSidesOfEveryImpact)
{
    ASSERT_EQ(run(simulate({"--csv", "ball.csv", "--samples", "101"})).status, 0);
    EXPECT_EQ(files(), Words{"ball.csv"});
    std::istringstream in(content(work() / "ball.csv"));
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line, "t [s],u [m],v [m/s],event");
    std::size_t lines = 0;
    std::size_t before = 0;
    std::size_t after = 0;
    double previous = -1;
    while (std::getline(in, line)) {
        ++lines;
        before += line.ends_with(",before floor") ? 1 : 0;
        after += line.ends_with(",after floor") ? 1 : 0;
        const double t = std::stod(line);
        EXPECT_GE(t, previous);
        previous = t;
    }
    EXPECT_EQ(lines, 101U + 2 * 13U);
    EXPECT_EQ(before, 13U);
    EXPECT_EQ(after, 13U);
    EXPECT_EQ(previous, 20.5);
}

TEST_F(App, SamplesAreInTheJsonWhenAskedFor)
{
    const nlohmann::json run = json(simulate({"--json", "--samples", "11"}));
    EXPECT_EQ(run["trajectory"]["t"].size(), 11U);
    EXPECT_EQ(run["trajectory"]["state"][0], nlohmann::json::array({10.0, 0.0}));
}

TEST_F(App, TheNetworkIsAGateByNameToo)
{
    const auto run_by = [&](const char* option) {
        nlohmann::json out = json(simulate({option, "network", "--step", "0.01", "--json"}));
        out.erase("seconds");
        return out;
    };
    const nlohmann::json found = run_by("--gate");
    EXPECT_EQ(found, run_by("--detector"));
    EXPECT_EQ(found["detector"], "network");
    expect_refused({"simulate", "thermostat", "--gate", "network"}, {"network", "thermostat"});
}

bool has_gnuplot()
{
    std::istringstream path(std::getenv("PATH") != nullptr ? std::getenv("PATH") : "");
    std::string directory;
    while (std::getline(path, directory, ':')) {
        if (access((directory + "/gnuplot").c_str(), X_OK) == 0) return true;
    }
    return false;
}

TEST_F(App, PlotsAreDrawnAsSvgAndPng)
{
    if (!has_gnuplot()) GTEST_SKIP() << "gnuplot is not installed";
    ASSERT_EQ(run(simulate({"--plot", "ball.svg"})).status, 0);
    ASSERT_EQ(run(simulate({"--plot", "ball.png"})).status, 0);
    EXPECT_EQ(files(), (Words{"ball.png", "ball.svg"}));
    EXPECT_NE(content(work() / "ball.svg").find("</svg>"), std::string::npos);
    EXPECT_TRUE(content(work() / "ball.png").starts_with("\x89PNG"));
}

TEST_F(App, AComponentIsDrawnOverAnother)
{
    expect_refused(simulate({"--phase", "u,v"}), {"--phase", "--plot"});
    for (const char* wrong : {"u", "u,", "u,w", "u,v,u", ","}) {
        expect_refused(simulate({"--plot", "ball.svg", "--phase", wrong}),
                       {"--phase", "u, v", std::string("'") + wrong + "'"});
    }
    expect_refused({"simulate", "fault", "--plot", "fault.svg", "--phase", "slip,velocity"},
                   {"--phase", "fault"});
    if (!has_gnuplot()) GTEST_SKIP() << "gnuplot is not installed";
    ASSERT_EQ(run(simulate({"--plot", "ball.svg", "--phase", "v,u"})).status, 0);
    const std::string drawn = content(work() / "ball.svg");
    EXPECT_NE(drawn.find("velocity v [m/s]"), std::string::npos);
    EXPECT_NE(drawn.find("height u [m]"), std::string::npos);
    EXPECT_EQ(drawn.find("time t [s]"), std::string::npos);
}

TEST_F(App, NameOfAPlotIsNotExecuted)
{
    if (!has_gnuplot()) GTEST_SKIP() << "gnuplot is not installed";
    const std::string name = "a'; touch broken; system(\"touch broken\") $(touch broken) .svg";
    ASSERT_EQ(run(simulate({"--plot", name})).status, 0);
    EXPECT_EQ(files(), Words{name});
}

TEST_F(App, WithoutGnuplotTheRunIsPrintedAndASentenceSaysHowToGetIt)
{
    const Result result =
        run(simulate({"--plot", "ball.svg", "--csv", "ball.csv"}), {"PATH=" + work().string()});
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.out.find("13 events"), std::string::npos);
    EXPECT_NE(result.err.find("apt-get install gnuplot-nox"), std::string::npos) << result.err;
    EXPECT_EQ(files(), Words{"ball.csv"});
}

TEST_F(App, FullDeviceIsReported)
{
    if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
    const Result result = run(simulate({"--csv", "/dev/full"}));
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.err.find("/dev/full"), std::string::npos);
}

// --- bad input ---

TEST_F(App, BadParametersAreRefused)
{
    expect_refused(simulate({"--set", "height=nan"}), {"height", "finite", "nan"});
    expect_refused(simulate({"--set", "gravity=inf"}), {"gravity", "finite", "inf"});
    expect_refused(simulate({"--set", "velocity=1e999"}), {"velocity", "finite", "1e999"});
    expect_refused(simulate({"--set", "gravity=0"}), {"gravity", "(0, inf)", "got 0"});
    expect_refused(simulate({"--set", "restitution=1.2"}), {"restitution", "[0, 1]", "1.2"});
    expect_refused(simulate({"--set", "height=-1"}), {"height", "[0, inf)", "-1"});
    expect_refused(simulate({"--set", "mass=1"}), {"mass", "gravity, restitution"});
    expect_refused(simulate({"--set", "height"}), {"--set", "name=value", "height"});
    expect_refused(simulate({"--set", "=1"}), {"--set", "name=value"});
    expect_refused(simulate({"--set", "height="}), {"height", "number"});
    expect_refused(simulate({"--set", "height=ten"}), {"height", "number", "ten"});
}

TEST_F(App, BadSteppingIsRefused)
{
    expect_refused(simulate({"--step", "0"}), {"--step", "positive", "0"});
    expect_refused(simulate({"--step", "-0.1"}), {"--step", "positive", "-0.1"});
    expect_refused(simulate({"--step", "nan"}), {"--step", "finite", "nan"});
    expect_refused(simulate({"--step", "0.1s"}), {"--step", "number", "0.1s"});
    expect_refused(simulate({"--rtol", "-1"}), {"--rtol", "-1"});
    expect_refused(simulate({"--atol", "inf"}), {"--atol", "finite"});
    expect_refused(simulate({"--rtol", "0", "--atol", "0"}), {"--rtol", "--atol"});
    expect_refused(simulate({"--step", "0.1", "--rtol", "1e-6"}), {"--step", "--rtol"});
    expect_refused(simulate({"--stepper", "rk4"}), {"rk4", "--step"});
    expect_refused(simulate({"--stepper", "euler"}), {"euler", "--step"});
    expect_refused(simulate({"--event-tolerance", "-1"}), {"--event-tolerance", "-1"});
    expect_refused(simulate({"--t-end", "inf"}), {"--t-end", "finite"});
    expect_refused(simulate({"--samples", "1"}), {"--samples", "from 2", "1"});
    expect_refused(simulate({"--samples", "-3"}), {"--samples", "-3"});
    expect_refused(simulate({"--max-steps", "0"}), {"--max-steps", "from 1", "0"});
    expect_refused(simulate({"--max-steps", "1e3"}), {"--max-steps", "1e3"});
}

TEST_F(App, TimeRunsBackwardFromALaterStart)
{
    // The ball at rest above the floor came from it: backward it falls as it does forward, and
    // meets the floor one fall earlier. Rounding of sqrt(2 h / g) and of its addition to
    // 5 s: 2 units in the last place of 5.
    const nlohmann::json run = json(simulate(
        {"--json", "--t-start", "5", "--t-end", "3", "--samples", "21", "--csv", "b.csv"}));
    EXPECT_EQ(run["outcome"], "reached_end");
    EXPECT_EQ(run["t"], 3.0);
    ASSERT_EQ(run["events"].size(), 1U);
    EXPECT_NEAR(run["events"][0]["t"].get<double>(), 5 - std::sqrt(2 * 10 / 9.81), 2e-15);
    const auto times = run["trajectory"]["t"].get<std::vector<double>>();
    ASSERT_EQ(times.size(), 21U);
    EXPECT_EQ(times.front(), 5);
    EXPECT_EQ(times.back(), 3);
    EXPECT_TRUE(std::is_sorted(times.rbegin(), times.rend()));
    // In the file the impact is between the samples around it.
    std::istringstream lines(content(work() / "b.csv"));
    std::string line;
    std::vector<double> column;
    for (std::getline(lines, line); std::getline(lines, line);) column.push_back(std::stod(line));
    EXPECT_EQ(column.size(), 23U);
    EXPECT_TRUE(std::is_sorted(column.rbegin(), column.rend()));
}

TEST_F(App, UnknownNamesAreRefusedWithTheKnownOnes)
{
    expect_refused({"simulate", "trebuchet"}, {"trebuchet", "bouncing-ball"});
    expect_refused({"compare", "trebuchet"}, {"trebuchet", "bouncing-ball"});
    expect_refused({"train", "trebuchet", "--out", "m"}, {"trebuchet", "bouncing-ball"});
    expect_refused({"train", "bouncing-ball", "--out", "m", "--kind", "big"}, {"big", "any-step"});
    expect_refused(simulate({"--stepper", "rk5"}), {"rk5", "dopri5"});
    expect_refused(simulate({"--detector", "oracle"}), {"oracle", "extremum"});
    expect_refused(simulate({"--locator", "map"}), {"map", "newton"});
    expect_refused({"fly"}, {"fly", "simulate"});
    expect_refused({}, {"command", "simulate"});
    expect_refused({"simulate"}, {"SYSTEM"});
    expect_refused({"train", "bouncing-ball"}, {"--out"});
    expect_refused(simulate({"--colour"}), {"--colour"});
}

TEST_F(App, OutputThatCannotBeWrittenIsRefusedBeforeTheRun)
{
    expect_refused(simulate({"--csv", "no/such/ball.csv"}), {"--csv", "no/such"});
    expect_refused(simulate({"--csv", "."}), {"--csv", "."});
    expect_refused(simulate({"--csv", ""}), {"--csv"});
    expect_refused(simulate({"--plot", "no/such/ball.png"}), {"--plot", "no/such"});
    expect_refused(simulate({"--plot", "ball.pdf"}), {"--plot", ".svg or .png", "ball.pdf"});
    expect_refused(simulate({"--csv", "ball.csv", "--plot", "ball"}), {"--plot", ".svg or .png"});
    expect_refused({"compare", "bouncing-ball", "--csv", "no/such.csv"}, {"--csv", "no"});
    expect_refused({"train", "bouncing-ball", "--out", "no/such"}, {"--out", "no"});
}

// --- the rest ---

TEST_F(App, HelpHasAnExampleForEveryCommand)
{
    for (const Words& words :
         {Words{"--help"}, Words{"systems", "--help"}, Words{"simulate", "--help"},
          Words{"train", "--help"}, Words{"inspect", "--help"}, Words{"compare", "--help"}}) {
        const Result result = run(words);
        EXPECT_EQ(result.status, 0);
        EXPECT_NE(result.out.find("Example"), std::string::npos);
    }
    EXPECT_NE(run({"simulate", "--help"}).out.find("scene file"), std::string::npos);
    EXPECT_TRUE(run({"--version"}).out.starts_with("ricochet "));
}

}  // namespace
}  // namespace ricochet::app_test
