// The part of an ensemble that a process runs.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

namespace ricochet::app {

/// Share number `index`, from 1, of `count`: block b of the table belongs to the share with
/// b mod count = index - 1.
struct Share {
    std::size_t index = 1;
    std::size_t count = 1;

    friend bool operator==(const Share&, const Share&) = default;
};

/// "3/16"
[[nodiscard]] std::string to_string(const Share& share);

/// "3/16" as a share.
/// @throws BadInput
[[nodiscard]] Share parse_share(const std::string& text);

/// An environment variable by name; null where it is not set.
using Environment = std::function<const char*(const char* name)>;

/// Share of this process according to its launcher: Open MPI's or PMI's rank, or else Slurm's,
/// within the task of a Slurm array. 1/1 without a launcher.
/// @throws BadInput for a rank without a size, or two that contradict each other.
[[nodiscard]] Share share_from(const Environment& environment);

/// The given share, or that of the launcher.
[[nodiscard]] Share chosen_share(const std::optional<std::string>& given);

}  // namespace ricochet::app
