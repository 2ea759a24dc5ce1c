// stress_tests: classes of stress, in the short form or, with --long, in the long one.
//
//     stress_tests [--long] [--seed <n>] [class ...]
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "stress.hpp"

namespace {

using namespace ricochet::stress;

struct Class {
    std::string_view name;
    Tally (*run)(const Size&);
};

constexpr Class classes[] = {
    {"bounces", bounces},         {"scales", scales}, {"poison", poison}, {"rates", rates},
    {"bounds", bounds},           {"memory", memory}, {"saves", saves},   {"cancels", cancels},
    {"oscillators", oscillators}, {"crowds", crowds}};

using Clock = std::chrono::steady_clock;

/// The class that runs, since when, and how many lines of progress there were.
struct Running {
    const char* name = "";
    Clock::time_point start;
    int shown = 0;

    [[nodiscard]] double seconds() const
    {
        return std::chrono::duration<double>(Clock::now() - start).count();
    }
} running;

bool run(const Class& of, const Size& size)
{
    running = {of.name.data(), Clock::now()};
    const Tally tally = of.run(size);
    if (running.shown > 0) std::fprintf(stderr, "\r%60s\r", "");
    std::printf("%-12s %10llu cases, %llu wrong%s%s  (%.1f s)\n", of.name.data(),
                static_cast<unsigned long long>(tally.cases),
                static_cast<unsigned long long>(tally.wrong), tally.said.empty() ? "" : "; ",
                tally.said.c_str(), running.seconds());
    for (const std::string& line : tally.first_wrong) std::printf("    %s\n", line.c_str());
    std::fflush(stdout);
    return tally.wrong == 0 && tally.cases > 0;
}

}  // namespace

void ricochet::stress::show(std::uint64_t cases)
{
    static const bool terminal = isatty(STDERR_FILENO) != 0;
    if (!terminal || running.seconds() < running.shown + 1) return;
    running.shown = static_cast<int>(running.seconds());
    std::fprintf(stderr, "\r%-12s %10llu cases, %.0f a second", running.name,
                 static_cast<unsigned long long>(cases),
                 static_cast<double>(cases) / running.seconds());
}

int main(int argc, char** argv)
{
    Size size;
    bool all = true;
    bool fine = true;
    for (int i = 1; i < argc; ++i) {
        const std::string_view word = argv[i];
        if (word == "--long") {
            size.long_form = true;
        } else if (word == "--seed" && i + 1 < argc) {
            size.seed = std::strtoull(argv[++i], nullptr, 10);
        } else {
            all = false;
            bool known = false;
            for (const Class& of : classes) {
                if (of.name != word) continue;
                known = true;
                fine &= run(of, size);
            }
            if (!known) {
                std::fprintf(stderr, "stress_tests: no class '%s'\n", argv[i]);
                return 2;
            }
        }
    }
    if (all) {
        for (const Class& of : classes) fine &= run(of, size);
    }
    return fine ? 0 : 1;
}
