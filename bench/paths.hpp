// Hot paths whose instructions are counted; bench/paths.cpp runs them by name.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

namespace ricochet::bench {

using Path = std::function<void()>;

struct Named {
    std::string_view name;
    std::function<Path()> prepare;
};

/// Larger states, methods by name, recorded passages, Taylor's method in lanes, inclusions.
[[nodiscard]] std::vector<Named> paths_of_runs();

/// Networks and expensive guards, guards in the steps of a host, and systems in C.
[[nodiscard]] std::vector<Named> paths_of_guards();

/// Scenes, faults and friction.
[[nodiscard]] std::vector<Named> paths_of_bodies();

}  // namespace ricochet::bench
