// `ricochet train`.
#include "app.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

namespace ricochet::train_test {
namespace {

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
    // After one iteration the network has learned nothing.
    const Result refused = run(train({"--iterations", "1"}));
    EXPECT_EQ(refused.status, 1);
    EXPECT_NE(refused.err.find("events are missed"), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find("--allow-misses"), std::string::npos) << refused.err;
    EXPECT_EQ(files(), Words{"ball.safetensors.checkpoint"});

    // The best weights are in the checkpoint, and are those that the whole training would write.
    EXPECT_EQ(run(train({"--iterations", "1", "--allow-misses", "--resume"})).status, 0);
    EXPECT_EQ(files(), Words{"ball.safetensors"});
    const std::string kept = content(work() / "ball.safetensors");
    EXPECT_EQ(run(train({"--iterations", "1", "--allow-misses"})).status, 0);
    EXPECT_EQ(files(), Words{"ball.safetensors"});
    EXPECT_EQ(content(work() / "ball.safetensors"), kept);
}

TEST_F(App, TrainingThatMissesLeavesAnEarlierModelAsItWas)
{
    write("ball.safetensors", "earlier");
    EXPECT_EQ(run(train({"--iterations", "1"})).status, 1);
    EXPECT_EQ(content(work() / "ball.safetensors"), "earlier");
}

TEST_F(App, InterruptedTrainingKeepsTheBestAndResumesToTheSameBits)
{
    const Words words = train({"--kind", "any-step", "--iterations", "60000"});
    const pid_t child = start(words);
    // The first line of progress says that the training itself has started.
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

    const std::string resumed_bytes = content(work() / "ball.safetensors");
    EXPECT_EQ(run(words).status, 0);  // from the start, uninterrupted
    EXPECT_EQ(content(work() / "ball.safetensors"), resumed_bytes);
}

TEST_F(App, CheckpointOfAnotherTrainingIsRefused)
{
    ASSERT_EQ(run(train({"--iterations", "1"})).status, 1);
    expect_refused(train({"--iterations", "2", "--resume"}),
                   {"ball.safetensors.checkpoint", "other data or options"});
}

TEST_F(App, ResumingWithoutACheckpointIsRefused)
{
    expect_refused(train({"--resume"}), {"ball.safetensors.checkpoint"});
    expect_refused(train({"--kind", "any-step", "--step", "1"}), {"--step", "fixed-step"});
}

/// A gate for a thermostat, small enough for a test.
Words train_gate(const Words& more)
{
    Words words{"train",    "thermostat", "--kind",  "gate", "--out", "gate.safetensors",
                "--states", "4000",       "--fresh", "200"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

Words simulate_thermostat(const Words& more)
{
    Words words{"simulate", "thermostat", "--step", "0.02", "--t-end", "60", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

TEST_F(App, TrainedGateIsWrittenAndSavesChecks)
{
    const nlohmann::json report = json(train_gate({"--iterations", "500", "--json"}));
    EXPECT_EQ(report["model"], "gate.safetensors");
    EXPECT_EQ(report["trial"]["misses"], 0);
    EXPECT_EQ(files(), Words{"gate.safetensors"});
    const nlohmann::json exact = json(simulate_thermostat({}));
    const nlohmann::json gated =
        json(simulate_thermostat({"--gate", "calibrated", "--model", "gate.safetensors"}));
    EXPECT_EQ(gated["detector"], "calibrated");
    ASSERT_GT(exact["events"].size(), 5U);
    EXPECT_EQ(gated["events"].size(), exact["events"].size());
    EXPECT_EQ(gated["state"], exact["state"]);
    EXPECT_LT(2 * gated["statistics"]["guard_calls"].get<int>(),
              exact["statistics"]["guard_calls"].get<int>());
    EXPECT_GT(gated["statistics"]["evidence"]["gated"].get<int>(), 100);
}

TEST_F(App, AGateIsTrustedByNameOnly)
{
    ASSERT_EQ(run(train_gate({"--iterations", "500"})).status, 0);
    expect_refused(simulate_thermostat({"--model", "gate.safetensors"}), {"network"});
    expect_refused(simulate_thermostat({"--gate", "calibrated"}), {"--model FILE"});
    expect_refused(simulate_thermostat({"--gate", "extremum", "--model", "gate.safetensors"}),
                   {"gate", "extremum", "calibrated"});
    expect_refused(simulate_thermostat({"--gate", "verified", "--model", "gate.safetensors"}),
                   {"bounds", "calibrated"});
    expect_refused(simulate_thermostat({"--gate", "certified", "--model", "gate.safetensors"}),
                   {"no certificate", "ricochet certify"});
    expect_refused(simulate_thermostat({"--gate", "calibrated", "--model", "gate.safetensors",
                                        "--set", "low=18.5"}),
                   {"low", "18.5"});
    expect_refused({"simulate", "thermostat", "--step", "0.5", "--gate", "calibrated", "--model",
                    "gate.safetensors"},
                   {"steps", "0.5"});
    EXPECT_EQ(run({"simulate", "thermostat", "--step", "0.02", "--stepper", "euler", "--gate",
                   "calibrated", "--model", "gate.safetensors"})
                  .status,
              0);
    expect_refused({"simulate", "pendulum", "--step", "0.01", "--gate", "calibrated", "--model",
                    "gate.safetensors"},
                   {"thermostat", "pendulum"});
}

TEST_F(App, GateTrainingIsInterruptedWhileItSamples)
{
    const Words words{"train",   "thermostat",       "--kind",       "gate",
                      "--out",   "gate.safetensors", "--states",     "4000",
                      "--fresh", "100000000",        "--iterations", "500"};
    const fs::path err = work().parent_path() / "err";
    for (const bool training_began : {false, true}) {
        fs::remove(err);
        const pid_t child = start(words);
        const std::string line = training_began ? "training: 100 %" : "sampling:";
        const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (content(err).find(line) == std::string::npos &&
               std::chrono::steady_clock::now() < deadline) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        // The weights are final; their misses are counted now.
        if (training_began) std::this_thread::sleep_for(std::chrono::milliseconds(300));
        const auto then = std::chrono::steady_clock::now();
        kill(child, training_began ? SIGTERM : SIGINT);
        const Result interrupted = wait_for(child);
        EXPECT_EQ(interrupted.status, 1);
        // A hundred million events would take hours.
        EXPECT_LT(std::chrono::steady_clock::now() - then, std::chrono::seconds(10));
        const char* sentence = training_began ? "--resume" : "nothing is kept";
        EXPECT_NE(interrupted.err.find(sentence), std::string::npos) << interrupted.err;
        EXPECT_EQ(files(), training_began ? Words{"gate.safetensors.checkpoint"} : Words{});
    }
}

TEST_F(App, InterruptedGateTrainingLosesNothing)
{
    const Words words = train_gate({"--iterations", "2000"});
    const pid_t child = start(words);
    const fs::path err = work().parent_path() / "err";
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (content(err).find("training:") == std::string::npos &&
           std::chrono::steady_clock::now() < deadline) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    kill(child, SIGINT);
    const Result interrupted = wait_for(child);
    EXPECT_EQ(interrupted.status, 1);
    EXPECT_NE(interrupted.err.find("--resume"), std::string::npos) << interrupted.err;
    EXPECT_EQ(files(), Words{"gate.safetensors.checkpoint"});

    Words resumed = words;
    resumed.emplace_back("--resume");
    const Result rest = run(resumed);
    EXPECT_EQ(rest.status, 0) << rest.err;
    EXPECT_EQ(files(), Words{"gate.safetensors"});
    const std::string bytes = content(work() / "gate.safetensors");
    EXPECT_EQ(run(words).status, 0);
    EXPECT_EQ(content(work() / "gate.safetensors"), bytes);
    expect_refused(resumed, {"gate.safetensors.checkpoint", "cannot be read"});
}

TEST_F(App, GateTrainingOnStatesWithoutEventsIsRefused)
{
    // A ball that never reaches the wall.
    expect_refused({"train", "impact-oscillator", "--kind", "gate", "--out", "gate.safetensors",
                    "--set", "wall=1000", "--iterations", "10"},
                   {"no event"});
    EXPECT_TRUE(files().empty());
}

}  // namespace
}  // namespace ricochet::train_test
