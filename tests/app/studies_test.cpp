// Comparisons of the further program `ricochet-studies`, which the default build leaves out.

#include "app.hpp"

#include <algorithm>
#include <chrono>
#include <string>

namespace ricochet::studies_test {
namespace {

TEST_F(App, CompareFaultShowsTrueErrors)
{
    const nlohmann::json table = json({"compare", "fault", "--set", "elements=4", "--json"});
    double worst_explicit = 0;
    double published = 0;
    for (const auto& row : table["methods"]) {
        const std::string method = row["method"];
        EXPECT_EQ(row["outcome"], "at_rest") << method;
        const double error = row["velocity_error"];
        if (method.starts_with("explicit")) worst_explicit = std::max(worst_explicit, error);
        if (method == "published, constant 0.5 s") published = error;
    }
    // At order 1 and 0.5 s the rupture shifts by half a second of the two or so that it lasts.
    EXPECT_GT(published, 0.1);
    EXPECT_LT(worst_explicit, 0.01);
    expect_refused({"compare", "fault", "--set", "elements=1000"}, {"1000"});
}

TEST_F(App, CompareStepControlShowsEveryRule)
{
    const nlohmann::json table =
        json({"compare", "step-control", "--system", "sliding-mode", "--json"});
    const nlohmann::json& rules = table["cases"][0]["rules"];
    ASSERT_EQ(rules.size(), 9U);
    for (const auto& rule : rules) {
        const std::string name = rule["rule"];
        const bool reached = rule["reached"];
        EXPECT_EQ(reached, rule["error"].get<double>() <= 1e-3) << name;
        // The result of a search may be worse, and is then not reported as equally good.
        EXPECT_TRUE(reached || name == "searched sequence" || name == "TQC, eq. 7") << name;
        if (name != "TQC, eq. 7") continue;
        // Six solves per step: one attempt by doubling.
        EXPECT_EQ(rule["solves"].get<int>(), 6 * rule["steps"].get<int>());
        EXPECT_GT(rule["error"].get<double>(), 0);
    }
}

TEST_F(App, CompareStepControlTakesParametersOfEverySystem)
{
    const auto one = [&](const Words& more) {
        Words all{"compare", "step-control", "--json", "--system"};
        all.insert(all.end(), more.begin(), more.end());
        return json(all)["cases"][0];
    };
    // The relay switches once at the same time, and the disturbance is twice as fast.
    const nlohmann::json mode = one({"sliding-mode", "--set", "frequency=100", "start=0.1"});
    ASSERT_EQ(mode["rules"].size(), 9U);
    for (const auto& rule : mode["rules"]) {
        EXPECT_EQ(rule["reached"].get<bool>(), rule["error"].get<double>() <= 1e-3);
    }
    // A requested value is no default, and the policy's limits are not shown.
    EXPECT_FALSE(mode.contains("beyond"));
    const nlohmann::json circuit = one({"diode-circuit", "--set", "current=0.4"});
    ASSERT_EQ(circuit["rules"].size(), 9U);
    const auto steps = [](const nlohmann::json& of) { return of["rules"][0]["steps"].get<int>(); };
    const nlohmann::json usual = one({"diode-circuit"});
    EXPECT_NE(steps(circuit), steps(usual));
    const Words mode_with{"compare", "step-control", "--system", "sliding-mode", "--set"};
    const auto refused = [&](const std::string& set, const Words& parts) {
        Words all = mode_with;
        all.push_back(set);
        expect_refused(all, parts);
    };
    refused("gain=1", {"gain", "amplitude", "got gain = 1"});
    refused("start=-1", {"start > 0", "-1"});
    refused("elements=3", {"elements"});
    expect_refused({"compare", "step-control", "--set", "frequency=100"}, {"--set", "--system"});
}

TEST_F(App, CompareStepControlShowsWhereAPolicyWasNotTrained)
{
    const nlohmann::json of =
        json({"compare", "step-control", "--system", "sliding-mode", "--json"})["cases"][0];
    ASSERT_EQ(of["beyond"].size(), 2U);
    for (const auto& problem : of["beyond"]) {
        ASSERT_EQ(problem["rules"].size(), 3U) << problem["what"];
        EXPECT_EQ(problem["rules"][0]["rule"], "constant");
        EXPECT_EQ(problem["rules"][1]["rule"], "free estimate");
        EXPECT_EQ(problem["rules"][2]["rule"], "learned");
        EXPECT_GT(problem["rules"][2]["asked"].get<int>(), 0);
        for (const auto& rule : problem["rules"]) {
            EXPECT_LE(rule["error"].get<double>(), 1e-3) << problem["what"] << rule["rule"];
        }
    }
    const std::string advice = of["advice"];
    EXPECT_NE(advice.find("free estimate"), std::string::npos);
    for (const char* model : {"fault-step", "sliding-mode-step", "diode-circuit-step"}) {
        const Result shown = run({"inspect", model});
        EXPECT_NE(shown.out.find("use          trained on"), std::string::npos) << shown.out;
        EXPECT_NE(shown.out.find("Take "), std::string::npos) << shown.out;
    }
}

TEST_F(App, CompareStepControlShowsHowFarItIs)
{
    // Minutes of work, of which the first lines of progress are enough. They begin after two
    // seconds, and there are few of them unless a terminal shows them.
    const Result shown = interrupted({"compare", "step-control", "--system", "fault", "--set",
                                      "elements=7", "friction_drop=0.4", "residual_friction=0.3"},
                                     SIGINT, std::chrono::seconds(5));
    EXPECT_EQ(shown.status, 130) << shown.err;
    EXPECT_NE(shown.err.find("ricochet: fault: "), std::string::npos) << shown.err;
    EXPECT_NE(shown.err.find(" %, "), std::string::npos) << shown.err;
    EXPECT_LT(std::count(shown.err.begin(), shown.err.end(), '\n'), 60) << shown.err;
}

TEST_F(App, ComparesRefuseWhatTheyDoNotTake)
{
    expect_refused({"compare", "fault", "--set", "rate_and_state=1"}, {"rate_and_state"});
    expect_refused({"compare", "rate-and-state", "--set", "a=1"}, {"no parameters to set"});
    expect_refused({"compare", "step-control", "--system", "pendulum"}, {"pendulum", "fault"});
    expect_refused({"compare", "step-control", "--system", "fault", "--set", "elements=80"},
                   {"50", "80"});
}

}  // namespace
}  // namespace ricochet::studies_test
