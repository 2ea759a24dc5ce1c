// The detectors that are chosen by name, in one list: the command line, Python, C and their
// messages are made from it. Those that need bounds or a model have options of their own.
#pragma once

#include <string>
#include <string_view>

#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::detail {

/// The first is the default; a new one comes last.
using NamedDetectors = TypeList<Extremum, Ends, Bernstein>;

inline constexpr auto detector_names =
    NamedDetectors::each([]<class Detector>() { return std::string_view(Detector::name); });

/// The place of a name in the list; its size if it is not there.
[[nodiscard]] constexpr std::size_t detector_place(std::string_view name) noexcept
{
    std::size_t place = 0;
    while (place < detector_names.size() && detector_names[place] != name) ++place;
    return place;
}

/// "extremum, ends or bernstein", each between two `quotes`.
[[nodiscard]] std::string spelled_detectors(std::string_view quotes = "");

}  // namespace ricochet::detail
