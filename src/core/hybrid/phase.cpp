#include "ricochet/phase.hpp"

namespace ricochet {

std::string_view name(PhaseCause cause) noexcept
{
    switch (cause) {
        case PhaseCause::start: return "start";
        case PhaseCause::no_modes: return "no_modes";
        case PhaseCause::no_flow: return "no_flow";
        case PhaseCause::several: return "several";
        case PhaseCause::accumulation: return "accumulation";
        case PhaseCause::chattering: return "chattering";
        case PhaseCause::stuck: return "stuck";
        case PhaseCause::contradiction: return "contradiction";
        case PhaseCause::released: return "released";
        case PhaseCause::held: return "held";
    }
    return "unknown";
}

}  // namespace ricochet
