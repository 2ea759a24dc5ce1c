// Internal: the declarations of this header may change without notice.
//
// Overloads that refuse mistaken calls of `integrate`, each with a sentence in place of the
// compiler's list of candidates.
//
// These overloads are never called. They accept arguments written in braces, which have no
// type, and are worse matches than the right ones wherever those fit.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/options.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

namespace detail {

template <class...>
inline constexpr bool never = false;

/// A system, a start and an option of any type.
struct AnySystemGiven {
    template <class System>
    AnySystemGiven(const System&);
};
struct AnyStartGiven {
    template <class X>
    AnyStartGiven(const X&);
    AnyStartGiven(std::initializer_list<double>);
};
struct AnyValueGiven {
    AnyValueGiven();
    template <class T>
    AnyValueGiven(const T&);
    template <class T>
    AnyValueGiven(std::initializer_list<T>);
};

/// The members of `Options`, in their order, each followed by other names that it may be given.
struct MisspeltOptions {
    using V = AnyValueGiven;
    V t_start{}, t_strat{}, tstart{}, start{}, start_time{}, t0{}, t_begin{}, begin{};
    V t_initial{}, t_init{};
    V t_end{}, t_ned{}, tend{}, end{}, end_time{}, t1{}, tf{}, t_f{}, t_final{}, t_stop{};
    V t_max{}, tmax{}, duration{}, span{};
    V mode{}, Mode{}, modes{}, start_mode{}, initial_mode{}, mode0{};
    V step{}, steps{}, stp{}, setp{}, h{}, dt{}, h0{}, step_size{}, stepsize{}, step_length{};
    V initial_step{}, first_step{};
    V rtol{}, rtoll{}, rtl{}, rotl{}, r_tol{}, rel_tol{}, reltol{}, rel_tolerance{};
    V relative_tolerance{}, tol{};
    V tolerance{}, eps_rel{}, rtolerance{};
    V atol{}, atoll{}, atl{}, aotl{}, a_tol{}, abs_tol{}, abstol{}, abs_tolerance{};
    V absolute_tolerance{}, eps_abs{};
    V atolerance{};
    V h_min{}, hmin{}, min_step{}, minimum_step{}, step_min{}, dt_min{}, dtmin{}, h_minimum{};
    V h_max{}, hmax{}, max_step{}, maximum_step{}, step_max{}, dt_max{}, dtmax{}, h_maximum{};
    V event_tolerance{}, event_tolerence{}, event_tol{}, event_atol{}, events_tolerance{};
    V eventtol{}, xtol{};
    V event_rtol{}, event_rel_tol{}, event_reltol{}, event_rtoll{}, event_relative_tolerance{};
    V event_window{}, event_windows{}, events_window{}, window{};
    V stop_at_event{}, stop_at_events{}, stop_on_event{}, stop_at_first_event{}, stop{};
    V terminal{};
    V record_events{}, record_event{}, keep_events{}, events{}, store_events{}, save_events{};
    V event_states{}, event_state{}, record_event_states{}, keep_event_states{};
    V record_steps{}, record_step{}, keep_steps{}, dense{}, dense_output{}, record_solution{};
    V solution{};
    V sample_times{}, sample_time{}, samples{}, sampletimes{}, sample{}, t_eval{}, save_at{};
    V saveat{}, times{};
    V max_steps{}, maxsteps{}, maximum_steps{}, steps_max{}, max_step_count{}, most_steps{};
    V step_limit{};
    V stall_steps{}, stalled_steps{}, stall_step{}, stall_limit{};
    V cancelled{}, canceled{}, cancel{}, stop_flag{}, abort{};
};

}  // namespace detail

/// An option that does not exist.
template <class... Choices>
auto integrate(detail::AnySystemGiven, detail::AnyStartGiven, const detail::MisspeltOptions&,
               const Choices&...)
{
    static_assert(detail::never<Choices...>,
                  "ricochet: found an option that there is not; expected t_end and others of "
                  "ricochet::Options, in the order of options.hpp");
    return Run<std::vector<double>>{};
}

/// A call without options.
template <class Unused = void>
auto integrate(detail::AnySystemGiven, detail::AnyStartGiven)
{
    static_assert(detail::never<Unused>,
                  "ricochet: found no options; expected at least when the run ends, {.t_end = 20}");
    return Run<std::vector<double>>{};
}

/// {10, 0, 1} for two components, or {10}, where the others would silently be zero.
template <class System, std::size_t given, class... Choices>
requires(detail::fixed_size<typename System::State>() > 0 &&
         detail::fixed_size<typename System::State>() != given)  //
    auto integrate(const System&, const double (&)[given], const Options&, const Choices&...)
{
    static_assert(detail::never<System>,
                  "ricochet: found a start with another number of components than System::State");
    return Run<typename System::State>{};
}

/// A start in braces that could be of any type.
template <class System, std::size_t given, class... Choices>
requires(!requires { typename System::State; })  //
    auto integrate(const System&, const double (&)[given], const Options&, const Choices&...)
{
    static_assert(
        detail::never<System>,
        "ricochet: found a start in braces for a system that declares no State; expected "
        "`using State = std::array<double, n>` in the system, or State{...} as the start");
    return Run<std::vector<double>>{};
}

}  // namespace ricochet
