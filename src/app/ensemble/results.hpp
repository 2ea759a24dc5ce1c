// The results of an ensemble as files.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "rows.hpp"

namespace ricochet::app {

/// Places of all blocks of an ensemble.
class AllBlocks {
public:
    /// @param blocks  number of blocks of the table
    explicit AllBlocks(std::size_t blocks) : places_(blocks) {}

    /// Adds the blocks of a file. A block that two files have is taken from the first.
    void add(const std::filesystem::path& file, const std::vector<BlockPlace>& blocks);

    [[nodiscard]] std::size_t size() const noexcept { return places_.size(); }
    [[nodiscard]] bool has(std::size_t block) const noexcept { return places_[block].file >= 0; }
    [[nodiscard]] std::string rows(std::size_t block) const;

private:
    struct Place {
        int file = -1;
        BlockPlace at;
    };

    std::vector<std::filesystem::path> files_;
    std::vector<Place> places_;
};

/// Writes results.npy, one structure a row, and results.csv, in the order of the table, from the
/// blocks of this number of shares. The same rows give the same bytes.
/// @throws WriteError
void write_results(const std::filesystem::path& directory, const std::vector<Field>& fields,
                   std::size_t rows, std::size_t shares, const AllBlocks& blocks);

}  // namespace ricochet::app
