// Runs of an FMU.
//
// Between two event modes an FMU for model exchange is a function of time, state and inputs, and
// its motion a run of its own here, a *phase*: with one of the library's methods and its location
// of events. A phase ends where
//
//     state    an event indicator has changed its domain, z > 0 or z <= 0
//     time     the FMU's next time event is due
//     step     the FMU has asked for event mode after a completed step
//     input    an input jumps, or a discrete one changes
//
// The event is located to neighbouring doubles at any tolerance. The FMU is put into event mode on
// the new side, iterates its event, and the next phase starts with whatever it has changed. No
// hysteresis is added.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/fmi/fmu.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/run.hpp"

namespace ricochet::fmi {

/// Methods of integration in model exchange.
enum class Method : std::uint8_t {
    automatic,    ///< rosenbrock4 where the FMU gives derivatives that agree with differences, up
                  ///< to 50 states; else dopri5
    dopri5,       ///< order 5, explicit
    fehlberg78,   ///< order 8, explicit, for small errors
    rosenbrock4,  ///< order 4, for stiff motion of up to some dozens of states
};

/// The enumerator's name.
[[nodiscard]] std::string_view name(Method method) noexcept;

/// An input as a function of time: a table, or a function.
///
/// In a table the value of a continuous input is linear between rows, and constant before the first
/// and after the last; that of a discrete input is constant from each row to the next. Two rows of
/// one time are a jump.
struct Input {
    std::string name;         ///< a variable, or an element of one
    std::vector<double> t{};  ///< [s] ascending
    std::vector<double> values{};
    std::function<double(double t)> function{};  ///< instead of a table: smooth
};

/// A level of a variable whose passages a run by co-simulation locates: the FMU takes its step
/// again and again from the kept state of its start, until it ends at the passage. A variable that
/// passes the level and is back within one step is not seen.
struct Watch {
    std::string name;  ///< a variable, or an element of one
    double level = 0;  ///< in its unit
    Crossing crossing = Crossing::either;
};

/// Options of `run`. Times are in seconds.
struct Options {
    std::optional<double> t_start{}, t_end{};  ///< [s] default: those of the FMU, else 0 and 1
    double rtol = 1e-8;  ///< the absolute tolerance of a state is rtol times its nominal value
    Method method = Method::automatic;
    double h_max = std::numeric_limits<double>::infinity();  ///< [s]
    std::uint64_t max_steps = std::numeric_limits<std::uint64_t>::max();
    /// Values of parameters, start values of others, by name.
    std::vector<std::pair<std::string, double>> start{};
    std::vector<Input> inputs{};
    /// Names of the variables that are recorded; empty: the FMU's outputs, or its states where it
    /// has none.
    std::vector<std::string> output{};
    std::vector<double> sample_times{};  ///< [s] ascending, between start and end
    /// [s] Length of the steps of co-simulation; default: the FMU's, else 1/500 of the span.
    std::optional<double> step{};
    /// Whether a run by model exchange or by co-simulation is wanted; default: the first that the
    /// FMU offers.
    std::optional<bool> co_simulation{};
    std::vector<Watch> watch{};  ///< of co-simulation, by an FMU that keeps its state
    const std::atomic<bool>* cancelled = nullptr;  ///< ends the run after the step in progress
};

/// Why an FMU was put into event mode; several causes may hold at one instant. A passage of a
/// watched variable is an event without event mode.
struct Causes {
    bool state = false, time = false, step = false, input = false, passage = false;

    /// Whether there is a cause.
    [[nodiscard]] bool any() const noexcept { return state || time || step || input || passage; }
    [[nodiscard]] bool operator==(const Causes&) const = default;
};

/// "state", "time and input", ...
[[nodiscard]] std::string describe(const Causes& causes);

/// `Event::indicator` of an event without one.
inline constexpr std::size_t no_indicator = static_cast<std::size_t>(-1);

/// An event mode of the FMU, or a passage of a watched variable.
struct Event {
    double t = 0;  ///< [s]
    Causes causes;
    std::size_t indicator = no_indicator;
    std::size_t watch = no_indicator;   ///< of `Options::watch`, of a passage
    std::vector<double> before, after;  ///< states; empty without states
};

/// Recorded values. At an event there are two rows of one time, at a passage there is one.
struct Row {
    /// Where a row was recorded.
    enum class Place : std::uint8_t { sample, before_event, after_event };

    double t = 0;  ///< [s]
    Place place = Place::sample;
    std::vector<double> values;  ///< in the order of `Run::output`
};

/// How a run ended.
enum class End : std::uint8_t {
    reached_end,
    terminated,      ///< the FMU has asked for the end
    chattering,      ///< a thousand events without progress in time
    call_failed,     ///< a function of the FMU has returned an error
    not_integrated,  ///< by `Run::integration`: no step met the tolerance, or the flow ended
};

/// The enumerator's name.
[[nodiscard]] std::string_view name(End end) noexcept;

/// How often each function of the FMU was called.
struct Calls {
    std::uint64_t set_time = 0, set_states = 0, derivatives = 0, indicators = 0;
    std::uint64_t directional = 0, event_modes = 0, rounds = 0, completed_steps = 0, steps = 0;
};

/// Result of a run: everything computed until its end, whatever that was.
struct Run {
    End end = End::reached_end;
    ricochet::Outcome integration = ricochet::Outcome::reached_end;  ///< of the last phase
    double t = 0;                                                    ///< [s] time reached
    std::vector<double> x;                                           ///< state there
    std::vector<Event> events;
    std::vector<std::string> output;  ///< names of the recorded values
    std::vector<Row> rows;
    std::size_t indicator = no_indicator;  ///< that chatters
    std::string message;                   ///< of an end before the end, a sentence
    std::vector<std::string> warnings;
    Method method = Method::dopri5;  ///< that was used
    std::uint64_t steps = 0, rejected = 0;
    Calls calls;

    /// The last recorded value of an output. @throws std::invalid_argument for an unknown one.
    [[nodiscard]] double last(std::string_view name) const;
};

/// One sentence on how the run has ended.
[[nodiscard]] std::string describe(const Run& run);

class Simulation;

/// A run at one time, with everything that its future depends on, and what it has recorded.
class SavedRun {
private:
    friend class Simulation;
    struct Kept;
    std::shared_ptr<const Kept> kept_;
};

/// A run that the caller drives from event to event.
class Simulation {
public:
    /// Starts an instance of the FMU and initializes it, with the arguments and errors of `run`.
    Simulation(const Fmu& fmu, const Options& options);
    ~Simulation();
    Simulation(Simulation&&) noexcept;
    Simulation& operator=(Simulation&&) noexcept;

    [[nodiscard]] double t() const noexcept;  ///< [s]
    [[nodiscard]] const std::vector<double>& x() const noexcept;
    [[nodiscard]] bool ended() const noexcept;
    [[nodiscard]] const Run& run() const noexcept;

    /// Advances to the next event, after it, or to the end. False: the run has ended. Of
    /// co-simulation: one communication step.
    bool advance();

    /// Sets a tunable parameter or an input that has no table, at the present time: the FMU is put
    /// into event mode, which is recorded as an event by an input.
    /// @throws Error if there is no such variable, or it cannot be set during a run.
    void set(std::string_view name, double value);

    /// The present value of a variable. @throws Error if it is unknown or no number.
    [[nodiscard]] double get(std::string_view name);

    /// Keeps the run as it is now, by the FMU's own copy of its state.
    /// @throws Error if the FMU does not offer that (`Interface::saves_state`), or it fails
    [[nodiscard]] SavedRun save();
    /// Goes on from a saved run of this simulation, any number of times; also where it has ended.
    /// @throws Error if it is of another simulation, or the FMU fails or has crashed
    void restore(const SavedRun& saved);

    /// Advances to the end and returns the result.
    [[nodiscard]] Run finish();

    struct Parts;

private:
    std::shared_ptr<Parts> parts_;  ///< shared with what is saved
};

/// Runs an FMU.
///
/// @throws Error if the FMU has no library for this platform, or none with the functions that it
/// needs, gives no instance, cannot be initialized, or does not have what the options name.
/// @throws std::invalid_argument if an option is out of its range.
[[nodiscard]] Run run(const Fmu& fmu, const Options& options = {});

}  // namespace ricochet::fmi
