// The ready systems of the core; `ricochet-nonsmooth` runs those with friction.
#include "ricochet/systems/ready.hpp"

#include <type_traits>

#include "entries.hpp"
#include "ready_runs.hpp"

namespace ricochet::app {

namespace {

template <class System>
SystemEntry entry_of()
{
    if constexpr (std::is_same_v<System, BouncingBall>) {
        return bouncing_ball_entry();
    } else if constexpr (std::is_base_of_v<FrictionOscillator, System>) {
        SystemEntry entry = described<System>();
        entry.integrators = {"event", "handover", "bathe", "time-stepping"};
        entry.set_valued_step = 0.01;
        entry.program = "nonsmooth";
        entry.modes.push_back("set-valued");
        entry.any_parameters = System::descriptor().event_times != nullptr;
        entry.known_solution = entry.any_parameters
                                   ? "event times in closed form"
                                   : "event times in closed form, for the default parameters";
        return entry;
    } else {
        SystemEntry entry = described<System>();
        ReadyRuns<System>::give_to(entry);
        return entry;
    }
}

}  // namespace

std::vector<SystemEntry> ready_entries()
{
    std::vector<SystemEntry> all;
    ReadySystems::for_each([&]<class System>() { all.push_back(entry_of<System>()); });
    return all;
}

}  // namespace ricochet::app
