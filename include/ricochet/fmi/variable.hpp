// A variable of a model that is exported as an FMU.
#pragma once

namespace ricochet::fmi {

/// A variable of an exported model.
struct Exported {
    const char* name;
    double start = 0;
    const char* unit = "";  ///< such as "m/s"; empty: none is named
    const char* description = "";
};

}  // namespace ricochet::fmi
