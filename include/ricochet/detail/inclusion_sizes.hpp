// Internal: the declarations of this header may change without notice.
//
// The sizes of inclusions that the library has compiled.
//
// The solvers of inclusions of N components and M reactions are the same for all systems of these
// sizes. Those of the sizes below are compiled in the library; others are compiled where they are
// used, in half a minute. Another size that several files use is compiled once by one of the macros
// below, with `extern` in a header and without it in one file.
#pragma once

/// declare(N, M, ...) for every size.
#define RICOCHET_COMPILED_SIZES(declare, ...)                                        \
    declare(1, 1, __VA_ARGS__) declare(2, 1, __VA_ARGS__) declare(3, 1, __VA_ARGS__) \
        declare(2, 2, __VA_ARGS__) declare(4, 2, __VA_ARGS__)

/// Set-valued steps.
#define RICOCHET_SET_VALUED_OF(N, M, how)                                       \
    how template class ricochet::detail::AnyMatrices<N, M>;                     \
    how template class ricochet::detail::AnyStep<N, M>;                         \
    how template class ricochet::detail::AnyMotion<N, M>;                       \
    how template Eigen::Matrix<double, M, 1> ricochet::minimal_selection<N, M>( \
        const ricochet::detail::AnyMatrices<N, M>&, double, const Eigen::Matrix<double, N, 1>&);

/// The hand-over, without its event-driven phases.
#define RICOCHET_HAND_OVER_OF(N, M, how)                                                           \
    how template double ricochet::law_violation<N, M>(const ricochet::detail::AnyMatrices<N, M>&,  \
                                                      double, const Eigen::Matrix<double, N, 1>&,  \
                                                      const Eigen::Matrix<double, M, 1>&, double); \
    how template class ricochet::detail::AnyHandOver<N, M>;

/// The modes of at most four reactions, and their simulation by one method with error control.
#define RICOCHET_MODES_OF(N, M, how) how template class ricochet::detail::AnyModes<N, M>;
#define RICOCHET_EVENTS_OF(N, M, Method, how)                                              \
    how template std::unique_ptr<ricochet::detail::EventLoop<N>>                           \
    ricochet::detail::make_event_loop<N, M, ricochet::ErrorControlled<ricochet::Method>>(  \
        const ricochet::detail::AnyModes<N, M>&, const ricochet::detail::EventLoop<N>::X&, \
        const ricochet::Options&);

/// All of these, with Dormand and Prince's method.
#define RICOCHET_INCLUSIONS_OF(N, M, how) \
    RICOCHET_SET_VALUED_OF(N, M, how)     \
    RICOCHET_HAND_OVER_OF(N, M, how)      \
    RICOCHET_MODES_OF(N, M, how)          \
    RICOCHET_EVENTS_OF(N, M, Dopri5, how)

/// Time stepping of N coordinates, and the hand-over from flight by one method.
#define RICOCHET_TIME_STEPPING_OF(N, how) how template class ricochet::detail::AnyTimeStepping<N>;
#define RICOCHET_CONTACT_MOTION_OF(N, Method, how)                                           \
    how template class ricochet::detail::AnyContactMotion<N>;                                \
    how template std::unique_ptr<ricochet::detail::EventLoop<2 * N>>                         \
    ricochet::detail::make_flight_loop<N, ricochet::ErrorControlled<ricochet::Method>>(      \
        const ricochet::detail::AnyFlight<N>&, const ricochet::detail::EventLoop<2 * N>::X&, \
        const ricochet::Options&);
