#include <ricochet/ricochet.hpp>

#include <array>
#include <cmath>

using namespace ricochet;

namespace {
struct Room {
    using State = std::array<double, 4>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], 0, -9.81}; }
    double guard(double, const State& x) const { return 5 - std::hypot(x[0], x[1]); }
    void reset(double, State& x) const
    {
        const double r = std::hypot(x[0], x[1]);
        const double v = (x[0] * x[2] + x[1] * x[3]) / r;
        for (int i = 0; i < 2; ++i) x[2 + i] -= 2 * v * x[i] / r;
    }
    double speed_bound(double, const State& x) const { return std::hypot(x[2], x[3]); }
    double acceleration_bound(double, const State&) const { return 9.81; }
};
}  // namespace

int main()
{
    const Room room;
    const Room::State x0{0, 0, 1, 0};
    // clang-format off
BLOCK
    // clang-format on
}
