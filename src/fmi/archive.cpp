// Unpacking of archives that others have written. Nothing is written outside of the folder, nothing
// but regular files and folders is made, and no more is unpacked than a model needs.
#include <fmt/format.h>
#include <minizip/unzip.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <unordered_set>
#include <vector>

#include "fmi/unpacked.hpp"

namespace ricochet::fmi {

namespace {

namespace fs = std::filesystem;

// Limits of what is unpacked: libraries of large models have some 100 MB, and deflate packs a
// thousand zeros in one byte, which no library comes near.
constexpr std::uint64_t most_bytes = std::uint64_t{4} << 30;
constexpr std::uint64_t most_entries = 100'000;
constexpr std::uint64_t most_ratio = 200;
constexpr std::uint64_t small_file = std::uint64_t{1} << 20;  // may have any ratio

class Archive {
public:
    explicit Archive(const fs::path& file) : file_(file.string())
    {
        std::error_code error;
        if (!fs::is_regular_file(file, error)) {
            throw Error(fmt::format("{}: {}", file_, error ? error.message() : "is not a file"));
        }
        zip_ = unzOpen64(file.c_str());
        if (zip_ == nullptr) fail("is no zip archive, which an FMU is");
    }
    ~Archive()
    {
        if (zip_ != nullptr) unzClose(zip_);
    }
    Archive(const Archive&) = delete;
    Archive& operator=(const Archive&) = delete;

    void unpack(const fs::path& folder)
    {
        int status = unzGoToFirstFile(zip_);
        for (std::uint64_t entries = 0; status == UNZ_OK; ++entries) {
            if (entries == most_entries) {
                fail(fmt::format("has more than {} entries", most_entries));
            }
            unpack_entry(folder);
            status = unzGoToNextFile(zip_);
        }
        if (status != UNZ_END_OF_LIST_OF_FILE) fail("is damaged: its list of entries ends early");
    }

private:
    [[noreturn]] void fail(std::string_view what) const
    {
        throw Error(fmt::format("{}: {}", file_, what));
    }

    void unpack_entry(const fs::path& folder)
    {
        const unz_file_info64 info = next_name();
        check_name();
        constexpr unsigned made_by_unix = 3;
        const auto mode = static_cast<unsigned>(info.external_fa >> 16);
        if (info.version >> 8 == made_by_unix && (mode & S_IFMT) != 0 && !S_ISREG(mode) &&
            !S_ISDIR(mode)) {
            fail(fmt::format("entry '{}' is a link or a device; expected files", name_));
        }
        if ((info.flag & 1) != 0) fail(fmt::format("entry '{}' is encrypted", name_));
        if (name_.back() == '/' || !is_needed()) return;
        if (!seen_.insert(name_).second) fail(fmt::format("has the entry '{}' twice", name_));
        if (info.uncompressed_size > small_file &&
            info.uncompressed_size / most_ratio > info.compressed_size) {
            fail(fmt::format("entry '{}' has {} bytes, packed in {}: too much for a model", name_,
                             info.uncompressed_size, info.compressed_size));
        }
        write(folder / name_, info.uncompressed_size);
    }

    unz_file_info64 next_name()
    {
        unz_file_info64 info{};
        std::vector<char> name(1 << 16);
        if (unzGetCurrentFileInfo64(zip_, &info, name.data(), name.size(), nullptr, 0, nullptr,
                                    0) != UNZ_OK) {
            fail("is damaged: an entry cannot be read");
        }
        name_.assign(name.data(), std::min<std::size_t>(info.size_filename, name.size()));
        return info;
    }

    /// Names are relative, and no part of them leads up.
    void check_name() const
    {
        const auto bad = [&](std::string_view why) {
            std::string shown;
            for (const char c : name_.substr(0, 100)) {
                shown += c >= ' ' && c < 127 ? c : '?';
            }
            fail(fmt::format("the name of the entry '{}' {}; expected a path inside of the archive",
                             shown, why));
        };
        if (name_.empty()) bad("is empty");
        if (name_.size() > 1000) bad("has more than 1000 characters");
        if (name_.front() == '/') bad("begins at the root");
        if (name_.find('\0') != std::string::npos) bad("holds a zero byte");
        if (name_.find('\\') != std::string::npos) bad("has a backslash");
        if (name_.size() > 1 && name_[1] == ':') bad("begins with a drive");
        for (std::size_t begin = 0; begin <= name_.size();) {
            const std::size_t end = std::min(name_.find('/', begin), name_.size());
            const std::string_view part = std::string_view(name_).substr(begin, end - begin);
            if (part == "..") bad("leads out of the folder");
            if (part == ".") bad("has a part '.'");
            begin = end + 1;
        }
    }

    [[nodiscard]] bool is_needed() const
    {
        if (name_ == "modelDescription.xml" || name_.starts_with("resources/")) return true;
        return std::ranges::any_of(std::array<int, 2>{2, 3}, [&](int version) {
            return name_.starts_with("binaries/" + platform_folder(version) + "/");
        });
    }

    void write(const fs::path& to, std::uint64_t size)
    {
        std::error_code error;
        fs::create_directories(to.parent_path(), error);
        std::ofstream out(to, std::ios::binary);
        if (error || !out) fail(fmt::format("entry '{}' cannot be written", name_));
        if (unzOpenCurrentFile(zip_) != UNZ_OK) {
            fail(fmt::format("entry '{}' is packed by a method other than deflate", name_));
        }
        std::vector<char> bytes(1 << 16);
        std::uint64_t written = 0;
        int count = 0;
        while ((count = unzReadCurrentFile(zip_, bytes.data(),
                                           static_cast<unsigned>(bytes.size()))) > 0) {
            written += static_cast<std::uint64_t>(count);
            total_ += static_cast<std::uint64_t>(count);
            if (written > size || total_ > most_bytes) break;
            out.write(bytes.data(), count);
        }
        const bool whole = unzCloseCurrentFile(zip_) == UNZ_OK && count == 0 && written == size;
        if (total_ > most_bytes) fail("unpacks to more than 4 GiB: too much for a model");
        if (!whole) fail(fmt::format("entry '{}' is damaged", name_));
        if (!out.flush()) fail(fmt::format("entry '{}' cannot be written: disk full?", name_));
    }

    std::string file_, name_;
    unzFile zip_ = nullptr;
    std::uint64_t total_ = 0;
    std::unordered_set<std::string> seen_;
};

}  // namespace

std::string platform_folder(int version)
{
#if defined(__aarch64__)
    constexpr std::string_view processor = "aarch64";
#elif defined(__x86_64__)
    constexpr std::string_view processor = "x86_64";
#else
    constexpr std::string_view processor = "unknown";
#endif
#if defined(__APPLE__)
    return version == 2 ? "darwin64" : fmt::format("{}-darwin", processor);
#else
    if (version == 2) return processor == "x86_64" ? "linux64" : fmt::format("{}-linux", processor);
    return fmt::format("{}-linux", processor);
#endif
}

void unpack(const fs::path& archive, const fs::path& folder)
{
    Archive(archive).unpack(folder);
    if (!fs::exists(folder / "modelDescription.xml")) {
        throw Error(archive.string() + ": holds no modelDescription.xml, which an FMU has");
    }
}

TemporaryFolder::TemporaryFolder()
{
    std::string name = (fs::temp_directory_path() / "ricochet-fmu-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
        throw Error(
            fmt::format("no temporary folder {} can be made: {}", name, std::strerror(errno)));
    }
    path_ = name;
}

TemporaryFolder::~TemporaryFolder()
{
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

}  // namespace ricochet::fmi
