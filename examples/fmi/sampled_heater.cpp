// A heater under a sampled controller as an FMU, for any tool that reads FMUs.
//
//     ricochet_add_fmu(sampled_heater SOURCES sampled_heater.cpp)
//
// The room loses warmth to the outside, an input; every ten minutes the controller compares the
// temperature with its set point, a parameter, and switches.
#include <array>
#include <ricochet/fmi/export.hpp>

namespace {

class Heater {
public:
    using State = std::array<double, 2>;  // temperature [degC], heating [0 or 1]

    explicit Heater(double set_point) : set_point_(set_point) {}

    ricochet::Times time_events = ricochet::every(600);  // [s]
    double outside = 0;                                  // [degC]

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        const double loss = 1.0 / 7200, gain = 0.004;  // [1/s], [degC/s]
        dxdt = {loss * (outside - x[0]) + gain * x[1], 0};
    }
    void time_reset(double /*t*/, State& x) const { x[1] = x[0] < set_point_ ? 1 : 0; }

private:
    double set_point_;  // [degC]
};

struct Room {
    static constexpr const char* name = "Heated room";
    static constexpr double t_end = 86400;
    static constexpr ricochet::fmi::Exported states[] = {{"temperature", 15, "degC", "of the room"},
                                                         {"heating", 0, "", "1: on"}};
    static constexpr ricochet::fmi::Exported parameters[] = {{"set_point", 20, "degC"}};
    static constexpr ricochet::fmi::Exported inputs[] = {{"outside", 5, "degC"}};
    static Heater make(std::span<const double> p) { return Heater(p[0]); }
    static void set_inputs(Heater& heater, std::span<const double> u) { heater.outside = u[0]; }
};

}  // namespace
RICOCHET_FMU(Room)
