// The bouncing ball as an FMU.
#include <ricochet/fmi/export.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

struct Ball {
    static constexpr ricochet::fmi::Exported states[] = {{"height", 10, "m"},
                                                         {"velocity", 0, "m/s"}};
    static ricochet::BouncingBall make(std::span<const double>) { return {}; }
};
RICOCHET_FMU(Ball)
