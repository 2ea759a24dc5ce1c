// An oscillator with dry friction as an FMU.
#include <ricochet/fmi/export.hpp>
#include <ricochet/systems/coulomb_oscillator.hpp>

struct Coulomb {
    using System = ricochet::CoulombOscillator;
    static constexpr double t_end = 20;
    static constexpr ricochet::Mode mode = System::start_mode;
    static constexpr ricochet::fmi::Exported states[] = {{"u", System::start[0], "m"},
                                                         {"v", System::start[1], "m/s"}};
    static System make(std::span<const double>) { return {}; }
};
RICOCHET_FMU(Coulomb)
