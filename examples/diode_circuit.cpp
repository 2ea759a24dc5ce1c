// A circuit whose diode takes any current at voltage zero.
//
// The motion is a differential inclusion: while V1 is zero, the diode's current takes the value,
// within its bound, that keeps it zero. Bathe's composite step solves for it. With
// `Switches::located`, steps end where the diode changes between conducting one way, conducting the
// other way, and holding.

#include <cmath>
#include <cstdio>

#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/systems/diode_circuit.hpp"

int main()
{
    using ricochet::DiodeCircuit;
    using ricochet::Outcome;

    const DiodeCircuit circuit;
    ricochet::SetValuedMotion<DiodeCircuit> motion(
        circuit, DiodeCircuit::start(),
        {.t_end = 20, .step = 1e-3, .switches = ricochet::Switches::located});

    unsigned long long seen = 0;
    while (motion.advance() == Outcome::running) {
        if (motion.statistics().switches == seen) continue;
        seen = motion.statistics().switches;
        const auto& at = motion.state();
        const auto branch = motion.branches()[0];
        std::printf("%9.6f s  V2 %+9.6f V, i %+9.6f A: V1 %s\n", at.t, at.w[1], at.w[2],
                    branch == ricochet::Branch::inside  ? "held at zero"
                    : branch == ricochet::Branch::lower ? "positive"
                                                        : "negative");
    }
    const auto& end = motion.state();
    std::printf("%s at %g s: V1 %g V, V2 %.7f V, i %.7f A\n", name(motion.outcome()).data(), end.t,
                end.w[0], end.w[1], end.w[2]);
    // The exact V2, from matrix exponentials, is -0.01179851086 V.
    return seen == 12 && std::abs(end.w[1] + 0.01179851086) < 1e-6 ? 0 : 1;
}
