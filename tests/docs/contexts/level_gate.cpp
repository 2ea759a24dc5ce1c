// needs: learn
#include <array>
#include <cmath>

#include <ricochet/learn/train.hpp>
#include <ricochet/ricochet.hpp>

using namespace ricochet;

namespace {
struct Room {
    using State = std::array<double, 4>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], 0, -9.81}; }
    double guard(double, const State& x) const { return 5 - std::hypot(x[0], x[1]); }
    void reset(double, State& x) const { x[2] *= -1, x[3] *= -1; }
    double speed_bound(double, const State& x) const { return std::hypot(x[2], x[3]); }
    double acceleration_bound(double, const State&) const { return 9.81; }
};
}  // namespace

// Compiled and not run: it is a training.
[[maybe_unused]] static void page()
{
    const Room room;
    const Room::State x0{0, 0, 1, 0};
    const double h = 1e-3;
    const auto starts = learn::from_box(Room::State{-1, -1, -1, -1}, Room::State{1, 1, 1, 1});
    // clang-format off
BLOCK
    // clang-format on
}

int main() {}
