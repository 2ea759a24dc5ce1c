// Internal: the declarations of this header may change without notice.
//
// The sizes of inclusions that the library has compiled.
//
// The solvers of inclusions of N components and M reactions are the same for all systems of these
// sizes. Those of the sizes below are compiled in the library. A system of another size, of at most
// 8 components and 4 reactions, runs in the first of them that holds it (any_inclusion.hpp): with
// the same bits, in 1.2 to 4 times the time. For its exact size, and for larger ones, the solvers
// are compiled in 50 s by RICOCHET_INCLUSIONS_OF, with `extern` in a header that all files with the
// system include, and with nothing in one of them.
#pragma once

#include <array>

#include "ricochet/detail/alignment.hpp"

/// declare(N, M, ...) for every size, each behind those that it holds.
#define RICOCHET_COMPILED_SIZES(declare, ...)                                        \
    declare(1, 1, __VA_ARGS__) declare(2, 1, __VA_ARGS__) declare(3, 1, __VA_ARGS__) \
        declare(4, 2, __VA_ARGS__) declare(8, 4, __VA_ARGS__)

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

/// All of these, with Dormand and Prince's method, for systems of exactly this size.
#define RICOCHET_INCLUSIONS_OF(N, M, how)           \
    template <>                                     \
    struct ricochet::detail::CompiledExactly<N, M>; \
    RICOCHET_SET_VALUED_OF(N, M, how)               \
    RICOCHET_HAND_OVER_OF(N, M, how)                \
    RICOCHET_MODES_OF(N, M, how)                    \
    RICOCHET_EVENTS_OF(N, M, Dopri5, how)

/// The same for more than four reactions, which have no modes. (clang 14 would instantiate members
/// of the hand-over whose constraints these sizes do not satisfy; there each file compiles its
/// own.)
#define RICOCHET_INCLUSIONS_WITHOUT_MODES_OF(N, M, how) \
    template <>                                         \
    struct ricochet::detail::CompiledExactly<N, M>;     \
    RICOCHET_SET_VALUED_OF(N, M, how)                   \
    RICOCHET_HAND_OVER_WITHOUT_MODES_OF(N, M, how)
#ifdef __clang__
#define RICOCHET_HAND_OVER_WITHOUT_MODES_OF(N, M, how)
#else
#define RICOCHET_HAND_OVER_WITHOUT_MODES_OF(N, M, how) RICOCHET_HAND_OVER_OF(N, M, how)
#endif

/// Time stepping of N coordinates, and the hand-over from flight by one method.
#define RICOCHET_TIME_STEPPING_OF(N, how) how template class ricochet::detail::AnyTimeStepping<N>;
#define RICOCHET_CONTACT_MOTION_OF(N, Method, how)                                           \
    how template class ricochet::detail::AnyContactMotion<N>;                                \
    how template std::unique_ptr<ricochet::detail::EventLoop<2 * N>>                         \
    ricochet::detail::make_flight_loop<N, ricochet::ErrorControlled<ricochet::Method>>(      \
        const ricochet::detail::AnyFlight<N>&, const ricochet::detail::EventLoop<2 * N>::X&, \
        const ricochet::Options&);

namespace ricochet::detail {

/// Incomplete for the sizes that RICOCHET_INCLUSIONS_OF has declared.
template <int N, int M>
struct CompiledExactly {
};

struct InclusionSize {
    int components;
    int reactions;
};

#define RICOCHET_LISTED(N, M, unused) InclusionSize{N, M},
inline constexpr std::array compiled_sizes{RICOCHET_COMPILED_SIZES(RICOCHET_LISTED, )};
#undef RICOCHET_LISTED

/// The size in which a system of n components and m reactions runs.
template <int n, int m>
[[nodiscard]] consteval InclusionSize size_for()
{
    constexpr bool exactly = !requires
    {
        sizeof(CompiledExactly<n, m>);
    };
#if RICOCHET_ALIGNED_AS_LIBRARY
    constexpr bool fixed = n > 0 && m > 0;
    if constexpr (!exactly && fixed) {
        for (const InclusionSize size : compiled_sizes) {
            if (n <= size.components && m <= size.reactions) return size;
        }
        static_assert(
            n <= compiled_sizes.back().components && m <= compiled_sizes.back().reactions,
            "ricochet: found an inclusion of more than 8 components or 4 reactions, which the "
            "library has not compiled; expected RICOCHET_INCLUSIONS_OF(state_size, reaction_size, "
            ") "
            "before its first use, RICOCHET_INCLUSIONS_WITHOUT_MODES_OF for more than 4 reactions, "
            "or "
            "sizes of Eigen::Dynamic");
    }
#endif
    return {n, m};
}

template <int n, int m>
inline constexpr int solver_components = size_for<n, m>().components;
template <int n, int m>
inline constexpr int solver_reactions = size_for<n, m>().reactions;

}  // namespace ricochet::detail
