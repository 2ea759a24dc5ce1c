// Options of the command line that check their values.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "input.hpp"

namespace ricochet::app {

/// An option with a finite number.
inline void add_number(CLI::App& command, const std::string& option, std::optional<double>& out,
                       const std::string& value, const std::string& help)
{
    command
        .add_option_function<std::string>(
            option, [&out, option](const std::string& text) { out = number(option, text); }, help)
        ->type_name(value);
}

/// An option with a whole number in [lowest, highest].
template <class Number>
void add_whole_number(CLI::App& command, const std::string& option, std::optional<Number>& out,
                      std::uint64_t lowest, std::uint64_t highest, const std::string& help)
{
    command
        .add_option_function<std::string>(
            option,
            [&out, option, lowest, highest](const std::string& text) {
                out = whole_number(option, text, lowest, highest);
            },
            help)
        ->type_name("N");
}

template <class Text>
CLI::Option* add_text(CLI::App& command, const std::string& option, std::optional<Text>& out,
                      const std::string& value, const std::string& help)
{
    return command
        .add_option_function<std::string>(
            option, [&out](const std::string& text) { out = text; }, help)
        ->type_name(value);
}

inline void add_system(CLI::App& command, std::string& out,
                       const std::string& help = "its name; `ricochet systems` lists them")
{
    command.add_option("SYSTEM", out, help)->required()->type_name("");
}

}  // namespace ricochet::app
