#include "ricochet/fmi/fmu.hpp"

#include "fmi/unpacked.hpp"

namespace ricochet::fmi {

std::filesystem::path Unpacked::binary(Kind kind) const
{
    const auto& interface =
        kind == Kind::co_simulation ? description.co_simulation : description.model_exchange;
#if defined(__APPLE__)
    constexpr const char* ending = ".dylib";
#else
    constexpr const char* ending = ".so";
#endif
    return folder.path() / "binaries" / platform_folder(description.version) /
           (interface->identifier + ending);
}

Fmu::Fmu(const std::filesystem::path& archive)
{
    const auto unpacked = std::make_shared<Unpacked>();
    unpack(archive, unpacked->folder.path());
    unpacked->description =
        read_description(unpacked->folder.path() / "modelDescription.xml", archive.string());
    unpacked_ = unpacked;
}

const Description& Fmu::description() const noexcept
{
    return unpacked_->description;
}

bool Fmu::has_binary() const
{
    const Description& d = description();
    return (d.model_exchange && std::filesystem::exists(unpacked_->binary(Kind::model_exchange))) ||
           (d.co_simulation && std::filesystem::exists(unpacked_->binary(Kind::co_simulation)));
}

}  // namespace ricochet::fmi
