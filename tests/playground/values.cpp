// Runs the playground's systems natively: a line of standard input is a system's number and its
// parameters. The output has a line for each run, its number of events and how it ended, and a line
// for each event, as `values.cjs` writes those of the module.
//
//     values [runs] < systems.txt     also prints the time of so many runs of the ball
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <sstream>
#include <string>

#include "../../examples/playground/play.hpp"

namespace {

void print_run(const std::string& line)
{
    std::istringstream words(line);
    int system = 0;
    words >> system;
    double* parameter = play_parameters();
    while (words >> *parameter) ++parameter;
    const int events = play_run(system, 0);
    std::printf("%d %s\n", events, play_message());
    const auto* event = reinterpret_cast<const playground::PlayEvent*>(play_events());
    for (int k = 0; k < events; ++k, ++event) {
        std::printf("%.17g %g %.17g %.17g %.17g %.17g\n", event->t, event->label, event->exact,
                    event->at, event->before, event->after);
    }
}

/// Writes how long a run of the ball through 13 impacts takes [us], to standard error.
void time_runs(int runs)
{
    std::ranges::copy(std::array{9.81, 0.9, 10.0, 0.0, 20.5}, play_parameters());
    const auto start = std::chrono::steady_clock::now();
    const double events = play_time_of_runs(0, runs);
    const std::chrono::duration<double, std::micro> time = std::chrono::steady_clock::now() - start;
    std::fprintf(stderr, "%.2f us for %g impacts\n", time.count() / runs, events / runs);
}

}  // namespace

int main(int argc, char** argv)
{
    std::string line;
    while (std::getline(std::cin, line)) print_run(line);
    if (argc > 1) time_runs(std::stoi(argv[1]));
}
