// What a ready system says of itself: names, units, ranges, its start, and what is known of its
// motion. The command line, Python, ensembles and the pages of the documentation read it.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ricochet {

/// The values that a parameter may have.
struct ParameterRange {
    double lower = -std::numeric_limits<double>::infinity();
    double upper = std::numeric_limits<double>::infinity();
    bool lower_included = false;
    bool upper_included = false;

    /// Whether a parameter may have this value.
    [[nodiscard]] bool contains(double value) const noexcept;
};

/// "[0, 1]", "(0, inf)"
[[nodiscard]] std::string to_string(const ParameterRange& range);

/// A parameter, in words that are joined by hyphens: "belt-speed".
struct ParameterInfo {
    std::string_view name;
    double initial;         ///< default value
    std::string_view unit;  ///< "1" where it has none
    ParameterRange range;
    std::string_view meaning;
};

/// A component of the state.
struct ComponentInfo {
    std::string_view name;  ///< its symbol, "u"
    std::string_view unit;
    std::string_view meaning;
    std::string_view title{};          ///< one word, "height"
    double start = 0;                  ///< default value at the start
    std::string_view start_meaning{};  ///< empty where no other start is offered
    ParameterRange start_range{};      ///< of the start
};

/// A function of the known motion.
struct KnownFunction {
    /// An argument of the function.
    struct Argument {
        std::string_view name;
        std::optional<double> initial{};  ///< nothing: it has to be given
        bool whole = false;               ///< a whole number that is not negative
    };
    /// Computes one value or, if `many`, several.
    using Values = std::vector<double> (*)(std::span<const double> parameters,
                                           std::span<const double> arguments);
    std::string_view name;
    std::string_view meaning;
    std::vector<Argument> arguments;
    Values values;
    bool many = false;
};

/// A ready system in words and numbers.
struct SystemDescriptor {
    std::string_view name;         ///< "bouncing-ball"
    std::string_view type;         ///< of C++ and Python, "BouncingBall"
    std::string_view description;  ///< one sentence
    std::string_view source{};     ///< of the problem; empty: it is ricochet's own
    /// A line each, in the names of parameters and state; empty where the description says it.
    std::vector<std::string_view> equations{};
    std::vector<ParameterInfo> parameters;  ///< as they are in `Parameters`
    std::vector<ComponentInfo> state;
    std::vector<std::string_view> events;  ///< on the surfaces of the guards, by their numbers
    std::string_view guard_name{};         ///< of a guard that declares none
    double t_end;                          ///< [s] of a run that shows it
    double comparison_step = 0;            ///< [s] of fixed steps in a comparison; with event_times

    std::vector<KnownFunction> known{};
    std::vector<std::pair<std::string_view, double>> constants{};  ///< for the default parameters
    /// Times [s] of the events up to a time; null if they are not known in closed form.
    /// @throws std::invalid_argument if they are not known for these parameters or this start.
    std::vector<double> (*event_times)(std::span<const double> parameters,
                                       std::span<const double> start, double t_end) = nullptr;
};

/// The system with these parameters, in the order of the descriptor.
/// @throws std::invalid_argument for another number of them, and what the constructor refuses.
template <class System>
[[nodiscard]] System with_parameters(std::span<const double> values);

namespace detail {

[[noreturn]] void refuse_parameter_count(std::string_view name, std::size_t found,
                                         std::size_t expected);

template <class Parameters, std::size_t... i>
[[nodiscard]] Parameters parameters_from(std::span<const double> values, std::index_sequence<i...>)
{
    return {values[i]...};
}

}  // namespace detail

template <class System>
System with_parameters(std::span<const double> values)
{
    using Parameters = typename System::Parameters;
    constexpr std::size_t count = sizeof(Parameters) / sizeof(double);
    if (values.size() != count) detail::refuse_parameter_count(System::name, values.size(), count);
    return System(detail::parameters_from<Parameters>(values, std::make_index_sequence<count>{}));
}

}  // namespace ricochet
