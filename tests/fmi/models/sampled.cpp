// A sampled controller as an FMU: time events, an input, a state that is held between them.
#include <ricochet/fmi/export.hpp>

#include <array>

namespace {

/// x' = -x + u + held; every half second held = -x.
struct Controller {
    using State = std::array<double, 2>;
    ricochet::Times time_events = ricochet::every(0.5);
    double u = 0;

    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {-x[0] + u + x[1], 0}; }
    void time_reset(double /*t*/, State& x) const { x[1] = -x[0]; }
};

struct Sampled {
    static constexpr double t_end = 4;
    static constexpr ricochet::fmi::Exported states[] = {{"x", 1}, {"held"}};
    static constexpr ricochet::fmi::Exported inputs[] = {{"u", 0.5}};
    static Controller make(std::span<const double>) { return {}; }
    static void set_inputs(Controller& controller, std::span<const double> u)
    {
        controller.u = u[0];
    }
};

}  // namespace
RICOCHET_FMU(Sampled)
