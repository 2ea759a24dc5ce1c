// What the build, and `ricochet fmu export`, ask of the library of an FMU.
#include <string>
#include <string_view>

#include "fmi/export/instance.hpp"

namespace {

const char* describe(const ricochet::fmi::detail::ModelSource& source, int version)
{
    using namespace ricochet::fmi::detail;
    static std::string text;
    try {
        text = description(make_exported_model(source)->facts(), version);
    } catch (const std::exception& error) {
        text = error.what();
    }
    return text.c_str();
}

}  // namespace

/// The description of a version, 2 or 3; where the model cannot be made the reason, which does not
/// begin with '<'.
RICOCHET_FMI_EXPORT const char* ricochet_fmu_description(int version)
{
    return describe({}, version);
}
/// The same of one of several models.
RICOCHET_FMI_EXPORT const char* ricochet_fmu_description_of(const char* told, const char* resource,
                                                            int version)
{
    return describe({.told = told, .resource = resource}, version);
}
