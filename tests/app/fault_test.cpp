// `simulate fault`.

#include "app.hpp"

#include <algorithm>

namespace ricochet::fault_test {
namespace {

const std::string kernels = std::string(RICOCHET_TEST_FIXTURES) + "/fault_kernels/";

TEST_F(App, SimulateFaultOfOneElementByDefault)
{
    const nlohmann::json run = json({"simulate", "fault", "--json"});
    EXPECT_EQ(run["outcome"], "at_rest");
    EXPECT_EQ(run["t"], 30.0);
    EXPECT_NEAR(run["mean_slip"].get<double>(), 0.22799875, 1e-7);
    EXPECT_NEAR(run["peak_velocity"].get<double>(), 0.0684778, 1e-7);
    EXPECT_NEAR(run["peak_time"].get<double>(), 10.43650, 1e-5);
    EXPECT_NEAR(run["arrest_time"].get<double>(), 12.683187, 1e-6);
    EXPECT_FALSE(run.contains("trajectory"));
}

TEST_F(App, SimulateFaultTakesAKernelAndWritesFiles)
{
    const nlohmann::json run = json(
        {"simulate", "fault", "--set", "elements=10", "side=5000", "--t-end", "50", "--kernel",
         kernels + "fault-kernel-10x10-5km.npy", "--json", "--csv", "mean.csv", "--samples", "11"});
    EXPECT_NEAR(run["mean_slip"].get<double>(), 0.825203, 1e-5);
    EXPECT_EQ(run["trajectory"]["t"].size(), 11U);
    EXPECT_EQ(run["trajectory"]["mean_slip"][10], run["mean_slip"]);
    const std::string csv = content(work() / "mean.csv");
    EXPECT_TRUE(csv.starts_with("t [s],mean slip [m],mean velocity [m/s]\n"));
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 12);
}

TEST_F(App, SimulateFaultByImplicitSteps)
{
    const Words words{"simulate",    "fault",    "--set",
                      "elements=10", "--kernel", kernels + "fault-kernel-10x10-3km.npy",
                      "--json"};
    const auto with = [&](const Words& more) {
        Words all = words;
        all.insert(all.end(), more.begin(), more.end());
        return json(all);
    };
    const nlohmann::json published = with({"--integrator", "bathe-published", "--step", "0.5"});
    EXPECT_NEAR(published["mean_slip"].get<double>(), 0.243671, 1e-6);
    const nlohmann::json averaged = with({"--integrator", "bathe", "--step", "0.125"});
    EXPECT_NEAR(averaged["mean_slip"].get<double>(), 0.237107, 2e-6);
    EXPECT_EQ(averaged["controller"], "constant");
    EXPECT_EQ(averaged["statistics"]["solves"], 190);
    for (const char* controller : {"error", "heuristic", "pi", "filter"}) {
        const nlohmann::json run = with({"--integrator", "bathe", "--controller", controller});
        EXPECT_EQ(run["outcome"], "at_rest") << controller;
        // At order 2 and tolerance 1e-3 no controller is off by more than half a percent.
        EXPECT_NEAR(run["mean_slip"].get<double>(), 0.23704, 0.0012) << controller;
    }
    expect_refused({"simulate", "fault", "--integrator", "handover"}, {"handover", "explicit"});
    expect_refused({"simulate", "fault", "--controller", "pi"}, {"--controller"});
    expect_refused(
        {"simulate", "fault", "--integrator", "bathe-published", "--controller", "error"},
        {"averaged"});
}

TEST_F(App, SimulateFaultDrawsMaps)
{
    const Result result = run({"simulate", "fault", "--set", "elements=4", "--plot", "maps.svg"});
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_NE(content(work() / "maps.svg").find("depth [km]"), std::string::npos);
}

TEST_F(App, SimulateFaultRefusesWhatDoesNotFit)
{
    expect_refused({"simulate", "fault", "--set", "elements=0"}, {"elements", "got 0"});
    expect_refused({"simulate", "fault", "--set", "elements=2.5"}, {"whole number", "2.5"});
    expect_refused({"simulate", "fault", "--set", "elements=1e5"}, {"MiB", "limit"});
    expect_refused({"simulate", "fault", "--t-end", "-1"}, {"--t-end"});
    expect_refused({"simulate", "fault", "--detector", "ends"}, {"--detector"});
    expect_refused({"simulate", "fault", "--kernel", "none.npy"}, {"none.npy", "cannot be read"});
    expect_refused({"simulate", "fault", "--kernel", kernels + "fault-kernel-10x10-3km.npy"},
                   {"1 x 1", "100 x 100"});
    expect_refused({"simulate", "pendulum", "--kernel", "k.npy"}, {"--kernel"});
}

TEST_F(App, SimulateFaultWithRateAndStateFriction)
{
    const Words words{"simulate", "fault", "--set", "rate_and_state=1", "elements=3", "b=0.04"};
    Words all = words;
    all.insert(all.end(), {"--t-end", "5e8", "--json", "--csv", "steps.csv", "--samples", "3"});
    const nlohmann::json run = json(all);
    EXPECT_EQ(run["outcome"], "reached_end");
    EXPECT_EQ(run["parameters"]["b"], 0.04);
    EXPECT_FALSE(run["parameters"].contains("friction_drop"));
    EXPECT_EQ(run["statistics"]["unsolved_stages"], 0);
    EXPECT_LE(run["largest_residual"].get<double>(), 1e-11);
    ASSERT_FALSE(run["earthquakes"].empty());
    const auto& event = run["earthquakes"][0];
    EXPECT_GT(event["largest_velocity"].get<double>(), 0.01);
    EXPECT_GT(event["mean_slip"].get<double>(), 0.001);
    EXPECT_LT(event["start"].get<double>(), event["end"].get<double>());
    EXPECT_DOUBLE_EQ(run["trajectory"]["mean_slip"][2].get<double>(),
                     run["mean_slip"].get<double>());
    const std::string csv = content(work() / "steps.csv");
    EXPECT_TRUE(csv.starts_with("t [s],mean slip [m],mean velocity [m/s],fastest [m/s]\n"));
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2 + run["statistics"]["steps"].get<int>());

    all = words;
    all.insert(all.end(), {"--t-end", "1e7", "--plot", "cycle.svg"});
    EXPECT_EQ(this->run(all).status, 0);
    EXPECT_NE(content(work() / "cycle.svg").find("fastest element"), std::string::npos);
}

TEST_F(App, SimulateFaultRefusesFrictionOfTheOtherKind)
{
    const auto refused = [&](const Words& more, const Words& parts) {
        Words all{"simulate", "fault"};
        all.insert(all.end(), more.begin(), more.end());
        expect_refused(all, parts);
    };
    refused({"--set", "a=0.01"}, {"a of fault", "rate_and_state=1"});
    refused({"--set", "rate_and_state=1", "friction_drop=0.2"}, {"friction_drop"});
    refused({"--set", "rate_and_state=1", "d_rs=-1"}, {"d_rs", "got -1"});
    refused({"--set", "rate_and_state=1", "order=3"}, {"order", "got 3"});
    refused({"--set", "rate_and_state=1", "theta=-1"}, {"theta", "got -1"});
    refused({"--set", "rate_and_state=1", "slip_rate=0"}, {"slip_rate", "got 0"});
    refused({"--set", "rate_and_state=1", "--integrator", "bathe"}, {"--integrator"});
    refused({"--set", "rate_and_state=1", "--step", "-1"}, {"--step", "got -1"});
}

}  // namespace
}  // namespace ricochet::fault_test
