// `ricochet simulate MODEL.fmu` and `ricochet fmu MODEL.fmu`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace ricochet::app {

struct FmuRequest {
    std::string file{};
    std::vector<std::string> words{};  ///< of `fmu`: [check] MODEL, or export SYSTEM
    std::vector<std::string> set{};    ///< name=value
    std::vector<std::string> watch{};  ///< name=level
    std::optional<double> t_start{}, t_end{}, rtol{}, step{};
    std::optional<std::string> method{}, output{};  ///< `output`: names with commas between them
    std::optional<std::filesystem::path> input{}, csv{}, plot{};
    std::optional<std::size_t> samples{};
    std::optional<std::uint64_t> max_steps{};
    bool json = false, co_simulation = false;
    std::optional<std::filesystem::path> out{};  ///< of `export`
    std::uint64_t version = 3;                   ///< of FMI, of `export`
};

/// Prints the run of an FMU, and writes the requested files. @return as `simulate`
int simulate_fmu(const FmuRequest& request);

/// Prints what an FMU is; with `check` before it, its faults; with `export`, writes that of a
/// ready system. @return 1 if it has faults
int describe_fmu(const FmuRequest& request);

}  // namespace ricochet::app
