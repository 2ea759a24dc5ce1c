// The stored runs of an ensemble: rows of fields, in blocks, in a file for each share.
//
// A file begins with a line of JSON, its set-up, followed by blocks, each with its number and
// a checksum. Blocks are appended whole, so that a process which is killed loses only the blocks
// that it has not finished.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../json_text.hpp"
#include "share.hpp"

namespace ricochet::app {

/// Type of a field of a row: a whole number, a number, or a text.
enum class FieldKind { count, number, text };

struct Field {
    std::string name;
    std::string unit;
    FieldKind kind = FieldKind::number;
    /// Characters of a text in a table of NumPy; 0: the field is not in that table.
    std::size_t width = 0;
};

[[nodiscard]] Json to_json(const std::vector<Field>& fields);
/// @throws nlohmann::json::exception for anything other than the results of `to_json`.
[[nodiscard]] std::vector<Field> fields_from(const Json& json);

/// A row as bytes, to which fields are appended in their order.
class RowWriter {
public:
    explicit RowWriter(std::string& out) : out_(out) {}

    void count(std::uint64_t value) { put(&value, sizeof value); }
    void number(double value) { put(&value, sizeof value); }
    void text(std::string_view value);

private:
    void put(const void* from, std::size_t bytes)
    {
        out_.append(static_cast<const char*>(from), bytes);
    }

    std::string& out_;
};

/// Reads the fields of rows, one after another, from bytes.
class RowReader {
public:
    explicit RowReader(std::string_view bytes) : rest_(bytes) {}

    [[nodiscard]] bool is_at_end() const noexcept { return rest_.empty(); }
    /// These throw std::runtime_error where the bytes end too early.
    [[nodiscard]] std::uint64_t count();
    [[nodiscard]] double number();
    [[nodiscard]] std::string_view text();

private:
    std::string_view take(std::size_t bytes);

    std::string_view rest_;
};

/// Place of a block in its file.
struct BlockPlace {
    std::uint64_t block = 0;
    std::uint64_t offset = 0;  ///< of its rows
    std::uint64_t bytes = 0;
};

/// Content of a share's file. Bytes after the last whole block are no part of it.
struct ShareContent {
    std::filesystem::path file;
    Json setup;
    std::vector<BlockPlace> blocks;
    std::uint64_t end = 0;  ///< of the last whole block
};

/// @param each  called with the rows of every block
/// @throws BadInput naming the file, if it is no file of a share or cannot be read.
[[nodiscard]] ShareContent read_share(const std::filesystem::path& file,
                                      const std::function<void(std::string_view rows)>& each);

/// The rows of a block.
/// @throws std::runtime_error if the file has changed.
[[nodiscard]] std::string read_block(const std::filesystem::path& file, const BlockPlace& place);

/// "share-3-of-16.rows"
[[nodiscard]] std::string file_name(const Share& share);

/// The shares whose files are in a directory, in their order.
[[nodiscard]] std::vector<Share> shares_in(const std::filesystem::path& directory);

/// First difference between two set-ups, as part of a sentence, such as "rtol is 1e-08 there, and
/// 1e-10 here"; empty if there is none.
[[nodiscard]] std::string difference(const Json& there, const Json& here);

/// The file of the share that this process runs, locked against other processes during the life of
/// this object.
class ShareFile {
public:
    /// Continues an existing file, or creates one.
    /// @throws BadInput if it has another set-up or is in use, WriteError
    ShareFile(const std::filesystem::path& directory, const Share& share, const Json& setup,
              const std::function<void(std::string_view rows)>& each);
    ~ShareFile();
    ShareFile(const ShareFile&) = delete;
    ShareFile& operator=(const ShareFile&) = delete;

    [[nodiscard]] const std::vector<BlockPlace>& blocks() const noexcept { return blocks_; }

    /// @throws WriteError
    void append(std::uint64_t block, std::string_view rows);

private:
    void begin(std::string_view first_line);
    [[noreturn]] void fail() const;

    std::filesystem::path file_;
    int descriptor_ = -1;
    std::vector<BlockPlace> blocks_;
    std::uint64_t end_ = 0;
};

}  // namespace ricochet::app
