// The part of an ensemble that a process runs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>

namespace ricochet::app {

/// Rows that are kept together.
inline constexpr std::size_t block_rows = 64;

/// Share number `index`, from 1, of `count`: row i of the table belongs to the share with
/// i mod count = index - 1, so that expensive rows next to each other are divided among all.
struct Share {
    std::size_t index = 1;
    std::size_t count = 1;

    friend bool operator==(const Share&, const Share&) = default;
};

/// The blocks of a table that is run by `shares`: block b has rows of share b mod shares + 1, which
/// are `shares` apart.
class Blocks {
public:
    Blocks(std::size_t rows, std::size_t shares) : rows_(rows), shares_(shares) {}

    [[nodiscard]] std::size_t size() const noexcept
    {
        const std::size_t together = block_rows * shares_;
        return rows_ / together * shares_ + std::min(rows_ % together, shares_);
    }
    /// Number of rows in a block.
    [[nodiscard]] std::size_t rows_of(std::size_t block) const noexcept
    {
        const std::size_t first = row(block, 0);
        return std::min(block_rows, (rows_ - first + shares_ - 1) / shares_);
    }
    /// Number in the table of row i of a block.
    [[nodiscard]] std::size_t row(std::size_t block, std::size_t i) const noexcept
    {
        return (block / shares_ * block_rows + i) * shares_ + block % shares_;
    }

private:
    std::size_t rows_, shares_;
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
