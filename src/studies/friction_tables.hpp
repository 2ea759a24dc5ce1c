// Tables 3 and 4 of the study of learned friction: fixed steps on 77 sliders.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "friction_study.hpp"

namespace ricochet::app {

/// The fixed steps, as the paper names them.
inline constexpr std::array<std::string_view, 6> study_step_names{"2^-13.5", "2^-13",   "2^-12.5",
                                                                  "2^-12",   "2^-11.5", "2^-11"};
/// [s] The steps taken, within a hundredth of those.
[[nodiscard]] std::vector<double> study_step_lengths();

/// A row of a table, one value for each step.
struct StudyRow {
    std::string name;
    std::array<double, std::size(learn::study_steps)> value{};
    bool published = false;
};

struct StabilityTables {
    std::vector<StudyRow> unstable;    ///< table 3: share of the sliders
    std::vector<StudyRow> mean_error;  ///< table 4: of the sliders that are stable at every step
    std::vector<StudyRow> deviation;   ///< table 4: standard deviation over the same sliders
};

/// Methods for which columns are computed.
struct StudyMethods {
    bool variational = true;       ///< orders 1, 2 and 4
    bool explicit_steps = true;    ///< RK4 in both forms
    bool functional = true;        ///< Adams' method in theta
    bool functional_pair = false;  ///< Adams' method, the form of the exact pair
    bool plain_newton = true;      ///< backward Euler
};

/// The published rows, then ours on one in `every` of the 77 `slider_cases(1)`. An interrupt leaves
/// the methods that were run by then.
[[nodiscard]] StabilityTables stability_tables(const StudyMethods& methods = {},
                                               std::size_t every = 1);

}  // namespace ricochet::app
