#include "files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "input.hpp"
#include "interrupt.hpp"
#include "say.hpp"

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

/// The file itself if the name is a link to it, so that the link stays; it need not exist.
fs::path behind_links(const fs::path& file)
{
    constexpr int most = 40;  // as many as the system follows
    std::error_code error;
    fs::path target = fs::absolute(file, error);
    for (int i = 0; i < most && fs::is_symlink(fs::symlink_status(target, error)); ++i) {
        target = target.parent_path() / fs::read_symlink(target, error);
    }
    const fs::path directory = fs::weakly_canonical(target.parent_path(), error);
    if (error) return file;
    const fs::path found = directory / target.filename();
    // The link of a descriptor, such as /dev/stdout, to a pipe names no file.
    const bool is_pipe =
        !fs::exists(found, error) && fs::exists(file, error) && !fs::is_regular_file(file, error);
    return is_pipe ? file : found;
}

mode_t creation_mask()
{
    const mode_t mask = umask(0);
    umask(mask);
    return mask;
}

}  // namespace

bool write_all(int descriptor, std::string_view content)
{
    while (!content.empty()) {
        const ssize_t n = ::write(descriptor, content.data(), content.size());
        if (n < 0 && errno != EINTR) return false;
        if (n > 0) content.remove_prefix(static_cast<std::size_t>(n));
    }
    return true;
}

namespace {

/// Longest name of a file beside which another is written first: a model needs
/// 15 characters more.
std::size_t longest_name(const fs::path& directory)
{
    constexpr long beside = 16;
    const long most = pathconf(directory.c_str(), _PC_NAME_MAX);
    return static_cast<std::size_t>(std::max(most < 0 ? 255L : most, beside) - beside);
}

[[noreturn]] void refuse_to_write(std::string_view option, const fs::path& file,
                                  std::string_view why)
{
    throw BadInput(fmt::format("{} must be a file that can be written, got '{}': {}", option,
                               shortened(file.string()), why));
}

/// @throws BadInput unless a file of that name could be written.
void check_writable(std::string_view option, const fs::path& file, bool only_files)
{
    const auto refuse = [&](std::string_view why) { refuse_to_write(option, file, why); };
    if (!file.has_filename()) refuse("it names no file");
    const fs::path target = behind_links(file);
    const fs::path directory = directory_of(target);
    if (target.filename().string().size() > longest_name(directory)) refuse("its name is too long");
    std::error_code error;
    const fs::file_status status = fs::status(target, error);
    if (fs::is_directory(status)) refuse("it is a directory");
    if (status.type() == fs::file_type::none) refuse(error.message());
    if (!fs::is_directory(directory, error)) {
        refuse(fmt::format("there is no directory '{}'", shortened(directory.string())));
    }
    if (fs::exists(status) && access(target.c_str(), W_OK) != 0) refuse(last_error());
    const bool regular = !fs::exists(status) || fs::is_regular_file(status);
    if (regular && access(directory.c_str(), W_OK | X_OK) != 0) refuse(last_error());
    if (only_files && !regular) {
        throw BadInput(fmt::format("{} must be a file, got '{}', which is something else", option,
                                   file.string()));
    }
}

bool is_device(const fs::path& file)
{
    std::error_code error;
    return fs::exists(file, error) && !fs::is_regular_file(file, error);
}

/// Opens a device for writing. It waits for a reader of a pipe until an interrupt: the system would
/// wait on. Below 0: errno gives the reason.
int open_device(const fs::path& device)
{
    constexpr std::chrono::milliseconds often(20);
    bool said = false;
    for (;;) {
        const int descriptor = open(device.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
        if (descriptor >= 0) {
            fcntl(descriptor, F_SETFL, fcntl(descriptor, F_GETFL) & ~O_NONBLOCK);
            return descriptor;
        }
        if (errno != ENXIO || !fs::is_fifo(device) || Interrupts::any()) return descriptor;
        if (!std::exchange(said, true)) {
            say("ricochet: waiting for somebody to read '{}'\n", device.string());
        }
        std::this_thread::sleep_for(often);
    }
}

bool same_file(const fs::path& a, const fs::path& b)
{
    std::error_code error;
    return a == b || fs::equivalent(a, b, error);
}

/// Whether the report is printed to this file, which would take its place.
bool is_standard_output(const fs::path& file)
{
    struct stat printed = {};
    struct stat other = {};
    return fstat(STDOUT_FILENO, &printed) == 0 && S_ISREG(printed.st_mode) &&
           stat(file.c_str(), &other) == 0 && printed.st_dev == other.st_dev &&
           printed.st_ino == other.st_ino;
}

}  // namespace

void Claims::add(std::string_view option, const fs::path& file, bool written)
{
    const fs::path target = behind_links(file);
    if (written && is_standard_output(target)) {
        throw BadInput(
            fmt::format("{} and the standard output must be two files, got '{}' for both", option,
                        file.string()));
    }
    for (const Claim& other : claims_) {
        if (!written && !other.written) continue;
        if (!same_file(target, other.file) || is_device(target)) continue;
        throw BadInput(fmt::format("{} and {} must be two files, got '{}' for both", other.option,
                                   option, file.string()));
    }
    claims_.push_back({.option = std::string(option), .file = target, .written = written});
}

void Claims::reads(std::string_view option, const fs::path& file)
{
    add(option, file, false);
}

void Claims::writes(std::string_view option, const fs::path& file)
{
    check_writable(option, file, false);
    add(option, file, true);
}

void Claims::replaces(std::string_view option, const fs::path& file)
{
    check_writable(option, file, true);
    add(option, file, true);
}

void Claims::keeps(std::string_view option, const fs::path& file, bool resume)
{
    replaces(option, file);
    fs::path part = file;
    part += ".part";
    add(fmt::format("the part of {}", option), part, true);
    std::error_code error;
    const bool there = fs::exists(file, error);
    if (resume && !there) {
        throw BadInput(
            fmt::format("there is no checkpoint '{}' to resume: it cannot be read", file.string()));
    }
    if (!resume && there) {
        throw BadInput(
            fmt::format("'{}' keeps an earlier training or proof: --resume continues from it; to "
                        "start again, remove it",
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
    if (is_device(target)) {
        const int descriptor = open_device(target);
        if (descriptor < 0) fail();
        const bool written = write_all(descriptor, content);
        const int why = errno;
        const bool closed = close(descriptor) == 0;
        if (!written) errno = why;
        if (!written || !closed) fail();
        return;
    }
    NewFile out(file);
    out.write(content);
    out.keep();
}

NewFile::NewFile(const fs::path& file)
    : file_(file), target_(behind_links(file)), name_(target_.string() + ".XXXXXX")
{
    descriptor_ = mkstemp(name_.data());
    if (descriptor_ < 0) fail();
}

NewFile::~NewFile()
{
    if (descriptor_ >= 0) close(descriptor_);
    if (!name_.empty()) unlink(name_.c_str());
}

void NewFile::fail() const
{
    throw WriteError(fmt::format("cannot write '{}': {}", file_.string(), last_error()));
}

void NewFile::write(std::string_view content)
{
    if (!write_all(descriptor_, content)) fail();
}

void NewFile::keep()
{
    if (fchmod(descriptor_, 0666 & ~creation_mask()) != 0) fail();
    if (close(std::exchange(descriptor_, -1)) != 0) fail();
    if (std::rename(name_.c_str(), target_.c_str()) != 0) fail();
    name_.clear();
}

void deliver(std::initializer_list<std::function<void()>> parts)
{
    std::exception_ptr first;
    for (const auto& part : parts) {
        try {
            part();
        } catch (...) {
            if (!first) first = std::current_exception();
        }
    }
    if (first) std::rethrow_exception(first);
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
