// Measures the savings of trained gates: ricochet_measure_gates [d4] [d6] [f] [g], all by default.
#include <fmt/format.h>

#include <cstdio>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "measure_gates.hpp"

int main(int argc, char** argv)
{
    using namespace ricochet::bench;
    const std::vector<std::string> wanted(argv + 1, argv + argc);
    const std::vector<std::pair<std::string, std::function<Measured()>>> known{
        {"d4", [] { return gate_black_box_4(); }},
        {"d6", [] { return gate_black_box_6(); }},
        {"f", [] { return gate_eigenvalue(1.3); }},
        {"f", [] { return gate_eigenvalue(1.55); }},
        {"g", [] { return gate_without_bounds(); }}};
    for (const auto& [name, run] : known) {
        bool chosen = wanted.empty();
        for (const std::string& word : wanted) chosen = chosen || word == name;
        if (!chosen) continue;
        const Measured found = run();
        fmt::print("{:<3} {}: {}\n", name, found.pass ? "reached" : "not reached", found.text);
        for (const std::string& line : found.details) fmt::print("      {}\n", line);
        std::fflush(stdout);
    }
    return 0;
}
