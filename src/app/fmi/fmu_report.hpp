// Reports on FMUs and their runs: as text, as JSON, as rows of numbers, as a picture.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ricochet/fmi/check.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::app {

/// A run of an FMU, with what was asked for and how long it took.
struct FmuRun {
    const fmi::Description& fmu;
    const fmi::Options& options;
    const fmi::Run& run;
    double seconds = 0;
};

[[nodiscard]] std::string fmu_run_text(const FmuRun& run);
/// @param with_trajectory  the recorded rows too
[[nodiscard]] std::string fmu_run_json(const FmuRun& run, bool with_trajectory);
/// Header "t [s],h [m],...,event", then the recorded rows.
[[nodiscard]] std::string fmu_run_csv(const FmuRun& run);
/// Every recorded variable against time.
/// @throws WriteError as `plot`
void plot_fmu_run(const FmuRun& run, const std::filesystem::path& file);

/// What an FMU is.
[[nodiscard]] std::string fmu_text(const fmi::Fmu& fmu);
[[nodiscard]] std::string fmu_json(const fmi::Fmu& fmu);

[[nodiscard]] std::string findings_text(const std::vector<fmi::Finding>& findings);
[[nodiscard]] std::string findings_json(const std::vector<fmi::Finding>& findings);

}  // namespace ricochet::app
