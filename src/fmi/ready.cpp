#include "ricochet/fmi/ready.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <minizip/zip.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>

#include "fmi/unpacked.hpp"
#include "ricochet/systems/ready.hpp"

namespace ricochet::fmi {

namespace {

namespace fs = std::filesystem;

constexpr const char* library_name = "ricochet_ready_fmu.so";

/// Beside the program, as in a build, or where it is installed.
[[nodiscard]] fs::path ready_library()
{
    std::error_code error;
    const fs::path here = fs::read_symlink("/proc/self/exe", error).parent_path();
    const std::array<fs::path, 3> places{
        here / library_name, here.parent_path() / RICOCHET_LIBRARY_FOLDER / library_name,
        fs::path(RICOCHET_INSTALLED_LIBRARIES) / library_name};
    for (const fs::path& place : places) {
        if (fs::is_regular_file(place, error)) return place;
    }
    throw Error(fmt::format("the library of the ready systems is missing; expected '{}'",
                            places.back().string()));
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
                                         int version)
{
    const std::unique_ptr<void, int (*)(void*)> handle(
        dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL),
        [](void* of) { return of ? dlclose(of) : 0; });
    if (!handle) throw Error(fmt::format("{}: {}", library.string(), dlerror()));
    using Describe = const char* (*)(const char* told, int version);
    const auto describe =
        reinterpret_cast<Describe>(dlsym(handle.get(), "ricochet_fmu_description_of"));
    std::string text = describe ? describe(told.c_str(), version) : "";
    if (text.empty()) {
        throw Error(fmt::format("{}: does not know '{}'; is it of another version?",
                                library.string(), told));
    }
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

}  // namespace

void export_ready(const ReadyFmu& wanted, const fs::path& file)
{
    if (wanted.version != 2 && wanted.version != 3) {
        throw Error(fmt::format("found the version {} of FMI; expected 2 or 3", wanted.version));
    }
    const std::string of = told(wanted);
    const fs::path library = ready_library();
    const std::string description = description_by(library, of, wanted.version);
    std::ifstream in(library, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(in), {}};
    if (!in) throw Error(fmt::format("{}: cannot be read", library.string()));
    const std::string name = fmt::format("binaries/{}/{}.so", platform_folder(wanted.version),
                                         structured(wanted.system));
    pack(file, std::array<PackedFile, 2>{
                   {{"modelDescription.xml", description}, {name, std::move(bytes)}}});
}

}  // namespace ricochet::fmi
