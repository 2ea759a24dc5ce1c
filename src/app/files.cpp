#include "files.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <string>
#include <system_error>

#include "input.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

std::string last_error()
{
    return std::generic_category().message(errno);
}

/// The directory that holds `file`.
fs::path directory_of(const fs::path& file)
{
    return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

/// The file itself where the name is a link to it, so that the link stays.
fs::path behind_links(const fs::path& file)
{
    std::error_code error;
    const fs::path resolved = fs::weakly_canonical(file, error);
    return error ? file : resolved;
}

mode_t creation_mask()
{
    const mode_t mask = umask(0);
    umask(mask);
    return mask;
}

/// Writes everything to an open file; false: errno says why not.
bool write_all(int descriptor, std::string_view content)
{
    while (!content.empty()) {
        const ssize_t n = ::write(descriptor, content.data(), content.size());
        if (n < 0 && errno != EINTR) return false;
        if (n > 0) content.remove_prefix(static_cast<std::size_t>(n));
    }
    return true;
}

}  // namespace

void check_writable(std::string_view option, const fs::path& file)
{
    const auto refuse = [&](const std::string& why) {
        throw BadInput(fmt::format("{} must be a file that can be written, got '{}': {}", option,
                                   file.string(), why));
    };
    if (!file.has_filename()) refuse("it names no file");
    const fs::path target = behind_links(file);
    std::error_code error;
    if (fs::is_directory(target, error)) refuse("it is a directory");
    const fs::path directory = directory_of(target);
    if (!fs::is_directory(directory, error)) {
        refuse(fmt::format("there is no directory '{}'", directory.string()));
    }
    if (fs::exists(target, error) && access(target.c_str(), W_OK) != 0) refuse(last_error());
    const bool regular = !fs::exists(target, error) || fs::is_regular_file(target, error);
    if (regular && access(directory.c_str(), W_OK | X_OK) != 0) refuse(last_error());
}

void check_replaceable(std::string_view option, const fs::path& file)
{
    check_writable(option, file);
    std::error_code error;
    const fs::path target = behind_links(file);
    if (fs::exists(target, error) && !fs::is_regular_file(target, error)) {
        throw BadInput(fmt::format("{} must be a file, got '{}', which is something else", option,
                                   file.string()));
    }
}

void write_file(const fs::path& file, std::string_view content)
{
    const auto fail = [&] {
        throw WriteError(fmt::format("cannot write '{}': {}", file.string(), last_error()));
    };
    const fs::path target = behind_links(file);
    std::error_code error;
    if (fs::exists(target, error) && !fs::is_regular_file(target, error)) {
        std::ofstream out(target, std::ios::binary);
        if (!(out << content << std::flush)) fail();
        return;
    }
    std::string name = target.string() + ".XXXXXX";
    const int descriptor = mkstemp(name.data());
    if (descriptor < 0) fail();
    const bool written =
        write_all(descriptor, content) && fchmod(descriptor, 0666 & ~creation_mask()) == 0;
    const int why = errno;
    const bool closed = close(descriptor) == 0;
    if (!written || !closed || std::rename(name.c_str(), target.c_str()) != 0) {
        if (!written) errno = why;
        const int reason = errno;
        unlink(name.c_str());
        errno = reason;
        fail();
    }
}

TemporaryDirectory::TemporaryDirectory()
{
    std::string name = (fs::temp_directory_path() / "ricochet-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
        throw WriteError(fmt::format("cannot make the directory '{}': {}", name, last_error()));
    }
    path_ = name;
}

TemporaryDirectory::~TemporaryDirectory()
{
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

}  // namespace ricochet::app
