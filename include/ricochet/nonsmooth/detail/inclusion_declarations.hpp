// Internal: the declarations of this header may change without notice.
//
// Members of an inclusion that exist but do not fit.
//
// Without these checks a member with other parameters, or one that is not const, would be ignored
// and the default used. The names are those of declarations.hpp.
#pragma once

#include <concepts>
#include <type_traits>

#include "ricochet/detail/declarations.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet::detail {

/// A function that is called with `Arguments`, the last of which it writes if `writes`. A data
/// member or a type of this name has a purpose of its own.
template <class Name, class System, bool writes, class... Arguments>
[[nodiscard]] constexpr Declaration member_declaration() noexcept
{
    if constexpr (!Name::template named<System>) {
        return Declaration::absent;
    } else if constexpr (Name::template takes<const System, Arguments...>) {
        if constexpr (writes && Name::template addressable<System> &&
                      Name::template takes<const System, std::remove_reference_t<Arguments>...>) {
            return Declaration::by_value;
        } else {
            return Declaration::fits;
        }
    } else if constexpr (Name::template value<System> || Name::template type<System>) {
        return Declaration::absent;
    } else if constexpr (Name::template takes<System, Arguments...>) {
        return Declaration::not_const;
    } else if constexpr (std::is_final_v<System> && !Name::template addressable<System>) {
        return Declaration::absent;
    } else {
        return Declaration::does_not_fit;
    }
}

template <class System>
[[nodiscard]] constexpr Declaration branch_bound_declaration() noexcept
{
    using W = const StateOf<System>&;
    constexpr Declaration found =
        member_declaration<Name_branch_bound, System, false, double, W, int, Branch>();
    constexpr bool returns = requires(const System& system, W w)
    {
        {
            system.branch_bound(0.0, w, 0, Branch::upper)
            } -> std::convertible_to<double>;
    };
    return found == Declaration::fits && !returns ? Declaration::does_not_fit : found;
}

template <class System>
[[nodiscard]] constexpr Declaration static_bound_declaration() noexcept
{
    using W = const StateOf<System>&;
    constexpr Declaration found =
        member_declaration<Name_static_bound, System, false, double, W, int>();
    return found == Declaration::fits && !HasStaticBound<System> ? Declaration::does_not_fit
                                                                 : found;
}

/// Refuses what does not fit. Returns true, so that a static_assert evaluates this check first.
// Long: a list of members with a sentence for each, whose macro reads names of this function.
template <class System>
constexpr bool check_inclusion()
{
    constexpr int N = state_size<System>, M = reaction_size<System>;
    using State = StateOf<System>;
    using Reaction = ReactionOf<System>;
    using Square = SquareOf<System>;
    using Observation =
        Eigen::Matrix<double, M, N, M == 1 && N != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Action =
        Eigen::Matrix<double, N, M, N == 1 && M != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    constexpr bool checks_names = !requires
    {
        requires System::unchecked_names;
    };
    constexpr bool confines_fits = requires
    {
        typename std::integral_constant<Confines, System::confines>;
    };
    constexpr bool affine_fits = requires
    {
        typename std::bool_constant<System::affine>;
    };
#define RICOCHET_CHECK(name, expected, ...)                                                        \
    {                                                                                              \
        constexpr Declaration found = __VA_ARGS__;                                                 \
        static_assert(found != Declaration::not_const, "ricochet: found a member `" #name          \
                                                       "` that is not const; expected " expected); \
        static_assert(found != Declaration::by_value,                                              \
                      "ricochet: found a member `" #name                                           \
                      "` that changes a copy; expected " expected);                                \
        static_assert(!checks_names || found != Declaration::does_not_fit,                         \
                      "ricochet: found a member `" #name                                           \
                      "` whose parameters or result do not fit, or that is "                       \
                      "private; expected " expected                                                \
                      "; or declare static constexpr bool "                                        \
                      "unchecked_names = true if that is meant");                                  \
    }
#define RICOCHET_CHECK_WRITER(name, expected, ...) \
    RICOCHET_CHECK(name, expected, member_declaration<Name_##name, System, true, __VA_ARGS__>())
    RICOCHET_CHECK(confines, "static constexpr ricochet::Confines confines",
                   value_declaration<Name_confines, System, confines_fits>())
    RICOCHET_CHECK(affine, "static constexpr bool affine",
                   value_declaration<Name_affine, System, affine_fits>())
    RICOCHET_CHECK_WRITER(
        smooth, "void smooth(double t, const State& w, State& f) const, of Eigen's vectors", double,
        const State&, State&)
    RICOCHET_CHECK_WRITER(smooth_jacobian,
                          "void smooth_jacobian(double t, const State& w, Square& J) const, "
                          "with J of state_size rows and columns",
                          double, const State&, Square&)
    RICOCHET_CHECK_WRITER(mass, "void mass(Square& A) const, with A of state_size rows and columns",
                          Square&)
    RICOCHET_CHECK_WRITER(observe,
                          "void observe(Observation& E) const, with E of reaction_size rows and "
                          "state_size columns",
                          Observation&)
    RICOCHET_CHECK_WRITER(
        act, "void act(Action& G) const, with G of state_size rows and reaction_size columns",
        Action&)
    RICOCHET_CHECK_WRITER(
        offset, "void offset(double t, Reaction& s) const, with s of reaction_size components",
        double, Reaction&)
    RICOCHET_CHECK_WRITER(
        offset_rate,
        "void offset_rate(double t, Reaction& s) const, with s of reaction_size components", double,
        Reaction&)
    RICOCHET_CHECK(
        branch_bound,
        "double branch_bound(double t, const State& w, int i, ricochet::Branch branch) const",
        branch_bound_declaration<System>())
    RICOCHET_CHECK(static_bound, "double static_bound(double t, const State& w, int i) const",
                   static_bound_declaration<System>())
    RICOCHET_CHECK_WRITER(
        bound_gradient,
        "void bound_gradient(double t, const State& w, int i, State& gradient) const", double,
        const State&, int, State&)
#undef RICOCHET_CHECK_WRITER
#undef RICOCHET_CHECK
    return true;
}

/// Reports what a system lacks to be an inclusion.
template <class System>
constexpr void refuse_no_inclusion()
{
    constexpr bool sized = requires
    {
        state_size<System>;
        reaction_size<System>;
    };
    static_assert(sized,
                  "ricochet: found a system that is no inclusion; expected static constexpr int "
                  "state_size and reaction_size");
    if constexpr (sized) {
        using W = const StateOf<System>&;
        static_assert(
            Name_smooth::takes<const System, double, W, StateOf<System>&>,
            "ricochet: found no `smooth` that fits; expected void smooth(double t, const State& w, "
            "State& f) const, of Eigen's vectors with state_size components");
        static_assert(
            !Name_smooth::takes<const System, double, W, StateOf<System>&> || Inclusion<System>,
            "ricochet: found no `reaction_set` that fits; expected reaction_set(double t, const "
            "State& w) "
            "const, which returns a set of nonsmooth/inclusion.hpp");
    }
}

}  // namespace ricochet::detail
