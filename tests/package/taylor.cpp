// A user of the component `taylor`: a turn of an oscillator whose state is a vector, so that its
// series is recorded.
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "ricochet/ricochet.hpp"
#include "ricochet/taylor/taylor.hpp"

struct Oscillator {
    template <class S>
    void flow(const S& /*t*/, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

int main()
{
    const ricochet::ErrorControlled<ricochet::Taylor> method;
    const auto run = ricochet::integrate(Oscillator{}, std::vector<double>{1.0, 0.0},
                                         {.t_end = 2 * std::numbers::pi, .rtol = 1e-12}, method);
    const bool fine = std::fabs(run.x[0] - 1) < 1e-10;
    std::puts(fine ? "fine" : "not back");
    return fine ? 0 : 1;
}
