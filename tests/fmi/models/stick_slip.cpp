// A mass on a belt as an FMU.
#include <ricochet/fmi/export.hpp>
#include <ricochet/systems/stick_slip.hpp>

struct OnABelt {
    using System = ricochet::StickSlip;
    static constexpr double t_end = 30;
    static constexpr ricochet::Mode mode = System::start_mode;
    static constexpr ricochet::fmi::Exported states[] = {{"u", System::start[0], "m"},
                                                         {"v", System::start[1], "m/s"}};
    static System make(std::span<const double>) { return {}; }
};
RICOCHET_FMU(OnABelt)
