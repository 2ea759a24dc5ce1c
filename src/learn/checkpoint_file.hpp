// Numbers in a file that is either whole or absent.
//
// The first line identifies the file; then come numbers as their bits,
// little-endian, and a checksum of them.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::learn {

/// FNV-1a of 64 bits.
[[nodiscard]] std::uint64_t checksum(std::string_view bytes) noexcept;

/// Numbers and lists of them, as bytes.
class Writer {
public:
    void put(std::uint64_t value);
    void put(double value) { put(std::bit_cast<std::uint64_t>(value)); }
    void put(float value);

    template <class Number>
    void put(const std::vector<Number>& values)
    {
        put(std::uint64_t{values.size()});
        for (const Number& value : values) put(value);
    }

    [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }

private:
    std::string bytes_;
};

/// Reads the values given to a `Writer`, in the same order.
/// Every `get` throws std::runtime_error naming the file if it is cut short.
class Reader {
public:
    Reader(std::string_view bytes, const std::filesystem::path& file) : bytes_(bytes), file_(file)
    {
    }

    void get(std::uint64_t& value);
    void get(double& value);
    void get(float& value);

    template <class Number>
    void get(std::vector<Number>& values)
    {
        values.resize(length(sizeof(Number) < 8 ? sizeof(Number) : 8));
        for (Number& value : values) get(value);
    }

    /// @throws std::runtime_error naming the file if something is left.
    void finish() const;

private:
    /// Length of a list of numbers of at least `least_bytes` each.
    [[nodiscard]] std::size_t length(std::size_t least_bytes);

    std::string_view bytes_;
    const std::filesystem::path& file_;
};

/// Throws std::runtime_error: checkpoint '<file>' <what>.
[[noreturn]] void refuse_checkpoint(const std::filesystem::path& file, const std::string& what);

/// Writes to a neighbouring file and renames it, so that an interruption leaves
/// the old file or the new one, never half of one.
/// @throws std::runtime_error naming the file if it cannot be written.
void write_checkpoint(std::string_view first_line, const Writer& writer,
                      const std::filesystem::path& file);

/// Saves a training to its checkpoint repeatedly. A disk that fills up later does not end the
/// training: the failure is remembered, and the next checkpoint is another attempt.
class Keeper {
public:
    /// @param file  empty: nothing is kept
    /// @throws std::runtime_error naming the file if it could not be written now
    explicit Keeper(const std::filesystem::path& file);

    /// Calls `save`, which writes the checkpoint.
    template <class Save>
    void operator()(const Save& save)
    {
        if (!keeps_) return;
        try {
            save();
            trouble_.clear();
        } catch (const std::runtime_error& error) {
            trouble_ = error.what();
        }
    }

    /// The reason why the last checkpoint could not be written; empty if it was.
    [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }

private:
    bool keeps_;
    std::string trouble_{};
};

/// The bytes between the first line and the checksum.
/// @throws std::runtime_error naming the file if it cannot be read, begins with
///         another line, is cut short or has been altered.
[[nodiscard]] std::string read_checkpoint(std::string_view first_line,
                                          const std::filesystem::path& file);

}  // namespace ricochet::learn
