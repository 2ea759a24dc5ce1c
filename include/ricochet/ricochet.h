/* ricochet for C: hybrid systems, that is smooth motion with events, resets and modes.
 *
 *     rc_system        the functions of a system, as pointers, and the properties of its guards
 *     rc_simulation    one run of a system, advanced by steps, from event to event, or to the end
 *     rc_monitor       the events of a system in the steps of the program's own integrator
 *
 * Link with the shared library ricochet_c (`ricochet::c` in CMake, `ricochet-c` in pkg-config).
 * C99; the same from C++. docs/c.md is the guide, examples/c/ has whole programs.
 *
 * Times are in seconds. A state is an array of n doubles, where n is the dimension of the system.
 *
 * Results. Functions that can fail return an rc_status, RC_OK for success; those that return a
 * value instead document which value means failure. After a failure
 * `rc_last_error()` says in a sentence what went wrong. How a motion ends (at its end time, at an
 * accumulation of events, because no step met the tolerance) is not a failure: see `rc_outcome()`.
 *
 * Every struct that is passed in or out begins with its own size, as the program was compiled.
 * A library newer than the program takes the fields that are missing as zero, or as an option
 * at its default; an older library refuses the struct with RC_WRONG_SIZE.
 *
 * Threads. A simulation or monitor belongs to one thread at a time: a call made while another is
 * in progress, from another thread or from a callback, is refused with RC_BUSY, except for
 * `rc_cancel`. Different simulations and monitors may run at the same time, even of one system,
 * if its callbacks allow it.
 *
 * Handles. A handle that is null, freed or of another kind is refused with RC_BAD_HANDLE. Only
 * debug builds of the library, which keep its memory, are certain to recognise a freed handle.
 */
#ifndef RICOCHET_RICOCHET_H
#define RICOCHET_RICOCHET_H

#include <stddef.h>
#include <stdint.h>

#if defined(RC_BUILDING_LIBRARY) && defined(__GNUC__)
#define RC_API __attribute__((visibility("default")))
#else
#define RC_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* --- results ----------------------------------------------------------------------------- */

/** Status of a call. */
typedef enum rc_status {
    RC_OK = 0,
    RC_INVALID = 1,    /**< an argument, an option or the system is not as it has to be */
    RC_CALLBACK = 2,   /**< a callback returned a number other than 0, see rc_callback_error */
    RC_NO_MEMORY = 3,  /**< nothing has changed */
    RC_BUSY = 4,       /**< the handle is in another call, of a thread or around a callback */
    RC_BAD_HANDLE = 5, /**< null, freed, or of another kind */
    RC_WRONG_SIZE = 6, /**< a struct of a newer header than the library, or of none */
    RC_INTERNAL = 7,   /**< a defect of the library, or an exception from a callback */
    RC_OUT_OF_TURN = 8 /**< not what the monitor expects next; nothing has changed */
} rc_status;

/** Message of the last failure in this thread: what was given and what was expected; empty if
 *  there was none. Valid until the next failure in this thread. */
RC_API const char* rc_last_error(void);

/** The name of a status, e.g. "RC_BUSY"; "unknown" for any other number. */
RC_API const char* rc_status_name(rc_status status);

/** The version of the library, e.g. "0.1.0". */
RC_API const char* rc_version(void);

/* --- systems ----------------------------------------------------------------------------- */

/** A hybrid system: its callbacks and the properties of its guards. Immutable, so that
 *  simulations and threads may share it. */
typedef struct rc_system rc_system;

/** The discrete state, counted from 0. */
typedef uint32_t rc_mode;

/** The sign change of a guard that counts as its event, as the run meets it. */
typedef enum rc_crossing {
    RC_FALLING = 0, /**< positive, then zero or negative: leaving the mode */
    RC_RISING = 1,
    RC_EITHER = 2
} rc_crossing;

/** Stands for "no guard" in place of the number of a guard. */
#define RC_NO_GUARD ((size_t)-1)
/** Stands for the reset of a time event in place of the number of a guard. */
#define RC_TIME_EVENT_RESET ((size_t)-2)
/** Stands for "no reaction" in place of the number of a reaction. */
#define RC_NO_REACTION ((size_t)-1)

/** Properties of a guard. All fields but the size may be zero. */
typedef struct rc_guard_info {
    size_t size;         /**< sizeof(rc_guard_info) */
    const char* name;    /**< for messages, copied; null: none */
    int32_t crossing;    /**< an rc_crossing */
    int32_t notifies;    /**< 1: its events are only recorded, no reset is called */
    int32_t unilateral;  /**< 1: g >= 0 bounds the motion; needs a reset, and RC_FALLING */
    int32_t boolean;     /**< 1: only its sign means anything: no rates, located by bisection */
    uint32_t stop_after; /**< the run ends with this many of its events; 0: never */
    int32_t degree;      /**< of the guard as a polynomial in (t, x) together; 0: not known */
    double touch;        /**< |g| up to which a zero of its rate counts as a touch */
    double lipschitz;    /**< largest change per unit of path, see speed_bound; 0 means 1 */
    int32_t at_start;    /**< 1: it fires at the start of a run, and */
    int32_t at_entry;    /**< 1: where its mode begins by a change of mode, if it is beyond its
                            surface there, or on it and does not move inside; not for RC_EITHER */
} rc_guard_info;

/* Callbacks. Each returns 0 for success. Any other number is an error of the program's own: the
 * call in progress then returns RC_CALLBACK, and the run stands after its last complete step or
 * event. `user` is the member of rc_callbacks. `x` has `n` doubles; where it is const it must not
 * be written to. Steps are repeated, so a callback must not have side effects that change what it
 * computes. It must not jump out (longjmp). `mode` is 0 in systems without modes. */

/** Writes x' = f(t, x) into `dxdt`, all n doubles. */
typedef int (*rc_flow_fn)(void* user, rc_mode mode, double t, const double* x, double* dxdt,
                          size_t n);
/** Writes all guards into `g`, `count` doubles: positive inside the mode, zero on surfaces. */
typedef int (*rc_guards_fn)(void* user, rc_mode mode, double t, const double* x, size_t n,
                            double* g, size_t count);
/** Writes guard `which` into `g`. */
typedef int (*rc_guard_fn)(void* user, size_t which, rc_mode mode, double t, const double* x,
                           size_t n, double* g);
/** Writes the rates dg/dt of all guards along the flow into `rates`; `dxdt` is x'. */
typedef int (*rc_guard_rates_fn)(void* user, rc_mode mode, double t, const double* x,
                                 const double* dxdt, size_t n, double* rates, size_t count);
/** Writes the rate dg/dt of guard `which` along the flow into `rate`. */
typedef int (*rc_guard_rate_fn)(void* user, size_t which, rc_mode mode, double t, const double* x,
                                const double* dxdt, size_t n, double* rate);
/** Replaces the state before the event of guard `which` by the state after it, and the mode by
 *  the next mode, both in place. Components that are not written keep their values. */
typedef int (*rc_reset_fn)(void* user, size_t which, rc_mode* mode, double t, double* x, size_t n);
/** Applies the resets of all guards that fired together, ascending in `fired`; `on_time` is 1 if
 *  the set includes a time event. */
typedef int (*rc_reset_set_fn)(void* user, const size_t* fired, size_t count, int on_time,
                               rc_mode* mode, double t, double* x, size_t n);
/** Writes 1 into `enabled` if guard `which` is examined in this mode, else 0. */
typedef int (*rc_enabled_in_fn)(void* user, size_t which, rc_mode mode, int* enabled);
/** Writes 1 into `enabled` if a crossing of guard `which` here is an event, else 0. */
typedef int (*rc_enabled_fn)(void* user, size_t which, rc_mode mode, double t, const double* x,
                             size_t n, int* enabled);
/** Writes the first time event after t (not at t) into `next`, or INFINITY if there is none; for
 *  runs backward in time the last one before t, or -INFINITY. */
typedef int (*rc_time_event_fn)(void* user, double t, double* next);
/** Writes the next time event of a timer in the state into `next`: t, if it is due now, a time
 *  after it, or INFINITY. It is asked at the start and after every set of events. */
typedef int (*rc_timer_fn)(void* user, rc_mode mode, double t, const double* x, size_t n,
                           double* next);
/** Same as rc_reset_fn, for a time event. */
typedef int (*rc_time_reset_fn)(void* user, rc_mode* mode, double t, double* x, size_t n);
/** Writes a bound of guard `which`, valid at (t, x), into `bound`. */
typedef int (*rc_bound_fn)(void* user, size_t which, rc_mode mode, double t, const double* x,
                           size_t n, double* bound);
/** Writes the value of the parameter `name`, on which a gate depends, into `value`. Leaves `value`
 *  unchanged, NaN, if the system has no such parameter. */
typedef int (*rc_parameter_fn)(void* user, const char* name, double* value);

/* Callbacks of set-valued motion: `w` is the state, with `n` doubles. */

/** Writes f(t, w) of an rc_inclusion into `f`, all n doubles. */
typedef int (*rc_smooth_fn)(void* user, rc_mode mode, double t, const double* w, double* f,
                            size_t n);
/** Writes the bounds of the `m` reactions into `lower` and `upper`; -INFINITY and INFINITY: none.
 */
typedef int (*rc_reaction_bounds_fn)(void* user, rc_mode mode, double t, const double* w, size_t n,
                                     double* lower, double* upper, size_t m);
/** Writes the largest |r| with which each of the `m` reactions holds its y at zero. */
typedef int (*rc_static_bounds_fn)(void* user, rc_mode mode, double t, const double* w, size_t n,
                                   double* bounds, size_t m);
/** Writes s(t) and its rate s'(t), `m` doubles each. */
typedef int (*rc_surface_fn)(void* user, rc_mode mode, double t, double* s, double* rate, size_t m);
/** The reset of a change of reaction `which`; `kind` is RC_STICK, RC_SLIP or RC_MODE. Changes the
 *  mode and the state in place. */
typedef int (*rc_change_fn)(void* user, size_t which, int32_t kind, rc_mode* mode, double t,
                            double* x, size_t n);
/** Replaces the mode by the one in which the flow of the system is followed again from (t, x). */
typedef int (*rc_start_mode_fn)(void* user, rc_mode* mode, double t, const double* x, size_t n);

/** Set-valued motion of the state of a system: dry friction, relays, diodes, stops.
 *
 *      A w' = f(t, w) + G r,   y = E w - s(t),   lower <= r <= upper,
 *
 *  r at its upper bound where y < 0, at its lower bound where y > 0, in between where y = 0. The
 *  flow of the system is followed while every y is clear of zero. Matrices are stored by rows.
 *  Zero the struct, then set its size and other members. Everything but the functions is copied. */
typedef struct rc_inclusion {
    size_t size;                  /**< sizeof(rc_inclusion) */
    size_t reactions;             /**< m, 1 to 4; the state has at most 8 components */
    rc_smooth_fn smooth;          /**< required */
    rc_reaction_bounds_fn bounds; /**< required */
    rc_surface_fn offset;         /**< null: s = 0 */
    const double* mass;           /**< A, n x n; null: the unit matrix */
    const double* observe;        /**< E, m x n; null: the first m components */
    const double* act;            /**< G, n x m; null: the transpose of E */
    const size_t* stands_for;     /**< guard_count of them: the reaction that is asked where events
                                     of a guard accumulate, press, or leave it on its surface with
                                     y at rest, or RC_NO_REACTION; null: found for guards that are
                                     a y */
    const int32_t* in_modes;      /**< mode_count of them: 0 where a mode has no inclusion, and the
                                     flow alone is followed; null: 1 for all */
    rc_change_fn change;          /**< null: none */
    rc_start_mode_fn start_mode;  /**< null: the mode stays */
    rc_static_bounds_fn static_bounds; /**< of static friction, no less than `bounds`, which have to
                                          contain 0; null: `bounds` hold, too */
} rc_inclusion;

/** Description of a system. Zero it, then set its size, dimension, flow and other members. */
typedef struct rc_callbacks {
    size_t size;        /**< sizeof(rc_callbacks) */
    size_t dimension;   /**< n, the number of components of the state, at least 1 */
    size_t guard_count; /**< 0: an ordinary differential equation */
    size_t mode_count;  /**< 0: there are no modes */
    const char* name;   /**< copied; snapshots and gates belong to a name. null: "callbacks" */
    void* user;         /**< handed to every callback; must outlive the system */
    const rc_guard_info* guard_infos; /**< guard_count of them, copied; null: all fields zero */

    rc_flow_fn flow;               /**< required */
    rc_guards_fn guards;           /**< this or `guard` is required where there are guards */
    rc_guard_fn guard;             /**< saves evaluating the others while one is located */
    rc_guard_rates_fn guard_rates; /**< without both, rates are differences along the flow */
    rc_guard_rate_fn guard_rate;
    rc_reset_fn reset;                    /**< null: events change nothing */
    rc_reset_set_fn reset_set;            /**< in place of `reset` */
    rc_reset_fn rest;                     /**< continues the motion where events accumulate */
    rc_enabled_in_fn enabled_in;          /**< null: all guards in all modes */
    rc_enabled_fn enabled;                /**< null: every crossing is an event */
    rc_time_event_fn next_time_event;     /**< null: none */
    rc_time_event_fn previous_time_event; /**< for runs backward in time */
    rc_time_reset_fn time_reset;          /**< null: a time event changes nothing */

    /* How fast guards can change, for RC_PLANNED; see ricochet/bounds.hpp. */
    rc_bound_fn speed_bound; /**< upper bound of the path per second, now */
    rc_bound_fn
        acceleration_bound;  /**< change of that speed per second; null: speed_bound always holds */
    rc_bound_fn lower_bound; /**< guard >= this; null: none is known */
    rc_bound_fn upper_bound; /**< guard <= this; null: none is known */

    rc_parameter_fn parameter; /**< null: the gate's parameters are not compared */

    /* Other ways to say when time events happen; at most one of all, next_time_event included. */
    rc_timer_fn next_time_event_at; /**< of timers in the state */
    const double* time_events;      /**< a list, copied, in any order, from the start to the end of
                                       a run, both included, and as often as each is listed */
    size_t time_event_count;        /**< number of them */
    double time_event_period;       /**< [s] above 0: a clock that ticks at all times phase + k
                                       period, from the start to the end, both included */
    double time_event_phase;        /**< [s] */
    const rc_inclusion* set_valued; /**< null: none. Not for monitors */
} rc_callbacks;

/** Ends the run at the event whose reset, or time_reset, returns the result of this call:
 *
 *      if (*level <= 0) return rc_stop("the tank is empty");
 *
 *  The outcome is RC_STOPPED_BY_EVENT, state and mode are what the callback has written, and
 *  rc_reason() returns a copy of the text, which may be null. */
RC_API int rc_stop(const char* reason);

/** The first tick phase + k period after t, for the whole numbers k; NaN unless period is positive.
 *  For callbacks of timers that contain a clock. */
RC_API double rc_next_tick(double period, double phase, double t);
/** The first of `count` ascending times after t, or INFINITY. */
RC_API double rc_next_listed(const double* times, size_t count, double t);

/** Creates a system; `*system` is null after a failure. The callbacks struct need not be kept.
 *  RC_INVALID: no flow, no dimension, guards without a callback. RC_WRONG_SIZE, RC_NO_MEMORY. The
 *  properties of guards are checked when a simulation or a monitor is created. */
RC_API rc_status rc_system_new(const rc_callbacks* callbacks, rc_system** system);

/** Releases the system; its simulations and monitors keep what they need. Null is allowed. */
RC_API void rc_system_free(rc_system* system);

/* --- options ----------------------------------------------------------------------------- */

/** The integration method. */
typedef enum rc_method {
    RC_DOPRI5 = 0,     /**< order 5, error estimate, dense output */
    RC_FEHLBERG78 = 1, /**< order 8, error estimate: the cheapest for small errors */
    RC_CASH_KARP54 = 2,
    RC_RK4 = 3,   /**< fixed steps only */
    RC_EULER = 4, /**< fixed steps only */
    RC_TAYLOR = 5 /**< power series, which need the flow as a formula: refused for callbacks, and
                     offered by C++ (ricochet/taylor/taylor.hpp) and by ready systems in Python */
} rc_method;

/** How events in a step are detected. */
typedef enum rc_detector {
    RC_EXTREMUM = 0,  /**< ends and extremum inside, a check inside each step */
    RC_ENDS = 1,      /**< ends of the step only */
    RC_BERNSTEIN = 2, /**< proves for guards that declare a degree */
    RC_PLANNED = 3,   /**< checks as declared bounds require; same events as RC_EXTREMUM */
    /* These need a trained gate, `rc_options.gate`: */
    RC_CALIBRATED = 4, /**< checks when a horizon gate says so; misses events at a measured rate */
    RC_CALIBRATED_BOUNDS = 5, /**< as RC_PLANNED, with the levels of a level gate as bounds */
    RC_FORESEEN = 6 /**< as RC_PLANNED; a horizon gate forecasts when a check is worth making */
} rc_detector;

/** How an event is located in its step. */
typedef enum rc_locator { RC_NEWTON = 0, RC_BISECTION = 1, RC_TOMS748 = 2 } rc_locator;

/** Options of a run. Fill them with rc_options_default, then change those that differ; t_end has
 *  no default. */
typedef struct rc_options {
    size_t size;           /**< sizeof(rc_options) */
    double t_start;        /**< [s], 0 */
    double t_end;          /**< [s]; before t_start: backward in time; infinite where a guard with
                              stop_after, stop_at_event or max_steps ends the run */
    rc_mode mode;          /**< at the start, 0 */
    int32_t method;        /**< an rc_method, RC_DOPRI5 */
    int32_t fixed_step;    /**< 1: steps of the length `step`; 0: error control */
    int32_t detector;      /**< an rc_detector, RC_EXTREMUM */
    int32_t locator;       /**< an rc_locator, RC_NEWTON */
    int32_t check_inside;  /**< 1: RC_EXTREMUM evaluates the guards once inside each step */
    int32_t stop_at_event; /**< 0; 1: the run ends with its first event */
    int32_t record_events; /**< 1; 0: events are counted, not kept */
    int32_t event_states;  /**< 1; 0: events without a reset are kept without their states if
                              the state has more than four components */
    int32_t record_steps;  /**< 0; 1: every step is kept, for rc_solution */
    double step;  /**< [s] of fixed steps, required there; else of the first step, 0: estimated */
    double rtol;  /**< 1e-8; a step is accepted if each error is below atol + rtol |x| */
    double atol;  /**< 1e-10 */
    double h_min; /**< [s], 0: a few units in the last place of the time */
    double h_max; /**< [s], INFINITY */
    double event_tolerance;     /**< [s] of the bracket of an event, 0: neighbouring doubles */
    double event_rtol;          /**< added to it per second of |t|, 0 */
    double event_window;        /**< [s] within which events happen together, 0 */
    const double* sample_times; /**< [s] where the trajectory is wanted, in the order of the run,
                                   copied; null: none */
    size_t sample_count;        /**< 0 */
    uint64_t max_steps;         /**< UINT64_MAX */
    uint64_t stall_steps; /**< the run ends as RC_STALLED if this many steps in a row, 1000000,
                             advance the time by less than 1e-9 of the span, or 20000 without
                             an event so little that 100 max_steps would not reach the end;
                             0: no limit */
    const char* gate;     /**< path of the model for detectors with a gate, else null */
    const double* component_atol; /**< one for each component in place of atol, copied; null */
    size_t component_count;       /**< number of them, 0 */
    int32_t continues; /**< 0; 1: t_start belongs to the run before: nothing happens there by the
                          list or the clock of the system, nor by at_start of its guards. A timer
                          of next_time_event_at that is due there has its event */
    int32_t reserved;  /**< 0 */
} rc_options;

/** Fills in the defaults; `size` is sizeof(rc_options), and t_end becomes NaN. RC_WRONG_SIZE. */
RC_API rc_status rc_options_default(rc_options* options, size_t size);

/* --- runs -------------------------------------------------------------------------------- */

/** A run in progress, or at its end. */
typedef struct rc_simulation rc_simulation;

/** How a run ended. */
typedef enum rc_outcome_code {
    RC_RUNNING = -1, /**< it has not ended */
    RC_REACHED_END = 0,
    RC_STOPPED_BY_EVENT = 1,
    RC_ZENO = 2,         /**< events accumulate and nothing stops the motion */
    RC_OUTSIDE_MODE = 3, /**< a reset left the state behind a unilateral guard */
    RC_ENDLESS_CASCADE = 4,
    RC_CONFLICTING_RESETS = 5,
    RC_UNKNOWN_MODE = 6,
    RC_STEP_UNDERFLOW = 7, /**< no step above h_min met the tolerance */
    RC_STEP_LIMIT = 8,
    RC_NON_FINITE = 9, /**< the flow, a guard or a reset gave NaN or infinity */
    RC_CANCELLED = 10, /**< by rc_cancel; the run can be continued */
    RC_WRONG_BOUND = 11,
    RC_NOT_CONVERGED = 12,
    RC_TIME_EVENT_NOT_AHEAD = 13,
    RC_WRONG_DIMENSION = 14,
    RC_STALLED = 15,
    RC_STOPPED_BY_CALLBACK = 16, /**< a callback failed; the run can be continued */
    /* Of systems with set_valued; 17 and 19 are never returned. */
    RC_NOT_HANDED_OVER = 18, /**< no reaction within its bounds goes with y, see rc_reason */
    RC_LAW_VIOLATED = 20,    /**< the flow contradicts the inclusion, see rc_reason */
    RC_SEVERAL = 21          /**< several motions satisfy the law of a reaction, see rc_reason */
} rc_outcome_code;

/** Creates a run of `system` from x0, n doubles, which are copied, and evaluates the flow and the
 *  guards there. `n` must be the dimension of the system. `*simulation` is null after a failure.
 *  RC_INVALID with the option in question, RC_CALLBACK, RC_NO_MEMORY, RC_BAD_HANDLE,
 *  RC_WRONG_SIZE. */
RC_API rc_status rc_simulation_new(const rc_system* system, const double* x0, size_t n,
                                   const rc_options* options, rc_simulation** simulation);

/** Frees the simulation and everything obtained from it. Null is allowed; RC_BUSY while it runs,
 *  and then nothing is freed. */
RC_API rc_status rc_simulation_free(rc_simulation* simulation);

/* The next three functions return RC_CALLBACK if a callback failed. Results so far are kept, time
 * and state are those of the last complete step or event, the outcome is RC_STOPPED_BY_CALLBACK,
 * and the next call continues from there, with the same bits as if nothing had happened. A run that
 * has ended stays as it is. */

/** Takes one step, with any events that it holds. Writes 0 into `goes_on` (which may be null) if
 *  the run has ended, else 1. */
RC_API rc_status rc_step(rc_simulation* simulation, int* goes_on);

/** Advances to the next sample time or event, recorded events included; what happens at one instant
 *  is shown once. Events whose states are not kept (`event_states`) are shown at the end of their
 *  step. Writes 0 into `goes_on` if the run has ended and everything that happened has been shown,
 *  else 1. */
RC_API rc_status rc_advance(rc_simulation* simulation, int* goes_on);

/** Advances to the end. */
RC_API rc_status rc_run(rc_simulation* simulation);

/** Ends the run after the step in progress, with the outcome RC_CANCELLED. May be called from any
 *  thread, a signal handler or a callback. The next call that advances the run continues it. */
RC_API rc_status rc_cancel(rc_simulation* simulation);

/** The last failure of a callback. */
typedef struct rc_callback_error {
    size_t size;          /**< sizeof(rc_callback_error), filled in by the caller */
    int32_t code;         /**< number that it returned; 0: none has failed */
    uint32_t reserved;    /**< 0 */
    const char* callback; /**< its name in rc_callbacks, e.g. "flow", or in rc_host_step; null:
                               none has failed */
    size_t guard;         /**< for which it was called, else RC_NO_GUARD */
    double t;             /**< [s] at which it was called; NaN: none */
} rc_callback_error;

/** Describes the last failure of a callback in this run. After RC_CALLBACK of rc_simulation_new,
 *  which leaves no simulation, pass null for the last such failure in this thread. */
RC_API rc_status rc_callback_failure(rc_simulation* simulation, rc_callback_error* error);

/* --- results of a run -------------------------------------------------------------------- */

/** The time [s]; NaN for a handle that cannot be used. */
RC_API double rc_time(rc_simulation* simulation);
/** The state at that time, n doubles, valid until the next call that advances, restores or frees
 *  the simulation; null for a handle that cannot be used. */
RC_API const double* rc_state(rc_simulation* simulation);
/** The mode at that time; UINT32_MAX for a handle that cannot be used. */
RC_API rc_mode rc_mode_now(rc_simulation* simulation);

/** How the run ended; RC_RUNNING before, and for a handle that cannot be used. */
RC_API rc_outcome_code rc_outcome(rc_simulation* simulation);
/** The name of an outcome, e.g. "reached_end"; "running"; "unknown" for any other number. */
RC_API const char* rc_outcome_name(rc_outcome_code outcome);
/** One sentence about an outcome, with the remedy. */
RC_API const char* rc_outcome_text(rc_outcome_code outcome);
/** The text of rc_stop() that ended the run, a sentence about the reactions that did, or, of
 *  RC_NON_FINITE, which function was not finite; else empty, and for a handle that cannot be used.
 * Valid until the next call that advances, restores or frees the simulation. */
RC_API const char* rc_reason(rc_simulation* simulation);
/** A sentence about the run so far: that about its outcome with the text of rc_stop(), and the
 *  guards that were armed beyond their surface. Valid until the next call with this simulation;
 *  empty for a handle that cannot be used. */
RC_API const char* rc_describe(rc_simulation* simulation);

/** Counts over a run. */
typedef struct rc_statistics {
    size_t size;               /**< sizeof(rc_statistics), filled in by the caller */
    uint64_t steps;            /**< accepted, also those cut short by an event */
    uint64_t rejected;         /**< steps that failed the error test */
    uint64_t refined_steps;    /**< steps divided for a guard that they did not resolve */
    uint64_t unresolved_steps; /**< of these, not resolved by the finest division */
    uint64_t resteps;          /**< steps repeated from their start to locate an event */
    uint64_t flow_calls;
    uint64_t guard_calls;
    uint64_t network_calls;   /**< of gates */
    uint64_t late_events;     /**< missed at first, found at a later step */
    uint64_t checks_deferred; /**< steps whose exact check a plan or a gate deferred for good */
    uint64_t outside_domain;  /**< states outside the box of a gate: checked exactly */
    uint64_t bound_calls;
    uint64_t rollbacks;      /**< returns to a step that could not be closed */
    uint64_t repeated_steps; /**< steps taken again after a rollback */
    uint64_t events;
    uint64_t suppressed; /**< repeats of an event inside its own window */
    uint64_t disabled;   /**< crossings that `enabled` rejected */
    /* Steps without an event, by the evidence for it. */
    uint64_t proved;             /**< a bound or a polynomial excludes a root */
    uint64_t checked;            /**< the ends and the extremum inside were examined */
    uint64_t gated;              /**< a calibrated gate skipped the check */
    uint64_t assumed;            /**< only the ends were examined */
    size_t guard;                /**< the guard that ended the run, or RC_NO_GUARD */
    size_t other_guard;          /**< the second of two conflicting resets, or of a cycle;
                                    RC_TIME_EVENT_RESET */
    uint64_t unmet_conditions;   /**< events whose guard had not left its side in any state found */
    uint64_t ineffective_resets; /**< events whose reset changed neither the state nor the mode */
    size_t declined_guard;       /**< of the last of them that was asked twice, or RC_NO_GUARD */
    uint64_t either_relays;      /**< events of RC_EITHER from which another mode turns back */
    size_t relay_guard;          /**< of the last of them, or RC_NO_GUARD */
    uint64_t armed_beyond; /**< guards with an effect that were beyond their surface at the start or
                              where a mode enabled them, and wait until they have returned */
} rc_statistics;

/** Fills in the counts. RC_WRONG_SIZE, RC_BAD_HANDLE, RC_BUSY. */
RC_API rc_status rc_get_statistics(rc_simulation* simulation, rc_statistics* statistics);

/** Kind of an event. */
typedef enum rc_event_kind {
    RC_CROSSING = 0,     /**< the guard changed sign */
    RC_TOUCH = 1,        /**< the guard reached its surface and turned back */
    RC_TIME = 2,         /**< a time event */
    RC_ACCUMULATION = 3, /**< the limit of infinitely many events */
    RC_MODE = 4,         /**< the flow lifts what the rest of the guard held; of a reaction: it went
                            from one of its bounds to the other */
    RC_STICK = 5,        /**< a reaction at a bound began to hold */
    RC_SLIP = 6,         /**< a reaction that held met a bound */
    RC_JUMP = 7          /**< the guard changed sign without a zero */
} rc_event_kind;

/** One event. */
typedef struct rc_event {
    size_t size;  /**< sizeof(rc_event), filled in by the caller */
    double t;     /**< [s] */
    size_t guard; /**< or RC_NO_GUARD */
    int32_t kind; /**< an rc_event_kind */
    int32_t late; /**< 1: found at a step after the one that held it */
    rc_mode mode_before;
    rc_mode mode_after;
    const double* before; /**< n doubles; null if not kept. Valid until the simulation continues */
    const double* after;  /**< n doubles, the same as before where nothing is reset */
    double bracket_lo;    /**< [s] the guard is still on its side here, */
    double bracket_hi;    /**< [s] and has left it here */
    double slope;         /**< rate of the guard [1/s]; NaN if not computed */
    double error;         /**< [s] of location within the step, not of the solution */
    size_t reaction;      /**< of a stick, a slip, a mode or a touch of a reaction, else
                             RC_NO_REACTION */
} rc_event;

/** Number of events recorded so far; 0 for a handle that cannot be used. */
RC_API size_t rc_event_count(rc_simulation* simulation);
/** Event `index`, in the order of time. RC_INVALID if there is none. */
RC_API rc_status rc_event_at(rc_simulation* simulation, size_t index, rc_event* event);

/** Why a phase of a run began. */
typedef enum rc_phase_cause {
    RC_CAUSE_START = 0,
    RC_CAUSE_NO_FLOW = 2,       /**< y' = 0 does not determine the held reactions */
    RC_CAUSE_SEVERAL = 3,       /**< changes coincide, and rates do not tell what follows */
    RC_CAUSE_ACCUMULATION = 4,  /**< infinitely many changes in finite time */
    RC_CAUSE_CHATTERING = 5,    /**< more changes in a short time than are worth locating */
    RC_CAUSE_STUCK = 6,         /**< steps by events could not go on */
    RC_CAUSE_CONTRADICTION = 7, /**< a step by events contradicted the law of a reaction */
    RC_CAUSE_RELEASED = 8,      /**< nothing is held any more */
    RC_CAUSE_HELD = 9           /**< a y arrived at zero, and its reaction holds it */
} rc_phase_cause;

/** A part of a run of a system with set_valued, until the next one or the end. */
typedef struct rc_phase {
    size_t size;        /**< sizeof(rc_phase), filled in by the caller */
    double from;        /**< [s] */
    int32_t set_valued; /**< 1: something is held, or followed by implicit steps */
    int32_t cause;      /**< an rc_phase_cause */
} rc_phase;

/** Number of phases so far; 0 without set_valued and for a handle that cannot be used. */
RC_API size_t rc_phase_count(rc_simulation* simulation);
/** Phase `index`, in the order of time. RC_INVALID if there is none. */
RC_API rc_status rc_phase_at(rc_simulation* simulation, size_t index, rc_phase* phase);

/** Number of samples taken so far, see `sample_times`; 0 for a handle that cannot be used. */
RC_API size_t rc_sample_count(rc_simulation* simulation);
/** The time [s] of sample `index` into `t` and its state, n doubles until the simulation continues,
 *  into `x`; either may be null. RC_INVALID if there is none. */
RC_API rc_status rc_sample_at(rc_simulation* simulation, size_t index, double* t, const double** x);

/** The reactions of a system with set_valued at rc_time, after the events there: `m` doubles until
 *  the next call with this simulation. m is 0 where the mode has no inclusion, and in systems
 *  without; NaN: none follows from the state. */
RC_API rc_status rc_reaction(rc_simulation* simulation, const double** r, size_t* m);
/** The same at sample `index`, until the simulation continues. RC_INVALID if there is none. */
RC_API rc_status rc_reaction_at(rc_simulation* simulation, size_t index, const double** r,
                                size_t* m);

/** The state at time t [s], after an event at t, into x, n doubles, where `record_steps` is set:
 *  before the first and after the last step the nearest state. RC_INVALID if no step was kept, n is
 *  not the dimension or t is NaN. */
RC_API rc_status rc_solution(rc_simulation* simulation, double t, double* x, size_t n);
/** The same before an event at t. */
RC_API rc_status rc_solution_before(rc_simulation* simulation, double t, double* x, size_t n);
/** The mode at time t, after an event at t. */
RC_API rc_status rc_solution_mode(rc_simulation* simulation, double t, rc_mode* mode);

/** Saves everything on which the future of the run depends, as text without a terminating zero. On
 *  entry `*size` is the capacity of `bytes`, on return the number of bytes needed. If `bytes` is
 *  null, only that number is computed; RC_INVALID if the capacity is too small. Recorded results
 *  are not saved. After a failure of a callback guards may be evaluated: RC_CALLBACK if they fail.
 */
RC_API rc_status rc_save(rc_simulation* simulation, void* bytes, size_t* size);
/** Returns to a state saved from this or another simulation of the same system with the same
 *  options; only the end, the sample times and what is recorded may differ. Recorded results are
 *  kept. RC_INVALID names what does not agree; then nothing has changed. */
RC_API rc_status rc_restore(rc_simulation* simulation, const void* bytes, size_t size);

/** Goes on from the `n` doubles `x` at time t in a mode, as from a start: guards are armed again,
 * an event of the list, the clock or next_time_event at t belongs to the past, and a timer of
 * next_time_event_at that is due there has its event. t may be any time from t_start to before
 * t_end, also one at which rc_advance has stopped inside a step; what was recorded after it is
 * dropped. A run that has ended goes on. RC_INVALID if t lies outside of the run, or
 * rc_simulation_new would refuse such a start; then, and after RC_CALLBACK, nothing has changed. */
RC_API rc_status rc_restart(rc_simulation* simulation, double t, const double* x, size_t n,
                            rc_mode mode);
/** Moves the end of the run to `t_end`. A run that has reached its end goes on. RC_INVALID if it
 *  does not lie ahead of the last step; then nothing has changed. */
RC_API rc_status rc_extend(rc_simulation* simulation, double t_end);

/* --- monitors ---------------------------------------------------------------------------- */

/** Finds the events of a motion that the program, called the host, integrates itself. The host
 *  shows every step that its integrator has accepted, in order, each beginning where the last one
 *  ended; steps that it rejects are never shown. Steps are half-open, (t0, t0 + h]. The monitor
 *  does not change the host:
 *
 *      rc_monitor_start(monitor, t, x, dxdt, n, 0, h, &verdict);
 *      while (verdict == RC_STANDS && t < t_end) {
 *          step, to rc_monitor_must_stop_at(monitor) at most
 *          rc_monitor_examine(monitor, &step, &verdict);
 *          if (verdict == RC_STANDS) continue from the end of the step
 *          while (verdict == RC_CUT) {
 *              rc_monitor_cut(monitor, &cut);
 *              continue from cut.t and cut.after
 *              rc_monitor_resume(monitor, dxdt, n, h, &verdict);
 *          }
 *      }
 *
 *  At an event the monitor does what a run would do that takes the same steps. */
typedef struct rc_monitor rc_monitor;

/** Options of a monitor. Fill them with rc_monitor_options_default, then change those that
 *  differ. */
typedef struct rc_monitor_options {
    size_t size;            /**< sizeof(rc_monitor_options) */
    double event_tolerance; /**< [s] of the bracket of an event, 0: neighbouring doubles */
    double event_rtol;      /**< added to it per second of |t|, 0 */
    double event_window;    /**< [s] within which events happen together, 0 */
    int32_t detector;       /**< an rc_detector, RC_EXTREMUM */
    int32_t locator;        /**< an rc_locator, RC_NEWTON */
    int32_t check_inside;   /**< 1: RC_EXTREMUM evaluates the guards once inside each step */
    int32_t record_events;  /**< 1; 0: events are counted, not kept */
    int32_t event_states;   /**< 1; as in rc_options */
    int32_t backward;       /**< 0; 1: the host's time runs backward */
    int32_t cut_at_all; /**< 0; 1: every crossing ends its step, whether the system has a reset for
                           it or not: for hosts that change the state themselves */
    int32_t reserved;   /**< 0 */
    const char* gate;   /**< path of the model for detectors with a gate, else null */
} rc_monitor_options;

/** Fills in the defaults; `size` is sizeof(rc_monitor_options). RC_WRONG_SIZE. */
RC_API rc_status rc_monitor_options_default(rc_monitor_options* options, size_t size);

/** Decision of a monitor about a step. */
typedef enum rc_verdict {
    RC_NO_VERDICT = -1, /**< the call has failed, see its status */
    RC_STANDS = 0,      /**< the step stands: continue from its end */
    RC_CUT = 1,   /**< it ends at a set of events: continue from `after` of rc_cut, and resume */
    RC_RESTS = 2, /**< the motion has come to rest: keep the state, and hold */
    RC_ENDED = 3  /**< the run is over, rc_monitor_outcome says why */
} rc_verdict;

/** Computes n doubles at the offset s [s] in [0, h] from the start of a step. Returns 0, or an
 *  error of the host's own. */
typedef int (*rc_offset_fn)(void* user, double s, double* x, size_t n);

/** A step that a host has accepted, from t0 to t0 + h, or t0 - h backward. It is read only during
 *  the call to which it is passed. Rates are with respect to offsets: those of the path that
 *  `interpolate` follows, backward in time -x'. */
typedef struct rc_host_step {
    size_t size;         /**< sizeof(rc_host_step) */
    size_t n;            /**< finite doubles in each array, the dimension of the system */
    double t0;           /**< [s] */
    double t0_remainder; /**< [s] rounding error of t0, if the host carries it along; 0 if not */
    double h;            /**< [s] above 0 */
    const double* x0;    /**< the states at its start, */
    const double* x1;    /**< and at its end */
    const double* rate0; /**< the rates at its start, */
    const double* rate1; /**< and at its end */
    void* user;          /**< handed to the three below */
    rc_offset_fn interpolate;      /**< the state; null: the cubic through both ends */
    rc_offset_fn interpolate_rate; /**< its derivative; null: a difference over 1e-4 h, and events
                                      near tangency are found less finely */
    rc_offset_fn restep; /**< the state by a step of length s from the start, as exact as the whole
                            one: events are located on it; null: on `interpolate` */
} rc_host_step;

/** A set of events that ends a step, at the same instant for all its guards. */
typedef struct rc_cut {
    size_t size;          /**< sizeof(rc_cut), filled in by the caller */
    double s;             /**< [s] offset in the step shown last; 0 where the set follows another */
    double t;             /**< [s] */
    double t_remainder;   /**< [s] rounding error of t */
    const double* before; /**< n doubles, valid until the next call that may be a cut */
    const double* after;  /**< n doubles, valid as long */
    const size_t* fired;  /**< the guards, ascending; of an accumulation the one at rest. As long */
    size_t fired_count;
    rc_mode mode_before;
    rc_mode mode_after;
    int32_t on_time;       /**< 1: with a time event */
    int32_t accumulation;  /**< 1: `after` is the state given by `rest` for the limit, at `t` */
    int32_t state_changed; /**< 0: the host need not start again */
    int32_t reserved;      /**< 0 */
} rc_cut;

/** Creates a monitor of the events of `system`, which must then be started. If `options` is null,
 *  the defaults apply. `*monitor` is null after a failure. The flow is called only if the host
 *  gives no rate, or a guard starts on its surface without one. RC_INVALID with the option in
 *  question, or for a system without events; RC_NO_MEMORY, RC_BAD_HANDLE, RC_WRONG_SIZE. */
RC_API rc_status rc_monitor_new(const rc_system* system, const rc_monitor_options* options,
                                rc_monitor** monitor);

/** Frees the monitor and everything obtained from it. Null is allowed; RC_BUSY while it is in use,
 *  and then nothing is freed. */
RC_API rc_status rc_monitor_free(rc_monitor* monitor);

/* The calls below take arrays of `n` finite doubles, where n is the dimension of the system, and
 * copy them. Rates are as in rc_host_step; if `dxdt` is null, the system's flow is called. `scale`
 * is roughly the length of the next step [s]. After RC_INVALID and RC_OUT_OF_TURN nothing has
 * changed, and the right call may follow. After any other failure, such as RC_CALLBACK, the search
 * in the current step is incomplete, and the monitor accepts only rc_monitor_start or
 * rc_monitor_restore. */

/** Arms all guards at a state that no event has produced: at the start, and after the host has
 *  changed the state itself. The verdict may be a cut immediately. RC_INVALID for a start that is
 * not finite, or behind a surface that bounds the motion; a new start must then follow. */
RC_API rc_status rc_monitor_start(rc_monitor* monitor, double t, const double* x,
                                  const double* dxdt, size_t n, rc_mode mode, double scale,
                                  rc_verdict* verdict);

/** Looks for events in the next step. RC_OUT_OF_TURN for a step that does not begin where the last
 *  one ended, that goes beyond a time event, or before a cut was resumed. */
RC_API rc_status rc_monitor_examine(rc_monitor* monitor, const rc_host_step* step,
                                    rc_verdict* verdict);

/** Arms all guards after a cut, with the rate at `after`, to which the host must have gone. The
 *  verdict may be another cut at the same instant: for guards that a reset has carried across their
 *  surfaces, or for a motion that comes to rest. */
RC_API rc_status rc_monitor_resume(rc_monitor* monitor, const double* dxdt, size_t n, double scale,
                                   rc_verdict* verdict);
/** The same, from a state that the host chooses instead of `after`. */
RC_API rc_status rc_monitor_resume_at(rc_monitor* monitor, const double* x, const double* dxdt,
                                      size_t n, rc_mode mode, double scale, rc_verdict* verdict);

/** Tells the monitor, after RC_RESTS, that the state has been kept until t [s], at most
 *  rc_monitor_must_stop_at. The verdict is a cut at a time event. */
RC_API rc_status rc_monitor_hold(rc_monitor* monitor, double t, rc_verdict* verdict);

/** The last set of events. RC_OUT_OF_TURN if there has been none since the start. */
RC_API rc_status rc_monitor_cut(rc_monitor* monitor, rc_cut* cut);

/** Time [s] at which the next step begins; its rounding error is written into `remainder`, which
 *  may be null. NaN before the start, and for a handle that cannot be used. */
RC_API double rc_monitor_time(rc_monitor* monitor, double* remainder);
/** The state there, n doubles, valid until the next call that starts, advances, restores or frees
 *  the monitor; null before the start, and for a handle that cannot be used. */
RC_API const double* rc_monitor_state(rc_monitor* monitor);
/** The mode there; UINT32_MAX before the start, and for a handle that cannot be used. */
RC_API rc_mode rc_monitor_mode(rc_monitor* monitor);

/** The components that a rest holds, ascending, `*count` of them: the host keeps them constant in
 *  its next steps, while the others flow. Valid until the next call that starts, advances, restores
 *  or frees the monitor. Null where nothing is held, and for a handle that cannot be used. */
RC_API const size_t* rc_monitor_held(rc_monitor* monitor, size_t* count);

/** The next time event [s], which no step may pass; infinite if there is none; NaN before the
 *  start, and for a handle that cannot be used. */
RC_API double rc_monitor_must_stop_at(rc_monitor* monitor);
/** Time [s] up to which no guard needs a check, by the system's bounds or by a gate: the host may
 *  go there in steps that it does not show, by rc_monitor_skip_to. Without bounds or a gate it is
 *  the current time; NaN before the start, and for a handle that cannot be used. */
RC_API double rc_monitor_quiet_until(rc_monitor* monitor);
/** Tells the monitor that the host has continued to t, at most rc_monitor_quiet_until and before
 * the next time event, in one step or several; x and its rate, which is required, belong to t.
 * RC_OUT_OF_TURN if t lies beyond that. */
RC_API rc_status rc_monitor_skip_to(rc_monitor* monitor, double t, const double* x,
                                    const double* dxdt, size_t n);

/** Where a guard is. */
typedef enum rc_side {
    RC_BELOW = -1,  /**< it is negative */
    RC_PLATEAU = 0, /**< zero, and not known where it goes */
    RC_ABOVE = 1    /**< it is positive, inside the mode */
} rc_side;

/** The side of its surface that guard `which` is on. RC_INVALID if there is none, RC_OUT_OF_TURN
 *  before the start. */
RC_API rc_status rc_monitor_side(rc_monitor* monitor, size_t which, rc_side* side);

/** How the run ended; RC_RUNNING before, and for a handle that cannot be used;
 *  RC_STOPPED_BY_CALLBACK while the monitor waits for a start after a callback has failed. */
RC_API rc_outcome_code rc_monitor_outcome(rc_monitor* monitor);
/** The guard that ended the run, or RC_NO_GUARD. */
RC_API size_t rc_monitor_guard(rc_monitor* monitor);
/** The text of rc_stop() that ended the run, like rc_reason. */
RC_API const char* rc_monitor_reason(rc_monitor* monitor);
/** Describes the last failure of a callback in this monitor, like rc_callback_failure; null: in
 * this thread. */
RC_API rc_status rc_monitor_callback_failure(rc_monitor* monitor, rc_callback_error* error);
/** Fills in the counts like rc_get_statistics; the host's own calls of the flow are not counted.
 */
RC_API rc_status rc_monitor_statistics(rc_monitor* monitor, rc_statistics* statistics);

/** Number of events recorded since rc_monitor_clear_events; 0 for a handle that cannot be used. */
RC_API size_t rc_monitor_event_count(rc_monitor* monitor);
/** Event `index`, in the order in which they happened. RC_INVALID if there is none. */
RC_API rc_status rc_monitor_event_at(rc_monitor* monitor, size_t index, rc_event* event);
/** Forgets the events recorded so far. */
RC_API rc_status rc_monitor_clear_events(rc_monitor* monitor);

/** Saves the monitor like rc_save, between two steps: everything on which its future depends. The
 * host saves its own state. RC_OUT_OF_TURN before the start, before a cut was resumed, and after
 * the end. */
RC_API rc_status rc_monitor_save(rc_monitor* monitor, void* bytes, size_t* size);
/** Restores a saved state like rc_restore, of the same or of another monitor of the same system
 * with the same options. */
RC_API rc_status rc_monitor_restore(rc_monitor* monitor, const void* bytes, size_t size);

#ifdef __cplusplus
}
#endif

#endif
