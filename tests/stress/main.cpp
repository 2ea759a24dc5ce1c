// stress_tests: classes of stress, in the short form or, with --long, in the long one.
//
//     stress_tests [--long] [--seed <n>] [class ...]
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

bool run(const Class& of, const Size& size)
{
    const auto start = std::chrono::steady_clock::now();
    const Tally tally = of.run(size);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    std::printf("%-12s %10llu cases, %llu wrong%s%s  (%.1f s)\n", of.name.data(),
                static_cast<unsigned long long>(tally.cases),
                static_cast<unsigned long long>(tally.wrong), tally.said.empty() ? "" : "; ",
                tally.said.c_str(), elapsed.count());
    for (const std::string& line : tally.first_wrong) std::printf("    %s\n", line.c_str());
    std::fflush(stdout);
    return tally.wrong == 0 && tally.cases > 0;
}

}  // namespace

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
