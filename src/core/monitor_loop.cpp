#include "core/monitor_loop.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <string_view>

#include "base/out_of_turn.hpp"

namespace ricochet::detail {

void throw_out_of_turn(std::string_view call, std::string_view expected)
{
    throw OutOfTurn(fmt::format("EventMonitor: found `{}`; expected {}", call, expected));
}

void throw_gap(double expected, double found)
{
    throw OutOfTurn(fmt::format(
        "EventMonitor: found a step that begins at {:.17g} s; expected one that begins where the "
        "last one ended, at {:.17g} s, or `start` after a gap",
        found, expected));
}

void throw_state_moved(std::size_t component, double expected, double found)
{
    throw OutOfTurn(fmt::format(
        "EventMonitor: found a step with x0[{}] = {:.17g}; expected {:.17g}, as the last one "
        "ended, or `start` after the host has moved the state",
        component, found, expected));
}

void throw_held_moved(std::size_t component, double expected, double found)
{
    throw OutOfTurn(fmt::format(
        "EventMonitor: found a step with x1[{}] = {:.17g}; expected {:.17g}, since a rest holds "
        "this component, see `held`",
        component, found, expected));
}

void throw_beyond_time_event(double event, double end)
{
    throw OutOfTurn(fmt::format(
        "EventMonitor: found a step or `hold` to {:.17g} s; expected none beyond the time event at "
        "{:.17g} s, see `must_stop_at`",
        end, event));
}

void throw_not_quiet(double until, double found)
{
    throw OutOfTurn(
        fmt::format("EventMonitor: found `skip_to` {:.17g} s; expected a time up to {:.17g} s, see "
                    "`quiet_until`, and steps beyond",
                    found, until));
}

void throw_host_not_finite(std::size_t component, double found, double s, bool by_restep)
{
    throw std::domain_error(fmt::format(
        "EventMonitor: found x[{}] = {} from the host's `{}` at {:.17g} s of its step; expected "
        "finite numbers, since an event is located there",
        component, found, by_restep ? "restep" : "interpolate", s));
}

void throw_no_length(std::string_view what, double found)
{
    throw std::invalid_argument(
        fmt::format("EventMonitor: found {} s for {}; expected a finite time, and lengths above 0",
                    found, what));
}

void throw_hold_not_ahead(double now, double found)
{
    throw std::invalid_argument(fmt::format(
        "EventMonitor: found `hold` to {} s; expected a finite time after {:.17g} s", found, now));
}

void throw_wrong_size(std::size_t expected, std::size_t found)
{
    throw std::invalid_argument(fmt::format(
        "EventMonitor: found an array of {} numbers; expected {}, as the state has components",
        found, expected));
}

void throw_no_such_guard(std::size_t found, std::size_t guards)
{
    throw std::out_of_range(
        fmt::format("EventMonitor: found guard {}; expected one below {}", found, guards));
}

void throw_without_events()
{
    throw std::invalid_argument(
        "EventMonitor: found a system without guards and time events; expected one that has "
        "events");
}

}  // namespace ricochet::detail
