// What the demo shows: the command line with the bouncing ball alone.
#include "systems/entries.hpp"

namespace ricochet::app {

std::vector<SystemEntry> all_entries()
{
    return {bouncing_ball_entry()};
}

}  // namespace ricochet::app
