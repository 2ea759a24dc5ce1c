// Reactions of the command line to invalid values, files and interrupts.
#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "app.hpp"

namespace ricochet::robustness_test {
namespace {

constexpr const char* kernel = RICOCHET_TEST_FIXTURES "/fault_kernels/fault-kernel-1x1-3km.npy";

/// A limit that processes inherit during its life.
class Limited {
public:
    Limited(decltype(RLIMIT_AS) resource, rlim_t most) : resource_(resource)
    {
        getrlimit(resource, &before_);
        rlimit now = before_;
        now.rlim_cur = most;
        setrlimit(resource, &now);
    }
    ~Limited() { setrlimit(resource_, &before_); }
    Limited(const Limited&) = delete;
    Limited& operator=(const Limited&) = delete;

private:
    decltype(RLIMIT_AS) resource_;
    rlimit before_{};
};

class Robust : public App {
protected:
    /// A run that a signal ends prints valid JSON that says so.
    void expect_kept(const Words& words, int signal, const std::string& cause,
                     Milliseconds after = Milliseconds(300)) const
    {
        std::string line;
        for (const std::string& word : words) line += ' ' + word;
        SCOPED_TRACE(line);
        const Result result = interrupted(words, signal, after);
        EXPECT_EQ(result.status, 128 + signal) << result.err;
        EXPECT_NE(result.err.find(cause), std::string::npos) << result.err;
        EXPECT_NE(result.err.find("the result is incomplete"), std::string::npos) << result.err;
        ASSERT_FALSE(result.out.empty());
        EXPECT_EQ(nlohmann::json::parse(result.out).at("incomplete"), cause);
    }
};

// --- values ---

TEST_F(Robust, OptionsWithoutAValueAreRefused)
{
    expect_refused(simulate({"--csv=", "--json"}), {"--csv", "value"});
    expect_refused(simulate({"--csv", "--json"}), {"--csv", "value", "--json"});
    expect_refused(simulate({"--csv"}), {"--csv", "value"});
    expect_refused(simulate({"--csv", ""}), {"--csv", "value"});
    expect_refused(simulate({"--csv", " "}), {"--csv", "value"});
    expect_refused(simulate({"--model", ""}), {"--model", "value"});
    expect_refused({"simulate", "fault", "--kernel", ""}, {"--kernel", "value"});
    expect_refused(simulate({"--t-end="}), {"--t-end", "value"});
    expect_refused({"simulate", ""}, {"value"});
    expect_refused({"train", "bouncing-ball", "--out", ""}, {"--out", "value"});
    expect_refused({"train", "bouncing-ball", "--out", "m", "--checkpoint="},
                   {"--checkpoint", "value"});
    expect_refused({"certify", "bouncing-ball", "--checkpoint", ""}, {"--checkpoint", "value"});
    expect_refused(simulate({"--json=7"}), {"--json", "no value"});
}

TEST_F(Robust, OptionsAndParametersAreGivenOnce)
{
    expect_refused(simulate({"--csv", "a.csv", "--csv", "b.csv"}), {"--csv", "twice"});
    expect_refused(simulate({"--t-end", "3", "--t-end=4"}), {"--t-end", "twice"});
    expect_refused(simulate({"--set", "height=1", "height=2"}), {"height", "twice"});
    expect_refused(simulate({"--set", "height=1", "--set", "height=1"}), {"height", "twice"});
    expect_refused({"compare", "bouncing-ball", "--set", "height=1", "height=2"},
                   {"height", "twice"});
}

TEST_F(Robust, NamesTooLongAreRefusedBeforeTheRun)
{
    const std::string name(250, 'x');  // 255 are allowed, but not with the suffix of a new file
    expect_refused(simulate({"--csv", name}), {"--csv", "too long"});
    expect_refused(simulate({"--plot", name + ".svg"}), {"--plot", "too long"});
    expect_refused({"train", "bouncing-ball", "--out", name}, {"--out", "too long"});
    expect_refused(simulate({"--csv", std::string(5000, 'x')}), {"--csv", "5000"});
    expect_refused(simulate({"--t-end", std::string(3000, '9')}), {"--t-end", "3000"});
    expect_refused({std::string(3000, 'f')}, {"3000"});
}

TEST_F(Robust, DirectoriesAndDevicesAreNoInput)
{
    ASSERT_EQ(::mkfifo((work() / "pipe").c_str(), 0600), 0);
    for (const std::string file : {".", "/dev/zero", "pipe"}) {
        SCOPED_TRACE(file);
        expect_refused({"inspect", file}, {file, "something else"});
        expect_refused(simulate({"--model", file}), {file, "something else"});
        expect_refused({"certify", file}, {file, "something else"});
        expect_refused({"simulate", "fault", "--kernel", file}, {file, "something else"});
        expect_refused({"train", "bouncing-ball", "--out", "m", "--checkpoint", file}, {file});
        expect_refused({"train", "bouncing-ball", "--out", "m", "--checkpoint", file, "--resume"},
                       {file});
    }
}

// --- files ---

TEST_F(Robust, NoOutputIsWrittenOverAnother)
{
    fs::create_symlink("a.svg", work() / "link.svg");
    expect_refused(simulate({"--csv", "a.svg", "--plot", "a.svg"}), {"--csv", "--plot", "a.svg"});
    expect_refused(simulate({"--csv", "./a.svg", "--plot", "link.svg"}), {"--csv", "--plot"});
    expect_refused({"train", "bouncing-ball", "--out", "m", "--checkpoint", "m"},
                   {"--out", "--checkpoint"});
    expect_refused(
        {"train", "thermostat", "--out", "m.checkpoint.part", "--checkpoint", "m.checkpoint"},
        {"--out", "--checkpoint"});
    expect_refused({"train", "bouncing-ball", "--out", "m", "--checkpoint", "m/../m"}, {"m"});
    // No result can be lost in a device.
    EXPECT_EQ(run(simulate({"--csv", "/dev/null"})).status, 0);
}

TEST_F(Robust, NoInputIsWrittenOver)
{
    const std::string models = RICOCHET_MODELS;
    fs::copy_file(models + "/bouncing-ball.safetensors", work() / "ball.safetensors");
    fs::create_hard_link(work() / "ball.safetensors", work() / "same.svg");
    fs::copy_file(kernel, work() / "kernel.npy");
    const std::string before = content(work() / "ball.safetensors");
    expect_refused(simulate({"--model", "ball.safetensors", "--csv", "ball.safetensors"}),
                   {"--csv", "ball.safetensors"});
    expect_refused(simulate({"--model", "ball.safetensors", "--plot", "same.svg"}), {"--plot"});
    expect_refused({"simulate", "fault", "--kernel", "kernel.npy", "--csv", "kernel.npy"},
                   {"--csv", "--kernel"});
    expect_refused({"simulate", "fault", "--kernel", "kernel.npy", "--csv", "kernel.npy", "--set",
                    "rate_and_state=1"},
                   {"--csv", "--kernel"});
    expect_refused({"certify", "ball.safetensors", "--checkpoint", "ball.safetensors"},
                   {"--checkpoint"});
    expect_refused(
        {"certify", "ball.safetensors", "--out", "other", "--checkpoint", "ball.safetensors"},
        {"--checkpoint"});
    expect_refused({"certify", "ball.safetensors", "--out", "other", "--checkpoint", "other"},
                   {"--out", "--checkpoint"});
    EXPECT_EQ(content(work() / "ball.safetensors"), before);
}

TEST_F(Robust, ACheckpointIsLeftAloneWithoutResume)
{
    fs::copy_file(RICOCHET_MODELS "/eigenvalue-certified.safetensors", work() / "m.safetensors");
    for (const Words& words :
         {Words{"train", "bouncing-ball", "--out", "m.safetensors", "--iterations", "1"},
          Words{"train", "thermostat", "--out", "m.safetensors", "--iterations", "1"},
          Words{"train", "step-policy", "sliding-mode", "--out", "m.safetensors"},
          Words{"train", "step-policy", "sliding-mode", "--out", "m.safetensors", "--trainer",
                "tqc"},
          Words{"certify", "m.safetensors", "--time-limit", "1e-9"}}) {
        write("m.safetensors.checkpoint", "an earlier training");
        expect_refused(words, {"m.safetensors.checkpoint", "--resume", "remove"});
        EXPECT_EQ(content(work() / "m.safetensors.checkpoint"), "an earlier training");
        // A file that is no checkpoint is not continued from.
        Words resumed = words;
        resumed.emplace_back("--resume");
        expect_refused(resumed, {"m.safetensors.checkpoint"});
        EXPECT_EQ(content(work() / "m.safetensors.checkpoint"), "an earlier training");
    }
}

TEST_F(Robust, AModelThatCannotBeWrittenIsKeptElsewhere)
{
    const Words words{"train",         "bouncing-ball", "--out",        "ball.safetensors",
                      "--states",      "20000",         "--fresh",      "2000",
                      "--kind",        "any-step",      "--iterations", "20000",
                      "--allow-misses"};
    const pid_t child = start(words);
    wait_for_handler(child, SIGINT, Milliseconds(300));
    // An obstacle that appears while the training runs.
    fs::create_directory(work() / "ball.safetensors");
    const Result result = wait_for(child);
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.err.find("the model is in"), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("ball.kept.safetensors"), std::string::npos) << result.err;
    EXPECT_NE(result.out.find("iterations in"), std::string::npos);
    EXPECT_EQ(run({"inspect", "ball.kept.safetensors"}).status, 0);
}

TEST_F(Robust, AFullDiskIsAnError)
{
    // Files of a limited size, as if the disk were full.
    const auto limited = [this](rlim_t most, const Words& words) {
        const Limited limit(RLIMIT_FSIZE, most);
        return run(words);
    };
    const Result csv = limited(8192, simulate({"--csv", "ball.csv", "--samples", "100000"}));
    EXPECT_EQ(csv.status, 1);
    EXPECT_NE(csv.err.find("cannot write 'ball.csv'"), std::string::npos) << csv.err;
    EXPECT_NE(csv.out.find("13 events"), std::string::npos);
    EXPECT_EQ(files(), Words{});
    const Result model =
        limited(3000, {"train", "bouncing-ball", "--out", "ball.safetensors", "--states", "20000",
                       "--fresh", "2000", "--iterations", "100", "--allow-misses"});
    EXPECT_EQ(model.status, 1);
    EXPECT_NE(model.err.find("no room"), std::string::npos) << model.err;
    EXPECT_NE(model.out.find("iterations in"), std::string::npos);
    EXPECT_EQ(files(), Words{});
}

TEST_F(Robust, FilesAreWrittenThoughNothingPrintedIsRead)
{
    if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
    const std::string command = "\"" RICOCHET_APP "\" simulate bouncing-ball --csv \"" +
                                (work() / "ball.csv").string() + "\" > /dev/full 2> /dev/null";
    const int status = std::system(command.c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1);
    EXPECT_EQ(files(), Words{"ball.csv"});
}

/// Runs a command of a shell, in the directory of the test; returns its status.
int shell(const fs::path& directory, const std::string& command)
{
    const int status = std::system(("cd '" + directory.string() + "' && " + command).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(Robust, AFileThatTakesWhatIsPrintedIsNoOutput)
{
    const std::string simulate = RICOCHET_APP " simulate bouncing-ball --csv ";
    EXPECT_EQ(shell(work(), simulate + "ball.csv > ball.csv 2> trouble"), 2);
    EXPECT_EQ(shell(work(), simulate + "/dev/stdout > ball.csv 2> trouble"), 2);
    EXPECT_NE(content(work() / "trouble").find("--csv and the standard output must be two files"),
              std::string::npos);
    EXPECT_EQ(shell(work(), simulate + "/dev/stdout | cat > both"), 0);
    EXPECT_NE(content(work() / "both").find("13 events"), std::string::npos);
    EXPECT_NE(content(work() / "both").find("t [s],"), std::string::npos);
}

TEST_F(Robust, HelpThatCannotBePrintedIsAnError)
{
    if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
    for (const char* command : {" --help", " --version", " simulate --help"}) {
        EXPECT_EQ(shell(work(), std::string(RICOCHET_APP) + command + " >/dev/null"), 0) << command;
        EXPECT_EQ(shell(work(), std::string(RICOCHET_APP) + command + " >/dev/full 2>/dev/null"), 1)
            << command;
    }
}

TEST_F(Robust, APipeIsWaitedForUntilAnInterrupt)
{
    ASSERT_EQ(::mkfifo((work() / "pipe").c_str(), 0600), 0);
    const Result result = interrupted(simulate({"--csv", "pipe"}), SIGINT);
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.out.find("13 events"), std::string::npos);
    EXPECT_NE(result.err.find("waiting for somebody to read"), std::string::npos) << result.err;
    const pid_t child = start(simulate({"--csv", "pipe"}));
    EXPECT_TRUE(content(work() / "pipe").starts_with("t [s],"));
    EXPECT_EQ(wait_for(child).status, 0);
}

TEST_F(Robust, StandardErrorThatTakesNothingChangesNoStatus)
{
    const std::string bad = RICOCHET_APP " simulate bouncing-ball --rtol -1 ";
    EXPECT_EQ(shell(work(), bad + "2>&-"), 2);
    EXPECT_EQ(shell(work(), bad + "2>/dev/full"), 2);
    // Closed outputs: no file gets their numbers.
    const std::string good = RICOCHET_APP " simulate bouncing-ball --csv ";
    EXPECT_EQ(shell(work(), good + "a.csv >/dev/null"), 0);
    EXPECT_EQ(shell(work(), good + "b.csv >/dev/null 2>&-"), 0);
    EXPECT_EQ(shell(work(), good + "c.csv <&- >&- 2>&-"), 1);
    EXPECT_EQ(content(work() / "b.csv"), content(work() / "a.csv"));
    EXPECT_EQ(content(work() / "c.csv"), content(work() / "a.csv"));
}

// --- interrupts ---

TEST_F(Robust, ATerminalThatGoesAwayLosesNothing)
{
    expect_kept({"simulate", "stick-slip", "--t-end", "1e7", "--json", "--csv", "a.csv"}, SIGHUP,
                "left by its terminal");
    EXPECT_TRUE(content(work() / "a.csv").ends_with("\n# incomplete: left by its terminal\n"));
}

TEST_F(Robust, AnInterruptKeepsWhatWasComputed)
{
    // A thousand years, by steps of a hundredth of a second.
    const Words words{"simulate", "thermostat",  "--step",        "0.01",  "--t-end",
                      "3e10",     "--max-steps", "1000000000000", "--json"};
    Words with_csv = words;
    with_csv.insert(with_csv.end(), {"--csv", "room.csv", "--samples", "100000000"});
    expect_refused(with_csv, {"--samples"});
    with_csv.back() = "10000000";
    expect_kept(with_csv, SIGINT, "interrupted");
    EXPECT_TRUE(content(work() / "room.csv").ends_with("\n# incomplete: interrupted\n"));
    expect_kept(words, SIGTERM, "asked to terminate");

    Words text = words;
    text.erase(std::find(text.begin(), text.end(), "--json"));
    const Result result = interrupted(text, SIGINT);
    EXPECT_EQ(result.status, 130);
    EXPECT_NE(result.out.find("cancelled at t = "), std::string::npos);
    EXPECT_NE(result.out.find("incomplete: interrupted"), std::string::npos);
}

TEST_F(Robust, EveryIntegratorCanBeInterrupted)
{
    const Words inclusion{"simulate", "sliding-mode", "--integrator", "bathe", "--step",
                          "1e-9",     "--max-steps",  "100000000000", "--json"};
    expect_kept(inclusion, SIGINT, "interrupted");
    expect_kept({"simulate", "woodpecker", "--integrator", "time-stepping", "--step", "1e-9",
                 "--max-steps", "100000000000", "--json"},
                SIGINT, "interrupted");
    expect_kept({"simulate", "spring-slider", "--step", "1e-7", "--t-end", "1e6", "--max-steps",
                 "100000000000", "--json"},
                SIGTERM, "asked to terminate");
    expect_kept({"simulate", "fault", "--set", "elements=20", "--step", "1e-6", "--max-steps",
                 "100000000000", "--json", "--csv", "fault.csv"},
                SIGINT, "interrupted");
    EXPECT_TRUE(content(work() / "fault.csv").ends_with("\n# incomplete: interrupted\n"));
    expect_kept({"simulate", "fault", "--set", "rate_and_state=1", "elements=10", "--step", "1e-3",
                 "--max-steps", "100000000000", "--json"},
                SIGINT, "interrupted");
}

TEST_F(Robust, ComparisonsKeepTheMethodsThatWereRun)
{
    // The whole comparison takes three tenths of a second, the start of the program a few
    // milliseconds, or more on a busy machine.
    constexpr Milliseconds soon(60);
    expect_kept({"compare", "bouncing-ball", "--json", "--csv", "a.csv"}, SIGINT, "interrupted",
                soon);
    EXPECT_TRUE(content(work() / "a.csv").ends_with("\n# incomplete: interrupted\n"));
    expect_kept({"compare", "stick-slip", "--json"}, SIGTERM, "asked to terminate", soon);
}

TEST_F(Robust, EventsAreKeptWhenMemoryRunsShort)
{
    // A ball that never rests: a million impacts in every second.
    for (const bool as_json : {true, false}) {
        Words words = simulate({"--set", "restitution=1", "height=1e-6", "--t-end", "1e9",
                                "--max-steps", "1000000000000"});
        if (as_json) words.emplace_back("--json");
        const pid_t child = [&] {
            const Limited limited(RLIMIT_AS, rlim_t{200} << 20);
            return start(words);
        }();
        const Result result = wait_for(child);
        EXPECT_EQ(result.status, 1);
        EXPECT_NE(result.err.find("no memory was left for more"), std::string::npos) << result.err;
        EXPECT_GT(result.out.size(), 1'000'000U);
        if (!as_json) continue;
        const nlohmann::json all = nlohmann::json::parse(result.out);
        EXPECT_EQ(all["incomplete"], "no memory was left for more");
        EXPECT_GT(all["events"].size(), 10'000U);
    }
}

}  // namespace
}  // namespace ricochet::robustness_test
