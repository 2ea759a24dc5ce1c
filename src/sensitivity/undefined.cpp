#include "ricochet/sensitivity/undefined.hpp"

namespace ricochet {

std::string_view name(Undefined reason) noexcept
{
    switch (reason) {
        case Undefined::no: return "no";
        case Undefined::grazing: return "grazing";
        case Undefined::simultaneous: return "simultaneous";
        case Undefined::off_surface: return "off_surface";
        case Undefined::boolean_guard: return "boolean_guard";
        case Undefined::time_event_jumps: return "time_event_jumps";
        case Undefined::non_finite: return "non_finite";
    }
    return "unknown";
}

std::string_view describe(Undefined reason) noexcept
{
    switch (reason) {
        case Undefined::no: return "the derivatives exist";
        case Undefined::grazing:
            return "the motion touches the surface without crossing it, as far as the tolerances "
                   "of the run can tell, so that neighbouring motions may miss it";
        case Undefined::simultaneous:
            return "events at one time lead elsewhere in another order, and the order is "
                   "different for different neighbours; only one-sided derivatives exist";
        case Undefined::off_surface:
            return "the event was found away from its surface; use a detector that looks at "
                   "every step";
        case Undefined::boolean_guard:
            return "the guard has only a sign; give it a value that varies smoothly across its "
                   "surface";
        case Undefined::time_event_jumps:
            return "the differences by a parameter move a time event too far to recognise it; "
                   "give the parameter a smaller scale";
        case Undefined::non_finite:
            return "a derivative of the flow, a guard or a reset is NaN or infinite";
    }
    return "unknown";
}

}  // namespace ricochet
