#include "ricochet/fmi/ready.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <minizip/zip.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>

#include "base/read_file.hpp"
#include "fmi/unpacked.hpp"
#include "ricochet/systems/ready.hpp"

namespace ricochet::fmi {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view text_in_fmu = "model.json";

/// A library for FMUs beside the program, as in a build, or where it is installed.
[[nodiscard]] fs::path library_for_fmus(std::string_view library_name)
{
    std::error_code error;
    const fs::path here = fs::read_symlink("/proc/self/exe", error).parent_path();
    const std::array<fs::path, 3> places{
        here / library_name, here.parent_path() / RICOCHET_LIBRARY_FOLDER / library_name,
        fs::path(RICOCHET_INSTALLED_LIBRARIES) / library_name};
    for (const fs::path& place : places) {
        if (fs::is_regular_file(place, error)) return place;
    }
    throw Error(
        fmt::format("a library for FMUs is missing; expected '{}'", places.back().string()));
}

[[nodiscard]] std::string structured(std::string_view name)
{
    std::string out(name);
    std::ranges::replace(out, '-', '_');
    return out;
}

[[nodiscard]] const SystemDescriptor& descriptor_of(std::string_view name)
{
    const SystemDescriptor* found = nullptr;
    std::string known;
    ReadySystems::for_each([&]<class System>() {
        known += (known.empty() ? "" : ", ") + std::string(System::name);
        if (name == System::name) found = &System::descriptor();
    });
    if (found) return *found;
    throw Error(fmt::format("found the ready system '{}'; expected one of {}", name, known));
}

/// What the library is told: the name, and every value that differs.
[[nodiscard]] std::string told(const ReadyFmu& wanted)
{
    const SystemDescriptor& of = descriptor_of(wanted.system);
    std::vector<double> parameters;
    for (const ParameterInfo& each : of.parameters) parameters.push_back(each.initial);
    std::string out(of.name);
    for (const auto& [given, value] : wanted.set) {
        const std::string name = structured(given);
        const auto parameter = std::ranges::find(
            of.parameters, name, [](const ParameterInfo& each) { return structured(each.name); });
        const bool is_start = std::ranges::find(of.state, std::string_view(name),
                                                &ComponentInfo::title) != of.state.end();
        if (parameter == of.parameters.end() && !is_start) {
            std::string known;
            for (const ParameterInfo& each : of.parameters) known += structured(each.name) + ", ";
            for (const ComponentInfo& each : of.state) known += fmt::format("{}, ", each.title);
            known.resize(known.size() - 2);
            throw Error(fmt::format("{}: found '{}'; expected one of {}", of.name, given, known));
        }
        if (!std::isfinite(value)) {
            throw Error(
                fmt::format("{}: found {} = {}; expected a finite number", of.name, given, value));
        }
        if (parameter != of.parameters.end()) {
            parameters[static_cast<std::size_t>(parameter - of.parameters.begin())] = value;
        }
        out += fmt::format(" {}={}", name, value);
    }
    try {
        ReadySystems::for_each([&]<class System>() {
            if (of.name == System::name) (void)with_parameters<System>(parameters);
        });
    } catch (const std::invalid_argument& error) {
        throw Error(error.what());
    }
    return out;
}

[[nodiscard]] std::string description_by(const fs::path& library, const std::string& told,
                                         const std::string& resource, int version)
{
    const std::unique_ptr<void, int (*)(void*)> handle(
        dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL),
        [](void* of) { return of ? dlclose(of) : 0; });
    if (!handle) throw Error(fmt::format("{}: {}", library.string(), dlerror()));
    using Describe = const char* (*)(const char* told, const char* resource, int version);
    const auto describe =
        reinterpret_cast<Describe>(dlsym(handle.get(), "ricochet_fmu_description_of"));
    std::string text = describe ? describe(told.c_str(), resource.c_str(), version)
                                : library.string() + ": is of another version";
    if (!text.starts_with('<')) throw Error(text);
    return text;
}

struct PackedFile {
    std::string name, bytes;
};

/// Writes a zip archive, the same bytes for the same files; what was there stays until it is whole.
void pack(const fs::path& to, std::span<const PackedFile> files)
{
    const fs::path part = to.string() + ".part";
    zipFile archive = zipOpen64(part.c_str(), APPEND_STATUS_CREATE);
    const auto fail = [&] {
        if (archive) zipClose(archive, nullptr);
        std::error_code ignored;
        fs::remove(part, ignored);
        throw Error(fmt::format("{}: cannot be written", to.string()));
    };
    if (!archive) fail();
    for (const PackedFile& each : files) {
        zip_fileinfo info{};
        info.tmz_date.tm_mday = 1;
        info.tmz_date.tm_year = 1980;
        const bool written =
            zipOpenNewFileInZip64(archive, each.name.c_str(), &info, nullptr, 0, nullptr, 0,
                                  nullptr, Z_DEFLATED, Z_BEST_COMPRESSION, 0) == ZIP_OK &&
            zipWriteInFileInZip(archive, each.bytes.data(),
                                static_cast<unsigned>(each.bytes.size())) == ZIP_OK &&
            zipCloseFileInZip(archive) == ZIP_OK;
        if (!written) fail();
    }
    if (zipClose(std::exchange(archive, nullptr), nullptr) != ZIP_OK) fail();
    std::error_code error;
    fs::rename(part, to, error);
    if (error) fail();
}

void require_version(int version)
{
    if (version == 2 || version == 3) return;
    throw Error(fmt::format("found the version {} of FMI; expected 2 or 3", version));
}

/// Packs a library that has several models, with a description by it.
void pack_model(const fs::path& library, std::string_view identifier, std::string description,
                const std::string* resource, int version, const fs::path& file)
{
    std::vector<PackedFile> files{{"modelDescription.xml", std::move(description)}};
    if (resource) files.push_back({"resources/model.json", *resource});
    const auto refuse = [&](std::string_view why) {
        throw Error(fmt::format("{}: {}", library.string(), why));
    };
    files.push_back({fmt::format("binaries/{}/{}.so", platform_folder(version), identifier),
                     ricochet::detail::read_file(library, refuse)});
    pack(file, files);
}

}  // namespace

void export_ready(const ReadyFmu& wanted, const fs::path& file)
{
    require_version(wanted.version);
    const std::string of = told(wanted);
    const fs::path library = library_for_fmus("ricochet_ready_fmu.so");
    pack_model(library, structured(wanted.system), description_by(library, of, "", wanted.version),
               nullptr, wanted.version, file);
}

void export_scene(const SceneFmu& wanted, const fs::path& file)
{
    require_version(wanted.version);
    const std::string name = wanted.scene.string();
    const std::string text = ricochet::detail::read_file(
        wanted.scene, [&](std::string_view why) { throw Error(fmt::format("{}: {}", name, why)); });
    std::string identifier = wanted.scene.stem().string();
    std::ranges::replace_if(
        identifier, [](unsigned char c) { return !std::isalnum(c) && c != '_'; }, '_');
    if (identifier.empty() || std::isdigit(static_cast<unsigned char>(identifier[0]))) {
        identifier.insert(0, "scene_");
    }
    std::string told = identifier;
    for (const auto& [given, value] : wanted.set) told += fmt::format(" {}={}", given, value);
    const fs::path library = library_for_fmus("ricochet_scene_fmu.so");
    std::string description;
    try {
        description = description_by(library, told, text, wanted.version);
    } catch (const Error& error) {
        // The library knows the text by the name that it has in the FMU.
        std::string_view why = error.what();
        if (why.starts_with(text_in_fmu)) why.remove_prefix(text_in_fmu.size());
        throw Error(fmt::format("{}{}{}", name, why.starts_with(':') ? "" : ": ", why));
    }
    pack_model(library, identifier, std::move(description), &text, wanted.version, file);
}

}  // namespace ricochet::fmi
