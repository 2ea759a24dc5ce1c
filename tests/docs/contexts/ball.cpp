// A ball, and the statements that a page may use with it.
#include <ricochet/ricochet.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

using namespace ricochet;
using X = std::array<double, 2>;

namespace {
[[maybe_unused]] void observe(double, const X&) {}
}  // namespace

int main()
{
    const BouncingBall ball;
    const X x0{10, 0};
    (void)x0;
    // clang-format off
BLOCK
    // clang-format on
}
