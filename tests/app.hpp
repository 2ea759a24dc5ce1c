// The command line, run as a child process like a user's command.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/detect/named_detectors.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

extern char** environ;

namespace ricochet {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

/// Methods with an error estimate, and any others, by name.
inline Words steppers(Words others = {})
{
    for (const detail::NamedMethod& method : detail::named_methods) {
        if (method.estimates_error) others.emplace_back(method.spelled);
    }
    return others;
}

/// The detectors that every system may be run with.
inline Words detectors(Words others = {})
{
    others.insert(others.end(), detail::detector_names.begin(), detail::detector_names.end());
    return others;
}

inline std::string content(const fs::path& file)
{
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

struct Result {
    int status = -1;
    std::string out;
    std::string err;
};

/// Waits until the process has installed its handler of the signal, as it does when its work
/// begins, and then for the duration `work`, so that there is a result to keep.
inline void wait_for_handler(pid_t child, int signal, std::chrono::milliseconds work)
{
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < deadline) {
        const std::string status = content("/proc/" + std::to_string(child) + "/status");
        const std::size_t at = status.find("SigCgt:");
        if (at != std::string::npos &&
            (std::stoull(status.substr(at + 7), nullptr, 16) >> (signal - 1) & 1) != 0) {
            break;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::this_thread::sleep_for(work);
}

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

    /// Starts the program in `work()`, with its output going to files outside of it.
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

    using Milliseconds = std::chrono::milliseconds;

    /// A run that gets the signal some time after its work has started.
    [[nodiscard]] Result interrupted(const Words& words, int signal,
                                     Milliseconds after = Milliseconds(300)) const
    {
        const pid_t child = start(words);
        wait_for_handler(child, signal, after);
        kill(child, signal);
        return wait_for(child);
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
        // On a slow machine a message may say that the program is still running.
        const auto lines = std::count(result.err.begin(), result.err.end(), '\n');
        const bool patient = result.err.starts_with("ricochet: still running");
        EXPECT_EQ(lines, patient ? 2 : 1) << result.err;
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

inline Words simulate(const Words& more)
{
    Words words{"simulate", "bouncing-ball"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

/// The largest error of the event times in `run`, which must be the 13 impacts.
inline double largest_error(const nlohmann::json& run)
{
    EXPECT_EQ(run.at("events").size(), 13U);
    double largest = 0;
    for (std::size_t i = 0; i < run.at("events").size(); ++i) {
        const double exact = BouncingBall().impact_time(static_cast<int>(i), 10);
        largest = std::max(largest, std::fabs(run["events"][i]["t"].get<double>() - exact));
    }
    return largest;
}

}  // namespace ricochet
