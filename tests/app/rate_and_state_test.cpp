// The spring-slider and the published study on the command line.
#include <string>

#include "app.hpp"

namespace ricochet::rate_and_state_test {
namespace {

TEST_F(App, SimulateSpringSliderShowsStickSlip)
{
    const nlohmann::json run =
        json({"simulate", "spring-slider", "--t-end", "0.5", "--samples", "51", "--json"});
    EXPECT_EQ(run["outcome"], "reached_end");
    EXPECT_EQ(run["t"], 0.5);
    ASSERT_GE(run["events"].size(), 4U);
    for (std::size_t i = 0; i < run["events"].size(); ++i) {
        EXPECT_EQ(run["events"][i]["kind"], i % 2 == 0 ? "onset" : "arrest");
        EXPECT_NEAR(run["events"][i]["state"][1].get<double>(), 1e-3, 1e-12);
    }
    EXPECT_EQ(run["unsolved"], 0);
    EXPECT_EQ(run["trajectory"]["t"].size(), 51U);
}

TEST_F(App, SimulateSpringSliderTakesAnyStep)
{
    const nlohmann::json run = json({"simulate", "spring-slider", "--step", "0.5", "--set",
                                     "order=2", "law=1", "--t-end", "10", "--json"});
    EXPECT_EQ(run["outcome"], "reached_end");
    EXPECT_EQ(run["steps"], 20);
    EXPECT_EQ(run["unsolved"], 0);
}

TEST_F(App, SimulateSpringSliderWritesItsTrajectory)
{
    const Result result = run(
        {"simulate", "spring-slider", "--t-end", "0.3", "--samples", "11", "--csv", "slider.csv"});
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_NE(result.out.find("onset"), std::string::npos) << result.out;
    const std::string csv = content(work() / "slider.csv");
    EXPECT_TRUE(csv.starts_with("t [s],x [m],V [m/s]")) << csv.substr(0, 80);
}

TEST_F(App, SystemsListsTheSpringSlider)
{
    const Result result = run({"systems"});
    EXPECT_NE(result.out.find("spring-slider"), std::string::npos);
}

TEST_F(App, RefusesWhatTheSpringSliderIsNot)
{
    const auto refused = [&](Words more, const Words& pieces) {
        Words words{"simulate", "spring-slider"};
        words.insert(words.end(), more.begin(), more.end());
        expect_refused(words, pieces);
    };
    refused({"--set", "d_rs=0"}, {"d_rs", "0"});
    refused({"--set", "a=0.02"}, {"needs b > a", "0.02"});
    refused({"--set", "order=3"}, {"order must be 1, 2 or 4, got 3"});
    refused({"--set", "law=0.5"}, {"law must be 0, 1 or 2, got 0.5"});
    refused({"--step", "0"}, {"--step must be positive, got 0"});
    refused({"--t-end", "-1"}, {"--t-end must be positive, got -1"});
    refused({"--detector", "ends"}, {"--detector is not for the spring-slider"});
}

TEST_F(App, TheLabelsOfASpringSliderAreInItsPicture)
{
    // Numbers such as 0.00035 are the widest that a tic has. A label is centred on a point that is
    // half a letter of 15 pixels from its left edge, at least.
    const Result result = run({"simulate", "spring-slider", "--plot", "slider.svg"});
    if (result.err.find("gnuplot-nox") != std::string::npos) GTEST_SKIP() << result.err;
    ASSERT_EQ(result.status, 0) << result.err;
    const std::string drawn = content(work() / "slider.svg");
    int labels = 0;
    for (std::size_t at = 0; (at = drawn.find(") rotate(270)", at)) != std::string::npos; ++at) {
        const std::size_t from = drawn.rfind("translate(", at) + 10;
        EXPECT_GE(std::stod(drawn.substr(from)), 15) << drawn.substr(at, 200);
        ++labels;
    }
    EXPECT_EQ(labels, 5);
}

}  // namespace
}  // namespace ricochet::rate_and_state_test
