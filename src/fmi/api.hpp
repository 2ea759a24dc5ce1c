// The functions of FMI 2.0 and 3.0 that an importer calls, by their names and signatures as the
// standard gives them. In C an enumeration is an int, fmi2Boolean an int, fmi3Boolean a bool, and a
// value reference 32 bits without a sign.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ricochet::fmi {

using Handle = void*;
using Reference = std::uint32_t;

enum Status : int { status_ok, status_warning, status_discard, status_error, status_fatal };

struct Callbacks2 {  ///< fmi2CallbackFunctions
    void (*logger)(void*, const char*, int, const char*, const char*, ...);
    void* (*allocate)(std::size_t, std::size_t);
    void (*release)(void*);
    void (*step_finished)(void*, int);
    void* environment;
};

struct EventInfo2 {  ///< fmi2EventInfo
    int new_discrete_states_needed, terminate, nominals_changed, values_changed, next_time_defined;
    double next_time;
};

using Log3 = void (*)(void*, int, const char*, const char*);
using Update3 = void (*)(void*, double, bool, bool, bool, bool, bool*, double*);

template <class T>
using Get2 = int (*)(Handle, const Reference*, std::size_t, T*);
template <class T>
using Set2 = int (*)(Handle, const Reference*, std::size_t, const T*);
template <class T>
using Get3 = int (*)(Handle, const Reference*, std::size_t, T*, std::size_t);
template <class T>
using Set3 = int (*)(Handle, const Reference*, std::size_t, const T*, std::size_t);

/// The functions of one library; those of the other version are null.
struct Functions {
    // 2.0
    Handle (*instantiate2)(const char*, int, const char*, const char*, const Callbacks2*, int, int);
    int (*setup2)(Handle, int, double, double, int, double);
    int (*enter_initialization2)(Handle);
    int (*update2)(Handle, EventInfo2*);
    int (*completed2)(Handle, int, int*, int*);
    int (*step2)(Handle, double, double, int);
    int (*boolean_status2)(Handle, int, int*);
    int (*real_status2)(Handle, int, double*);
    int (*directional2)(Handle, const Reference*, std::size_t, const Reference*, std::size_t,
                        const double*, double*);
    Get2<double> get_real2;
    Set2<double> set_real2;
    Get2<int> get_integer2, get_boolean2;
    Set2<int> set_integer2, set_boolean2;
    // 3.0
    Handle (*instantiate_me3)(const char*, const char*, const char*, bool, bool, void*, Log3);
    Handle (*instantiate_cs3)(const char*, const char*, const char*, bool, bool, bool, bool,
                              const Reference*, std::size_t, void*, Log3, Update3);
    int (*enter_initialization3)(Handle, bool, double, double, bool, double);
    int (*update3)(Handle, bool*, bool*, bool*, bool*, bool*, double*);
    int (*completed3)(Handle, bool, bool*, bool*);
    int (*count_states3)(Handle, std::size_t*);
    int (*count_indicators3)(Handle, std::size_t*);
    int (*step3)(Handle, double, double, bool, bool*, bool*, bool*, double*);
    int (*enter_step3)(Handle);
    int (*directional3)(Handle, const Reference*, std::size_t, const Reference*, std::size_t,
                        const double*, std::size_t, double*, std::size_t);
    Get3<double> get_float64;
    Set3<double> set_float64;
    Get3<float> get_float32;
    Set3<float> set_float32;
    Get3<std::int8_t> get_int8;
    Set3<std::int8_t> set_int8;
    Get3<std::uint8_t> get_uint8;
    Set3<std::uint8_t> set_uint8;
    Get3<std::int16_t> get_int16;
    Set3<std::int16_t> set_int16;
    Get3<std::uint16_t> get_uint16;
    Set3<std::uint16_t> set_uint16;
    Get3<std::int32_t> get_int32;
    Set3<std::int32_t> set_int32;
    Get3<std::uint32_t> get_uint32;
    Set3<std::uint32_t> set_uint32;
    Get3<std::int64_t> get_int64;
    Set3<std::int64_t> set_int64;
    Get3<std::uint64_t> get_uint64;
    Set3<std::uint64_t> set_uint64;
    Get3<bool> get_boolean3;
    Set3<bool> set_boolean3;
    // The same in both.
    int (*exit_initialization)(Handle);
    int (*enter_event)(Handle);
    int (*enter_continuous)(Handle);
    int (*set_time)(Handle, double);
    int (*set_states)(Handle, const double*, std::size_t);
    int (*get_states)(Handle, double*, std::size_t);
    int (*get_nominals)(Handle, double*, std::size_t);
    int (*derivatives)(Handle, double*, std::size_t);
    int (*indicators)(Handle, double*, std::size_t);
    int (*terminate)(Handle);
    int (*keep_state)(Handle, void**);
    int (*set_kept_state)(Handle, void*);
    int (*free_state)(Handle, void**);
    void (*free)(Handle);
};

}  // namespace ricochet::fmi
