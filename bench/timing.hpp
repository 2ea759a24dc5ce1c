// Timing on a busy machine: many short samples, their median and their spread.
//
// The clock is the processor time of this thread, so that waiting for other programs is not
// counted. Works to be compared are timed in turns, sample by sample, so that a change of the
// processor's frequency affects all alike.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <utility>
#include <vector>

namespace ricochet::bench {

/// Makes the compiler believe that `value` is read and written here.
template <class T>
inline void keep(T& value)
{
    asm volatile("" : "+m"(value) : : "memory");
}

/// Something that can be done `n` times in a row.
using Work = std::function<void(std::size_t n)>;

/// Makes a work of `function`; its result is kept, so that repetitions are not optimised away.
template <class Function>
[[nodiscard]] Work repeated(Function function)
{
    return [function = std::move(function)](std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) {
            auto result = function();
            keep(result);
        }
    };
}

/// Seconds for one repetition.
struct Timing {
    double median = 0;
    double p10 = 0;  ///< a tenth of the samples were faster
    double p90 = 0;  ///< a tenth of the samples were slower
    std::size_t samples = 0;
    std::size_t repetitions = 0;  ///< in one sample
};

struct TimingOptions {
    double sample = 2e-4;     ///< [s] shortest sample
    double budget = 4e-2;     ///< [s] time for each work
    std::size_t fewest = 11;  ///< samples
    std::size_t most = 201;   ///< samples
};

/// Times all works in turns.
[[nodiscard]] std::vector<Timing> time_in_turns(std::span<const Work> works,
                                                const TimingOptions& options = {});

[[nodiscard]] Timing time_alone(const Work& work, const TimingOptions& options = {});

/// The yardstick by which figures of different machines are compared: one step of
/// 0.01 s of the ball, by odeint's generic `runge_kutta4` with its default algebra
/// on `std::array<double, 2>`. The state is read from memory and written back at
/// every step, as `keep` forces.
[[nodiscard]] Work yardstick();

/// [s] Time of the yardstick on the reference machine.
inline constexpr double yardstick_reference = 4.5e-9;

/// What `seconds` would be on the reference machine, where the yardstick took
/// `yardstick` seconds on this one.
[[nodiscard]] constexpr double scaled(double seconds, const Timing& yardstick) noexcept
{
    return seconds * yardstick_reference / yardstick.median;
}

}  // namespace ricochet::bench
