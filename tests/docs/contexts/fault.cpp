// needs: faults
#include <ricochet/faults/fault_rate_state.hpp>

using namespace ricochet;

namespace {
void use(double, double) {}
}  // namespace

// Compiled and not run: it is years of motion.
[[maybe_unused]] static void page()
{
    // clang-format off
BLOCK
    // clang-format on
}

int main() {}
