// needs: learn_steps
#include <ricochet/base/random.hpp>
#include <ricochet/faults/strike_slip_fault.hpp>
#include <ricochet/learn_steps/policies.hpp>
#include <ricochet/learn_steps/step_environment.hpp>
#include <ricochet/nn/model.hpp>

using namespace ricochet;
using namespace ricochet::learn;
using namespace ricochet::detail;

namespace {
double work_and_error_of_runs_with(std::span<const double> x)
{
    return x[0] * x[0];
}
}  // namespace

// Compiled and not run: they are trainings.
[[maybe_unused]] static void page()
{
    const std::vector<double> x0{1, 2};
    double x = 0;
    int steps = 0;
    // clang-format off
BLOCK
    // clang-format on
    static_cast<void>(x);
    static_cast<void>(steps);
}

int main() {}
