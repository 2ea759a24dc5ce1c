// Internal: the declarations of this header may change without notice.
//
// The sizes of inclusions that the library has compiled.
//
// The solvers of inclusions of N components and M reactions are the same for all systems of these
// sizes. Those of the sizes below are compiled in the library. A system of another size, of at most
// 8 components and 4 reactions, runs in the first of them that holds it (any_inclusion.hpp): with
// the same bits, in 1.2 to 4 times the time. For its exact size, and for larger ones, the solvers
// are compiled by RICOCHET_INCLUSIONS_OF, in a minute of a source of their own.
#pragma once

#include <array>
#include <memory>

#include "ricochet/nonsmooth/detail/alignment.hpp"

/// declare(N, M, ...) for every size, each behind those that it holds.
#define RICOCHET_COMPILED_SIZES(declare, ...)                                        \
    declare(1, 1, __VA_ARGS__) declare(2, 1, __VA_ARGS__) declare(3, 1, __VA_ARGS__) \
        declare(4, 2, __VA_ARGS__) declare(8, 4, __VA_ARGS__)

/// Set-valued steps.
#define RICOCHET_SET_VALUED_OF(N, M)                                                            \
    template class ricochet::detail::AnyMatrices<N, M>;                                         \
    template class ricochet::detail::AnyStep<N, M>;                                             \
    template class ricochet::detail::AnyMotion<N, M>;                                           \
    template Eigen::Matrix<double, M, 1> ricochet::minimal_selection<N, M>(                     \
        const ricochet::detail::AnyMatrices<N, M>&, double, const Eigen::Matrix<double, N, 1>&, \
        double);

/// The phases of a run.
#define RICOCHET_HAND_OVER_OF(N, M)                                                            \
    template double ricochet::law_violation<N, M>(const ricochet::detail::AnyMatrices<N, M>&,  \
                                                  double, const Eigen::Matrix<double, N, 1>&,  \
                                                  const Eigen::Matrix<double, M, 1>&, double); \
    template ricochet::detail::Owner<ricochet::detail::BranchPhases>                           \
    ricochet::detail::make_branch_phases<N, M>(const ricochet::detail::AnyInclusion<N, M>&,    \
                                               const ricochet::detail::BranchPhasesOptions&);

/// Compiles matrices and steps of exactly this size alone, for `InclusionMatrices`, `CompositeStep`
/// and `BranchModes`, which look into a system in its own size. `how` as below.
#define RICOCHET_STEPS_OF(N, M, how) RICOCHET_STEPS_OF_##how(N, M)
#define RICOCHET_STEPS_OF_extern(N, M) \
    template <>                        \
    struct ricochet::detail::CompiledSteps<N, M>;
#define RICOCHET_STEPS_OF_(N, M) RICOCHET_STEPS_OF_extern(N, M) RICOCHET_SET_VALUED_OF(N, M)

/// Runs systems of N components and M reactions in solvers of exactly this size. With `extern` as
/// its third argument it says that they are compiled elsewhere; with nothing it compiles them, and
/// needs nonsmooth/solvers.hpp. More than four reactions have no modes.
#define RICOCHET_INCLUSIONS_OF(N, M, how) RICOCHET_INCLUSIONS_OF_##how(N, M)
#define RICOCHET_INCLUSIONS_OF_extern(N, M) \
    template <>                             \
    struct ricochet::detail::CompiledExactly<N, M>;
#define RICOCHET_INCLUSIONS_OF_(N, M) \
    RICOCHET_INCLUSIONS_OF_extern(N, M) RICOCHET_SET_VALUED_OF(N, M) RICOCHET_HAND_OVER_OF(N, M)

/// Time stepping of N coordinates, and what the phases of a mechanism need.
#define RICOCHET_TIME_STEPPING_OF(N, how)               \
    how template class ricochet::detail::MoreauStep<N>; \
    how template class ricochet::detail::AnyTimeStepping<N>;
#define RICOCHET_CONTACT_MOTION_OF(N, how)             \
    how template class ricochet::detail::AnyFlight<N>; \
    how template class ricochet::detail::ContactStepsOf<N>;

namespace ricochet::detail {

/// Incomplete for the sizes that RICOCHET_INCLUSIONS_OF has declared.
template <int N, int M>
struct CompiledExactly {
};

/// Incomplete for the sizes that RICOCHET_STEPS_OF has declared.
template <int N, int M>
struct CompiledSteps {
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
    static_assert(
        exactly || fixed || (n < 0 && m < 0),
        "ricochet: found an inclusion of which one size is Eigen::Dynamic; expected both");
    if constexpr (!exactly && fixed) {
        for (const InclusionSize size : compiled_sizes) {
            if (n <= size.components && m <= size.reactions) return size;
        }
        static_assert(
            n <= compiled_sizes.back().components && m <= compiled_sizes.back().reactions,
            "ricochet: found an inclusion of more than 8 components or 4 reactions, which the "
            "library has not compiled; expected RICOCHET_INCLUSIONS_OF(state_size, reaction_size, "
            "extern) "
            "before its first use and, in one source with nonsmooth/solvers.hpp, the same without "
            "`extern`; "
            "or sizes of Eigen::Dynamic");
    }
#endif
    return {n, m};
}

/// Refuses a size in which no matrices and steps are compiled.
template <int n, int m>
consteval bool check_own_size()
{
    constexpr bool steps = !requires
    {
        sizeof(CompiledSteps<n, m>);
    };
    if constexpr (!steps) {
        constexpr InclusionSize size = size_for<n, m>();
        static_assert(
            size.components == n && size.reactions == m,
            "ricochet: found matrices or steps of an inclusion in its own size, which the library "
            "has not compiled; expected RICOCHET_STEPS_OF(state_size, reaction_size, extern) "
            "before "
            "their first use and, in one source with nonsmooth/solvers.hpp, the same without "
            "`extern`; or a SetValuedMotion, which needs neither");
    }
    return true;
}

template <int n, int m>
inline constexpr int solver_components = size_for<n, m>().components;
template <int n, int m>
inline constexpr int solver_reactions = size_for<n, m>().reactions;

}  // namespace ricochet::detail
