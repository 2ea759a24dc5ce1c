// What is refused at compile time of fields that meet at switching surfaces; see refused.cpp.

#include <array>
#include <cstddef>

#include "ricochet/filippov.hpp"
#include "ricochet/integrate.hpp"

using namespace ricochet;
using X = std::array<double, 2>;

// CASE 1: found fields with modes of their own; expected guards, resets and time events that take
// CASE 2 alone: found a guard and no reset; expected a reset of that name or
// CASE 3 alone: found fields with a flow, which Filippov does not call; expected void field(
// CASE 4: found fields with guards of their own, but without a type State; expected `using
// CASE 5: found a reset that is not const
// CASE 6: found fields whose class is final, so that a guard of theirs could not be found
// CASE 7 alone: found fields with set_valued(), which Filippov does not follow; expected switching
#if CASE == 6
struct Fields final {
#else
struct Fields {
#endif
#if CASE != 4
    using State = X;
#endif
    static constexpr std::size_t surface_count = 1;
#if CASE != 2 && CASE != 5
    static constexpr bool resets = false;
#endif
    [[nodiscard]] double surface(std::size_t, double, const X& x) const
    {
        return x[1];
    }
    void field(std::size_t region, double, const X&, X& v) const
    {
        v = {1, region != 0 ? -1.0 : 1.0};
    }
#if CASE == 1
    double guard(Mode, double, const X& x) const
    {
        return 1 - x[0];
    }
#else
    double guard(double, const X& x) const
    {
        return 1 - x[0];
    }
#endif
#if CASE == 3
    void flow(double, const X&, X& v) const
    {
        v = {1, 0};
    }
#elif CASE == 5
    void reset(double, X& x)
    {
        x[0] = 0;
    }
#elif CASE == 7
int set_valued() const
{
    return 0;
}
#endif
};

int main()
{
    const Filippov<Fields> system;
    static_cast<void>(
        integrate(system, X{0, 0}, {.t_end = 1, .mode = system.mode_of(Place::sliding)}));
}
