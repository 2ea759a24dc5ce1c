// A Functional Mock-up Unit (FMU): a model of another tool, as an archive with a description and a
// compiled library.
//
//     #include <ricochet/fmi/run.hpp>
//
//     const ricochet::fmi::Fmu ball("ball.fmu");
//     const auto run = ricochet::fmi::run(ball, {.t_end = 3, .output = {"h"}});
//
// Of FMI 2.0 and 3.0, for model exchange and co-simulation, as the standard of the Modelica
// Association describes them. The archive is unpacked into a temporary folder, which the last copy
// of the FMU removes. The library is foreign code: it is loaded when the first run starts, and can
// do whatever a process can.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::fmi {

/// An FMU that cannot be used; one sentence that names the file, where possible the line and the
/// attribute, what was found and what was expected.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// A function of an FMU that has returned an error, with the messages that the FMU has logged.
class CallError : public Error {
public:
    using Error::Error;
};

/// Types of variables. `float64` to `boolean` are read and set as doubles.
enum class Type : std::uint8_t {
    float64,
    float32,
    int8,
    uint8,
    int16,
    uint16,
    int32,
    uint32,
    int64,
    uint64,
    boolean,
    text,
    binary,
    clock,
};

/// Whether values of the type are numbers here.
[[nodiscard]] constexpr bool is_number(Type type) noexcept
{
    return type <= Type::boolean;
}

/// The role of a variable in its model.
enum class Causality : std::uint8_t {
    structural_parameter,
    parameter,
    calculated_parameter,
    input,
    output,
    local,
    independent,
};

/// When a variable may change.
enum class Variability : std::uint8_t { constant, fixed, tunable, discrete, continuous };

/// The name that the description has for it, such as "calculatedParameter".
[[nodiscard]] std::string_view name(Causality causality) noexcept;
[[nodiscard]] std::string_view name(Variability variability) noexcept;

/// A variable of an FMU: a number, or an array of numbers in row-major order.
struct Variable {
    std::string name;
    std::uint32_t reference = 0;
    Type type = Type::float64;
    Causality causality = Causality::local;
    Variability variability = Variability::continuous;
    bool starts_calculated = false;  ///< its start follows from others, and cannot be set
    std::string unit{};              ///< as the description spells it
    std::string description{};
    std::vector<double> start{};            ///< none, one for all elements, or one for each
    std::vector<std::size_t> dimensions{};  ///< empty: one number
    std::size_t size = 1;                   ///< number of elements
};

/// Capabilities of an FMU in one of its interfaces.
struct Interface {
    std::string identifier;             ///< of the library
    bool needs_completed_step = false;  ///< model exchange: wants to be told of every step
    bool directional_derivatives = false;
    bool once_per_process = false;  ///< one instance at a time
    bool saves_state = false;       ///< its state can be kept and set again
    // Of co-simulation alone:
    bool variable_steps = false;
    bool event_mode = false;
    bool returns_early = false;
};

/// One element of a variable.
struct Element {
    std::size_t variable = 0;  ///< index in `Description::variables`
    std::size_t offset = 0;    ///< in row-major order
};

/// Content of `modelDescription.xml`.
struct Description {
    std::string file;  ///< archive, for messages
    int version = 0;   ///< 2 or 3
    std::string version_text, model_name, token, tool, about;
    std::optional<Interface> model_exchange, co_simulation;
    bool scheduled_execution = false;
    std::vector<Variable> variables;
    std::vector<std::size_t> states;       ///< variables that are states, in the order of x
    std::vector<std::size_t> derivatives;  ///< their rates
    std::size_t state_count = 0;           ///< number of components of x
    std::size_t indicator_count = 0;
    std::vector<std::size_t> indicators;                    ///< their variables, in FMI 3
    std::optional<double> t_start, t_end, tolerance, step;  ///< of the default experiment

    /// The variable, or element of an array, of that name: "v", "x[2]", "A[2,3]", counted from 1.
    [[nodiscard]] std::optional<Element> find(std::string_view name) const;
    /// The name of an element, as `find` understands it.
    [[nodiscard]] std::string name_of(const Element& element) const;
    /// Names of the components of x.
    [[nodiscard]] std::vector<std::string> state_names() const;
    /// Number `k` of an indicator, with its variable where the description names one.
    [[nodiscard]] std::string indicator_name(std::size_t k) const;
};

struct Unpacked;

/// An unpacked archive and its description. Copies share both.
class Fmu {
public:
    /// @throws Error if the archive or the description is not one of an FMU of version 2.0 or 3.0,
    /// or the archive is a danger: it leads out of its folder, holds links, or is far larger
    /// unpacked than packed.
    explicit Fmu(const std::filesystem::path& archive);

    /// Content of its description, which lives as long as a copy of the FMU.
    [[nodiscard]] const Description& description() const noexcept;

    /// Whether the archive holds a library for this platform.
    [[nodiscard]] bool has_binary() const;

    /// For the parts of this component.
    [[nodiscard]] const std::shared_ptr<const Unpacked>& unpacked() const noexcept
    {
        return unpacked_;
    }

private:
    std::shared_ptr<const Unpacked> unpacked_;
};

}  // namespace ricochet::fmi
