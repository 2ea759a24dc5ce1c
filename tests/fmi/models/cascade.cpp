// Two guards at one instant, and a guard that a reset carries across, as an FMU.
#include <ricochet/fmi/export.hpp>

#include <array>

namespace {

/// Two points fall from the same height onto a floor that throws them back; a counter that both
/// impacts raise, and whose passage through 1.5 raises it once more by 10.
struct Points {
    using State = std::array<double, 5>;
    static constexpr std::size_t guard_count = 3;

    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -1, x[3], -1, 0}; }
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const State& x) const
    {
        return which == 2 ? 1.5 - x[4] : x[2 * which];
    }
    void reset(std::size_t which, double /*t*/, State& x) const
    {
        if (which == 2) {
            x[4] += 10;
        } else {
            x[2 * which] = 0;
            x[2 * which + 1] *= -0.5;
            x[4] += 1;
        }
    }
};

struct Cascade {
    static constexpr double t_end = 2;
    static constexpr ricochet::fmi::Exported states[] = {
        {"a", 0.5}, {"va"}, {"b", 0.5}, {"vb"}, {"count"}};
    static Points make(std::span<const double>) { return {}; }
};

}  // namespace
RICOCHET_FMU(Cascade)
