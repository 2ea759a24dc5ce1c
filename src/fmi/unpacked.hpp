// An FMU in its temporary folder.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "fmi/api.hpp"
#include "ricochet/fmi/fmu.hpp"

namespace ricochet::fmi {

enum class Kind : std::uint8_t { model_exchange, co_simulation };

/// A loaded library, unloaded at the end of its life.
class Library {
public:
    /// @throws Error if it cannot be loaded, or lacks a function that runs of this kind need.
    Library(const std::filesystem::path& file, const Description& description, Kind kind);
    ~Library();
    Library(const Library&) = delete;
    Library& operator=(const Library&) = delete;

    Functions functions{};

private:
    void* handle_ = nullptr;
};

/// A folder that is removed at the end of its life, with what is in it.
class TemporaryFolder {
public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

private:
    std::filesystem::path path_;
};

struct Unpacked {
    TemporaryFolder folder;
    Description description;

    /// The library for runs of a kind on this platform.
    [[nodiscard]] std::filesystem::path binary(Kind kind) const;
};

/// Name of the folder in `binaries/` with libraries for this platform.
[[nodiscard]] std::string platform_folder(int version);

/// Unpacks the description, the resources and the libraries for this platform.
/// @throws Error if the archive is none, or a danger.
void unpack(const std::filesystem::path& archive, const std::filesystem::path& folder);

/// @param archive  for messages
/// @throws Error naming line and attribute
[[nodiscard]] Description read_description(const std::filesystem::path& xml,
                                           const std::string& archive);

}  // namespace ricochet::fmi
