// needs: faults
#include <ricochet/faults/strike_slip_fault.hpp>

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
