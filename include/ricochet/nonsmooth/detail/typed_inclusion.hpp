// Internal: the declarations of this header may change without notice.
//
// The table of functions of a user's inclusion, for solvers of N components and M reactions.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <string>

#include "ricochet/nonsmooth/detail/any_inclusion.hpp"
#include "ricochet/nonsmooth/detail/inclusion_declarations.hpp"
#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"

namespace ricochet::detail {

/// to = from, in the components that both have; zero in the others.
template <class From, class To>
[[gnu::always_inline]] inline void copy_padded(const From& from, To& to)
{
    constexpr Eigen::Index count = From::SizeAtCompileTime;
    for_each_component(to, [&](auto i) { to[i] = i < count ? from[i < count ? i : 0] : 0; });
}

/// Sizes of the discs and intervals that a set is the product of; none for other sets.
template <class Set>
struct SetParts {
    static constexpr std::array<int, 0> sizes{};
};
template <>
struct SetParts<sets::IntervalSet> {
    static constexpr std::array<int, 1> sizes{1};
};
template <std::size_t N>
struct SetParts<sets::Ball<N>> {
    static constexpr std::array<int, 1> sizes{static_cast<int>(N)};
};
template <class... Sets>
requires(!SetParts<Sets>::sizes.empty() && ...) struct SetParts<sets::Product<Sets...>> {
    static constexpr std::size_t count = (SetParts<Sets>::sizes.size() + ... + 0);
    static constexpr std::array<int, count> sizes = [] {
        std::array<int, count> all{};
        std::size_t next = 0;
        const auto add = [&](const auto& some) {
            for (const int size : some) all[next++] = size;
        };
        (add(SetParts<Sets>::sizes), ...);
        return all;
    }();
};

template <class System, int N, int M>
class TypedInclusion {
    static_assert(check_inclusion<System>());
    static constexpr int n = state_size<System>;
    static constexpr int m = reaction_size<System>;
    static_assert(n <= N && m <= M && (n == N || n > 0) && (m == M || m > 0));

    using Table = InclusionTable<N, M>;
    using Set = SetOf<System>;
    // Of the solvers.
    using State = typename Table::State;
    using Reaction = typename Table::Reaction;
    using Square = typename Table::Square;
    using Observation = typename Table::Observation;
    using Action = typename Table::Action;
    using Terms = typename Table::Terms;
    // Of the system.
    using Own = InclusionTable<n, m>;
    using OwnState = typename Own::State;
    using OwnReaction = typename Own::Reaction;

    static constexpr bool box = BoxSet<Set>;
    static constexpr bool of_reactions = confines<System>() == Confines::reaction;
    static constexpr bool has_fault = requires(const Set& set)
    {
        {
            set.fault()
            } -> std::convertible_to<std::string_view>;
    };
    static constexpr bool gives_jacobian =
        requires(const System& s, const OwnState& w, typename Own::Square& j)
    {
        s.smooth_jacobian(0.0, w, j);
    };
    static constexpr bool moves = requires(const System& s, OwnReaction& r) { s.offset(0.0, r); };
    static constexpr bool gives_offset_rate = requires(const System& s, OwnReaction& r)
    {
        s.offset_rate(0.0, r);
    };
    static constexpr bool continues_bounds = requires(const System& s, const OwnState& w, int i)
    {
        {
            s.branch_bound(0.0, w, i, Branch::upper)
            } -> std::convertible_to<double>;
    };
    static constexpr bool gives_bound_gradient =
        requires(const System& s, const OwnState& w, int i, OwnState& g)
    {
        s.bound_gradient(0.0, w, i, g);
    };
    static constexpr bool branching = has_modes<n, m> && (box || continues_bounds);
    static constexpr bool in_parts = m != 1 && !box && !SetParts<Set>::sizes.empty();
    static_assert(!HasStaticBound<System> ||
                      (of_reactions && ((has_modes<n, m> && box) || in_parts)),
                  "ricochet: found static_bound in an inclusion without branches; expected a box "
                  "of one to four reactions in a system of fixed size, or a product of discs "
                  "sets::Ball and intervals sets::IntervalSet");
    static constexpr bool declares_inputs = DeclaresStepInputs<System, OwnState, OwnReaction>;
    /// Padded reactions of a box have the offset -1.
    static constexpr bool pads_offset = m != M && box && of_reactions;

    [[nodiscard, gnu::always_inline]] static const System& at(const void* system) noexcept
    {
        return *static_cast<const System*>(system);
    }

    /// The vector of the system in one of the solvers, which is the same one where sizes are.
    template <class OwnVector, class Vector>
    [[nodiscard, gnu::always_inline]] static decltype(auto) own(const Vector& v)
    {
        if constexpr (std::is_same_v<OwnVector, Vector>) {
            return (v);
        } else {
            OwnVector out;
            for_each_component(out, [&](auto i) { out[i] = v[i]; });
            return out;
        }
    }
    [[nodiscard, gnu::always_inline]] static decltype(auto) state(const State& w)
    {
        return own<OwnState>(w);
    }

    /// Lets a function of the system write its part of a vector or matrix.
    template <class OwnMatrix, class Matrix, class Write>
    static void write(Matrix& out, const Write& write)
    {
        if constexpr (std::is_same_v<OwnMatrix, Matrix>) {
            write(out);
        } else {
            constexpr int rows = OwnMatrix::RowsAtCompileTime;
            constexpr int columns = OwnMatrix::ColsAtCompileTime;
            OwnMatrix part = out.template topLeftCorner<rows, columns>();
            write(part);
            out.template topLeftCorner<rows, columns>() = part;
        }
    }

    template <int rows, int columns, class Matrix>
    [[nodiscard, gnu::always_inline]] static decltype(auto) corner(const Matrix& of)
    {
        if constexpr (rows == Matrix::RowsAtCompileTime && columns == Matrix::ColsAtCompileTime) {
            return (of);
        } else {
            return of.template topLeftCorner<rows, columns>();
        }
    }

    static void smooth(const void* system, double t, const State& w, State& f)
    {
        if constexpr (n == N) {
            at(system).smooth(t, w, f);
        } else {
            OwnState part;
            at(system).smooth(t, state(w), part);
            copy_padded(part, f);
        }
    }

    static bool project(const void* system, double t, const State& w, const Reaction& z,
                        Reaction& p)
    {
        const Set set = at(system).reaction_set(t, state(w));
        if constexpr (m == M) {
            set.project(span_of(z), span_of(p));
        } else {
            OwnReaction part = own<OwnReaction>(z);
            set.project(span_of(part), span_of(part));
            for (Eigen::Index i = m; i < M; ++i) {
                p[i] = of_reactions ? 0 : std::min(std::max(z[i], -1.0), 1.0);
            }
            p.template head<m>() = part;
        }
        return fault_of(set).empty();
    }
    static bool derivative(const void* system, double t, const State& w, const Reaction& z,
                           double* d)
    {
        const Set set = at(system).reaction_set(t, state(w));
        if constexpr (m == M) {
            const auto k = static_cast<std::size_t>(z.size());
            set.derivative(span_of(z), {d, k * k});
        } else {
            const OwnReaction part = own<OwnReaction>(z);
            std::array<double, static_cast<std::size_t>(m * m)> block{};
            set.derivative(span_of(part), std::span<double>(block));
            std::fill(d, d + M * M, 0.0);
            for (int i = 0; i < m; ++i) std::copy_n(block.data() + i * m, m, d + i * M);
            for (int i = m; i < M && !of_reactions; ++i) d[i * M + i] = clamp_slope(z[i], -1, 1);
        }
        return fault_of(set).empty();
    }
    static bool bounds(const void* system, double t, const State& w, Reaction& lower,
                       Reaction& upper)
    {
        const Set set = at(system).reaction_set(t, state(w));
        const Eigen::Index count = m == Eigen::Dynamic ? lower.size() : m;
        for (Eigen::Index i = 0; i < count; ++i) {
            lower[i] = set.lower(static_cast<std::size_t>(i));
            upper[i] = set.upper(static_cast<std::size_t>(i));
        }
        for (Eigen::Index i = count; i < lower.size(); ++i) {
            lower[i] = of_reactions ? 0 : -1;
            upper[i] = of_reactions ? 0 : 1;
        }
        return fault_of(set).empty();
    }
    static double bound(const void* system, double t, const State& w, Eigen::Index i, Branch side)
    {
        if constexpr (m != M) {
            if (i >= m) return 0;
        }
        return own_bound(at(system), t, state(w), i, side);
    }
    [[nodiscard]] static double own_bound(const System& system, double t, const OwnState& w,
                                          Eigen::Index i, Branch side)
    {
        if constexpr (continues_bounds) {
            return system.branch_bound(t, w, static_cast<int>(i), side);
        } else {
            const Set set = system.reaction_set(t, w);
            const auto k = static_cast<std::size_t>(i);
            return side == Branch::lower ? set.lower(k) : set.upper(k);
        }
    }

    template <bool diagonal>
    static void branch_state(const void* system, const Terms& terms, Mode mode, double t,
                             const State& w, MotionInBranches<N, M>& out)
    {
        // Works on copies, since the output may overlap the input.
        const OwnState here = by_components(w.data());
        OwnState motion;
        free_rate<diagonal>(at(system), terms, t, here, motion);
        const OwnReaction acting = reactions(at(system), terms, mode, t, here, motion);
        add_reactions(terms, acting, motion);
        copy_padded(motion, out.rate);
        copy_padded(acting, out.reaction);
        if constexpr (continues_bounds) {
            for (Eigen::Index i = 0; i < M; ++i) {
                out.lower[i] = i < m ? own_bound(at(system), t, here, i, Branch::lower) : 0;
                out.upper[i] = i < m ? own_bound(at(system), t, here, i, Branch::upper) : 0;
            }
        } else {
            const Set set = at(system).reaction_set(t, here);
            for (Eigen::Index i = 0; i < M; ++i) {
                out.lower[i] = i < m ? set.lower(static_cast<std::size_t>(i)) : 0;
                out.upper[i] = i < m ? set.upper(static_cast<std::size_t>(i)) : 0;
            }
        }
    }

    /// Reads a state one component at a time, as it was written: see components.hpp. Volatile,
    /// since compilers otherwise read pairs.
    [[nodiscard, gnu::always_inline]] static OwnState by_components(const double* x)
    {
        OwnState w;
        for_each_component(w, [&](auto i) { w[i] = *static_cast<const volatile double*>(x + i); });
        return w;
    }

    /// A copy for Eigen's products, whose operands are in memory; the original stays in registers.
    [[nodiscard, gnu::always_inline]] static OwnState copied(const OwnState& from)
    {
        OwnState to;
        for_each_component(from, [&](auto i) { to[i] = from[i]; });
        return to;
    }

    static void set_where(bool here, double value, double& out) noexcept
    {
        if (here) out = value;
    }

    /// The branch of the first reaction, or of the only one.
    [[nodiscard]] static constexpr Branch branch_of_first(Mode mode) noexcept
    {
        if constexpr (m > 1) mode %= 3;
        return static_cast<Branch>(static_cast<int>(mode) - 1);
    }

    /// s'(t), by a central difference where the system does not give it.
    [[nodiscard]] static OwnReaction rate_of_offset(const System& system, double t)
    {
        OwnReaction rate;
        if constexpr (gives_offset_rate) {
            system.offset_rate(t, rate);
        } else if constexpr (moves) {
            const double step = 1e-5 * std::max(1.0, std::abs(t));
            OwnReaction ahead, behind;
            ahead.setZero();
            behind.setZero();
            system.offset(t + step, ahead);
            system.offset(t - step, behind);
            rate = (ahead - behind) / (2 * step);
        } else {
            rate.setZero();
        }
        return rate;
    }

    /// Writes A^-1 f.
    template <bool diagonal>
    [[gnu::always_inline]] static void free_rate(const System& system, const Terms& terms, double t,
                                                 const OwnState& w, OwnState& free)
    {
        OwnState f;
        system.smooth(t, w, f);
        if constexpr (diagonal) {
            for_each_component(f, [&](auto i) { free[i] = terms.inverse_diagonal[i] * f[i]; });
        } else {
            const OwnState force = copied(f);
            const OwnState out = times(corner<n, n>(terms.inverse_mass), force);
            free = by_components(out.data());
        }
    }

    /// The reactions in a mode, where the rate without them is `free`.
    [[nodiscard, gnu::always_inline]] static OwnReaction reactions(const System& system,
                                                                   const Terms& terms,
                                                                   const Mode mode, double t,
                                                                   const OwnState& w,
                                                                   const OwnState& free)
    {
        OwnReaction r;
        std::size_t held = 0;
        Mode rest = mode;
        for (Eigen::Index i = 0; i < m; ++i, rest /= 3) {
            const Branch on = branch_of_first(rest);
            if (on == Branch::inside) held |= std::size_t{1} << i;
            r[i] = on == Branch::inside ? 0 : own_bound(system, t, w, i, on);
        }
        if (held == 0) return r;
        if constexpr (m == 1) {
            const Eigen::Index k = terms.selected[0];
            double rate = 0;
            if (k < 0) {
                rate = terms.observed(0, free);
            } else {
                // Avoids free[k]: an array that is indexed at run time is kept in memory.
                for_each_component(free, [&](auto i) { set_where(i == k, free[i], rate); });
            }
            if constexpr (moves) rate -= rate_of_offset(system, t)[0];
            r[0] = -terms.holds[1].inverse(0, 0) * rate;
        } else {
            const OwnState all = copied(free);
            OwnReaction rate = times(corner<m, n>(terms.observe), all);
            rate += times(corner<m, m>(terms.delassus), r);
            if constexpr (moves) rate -= rate_of_offset(system, t);
            r -= times(corner<m, m>(terms.holds[held].inverse), rate);
        }
        return r;
    }

    /// A^-1 (f + G r) from A^-1 f.
    [[gnu::always_inline]] static void add_reactions(const Terms& terms, const OwnReaction& r,
                                                     OwnState& free)
    {
        if constexpr (m == 1) {
            for_each_component(free, [&](auto i) { free[i] = free[i] + terms.lever(i, 0) * r[0]; });
        } else {
            const OwnReaction acting = r;
            const OwnState more = times(corner<n, m>(terms.lever), acting);
            for_each_component(free, [&](auto i) { free[i] += more[i]; });
        }
    }

    template <bool diagonal>
    [[gnu::always_inline]] static void own_flow(const System& system, const Terms& terms, Mode mode,
                                                double t, const OwnState& w, OwnState& rate)
    {
        free_rate<diagonal>(system, terms, t, w, rate);
        const OwnReaction r = reactions(system, terms, mode, t, w, rate);
        add_reactions(terms, r, rate);
        for (Eigen::Index i = 0; i < m; ++i, mode /= 3) {
            if (branch_of_first(mode) != Branch::inside || terms.selected[i] < 0) continue;
            const double still = rate_of_offset(system, t)[i];
            for_each_component(rate,
                               [&](auto k) { set_where(k == terms.selected[i], still, rate[k]); });
        }
    }

public:
    /// Called by `FlowByComponents`.
    template <bool diagonal>
    [[gnu::always_inline]] static void flow(const void* system, const Terms& terms, Mode mode,
                                            double t, const State& w, State& rate)
    {
        if constexpr (n == N) {
            own_flow<diagonal>(at(system), terms, mode, t, w, rate);
        } else {
            OwnState part;
            own_flow<diagonal>(at(system), terms, mode, t, state(w), part);
            copy_padded(part, rate);
        }
    }
    // Long: a list of functions, one for each entry of the table.
    [[nodiscard]] static constexpr Table table()
    {
        using S = const void*;
        Table out;
        InclusionTraits& traits = out.traits;
        traits.confines = confines<System>();
        if constexpr (requires { System::affine; }) traits.affine = System::affine;
        traits.box = box;
        traits.gives_jacobian = gives_jacobian;
        traits.moves = moves || pads_offset;
        traits.gives_offset_rate = gives_offset_rate || (pads_offset && !moves);
        traits.continues_bounds = continues_bounds;
        traits.gives_static_bound = HasStaticBound<System>;
        traits.gives_bound_gradient = gives_bound_gradient;

        out.smooth = smooth;
        if constexpr (gives_jacobian) {
            out.smooth_jacobian = [](S s, double t, const State& w, Square& j) {
                write<typename Own::Square>(
                    j, [&](auto& part) { at(s).smooth_jacobian(t, state(w), part); });
            };
        }
        if constexpr (requires(const System& s, typename Own::Square& a) { s.mass(a); }) {
            out.mass = [](S s, Square& a) {
                write<typename Own::Square>(a, [&](auto& part) { at(s).mass(part); });
            };
        }
        if constexpr (requires(const System& s, typename Own::Observation& e) { s.observe(e); }) {
            out.observe = [](S s, Observation& e) {
                write<typename Own::Observation>(e, [&](auto& part) { at(s).observe(part); });
            };
        }
        if constexpr (requires(const System& s, typename Own::Action& g) { s.act(g); }) {
            out.act = [](S s, Action& g) {
                write<typename Own::Action>(g, [&](auto& part) { at(s).act(part); });
            };
        }
        if constexpr (moves || pads_offset) {
            out.offset = []([[maybe_unused]] S s, [[maybe_unused]] double t, Reaction& r) {
                if constexpr (moves) {
                    write<OwnReaction>(r, [&](auto& part) { at(s).offset(t, part); });
                }
                if constexpr (pads_offset) r.template tail<M - m>().setConstant(-1);
            };
        }
        out.has_own_offset = [](S s) {
            if constexpr (requires { at(s).has_own_offset(); }) return at(s).has_own_offset();
            return static_cast<void>(s), moves;
        };
        if constexpr (gives_offset_rate) {
            out.offset_rate = [](S s, double t, Reaction& r) {
                if constexpr (m != M) r.setZero();
                write<OwnReaction>(r, [&](auto& part) { at(s).offset_rate(t, part); });
            };
        } else if constexpr (pads_offset && !moves) {
            out.offset_rate = [](S, double, Reaction& r) { r.setZero(); };
        }

        out.project = project;
        out.derivative = derivative;
        if constexpr (box) out.bounds = bounds;
        if constexpr (has_fault) {
            out.fault = [](S s, double t, const State& w) {
                const Set set = at(s).reaction_set(t, state(w));
                return std::string(fault_of(set));
            };
        }
        out.set_dimension = [](S s, double t, const State& w) {
            return static_cast<std::size_t>(at(s).reaction_set(t, state(w)).dimension());
        };
        if constexpr (box || continues_bounds) out.bound = bound;
        if constexpr (HasStaticBound<System>) {
            out.static_bound = [](S s, double t, const State& w, Eigen::Index i) -> double {
                if constexpr (in_parts) {
                    return at(s).static_bound(t, state(w), static_cast<int>(i));
                } else {
                    return i < m ? at(s).static_bound(t, state(w), static_cast<int>(i)) : 0;
                }
            };
            if constexpr (in_parts) out.parts = SetParts<Set>::sizes;
        }
        if constexpr (gives_bound_gradient) {
            out.bound_gradient = [](S s, double t, const State& w, Eigen::Index i, State& g) {
                write<OwnState>(g, [&](auto& part) {
                    at(s).bound_gradient(t, state(w), static_cast<int>(i), part);
                });
            };
        }
        if constexpr (branching) {
            out.flow = &Table::Flow::template call<TypedInclusion, Terms, false>;
            out.flow_of_diagonal = &Table::Flow::template call<TypedInclusion, Terms, true>;
            out.branch_state = branch_state<false>;
            out.branch_state_of_diagonal = branch_state<true>;
        }
        if constexpr (declares_inputs) {
            out.step_layout = []() -> const StepLayout& { return System::step_layout(); };
            out.step_unit = [](S s) { return static_cast<double>(at(s).step_unit()); };
            out.step_inputs = [](S s, double t, const State& w, const State& rate,
                                 const Reaction& r, typename Table::StepInputs& inputs) {
                at(s).step_inputs(t, state(w), state(rate), own<OwnReaction>(r), inputs);
            };
        }
        return out;
    }
};

template <class System, int N, int M>
inline constexpr InclusionTable<N, M> inclusion_table = TypedInclusion<System, N, M>::table();

/// A copy of a system, for solvers of N components and M reactions.
template <int N, int M, class System>
[[nodiscard]] AnyInclusion<N, M> inclusion_of(const System& system)
{
    Eigen::Index n = state_size<System>, m = reaction_size<System>;
    if constexpr (state_size<System> == Eigen::Dynamic)
        n = static_cast<Eigen::Index>(system.size());
    if constexpr (reaction_size<System> == Eigen::Dynamic) {
        m = static_cast<Eigen::Index>(system.reactions());
    }
    return {inclusion_table<System, N, M>, std::make_shared<const System>(system), n, m};
}

/// Whether the solvers of a system have its sizes.
template <class System>
inline constexpr bool runs_exactly =
    solver_components<state_size<System>, reaction_size<System>> ==
    state_size<System>&& solver_reactions<state_size<System>, reaction_size<System>> ==
    reaction_size<System>;

/// A copy of a system for the solvers in which it runs.
template <class System>
[[nodiscard]] auto solver_inclusion(const System& system)
{
    return inclusion_of<solver_components<state_size<System>, reaction_size<System>>,
                        solver_reactions<state_size<System>, reaction_size<System>>>(system);
}

/// The same for solvers of its own sizes.
template <class System>
[[nodiscard]] auto exact_inclusion(const System& system)
{
    return inclusion_of<state_size<System>, reaction_size<System>>(system);
}

/// A system with its constant matrices, which have been checked.
template <Inclusion System>
class InclusionMatrices : public AnyMatrices<state_size<System>, reaction_size<System>> {
public:
    static constexpr int N = state_size<System>;
    static constexpr int M = reaction_size<System>;

    /// @throws std::invalid_argument for a singular or non-finite A, or E or G that are not
    /// finite.
    explicit InclusionMatrices(const System& system)
        : InclusionMatrices::AnyMatrices(exact_inclusion(system))
    {
        static_assert(check_own_size<N, M>());
    }

    [[nodiscard]] const System& system() const noexcept
    {
        return *static_cast<const System*>(this->inclusion().system());
    }
};

}  // namespace ricochet::detail
