// Tables as files: NumPy's .npy, CSV, and the checksum of a whole set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "studies/training_sets.hpp"

namespace ricochet::studies {

/// The bytes of a .npy file of version 1.0: float64, little-endian, rows x columns in C order.
[[nodiscard]] std::string to_npy(const TrainingSet& set);

/// A header line, `name [unit]` for each column (the unit 1 is omitted), and at most the first
/// `most_rows` rows of the set. Numbers have the fewest digits that give the same double again.
[[nodiscard]] std::string to_csv(const TrainingSet& set, std::size_t most_rows);

/// CRC-32 as in zip and zlib (ISO 3309).
[[nodiscard]] std::uint32_t crc32(std::string_view bytes);

/// "model,rows,columns,bytes,crc32", the first line of training_data/checksums.csv.
inline constexpr std::string_view checksum_header = "model,rows,columns,bytes,crc32";

/// A set as a line of that file, without its end.
/// @param npy  the bytes of `to_npy`
[[nodiscard]] std::string checksum_line(std::string_view model, const TrainingSet& set,
                                        std::string_view npy);

/// Writes a neighbouring file and renames it, so that the file is either complete or unchanged.
/// @throws std::runtime_error naming the file and the error of the system.
void write_whole(const std::filesystem::path& file, std::string_view bytes);

}  // namespace ricochet::studies
