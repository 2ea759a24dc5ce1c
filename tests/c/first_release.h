/* The structs of the first release, 0.1, as they were: a program that was compiled with them
 * continues working with every later library of the same soname. Not to be changed. */
#ifndef RICOCHET_TESTS_C_FIRST_RELEASE_H
#define RICOCHET_TESTS_C_FIRST_RELEASE_H

#include <stddef.h>
#include <stdint.h>

struct first_guard_info {
    size_t size;
    const char* name;
    int32_t crossing;
    int32_t notifies;
    int32_t unilateral;
    int32_t boolean;
    uint32_t stop_after;
    int32_t degree;
    double touch;
    double lipschitz;
};

struct first_callbacks {
    size_t size;
    size_t dimension;
    size_t guard_count;
    size_t mode_count;
    const char* name;
    void* user;
    const void* guard_infos;
    void (*flow)(void);
    void (*guards)(void);
    void (*guard)(void);
    void (*guard_rates)(void);
    void (*guard_rate)(void);
    void (*reset)(void);
    void (*reset_set)(void);
    void (*rest)(void);
    void (*enabled_in)(void);
    void (*enabled)(void);
    void (*next_time_event)(void);
    void (*previous_time_event)(void);
    void (*time_reset)(void);
    void (*speed_bound)(void);
    void (*acceleration_bound)(void);
    void (*lower_bound)(void);
    void (*upper_bound)(void);
    void (*parameter)(void);
};

struct first_options {
    size_t size;
    double t_start;
    double t_end;
    uint32_t mode;
    int32_t method;
    int32_t fixed_step;
    int32_t detector;
    int32_t locator;
    int32_t look_inside;
    int32_t stop_at_event;
    int32_t record_events;
    int32_t event_states;
    int32_t record_steps;
    double step;
    double rtol;
    double atol;
    double h_min;
    double h_max;
    double event_tolerance;
    double event_rtol;
    double event_window;
    const double* sample_times;
    size_t sample_count;
    uint64_t max_steps;
    uint64_t stall_steps;
    const char* gate;
};

struct first_statistics {
    size_t size;
    uint64_t steps;
    uint64_t rejected;
    uint64_t refined_steps;
    uint64_t unresolved_steps;
    uint64_t resteps;
    uint64_t flow_calls;
    uint64_t guard_calls;
    uint64_t network_calls;
    uint64_t late_events;
    uint64_t checks_put_off;
    uint64_t outside_domain;
    uint64_t bound_calls;
    uint64_t rollbacks;
    uint64_t repeated_steps;
    uint64_t events;
    uint64_t suppressed;
    uint64_t disabled;
    uint64_t proved;
    uint64_t checked;
    uint64_t gated;
    uint64_t assumed;
    size_t guard;
    size_t other_guard;
};

struct first_event {
    size_t size;
    double t;
    size_t guard;
    int32_t kind;
    int32_t late;
    uint32_t mode_before;
    uint32_t mode_after;
    const double* before;
    const double* after;
    double bracket_lo;
    double bracket_hi;
    double slope;
    double error;
};

struct first_monitor_options {
    size_t size;
    double event_tolerance;
    double event_rtol;
    double event_window;
    int32_t detector;
    int32_t locator;
    int32_t look_inside;
    int32_t record_events;
    int32_t event_states;
    int32_t backward;
    int32_t cut_at_all;
    int32_t reserved;
    const char* gate;
};

struct first_host_step {
    size_t size;
    size_t n;
    double t0;
    double t0_remainder;
    double h;
    const double* x0;
    const double* x1;
    const double* rate0;
    const double* rate1;
    void* user;
    int (*interpolate)(void*, double, double*, size_t);
    int (*interpolate_rate)(void*, double, double*, size_t);
    int (*restep)(void*, double, double*, size_t);
};

struct first_cut {
    size_t size;
    double s;
    double t;
    double t_remainder;
    const double* before;
    const double* after;
    const size_t* fired;
    size_t fired_count;
    uint32_t mode_before;
    uint32_t mode_after;
    int32_t on_time;
    int32_t accumulation;
    int32_t state_changed;
    int32_t reserved;
};

#endif
