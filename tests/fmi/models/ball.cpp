// The bouncing ball as an FMU.
#include <ricochet/fmi/export.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

struct Ball {
    using Method = ricochet::Fehlberg78;  // whose steps round less than those of dopri5
    static constexpr const char* name = "Ball & \"floor\"";
    static constexpr double t_end = 12;
    static constexpr ricochet::fmi::Exported states[] = {{"height", 10, "m", "above the floor"},
                                                         {"velocity", 0, "m/s"}};
    static constexpr ricochet::fmi::Exported parameters[] = {{"gravity", 9.81, "m/s2"},
                                                             {"restitution", 0.9}};
    static ricochet::BouncingBall make(std::span<const double> p)
    {
        return ricochet::BouncingBall({.gravity = p[0], .restitution = p[1]});
    }
};
RICOCHET_FMU(Ball)
