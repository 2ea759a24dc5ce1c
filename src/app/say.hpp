// Sentences on standard error.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace ricochet::app {

/// Prints to standard error. If it is closed, full or a terminal that has gone, only the message is
/// lost, whereas `fmt::print` would throw.
template <class... Values>
void say(fmt::format_string<Values...> format, Values&&... values)
{
    const std::string text = fmt::format(format, std::forward<Values>(values)...);
    std::fwrite(text.data(), 1, text.size(), stderr);
}

}  // namespace ricochet::app
