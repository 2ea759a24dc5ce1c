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
    std::optional<std::string> of{};  ///< the system, for step-control
    bool json = false;
    std::optional<std::filesystem::path> csv{};
};

/// Prints the event times of every method beside the exact ones, then the accuracy
/// and the cost of each method. The answers are checked before times are
/// measured.
/// An interrupt leaves the methods that had run by then.
/// @return 0 if every method found every event, else 1.
/// @throws BadInput or ModelError before anything is printed or written.
int compare(const CompareRequest& request);

}  // namespace ricochet::app
