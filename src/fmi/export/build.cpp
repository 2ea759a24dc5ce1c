// What the build asks of the library of an FMU.
#include <string>

#include "fmi/export/instance.hpp"

/// The description of a version, 2 or 3; empty if the model cannot be made.
RICOCHET_FMI_EXPORT const char* ricochet_fmu_description(int version)
{
    using namespace ricochet::fmi::detail;
    static std::string text;
    try {
        text = description(make_exported_model()->facts(), version);
    } catch (const std::exception&) {
        text.clear();
    }
    return text.c_str();
}
