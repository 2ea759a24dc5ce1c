// A system with modes as an FMU.
#include <ricochet/fmi/export.hpp>
#include <ricochet/systems/thermostat.hpp>

struct Room {
    static constexpr ricochet::fmi::Exported states[] = {{"temperature", 20, "degC"}};
    static ricochet::Thermostat make(std::span<const double>) { return ricochet::Thermostat(); }
};
RICOCHET_FMU(Room)
