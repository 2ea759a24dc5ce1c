// Files that are written whole or not at all.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string_view>

namespace ricochet::app {

/// A file could not be written although it seemed so: status 1.
class WriteError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Looks, before any work is done, whether a file of that name could be written.
/// Creates nothing.
/// @throws BadInput naming the option.
void check_writable(std::string_view option, const std::filesystem::path& file);

/// The same for models and checkpoints, which are renamed into place: only a file may be there.
/// @throws BadInput naming the option.
void check_replaceable(std::string_view option, const std::filesystem::path& file);

/// Writes a neighbouring file and renames it. Devices and pipes are written to.
/// @throws WriteError naming the file and what the system said.
void write_file(const std::filesystem::path& file, std::string_view content);

/// A new directory under the system's temporary one, removed with what is in it.
class TemporaryDirectory {
public:
    TemporaryDirectory();
    ~TemporaryDirectory();
    TemporaryDirectory(const TemporaryDirectory&) = delete;
    TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

private:
    std::filesystem::path path_;
};

}  // namespace ricochet::app
