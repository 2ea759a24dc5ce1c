// Internal: the declarations of this header may change without notice.
//
// Constants of the modes of an inclusion.
//
// Digit i to base 3 of a mode is the branch of reaction i: 0 lower, 1 inside (held), 2 upper. With
//
//     A w' = f(t, w) + G r,    y = E w - s(t)
//
// the reactions at a bound are known, and the held ones follow from y' = 0,
//
//     r_held = -D^-1 (E A^-1 (f + G r_known) - s'),    D = E A^-1 G of the held reactions,
//
// with constant matrices. They are plain data, filled once, by `AnyModes`; the table of a system
// (typed_inclusion.hpp), which knows f and the bounds, evaluates the modes from them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "ricochet/guard.hpp"
#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet::detail {

/// Whether inclusions of these sizes have branches that are modes, if their sets are boxes of
/// reactions.
template <int N, int M>
inline constexpr bool has_modes = N != Eigen::Dynamic&& M != Eigen::Dynamic&& M <= most_cases;

/// The constant matrices of the modes.
template <int N, int M>
struct RICOCHET_ALIGNED BranchTerms {
    using Delassus = Eigen::Matrix<double, M, M>;

    /// D^-1 where reactions are held, zero elsewhere. Of reactions that act on the same motion it
    /// has the first one, which stands for all of them, if static bounds hold them.
    struct Hold {
        Delassus inverse;
        double largest = 0;
        bool determined = true;
        bool joint = false;  ///< some stand for others
    };

    using Action =
        Eigen::Matrix<double, N, M, N == 1 && M != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Observation =
        Eigen::Matrix<double, M, N, M == 1 && N != 1 ? Eigen::RowMajor : Eigen::ColMajor>;

    Eigen::Matrix<double, N, 1> inverse_diagonal;  ///< of A^-1, most often its only entries
    bool diagonal = false;
    Eigen::Matrix<Eigen::Index, M, 1> selected;   ///< component of every y, -1 if it is not one
    Action lever;                                 ///< A^-1 G
    Delassus delassus;                            ///< E A^-1 G
    std::array<Hold, std::size_t{1} << M> holds;  ///< bit i of the index: reaction i is held
    Observation observe;                          ///< E
    Eigen::Matrix<double, N, N> inverse_mass;     ///< A^-1

    /// Row i of E times v, by a loop that reads the components one at a time, as they were written.
    template <class Vector>
    [[nodiscard, gnu::always_inline]] double observed(Eigen::Index i, const Vector& v) const
    {
        double sum = observe(i, 0) * v[0];
        for (Eigen::Index k = 1; k < Vector::SizeAtCompileTime; ++k) sum += observe(i, k) * v[k];
        return sum;
    }
};

/// The first two components of a rate: as many as a function returns in registers. Compilers write
/// a struct of two members as a pair, which would go through memory.
__extension__ using FirstRates = __complex__ double;

/// The flow of a mode at (t, x_1, ..., x_N), whose components after the second are written to
/// `more`. Every stage of a Runge-Kutta step depends on the flow of the stage before, and passing
/// the state through memory lengthens this chain: with three components the run of the diode
/// circuit takes 72 us through memory, and 59 us with components in registers.
template <class Components>
struct FlowByComponents;

template <std::size_t... I>
struct FlowByComponents<std::index_sequence<I...>> {
    template <std::size_t>
    using Component = double;
    using Function = FirstRates (*)(const void* system, const void* terms, Mode mode, double t,
                                    Component<I>... x, double* more);

    template <class Typed, class Terms, bool diagonal>
    static FirstRates call(const void* system, const void* terms, Mode mode, double t,
                           Component<I>... x, [[maybe_unused]] double* more)
    {
        Eigen::Matrix<double, sizeof...(I), 1> w, rate;
        ((w[I] = x), ...);
        const auto& typed = *static_cast<const Terms*>(terms);
        Typed::template flow<diagonal>(system, typed, mode, t, w, rate);
        ((I < 2 ? void() : void(more[I - 2] = rate[I])), ...);
        FirstRates two = rate[0];
        if constexpr (sizeof...(I) > 1) __imag__ two = rate[1];
        return two;
    }

    Function function = nullptr;
    const void* system = nullptr;
    const void* terms = nullptr;  ///< `BranchTerms` of N components

    /// Calls the function at (t, x).
    template <class X>
    [[gnu::always_inline]] void operator()(Mode mode, double t, const X& x, X& rate) const
    {
        std::array<double, std::max<std::size_t>(sizeof...(I), 3) - 2> more;
        const FirstRates two = function(system, terms, mode, t, x[I]..., more.data());
        ((rate[I] = I == 0 ? __real__ two : I == 1 ? __imag__ two : more[I < 2 ? 0 : I - 2]), ...);
    }
};

/// None for sizes that are not fixed, which have no modes.
template <int N>
using BranchFlow =
    FlowByComponents<std::make_index_sequence<static_cast<std::size_t>(N > 0 ? N : 0)>>;

}  // namespace ricochet::detail
