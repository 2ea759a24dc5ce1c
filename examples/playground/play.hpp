// What the page calls. Arrays belong to the module, and are valid until the next run.
#pragma once

#include <cstddef>

namespace playground {

constexpr std::size_t most_parameters = 8;
constexpr std::size_t most_events = 2000;
constexpr std::size_t path_columns = 3;

/// A row of the table of events.
struct PlayEvent {
    double t;              ///< [s]
    double label;          ///< index of what happened in the page's list of words
    double exact;          ///< [s] the closed form; NaN where there is none
    double at;             ///< the plotted value there
    double before, after;  ///< the value that the table shows
};
static_assert(sizeof(PlayEvent) == 6 * sizeof(double));

}  // namespace playground

// Exported functions keep their names and are not dropped by the linker.
#define PLAY_EXPORT extern "C" __attribute__((used, visibility("default")))

/// Parameters of the next run, `most_parameters` of them, in the order of the page's sliders.
PLAY_EXPORT double* play_parameters();
/// Runs a system by its number; the path has `points` points, none for 0.
/// Returns the number of events, or -1 where `play_message` says what is wrong.
PLAY_EXPORT int play_run(int system, int points);
PLAY_EXPORT const double* play_events();  ///< a `PlayEvent` each
PLAY_EXPORT const double* play_path();    ///< rows: time [s] and two values, NaN if there is one
PLAY_EXPORT int play_path_rows();
PLAY_EXPORT const double* play_counts();  ///< events, steps (or predictions), calls of the flow
PLAY_EXPORT const char* play_message();   ///< how the run ended, in words
/// Runs a system many times without a path, for measurements; returns the sum of its events.
PLAY_EXPORT double play_time_of_runs(int system, int runs);
