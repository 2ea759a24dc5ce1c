// The two functions of a controller, in a class that has the rest.
#include <algorithm>
#include <array>

#include <ricochet/ricochet.hpp>

namespace {
struct Plant {
    using State = std::array<double, 4>;
    enum : std::size_t { plant, held, computed, due };
    static constexpr double delay = 0.03, never = 1e9;
    ricochet::Times ticks = ricochet::every(0.1);

    void flow(double, const State& x, State& dxdt) const { dxdt = {x[held] - x[plant], 0, 0, 0}; }
};

struct Scope : Plant
                   // clang-format off
BLOCK
;
// clang-format on
}  // namespace

int main()
{
    // The plant settles where it holds 4 (1 - x) = x.
    const auto run = ricochet::integrate(Scope{}, {0, 0, 0, 0.1}, {.t_end = 10});
    return std::abs(run.x[0] - 0.8) < 1e-6 ? 0 : 1;
}
