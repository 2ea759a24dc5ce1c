// A forced system with impacts as an FMU, with an output.
#include <ricochet/fmi/export.hpp>
#include <ricochet/systems/impact_oscillator.hpp>

struct Oscillator {
    using State = ricochet::ImpactOscillator::State;
    static constexpr double t_end = 40;
    static constexpr ricochet::fmi::Exported states[] = {{"x"}, {"v"}};
    static constexpr ricochet::fmi::Exported parameters[] = {
        {"frequency", 0.7}, {"wall", 1}, {"restitution", 0.8}};
    static constexpr ricochet::fmi::Exported outputs[] = {{"energy"}};
    static ricochet::ImpactOscillator make(std::span<const double> p)
    {
        return ricochet::ImpactOscillator({.frequency = p[0], .wall = p[1], .restitution = p[2]});
    }
    static void get_outputs(const ricochet::ImpactOscillator&, ricochet::Mode, double,
                            const State& x, std::span<double> out)
    {
        out[0] = (x[0] * x[0] + x[1] * x[1]) / 2;
    }
};
RICOCHET_FMU(Oscillator)
