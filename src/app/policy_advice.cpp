#include "policy_advice.hpp"

namespace ricochet::app {

std::string_view policy_advice(std::string_view system)
{
    if (system == "fault") {
        return "trained on sides of 2 to 6 km, damping ratios of 0.15 to 0.45, friction drops of "
               "0.05 to 0.2, "
               "slip distances of 0.05 to 0.2 m and overloads of 1e-6 to 1e-4. Take constant steps "
               "with less "
               "damping or more overload, where they need fewer iterations (0.05: 212, not 246; "
               "1e-2: 54, "
               "not 114); on larger and smaller faults the classical rule decides every step";
    }
    if (system == "sliding-mode") {
        return "trained on gains, frequencies and starts up to a factor of 2 from 2 1/s, 50 rad/s "
               "and 0.15, "
               "amplitudes of 0.4 to 0.95 of the gain. Take the free estimate for starts farther "
               "away, "
               "where it needs fewer solves (2: 234, not 282)";
    }
    if (system == "diode-circuit") {
        return "trained on parameters up to a factor of 1.5 and starts up to 2 from the default. "
               "Take the free "
               "estimate beyond them, where it needs fewer solves (5 times the current: 314, not "
               "348; 10 "
               "times the resistance: 1088, not 1130)";
    }
    return "";
}

}  // namespace ricochet::app
