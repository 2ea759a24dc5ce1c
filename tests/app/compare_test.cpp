// `ricochet compare`.
#include "app.hpp"

#include <algorithm>
#include <sstream>
#include <string>

namespace ricochet::compare_test {
namespace {

TEST_F(App, CompareFindsAllImpactsByEveryDetector)
{
    const nlohmann::json table = json({"compare", "bouncing-ball", "--json"});
    ASSERT_EQ(table["reference"].size(), 13U);
    EXPECT_EQ(table["reference_kind"], "closed form");
    Words labels;
    for (const nlohmann::json& method : table["methods"]) {
        labels.push_back(method["label"].get<std::string>() + ' ' +
                         method["stepper"].get<std::string>());
    }
    EXPECT_EQ(labels,
              (Words{"network fixed-step rk4", "network any-step rk4", "line rk4", "verified rk4",
                     "ends rk4", "extremum rk4", "bernstein rk4", "network any-step dopri5",
                     "line dopri5", "verified dopri5", "ends dopri5", "extremum dopri5",
                     "bernstein dopri5", "extremum taylor"}));
    for (const nlohmann::json& method : table["methods"]) {
        SCOPED_TRACE(method["label"].get<std::string>() +
                     (method["step"].is_null() ? "" : " fixed"));
        EXPECT_EQ(method["missed"], 0);
        EXPECT_EQ(method["spurious"], 0);
        EXPECT_EQ(method["times"].size(), 13U);
        // Where error control makes a flight one step, its rounding is larger: see
        // integrate_test.cpp.
        EXPECT_LE(method["largest_error"].get<double>(),
                  method["step"].is_null() ? 1.7e-13 : 2e-14);
        EXPECT_GT(method["seconds"]["median"].get<double>(), 0);
    }
    for (const nlohmann::json& method : table["methods"]) {
        const bool asks_without_gain = method["detector"] == "verified";
        const bool bare = method["detector"] == "network" || method["detector"] == "line";
        EXPECT_EQ(method["checks_deferred"] > 0, bare);
        EXPECT_EQ(method["network_calls"] > 0, bare || asks_without_gain);
        if (!asks_without_gain) continue;
        const auto extremum = std::find_if(
            table["methods"].begin(), table["methods"].end(), [&](const nlohmann::json& other) {
                return other["detector"] == "extremum" && other["stepper"] == method["stepper"];
            });
        ASSERT_NE(extremum, table["methods"].end());
        EXPECT_EQ(method["times"], (*extremum)["times"]);
    }
    // The figures of the source paper, against the closed form.
    EXPECT_NEAR(table["published"][0]["largest_error"].get<double>(), 2.2e-11, 0.1e-11);
    EXPECT_NEAR(table["published"][1]["largest_error"].get<double>(), 1.2e-12, 0.1e-12);
}

TEST_F(App, CompareSaysWhatTheNetworkCostsAndWritesTheTimes)
{
    const Result result = run({"compare", "bouncing-ball", "--csv", "table.csv"});
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_NE(result.out.find("the network costs"), std::string::npos);
    EXPECT_NE(result.out.find("verified deferred 0 checks"), std::string::npos);
    EXPECT_NE(result.out.find("with the same events"), std::string::npos);
    EXPECT_NE(result.out.find("u/(g h²) + v/(g h) <= 1/2"), std::string::npos);
    // The title, then the two tables.
    std::istringstream lines(result.out);
    std::string line;
    std::getline(lines, line);
    for (int i = 0; i < 2 + 16 + 1 + 2 + 13 && std::getline(lines, line); ++i) {
        EXPECT_LE(line.size(), 120U) << line;
    }
    EXPECT_NE(result.out.find("19.870248050848"), std::string::npos);
    const std::string csv = content(work() / "table.csv");
    EXPECT_TRUE(csv.starts_with("event,closed form [s],"));
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 14);
}

TEST_F(App, CompareTakesParameters)
{
    const nlohmann::json table = json({"compare", "bouncing-ball", "--json", "--set", "height=12"});
    EXPECT_NEAR(table["reference"][0].get<double>(), std::sqrt(2 * 12 / 9.81), 1e-15);
    EXPECT_TRUE(table["published"].empty());  // of the defaults
    for (const nlohmann::json& method : table["methods"]) {
        EXPECT_NE(method["label"], "network fixed-step");  // so is this network
    }
    const nlohmann::json thermostat = json({"compare", "thermostat", "--json", "--set", "low=19"});
    // From 20 to 19 degrees at 0.1 per second, towards 0.
    EXPECT_NEAR(thermostat["reference"][0].get<double>(), 10 * std::log(20.0 / 19.0), 1e-14);
}

TEST_F(App, CompareSaysWhatItsReferenceIs)
{
    const Result result = run({"compare", "henon-heiles", "--json", "--csv", "hh.csv"});
    ASSERT_TRUE(result.err.empty()) << result.err;
    const nlohmann::json table = nlohmann::json::parse(result.out);
    EXPECT_EQ(table["reference_kind"], "numerical");
    EXPECT_TRUE(content(work() / "hh.csv").starts_with("event,reference [s],"));
}

TEST_F(App, CompareRefusesParametersOfWhichNothingIsKnown)
{
    expect_refused({"compare", "three-body", "--set", "vx=0.1"}, {"three-body", "default"});
    expect_refused({"compare", "pendulum", "--set", "rate=1"}, {"pendulum", "rate = 0"});
    expect_refused({"compare", "coulomb-oscillator", "--set", "friction=0"}, {"friction > 0"});
    expect_refused({"compare", "thermostat", "--set", "tempo=1"}, {"tempo", "low"});
}

}  // namespace
}  // namespace ricochet::compare_test
