// The command line, run as a child process as a user runs it.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "ricochet/ricochet.hpp"

extern char** environ;

namespace ricochet {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

std::string content(const fs::path& file)
{
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

struct Result {
    int status = -1;
    std::string out;
    std::string err;
};

/// Each test has a directory of its own, in which the program runs.
class App : public testing::Test {
protected:
    App()
    {
        std::string name = (fs::temp_directory_path() / "ricochet-test-XXXXXX").string();
        if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary directory");
        root_ = name;
        fs::create_directory(work());
    }
    ~App() override
    {
        std::error_code ignored;
        fs::remove_all(root_, ignored);
    }

    [[nodiscard]] fs::path work() const { return root_ / "work"; }

    /// Starts the program in `work()`, its output going to files outside of it.
    pid_t start(const Words& words, const Words& environment = {}) const
    {
        Words all{RICOCHET_APP};
        all.insert(all.end(), words.begin(), words.end());
        std::vector<char*> arguments;
        for (std::string& word : all) arguments.push_back(word.data());
        arguments.push_back(nullptr);
        Words own = environment;
        std::vector<char*> variables;
        for (std::string& variable : own) variables.push_back(variable.data());
        variables.push_back(nullptr);

        const std::string out = (root_ / "out").string();
        const std::string err = (root_ / "err").string();
        posix_spawn_file_actions_t actions;
        posix_spawn_file_actions_init(&actions);
        constexpr int flags = O_WRONLY | O_CREAT | O_TRUNC;
        posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), flags, 0600);
        posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), flags, 0600);
        posix_spawn_file_actions_addchdir_np(&actions, work().c_str());
        pid_t child = 0;
        const int error = posix_spawn(&child, RICOCHET_APP, &actions, nullptr, arguments.data(),
                                      environment.empty() ? environ : variables.data());
        posix_spawn_file_actions_destroy(&actions);
        if (error != 0) throw std::runtime_error("cannot start " RICOCHET_APP);
        return child;
    }

    [[nodiscard]] Result wait_for(pid_t child) const
    {
        int status = 0;
        waitpid(child, &status, 0);
        return {.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
                .out = content(root_ / "out"),
                .err = content(root_ / "err")};
    }

    [[nodiscard]] Result run(const Words& words, const Words& environment = {}) const
    {
        return wait_for(start(words, environment));
    }

    /// Runs a command that prints JSON.
    [[nodiscard]] nlohmann::json json(const Words& words, int expected_status = 0) const
    {
        const Result result = run(words);
        EXPECT_EQ(result.status, expected_status) << result.err;
        return nlohmann::json::parse(result.out);
    }

    /// Input that is refused: status 2, one sentence with these pieces, nothing
    /// printed and nothing written.
    void expect_refused(const Words& words, const Words& pieces) const
    {
        std::string line = "ricochet";
        for (const std::string& word : words) line += ' ' + word;
        SCOPED_TRACE(line);
        Words before = files();
        const Result result = run(words);
        EXPECT_EQ(result.status, 2);
        EXPECT_EQ(result.out, "");
        EXPECT_EQ(files(), before);
        EXPECT_TRUE(result.err.starts_with("ricochet: ")) << result.err;
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        for (const std::string& piece : pieces) {
            EXPECT_NE(result.err.find(piece), std::string::npos)
                << "no '" << piece << "' in: " << result.err;
        }
    }

    /// The names of the files in `work()`.
    [[nodiscard]] Words files() const
    {
        Words names;
        for (const auto& entry : fs::directory_iterator(work())) {
            names.push_back(entry.path().filename().string());
        }
        std::sort(names.begin(), names.end());
        return names;
    }

    void write(const std::string& name, std::string_view text) const
    {
        std::ofstream(work() / name, std::ios::binary) << text;
    }

private:
    fs::path root_;
};

Words simulate(const Words& more)
{
    Words words{"simulate", "bouncing-ball"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

/// The largest error of the event times in `run`, which must be the 13 impacts.
double largest_error(const nlohmann::json& run)
{
    EXPECT_EQ(run.at("events").size(), 13U);
    double largest = 0;
    for (std::size_t i = 0; i < run.at("events").size(); ++i) {
        const double exact = BouncingBall().impact_time(static_cast<int>(i), 10);
        largest = std::max(largest, std::fabs(run["events"][i]["t"].get<double>() - exact));
    }
    return largest;
}

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
    for (const char* key : {"steps", "rejected", "flow_calls", "guard_calls", "network_calls",
                            "false_alarms", "evidence"}) {
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

TEST_F(App, EveryStepperDetectorAndLocatorFindsThe13Impacts)
{
    // 2e-14 s is ten units in the last place of the last impact, 19.87 s.
    for (const char* detector : {"ends", "extremum", "network"}) {
        for (const char* stepper : {"rk4", "dopri5", "fehlberg78", "cash-karp54"}) {
            SCOPED_TRACE(std::string(detector) + ' ' + stepper);
            const Words words = simulate(
                {"--json", "--step", "0.01", "--stepper", stepper, "--detector", detector});
            EXPECT_LE(largest_error(json(words)), 2e-14);
        }
    }
    for (const char* locator : {"newton", "bisection", "toms748"}) {
        SCOPED_TRACE(locator);
        EXPECT_LE(largest_error(json(simulate({"--json", "--locator", locator}))), 2e-14);
    }
    for (const char* stepper : {"dopri5", "fehlberg78", "cash-karp54"}) {
        for (const char* detector : {"ends", "extremum", "network"}) {
            SCOPED_TRACE(std::string(detector) + ' ' + stepper);
            const Words words = simulate({"--json", "--stepper", stepper, "--detector", detector});
            EXPECT_LE(largest_error(json(words)), 2e-13);
        }
    }
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

TEST_F(App, NetworkIsAskedEveryStepAndLooksAtTheGuardLess)
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

TEST_F(App, SlopeThatNobodyComputedIsNull)
{
    // Neither the detector nor the locator needs the guard's rate.
    const nlohmann::json run =
        json(simulate({"--json", "--detector", "ends", "--locator", "bisection"}));
    EXPECT_TRUE(run["events"][0]["slope"].is_null());
}

TEST_F(App, RunThatEndsEarlyIsPrintedWithStatusOne)
{
    // A ball at rest on the floor cannot leave it: no rest rule is given.
    const nlohmann::json run =
        json(simulate({"--json", "--set", "restitution=0.5", "--t-end", "100"}), 1);
    EXPECT_EQ(run["outcome"], "zeno");
    EXPECT_LT(run["t"].get<double>(), 5);
    EXPECT_GT(run["events"].size(), 10U);
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
    expect_refused(simulate({"--t-end", "-1"}), {"--t-end", "-1"});
    expect_refused(simulate({"--t-end", "inf"}), {"--t-end", "finite"});
    expect_refused(simulate({"--t-start", "5", "--t-end", "4"}), {"--t-end", "5", "4"});
    expect_refused(simulate({"--samples", "1"}), {"--samples", "from 2", "1"});
    expect_refused(simulate({"--samples", "-3"}), {"--samples", "-3"});
}

TEST_F(App, UnknownNamesAreRefusedWithTheKnownOnes)
{
    expect_refused({"simulate", "pendulum"}, {"pendulum", "bouncing-ball"});
    expect_refused({"compare", "pendulum"}, {"pendulum", "bouncing-ball"});
    expect_refused({"train", "pendulum", "--out", "m"}, {"pendulum", "bouncing-ball"});
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

TEST_F(App, ModelsThatDoNotFitAreRefused)
{
    expect_refused(simulate({"--model", "missing.safetensors"}), {"missing.safetensors", "looked"});
    write("text.safetensors", "this is not a model, whatever its name says");
    expect_refused(simulate({"--model", "text.safetensors"}), {"text.safetensors"});
    write("empty.safetensors", "");
    expect_refused(simulate({"--model", "empty.safetensors"}), {"empty.safetensors"});
    expect_refused(simulate({"--model", "."}), {"."});

    Model other = load_model(RICOCHET_MODELS "/bouncing-ball.safetensors");
    other.system = "pendulum";
    save_model(other, work() / "other.safetensors");
    expect_refused(simulate({"--model", "other.safetensors"}), {"pendulum", "bouncing-ball"});

    const std::string fixed = "bouncing-ball-step-0.01";
    expect_refused(simulate({"--model", fixed, "--step", "0.02"}), {fixed, "0.01", "0.02"});
    expect_refused(simulate({"--model", fixed}), {fixed, "--step 0.01"});
    expect_refused(simulate({"--model", fixed, "--step", "0.01", "--set", "gravity=2"}),
                   {fixed, "gravity = 9.81", "2"});
    expect_refused(simulate({"--model", fixed, "--detector", "ends"}), {"--model", "ends"});
    expect_refused(simulate({"--detector", "network", "--step", "1000"}), {"[1e-06, 100]", "1000"});
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

// --- train ---

const Words small_training{"train",    "bouncing-ball", "--out",   "ball.safetensors",
                           "--states", "20000",         "--fresh", "2000"};

Words train(const Words& more)
{
    Words words = small_training;
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

TEST_F(App, TrainedModelIsWrittenAndFindsThe13Impacts)
{
    const nlohmann::json report = json(train({"--iterations", "2000", "--json"}));
    EXPECT_EQ(report["fresh"]["missed"], 0);
    EXPECT_EQ(report["model"], "ball.safetensors");
    EXPECT_EQ(files(), Words{"ball.safetensors"});
    const nlohmann::json run =
        json(simulate({"--json", "--step", "0.01", "--model", "ball.safetensors"}));
    EXPECT_LE(largest_error(run), 2e-14);
    EXPECT_GT(run["statistics"]["network_calls"].get<int>(), 2000);
}

TEST_F(App, ModelThatMissesEventsIsOnlyWrittenWhenAllowed)
{
    // After one iteration the network knows nothing.
    const Result refused = run(train({"--iterations", "1"}));
    EXPECT_EQ(refused.status, 1);
    EXPECT_NE(refused.err.find("--allow-misses"), std::string::npos) << refused.err;
    EXPECT_EQ(files(), Words{});

    EXPECT_EQ(run(train({"--iterations", "1", "--allow-misses"})).status, 0);
    EXPECT_EQ(files(), Words{"ball.safetensors"});
}

TEST_F(App, InterruptedTrainingKeepsTheBestAndResumes)
{
    const Words words = train({"--kind", "any-step", "--iterations", "60000"});
    const pid_t child = start(words);
    // The first line of progress says that the training itself has begun.
    const fs::path err = work().parent_path() / "err";
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (content(err).find("10 %") == std::string::npos &&
           std::chrono::steady_clock::now() < deadline) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    kill(child, SIGINT);
    const Result interrupted = wait_for(child);
    EXPECT_EQ(interrupted.status, 1);
    EXPECT_NE(interrupted.err.find("interrupted"), std::string::npos) << interrupted.err;
    EXPECT_NE(interrupted.err.find("--resume"), std::string::npos);
    const Words kept = files();
    EXPECT_NE(std::find(kept.begin(), kept.end(), "ball.safetensors.checkpoint"), kept.end());

    Words resumed = words;
    resumed.emplace_back("--resume");
    const Result rest = run(resumed);
    EXPECT_EQ(rest.status, 0) << rest.err;
    EXPECT_EQ(rest.err.find(" 0 of 60000"), std::string::npos) << rest.err;
    EXPECT_EQ(files(), Words{"ball.safetensors"});
}

TEST_F(App, ResumingWithoutACheckpointIsRefused)
{
    expect_refused(train({"--resume"}), {"ball.safetensors.checkpoint"});
    expect_refused(train({"--kind", "any-step", "--step", "1"}), {"--step", "fixed-step"});
}

// --- compare ---

TEST_F(App, CompareFindsAllImpactsByEveryDetector)
{
    const nlohmann::json table = json({"compare", "bouncing-ball", "--json"});
    ASSERT_EQ(table["closed_form"].size(), 13U);
    ASSERT_GE(table["methods"].size(), 4U);
    for (const nlohmann::json& method : table["methods"]) {
        SCOPED_TRACE(method["detector"].get<std::string>());
        EXPECT_EQ(method["missed"], 0);
        EXPECT_EQ(method["spurious"], 0);
        EXPECT_EQ(method["times"].size(), 13U);
        EXPECT_LE(method["largest_error"].get<double>(), 2e-14);
        EXPECT_GT(method["seconds"]["median"].get<double>(), 0);
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
    EXPECT_NE(result.out.find("19.870248050848"), std::string::npos);
    const std::string csv = content(work() / "table.csv");
    EXPECT_TRUE(csv.starts_with("event,closed form [s],"));
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 14);
}

// --- the rest ---

TEST_F(App, HelpHasAnExampleForEveryCommand)
{
    for (const Words& words :
         {Words{"--help"}, Words{"systems", "--help"}, Words{"simulate", "--help"},
          Words{"train", "--help"}, Words{"compare", "--help"}}) {
        const Result result = run(words);
        EXPECT_EQ(result.status, 0);
        EXPECT_NE(result.out.find("Example"), std::string::npos);
    }
    EXPECT_TRUE(run({"--version"}).out.starts_with("ricochet "));
}

}  // namespace
}  // namespace ricochet
