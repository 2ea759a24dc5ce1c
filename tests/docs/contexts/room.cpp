// Only declarations: a local class whose functions are defined nowhere.
#include <array>
#include <cmath>

namespace {
struct Scope
    // clang-format off
BLOCK
;
// clang-format on
}  // namespace

int main()
{
    const Scope::Room room;
    return room.speed_bound(0, {0, 0, 3, 4}) == 5 && room.acceleration_bound(0, {}) > 0 ? 0 : 1;
}
