// What each part of the library must show, as checks that can be run.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace ricochet::bench {

/// What a check found.
struct Measured {
    bool pass = false;
    std::string text;                    ///< the figure, in one line
    std::vector<std::string> details{};  ///< printed below it
};

struct Check {
    int part = 0;
    std::string id;        ///< e.g. "b1-rk4"
    std::string sentence;  ///< what is claimed
    std::string target;
    std::function<Measured()> run;
    bool required = true;  ///< false: a wish, which does not fail the run
};

/// The bouncing ball, end to end.
[[nodiscard]] std::vector<Check> checks_of_part_1();

/// The network: kernels, models, training, gate.
[[nodiscard]] std::vector<Check> checks_of_part_2();

/// Whether every state type gives the same events, bit for bit.
[[nodiscard]] Measured compare_state_types();

/// The observed order of convergence of every stepper, through events.
[[nodiscard]] Measured observe_orders();

/// The cost of one evaluation, against hand-written kernels.
[[nodiscard]] Measured time_inference();

/// Whether every kernel returns the same bytes.
[[nodiscard]] Measured compare_instruction_sets();

/// Whether the verified gate returns the bits of its exact detector.
[[nodiscard]] Measured compare_verified();

/// The cost of one step with each detector.
[[nodiscard]] Measured compare_detectors();

}  // namespace ricochet::bench
