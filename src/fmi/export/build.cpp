// What the build, and `ricochet fmu export`, ask of the library of an FMU.
#include <string>
#include <string_view>

#include "fmi/export/instance.hpp"

namespace {

const char* describe(std::string_view told, int version)
{
    using namespace ricochet::fmi::detail;
    static std::string text;
    try {
        text = description(make_exported_model(told)->facts(), version);
    } catch (const std::exception&) {
        text.clear();
    }
    return text.c_str();
}

}  // namespace

/// The description of a version, 2 or 3; empty if the model cannot be made.
RICOCHET_FMI_EXPORT const char* ricochet_fmu_description(int version)
{
    return describe({}, version);
}
/// The same of one of several models.
RICOCHET_FMI_EXPORT const char* ricochet_fmu_description_of(const char* told, int version)
{
    return describe(told, version);
}
