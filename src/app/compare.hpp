// `ricochet compare`: every detector on one system, against the exact event times.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace ricochet::app {

struct CompareRequest {
    std::string system{};
    std::vector<std::string> set{};   ///< name=value
    std::optional<std::string> of{};  ///< system, of step-control
    bool json = false;
    std::optional<std::filesystem::path> csv{};
};

/// Prints the event times of every method beside the exact ones, then what each
/// method made of them and what it cost. The answers are checked before the clock
/// counts.
/// An interrupt leaves the methods that were run by then.
/// @return 0 if every method found every event, else 1.
/// @throws BadInput or ModelError before anything is printed or written.
int compare(const CompareRequest& request);

}  // namespace ricochet::app
