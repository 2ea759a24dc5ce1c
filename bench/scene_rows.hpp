// Scenes with expensive guards: the planner, and the bits by which runs are compared.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "problems.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/planned.hpp"
#include "timing.hpp"

namespace ricochet::bench {

/// FNV-1a over 64-bit words.
class BitHash {
public:
    void add(std::uint64_t word) noexcept { hash_ = (hash_ ^ word) * 0x100000001b3U; }
    void add(double value) noexcept { add(std::bit_cast<std::uint64_t>(value)); }
    [[nodiscard]] std::uint64_t value() const noexcept { return hash_; }

private:
    std::uint64_t hash_ = 0xcbf29ce484222325U;
};

/// Hash (FNV-1a) of the bits by which two runs are compared: kind, guard, time and both states of
/// every event, and the end.
template <class X>
[[nodiscard]] std::uint64_t hash_of(const Run<X>& run)
{
    BitHash hash;
    hash.add(static_cast<std::uint64_t>(run.outcome));
    hash.add(run.t);
    for (const double value : run.x) hash.add(value);
    for (const auto& event : run.events) {
        hash.add(static_cast<std::uint64_t>(event.kind));
        hash.add(event.guard);
        hash.add(event.t);
        for (const double value : event.before) hash.add(value);
        for (const double value : event.after) hash.add(value);
    }
    return hash.value();
}

/// A planner that does not check bounds, as in release builds, whatever the build.
[[nodiscard]] inline Planned<> planner(bool two_ended = true)
{
    return Planned<>({.two_ended = two_ended, .check_bounds = false});
}

}  // namespace ricochet::bench
