#include "ricochet/guard.hpp"

namespace ricochet {

std::string_view name(EventKind kind) noexcept
{
    switch (kind) {
        case EventKind::crossing: return "crossing";
        case EventKind::touch: return "touch";
        case EventKind::time: return "time";
        case EventKind::accumulation: return "accumulation";
        case EventKind::mode: return "mode";
        case EventKind::stick: return "stick";
        case EventKind::slip: return "slip";
        case EventKind::jump: return "jump";
    }
    return "unknown";
}

}  // namespace ricochet
