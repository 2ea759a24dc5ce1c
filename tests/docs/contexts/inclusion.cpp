// needs: nonsmooth
#include <cstdio>
#include <ricochet/nonsmooth/hand_over.hpp>
#include <ricochet/systems/diode_circuit.hpp>

using namespace ricochet;

int main()
{
    // clang-format off
BLOCK
    // clang-format on
}
