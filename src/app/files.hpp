// Files that are written whole or not at all.
#pragma once

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::app {

/// A file could not be written although it seemed possible: status 1.
class WriteError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// The files of one command, claimed before any work is done: a file that it reads is not written,
/// and none is written twice. Creates nothing. All functions throw BadInput naming the options.
class Claims {
public:
    /// A model or a kernel.
    void reads(std::string_view option, const std::filesystem::path& file);

    /// A file that could be written now, or a device or a pipe.
    void writes(std::string_view option, const std::filesystem::path& file);

    /// The same for models, which are renamed into place: only a file may exist there.
    void replaces(std::string_view option, const std::filesystem::path& file);

    /// File for an interrupted training or proof: it must not exist, unless it is to `resume`.
    void keeps(std::string_view option, const std::filesystem::path& file, bool resume);

private:
    struct Claim {
        std::string option;
        std::filesystem::path file;
        bool written;
    };

    void add(std::string_view option, const std::filesystem::path& file, bool written);

    std::vector<Claim> claims_;
};

/// Writes everything to an open file; false: errno gives the reason.
[[nodiscard]] bool write_all(int descriptor, std::string_view content);

/// A file that is written piece by piece beside the one that it finally replaces.
/// All functions throw WriteError naming the file and the system's message.
class NewFile {
public:
    explicit NewFile(const std::filesystem::path& file);
    ~NewFile();
    NewFile(const NewFile&) = delete;
    NewFile& operator=(const NewFile&) = delete;

    void write(std::string_view content);
    /// Replaces the file. Without this call the new one is removed.
    void keep();

private:
    [[noreturn]] void fail() const;

    std::filesystem::path file_, target_;
    std::string name_;
    int descriptor_ = -1;
};

/// Writes a neighbouring file and renames it; writes directly to devices and pipes.
/// @throws WriteError naming the file and the system's message.
void write_file(const std::filesystem::path& file, std::string_view content);

/// Calls all functions of a list, even if some fail, and then throws the first exception: results
/// are not lost with the first file that cannot be written.
void deliver(std::initializer_list<std::function<void()>> parts);

/// A new directory under the system's temporary one, removed with its contents.
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
