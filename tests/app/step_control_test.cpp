// Steps chosen by policies, on the command line.

#include <sys/stat.h>

#include "app.hpp"

namespace ricochet::step_control_test {
namespace {

TEST_F(App, SimulateFaultByLearnedSteps)
{
    const auto with = [&](const std::string& controller) {
        return json({"simulate", "fault", "--set", "elements=5", "--integrator", "bathe",
                     "--controller", controller, "--rtol", "1e-3", "--json"});
    };
    const nlohmann::json learned = with("learned");
    const nlohmann::json classical = with("error");
    EXPECT_EQ(learned["outcome"], "at_rest");
    EXPECT_EQ(learned["controller"], "learned");
    // Both are of order 2 at tolerance 1e-3.
    EXPECT_NEAR(learned["mean_slip"].get<double>() / classical["mean_slip"].get<double>(), 1, 5e-3);
    EXPECT_LT(learned["statistics"]["handed_over"].get<int>(),
              learned["statistics"]["steps"].get<int>() / 2);
}

TEST_F(App, TheLengthOfARunIsNoMeasureOfItsSteps)
{
    const nlohmann::json run = json({"simulate", "fault", "--integrator", "bathe", "--controller",
                                     "learned", "--t-end", "1e8", "--json"});
    EXPECT_EQ(run["outcome"], "at_rest");
}

TEST_F(App, SimulateSlidingModeByLearnedSteps)
{
    for (const char* controller : {"error", "learned"}) {
        const nlohmann::json run = json({"simulate", "sliding-mode", "--integrator", "bathe",
                                         "--controller", controller, "--rtol", "1e-4", "--json"});
        EXPECT_EQ(run["outcome"], "reached_end") << controller;
        EXPECT_LT(run["set_valued_statistics"]["solves"].get<int>(), 150) << controller;
    }
}

TEST_F(App, LearnedStepsRefuseWhatIsNotTheirs)
{
    const auto fault = [](std::vector<std::string> more) {
        Words all{"simulate", "fault", "--integrator", "bathe", "--controller", "learned"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    expect_refused(fault({"--model", "sliding-mode-step"}), {"sliding-mode", "fault"});
    expect_refused(fault({"--model", "bouncing-ball"}), {"step-policy", "event-classifier"});
    expect_refused(fault({"--model", "nowhere"}), {"nowhere", "not found"});
    expect_refused({"simulate", "fault", "--model", "fault-step"}, {"--controller learned"});
    expect_refused(
        {"simulate", "super-twisting", "--integrator", "bathe", "--controller", "learned"},
        {"super-twisting", "sliding-mode"});
    expect_refused(
        {"simulate", "sliding-mode", "--integrator", "bathe", "--model", "sliding-mode-step"},
        {"--model", "learned"});
}

TEST_F(App, TrainStepPolicyWritesAModelThatIsUsed)
{
    const nlohmann::json report = json({"train", "step-policy", "sliding-mode", "--out",
                                        "mine.safetensors", "--iterations", "41", "--json"});
    EXPECT_GE(report["evaluations"].get<int>(), 41);
    EXPECT_EQ(report["held_out"].size(), 4U);
    EXPECT_FALSE(fs::exists(work() / "mine.safetensors.checkpoint"));
    const nlohmann::json used =
        json({"simulate", "sliding-mode", "--integrator", "bathe", "--controller", "learned",
              "--model", "mine.safetensors", "--json"});
    EXPECT_EQ(used["outcome"], "reached_end");
    const Result shown = run({"inspect", "mine.safetensors"});
    EXPECT_NE(shown.out.find("log_distance"), std::string::npos) << shown.out;
}

TEST_F(App, TrainStepPolicyRefusesBadInput)
{
    expect_refused({"train", "step-policy", "--out", "a.safetensors"}, {"fault", "none"});
    expect_refused({"train", "step-policy", "pendulum", "--out", "a.safetensors"},
                   {"pendulum", "sliding-mode"});
    expect_refused({"train", "step-policy", "fault", "--out", "a.safetensors", "--resume"},
                   {"a.safetensors.checkpoint"});
    expect_refused({"train", "step-policy", "fault", "--out", "a.safetensors", "--seconds", "0"},
                   {"--seconds"});
    expect_refused({"train", "step-policy", "fault", "--out", "a.safetensors", "--kind", "gate"},
                   {"--kind"});
    expect_refused({"train", "pendulum", "fault", "--out", "a.safetensors"}, {"one system"});
    expect_refused({"compare", "pendulum", "--system", "fault"}, {"--system"});
}

TEST_F(App, TrainStepPolicyResumesNoOtherSystem)
{
    (void)json({"train", "step-policy", "sliding-mode", "--out", "a.safetensors", "--checkpoint",
                "shared", "--iterations", "21", "--json"});
    ASSERT_TRUE(fs::exists(work() / "shared"));
    expect_refused({"train", "step-policy", "sliding-mode", "--out", "b.safetensors",
                    "--checkpoint", "shared"},
                   {"shared", "--resume", "remove"});
    expect_refused({"train", "step-policy", "diode-circuit", "--out", "b.safetensors",
                    "--checkpoint", "shared", "--resume"},
                   {"shared", "another search"});
}

TEST_F(App, TrainStepPolicyReplacesNothingButFiles)
{
    ASSERT_EQ(::mkfifo((work() / "pipe").c_str(), 0600), 0);
    expect_refused({"train", "step-policy", "sliding-mode", "--out", "pipe"}, {"--out", "pipe"});
    expect_refused(
        {"train", "step-policy", "sliding-mode", "--out", "a.safetensors", "--checkpoint", "pipe"},
        {"--checkpoint", "pipe"});
    expect_refused({"train", "step-policy", "sliding-mode", "--out", "a", "--checkpoint", "a"},
                   {"two files"});
    expect_refused({"simulate", "fault", "--kernel", "pipe"}, {"pipe", "something else"});
}

TEST_F(App, TrainStepPolicyByReinforcement)
{
    for (const char* trainer : {"tqc", "td3"}) {
        const nlohmann::json report =
            json({"train", "step-policy", "sliding-mode", "--trainer", trainer, "--alpha", "1",
                  "--iterations", "150", "--threads", "1", "--out", "actor.safetensors", "--json"});
        EXPECT_EQ(report["trained_steps"], 150) << trainer;
        EXPECT_EQ(report["trainer"], trainer);
        const nlohmann::json actor = json({"inspect", "actor.safetensors", "--json"});
        EXPECT_EQ(actor["kind"], "step-actor");
        EXPECT_EQ(actor["parameters"]["alpha"], 1);
        EXPECT_FALSE(std::filesystem::exists(work() / "actor.safetensors.checkpoint"));
    }
    const Words simulate{"simulate",     "sliding-mode", "--integrator", "bathe",
                         "--controller", "learned",      "--model",      "actor.safetensors"};
    expect_refused(simulate, {"step-policy", "step-actor"});
    const auto train = [](std::vector<std::string> more) {
        Words all{"train", "step-policy", "sliding-mode", "--out", "b.safetensors"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    expect_refused(train({"--trainer", "ppo"}), {"ppo", "tqc"});
    expect_refused(train({"--alpha", "2"}), {"--alpha", "tqc"});
    expect_refused(train({"--trainer", "tqc", "--alpha", "-1"}), {"alpha", "-1"});
    expect_refused(train({"--trainer", "td3", "--resume"}), {"checkpoint", "resume"});
    expect_refused({"train", "bouncing-ball", "--trainer", "tqc", "--out", "b.safetensors"},
                   {"--trainer", "step policy"});
}

}  // namespace
}  // namespace ricochet::step_control_test
