// The branches of an inclusion as the modes of a hybrid system.
//
// Where every reaction is at one of its bounds, or held, the inclusion
//
//     A w' = f(t, w) + G reaction,    -y in the normal cone of K at the reaction
//
// is an ordinary differential equation: a reaction at a bound is known, and the reactions that
// hold their y at zero follow from y' = 0, a linear system whose matrix is constant. A mode
// states the branch of every reaction. Between changes of mode the motion is as smooth as f,
// for any stepper; a change of mode is the event of a guard, located like any other.
//
//     y > 0     reaction at its lower bound    until y falls to zero
//     y < 0     reaction at its upper bound    until -y does
//     y = 0     reaction in between            until it meets a bound
//
// Boxes of at most four reactions, in systems of fixed size, have such modes.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/filippov_motion.hpp"
#include "ricochet/nonsmooth/composite_step.hpp"
#include "ricochet/nonsmooth/detail/least_reaction.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// Inclusions whose branches are modes.
template <class System>
concept Branching = Inclusion<System> &&
    detail::has_modes<state_size<System>, reaction_size<System>> && BoxSet<SetOf<System>> &&
    detail::confines<System>()
== Confines::reaction;

namespace detail {

/// The hybrid system. Digit i to base 3 of a mode is the branch of reaction i: 0 lower (y > 0),
/// 1 inside (held), 2 upper. Three more modes mean that the motion cannot continue by itself:
/// `several`, where changes coincide and the rates do not determine what follows, `no_flow`, where
/// the held reactions are not determined by y' = 0, and `empty`, where a lower bound lies above
/// the upper one. In these modes nothing moves.
///
/// There are four guards per reaction, 4 i + kind: y, -y, reaction - lower, upper - reaction, where
/// an infinite bound is always far away; and guard 4 M + i, which is 1 where the bounds of reaction
/// i form an interval and -1 where they do not.
///
/// A bound that depends on y must be smooth a little beyond y = 0 on its side. Where the bound
/// of `reaction_set` is not, as with F(|y|), the system declares
///
///     double branch_bound(t, w, i, branch) const
///
/// Held reactions have the bounds of `static_bound`, where the system declares it.
template <int N, int M>
class RICOCHET_ALIGNED AnyModes {
public:
    using State = std::array<double, static_cast<std::size_t>(N)>;
    using Inclusion = AnyInclusion<N, M>;
    using Matrices = AnyMatrices<N, M>;
    using Vector = typename Matrices::State;
    using Reaction = typename Matrices::Reaction;
    using Branches = Eigen::Matrix<Branch, M, 1>;
    using Motion = typename AnyInclusion<N, M>::BranchMotion;
    using Slacks = std::array<double, 2>;  ///< above the lower bound, below the upper one
    using Rooms = std::array<double, 2 * static_cast<std::size_t>(M)>;  ///< of all reactions

    static constexpr bool forward_only = true;
    static constexpr std::size_t guard_count = 5 * static_cast<std::size_t>(M);
    static constexpr std::size_t first_set_guard = 4 * static_cast<std::size_t>(M);
    static constexpr std::size_t branch_modes = M == 1 ? 3 : M == 2 ? 9 : M == 3 ? 27 : 81;
    static constexpr std::size_t mode_count = branch_modes + 3;
    static constexpr Mode several = branch_modes;
    static constexpr Mode no_flow = branch_modes + 1;
    static constexpr Mode empty = branch_modes + 2;

    /// @throws std::invalid_argument for matrices that `detail::InclusionMatrices` refuses.
    explicit AnyModes(const AnyInclusion<N, M>& inclusion);

    [[nodiscard]] const Matrices& matrices() const noexcept { return matrices_; }
    /// Number of reactions of the system.
    [[nodiscard]] Eigen::Index count() const noexcept { return matrices_.own_reactions(); }

    // --- modes and guards by name ---

    [[nodiscard]] static constexpr Branch branch(std::size_t i, Mode mode) noexcept
    {
        for (; i > 0; --i) mode /= 3;
        return static_cast<Branch>(static_cast<int>(mode % 3) - 1);
    }
    [[nodiscard]] static constexpr Mode mode_of(const Branches& branches) noexcept
    {
        Mode mode = 0;
        for (Eigen::Index i = M; i-- > 0;) {
            mode = 3 * mode + static_cast<Mode>(static_cast<int>(branches[i]) + 1);
        }
        return mode;
    }
    [[nodiscard]] static Branches branches_of(Mode mode) noexcept
    {
        Branches branches;
        for (Eigen::Index i = 0; i < M; ++i) {
            branches[i] = branch(static_cast<std::size_t>(i), mode);
        }
        return branches;
    }
    /// Whether the reactions that a mode holds are uniquely determined.
    [[nodiscard]] bool flows(Mode mode) const noexcept
    {
        return mode < branch_modes && terms_.holds[mask_of(mode)].determined;
    }

    /// Whether a mode of branches holds any reaction.
    [[nodiscard]] static constexpr bool holds(Mode mode) noexcept
    {
        return mode < branch_modes && mask_of(mode) != 0;
    }

    [[nodiscard]] static GuardInfo guard_info(std::size_t which) noexcept
    {
        constexpr std::array<std::string_view, 4> names{"y falls to zero", "y rises to zero",
                                                        "lower bound", "upper bound"};
        GuardInfo info;
        info.name = which < first_set_guard ? names[which % 4] : "the set is not empty";
        info.unilateral = which < first_set_guard && which % 4 < 2;
        return info;
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const noexcept
    {
        if (mode >= branch_modes) return false;
        const std::size_t i = which >= first_set_guard ? which - first_set_guard : which / 4;
        if (i >= static_cast<std::size_t>(count())) return false;
        if (which >= first_set_guard) return true;
        const Branch at = branch(i, mode);
        if (which % 4 == 0) return at == Branch::lower;
        if (which % 4 == 1) return at == Branch::upper;
        return at == Branch::inside;
    }

    // --- the contract of a system ---

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        if (mode >= branch_modes) {
            for_each_component(dxdt, [&](auto i) { dxdt[i] = 0; });
            return;
        }
        flow_by_components()(mode, t, x, dxdt);
    }
    /// The flow of the modes of branches.
    [[nodiscard]] BranchFlow<N> flow_by_components() const noexcept
    {
        return {flow_, matrices_.inclusion().system(), &terms_};
    }

    /// The reactions in a mode at (t, w): of those with the same effect the least.
    [[nodiscard]] Reaction reaction(Mode mode, double t, const Vector& w) const
    {
        Motion now = motion(mode, t, w);
        Reaction r = now.reaction;
        if (mode >= branch_modes || !terms_.holds[mask_of(mode)].joint) return r;
        for (Eigen::Index i = 0; i < M; ++i) {
            if (!is_held(i, mode)) now.lower[i] = now.upper[i] = r[i];
        }
        LeastReaction<M>(matrices_.act(), count()).choose(now.lower, now.upper, r);
        return r;
    }

    /// How far every held reaction is from its bounds; infinite where there is no bound, and for
    /// reactions that are not held. Writes the rate of the motion and the reactions, too.
    void rooms(Mode mode, double t, const Vector& w, Motion& motion, Rooms& rooms) const;

    /// Change of the held reactions that the rounding of the terms may cause.
    [[nodiscard]] double rounding_of_held(Mode mode, const Vector& rate, const Reaction& r) const
    {
        const double free = (rate - times(terms_.lever, r)).template lpNorm<Eigen::Infinity>();
        return negligible *
               (terms_.holds[mask_of(mode)].largest * free + r.template lpNorm<Eigen::Infinity>());
    }

    /// By how much a held reaction has to be beyond its bound to be released: more than the
    /// rounding that `settle` forgives.
    [[nodiscard]] double rounding_at_bound(Mode mode, const Motion& motion) const
    {
        const Reaction& r = motion.reaction;
        const Vector free = motion.rate - times(terms_.lever, r);
        const double y = times(terms_.observe, free).template lpNorm<Eigen::Infinity>();
        const double of_y = negligible * (terms_.holds[mask_of(mode)].largest * y +
                                          r.template lpNorm<Eigen::Infinity>());
        return 2 * std::max(of_y, rounding_of_held(mode, motion.rate, r));
    }

    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        return guard(which, mode, t, vector(x));
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const Vector& w) const;

    /// Evaluates all guards from one evaluation of the reactions.
    void guards(Mode mode, double t, const State& x, std::span<double> g) const
    {
        guards(mode, t, vector(x), nullptr, g);
    }
    /// @param known  the motion there, or null
    void guards(Mode mode, double t, const Vector& w, const Motion* known,
                std::span<double> g) const;

    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const State& x,
                                    const State& dxdt) const
    {
        return guard_rate(which, mode, t, vector(x), vector(dxdt));
    }
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const Vector& w,
                                    const Vector& dwdt) const;

    /// Rates of the guards that the mode enables; the others are 0.
    void guard_rates(Mode mode, double t, const State& x, const State& dxdt,
                     std::span<double> rates) const
    {
        guard_rates(mode, t, vector(x), vector(dxdt), nullptr, rates);
    }
    void guard_rates(Mode mode, double t, const Vector& w, const Vector& dwdt, const Motion* known,
                     std::span<double> rates) const;

    /// Applies all transitions of one instant together.
    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t, State& x) const;

    // --- entering ---

    /// The mode of the motion from (t, w). Observed components that are zero up to rounding are
    /// set to zero; `several` where the rates do not decide.
    /// @throws std::invalid_argument for what `minimal_selection` refuses.
    [[nodiscard]] Mode mode_at(double t, Vector& w) const;

    /// The same at the end of an earlier run, whose steps have held a y only up to their error: a y
    /// of at most `error` whose reaction is inside its bounds counts as zero, too.
    [[nodiscard]] Mode mode_after(StateWithReaction<N, M>& end, double error) const;

    /// The mode of the motion where the y of the reactions marked inside are zero; they are set to
    /// zero. `several` where the rates do not decide, `empty` where bounds form no interval.
    [[nodiscard]] Mode arrive(const Branches& at, double t, Vector& w) const
    {
        hold(at, t, w);
        return faulty(t, w) >= 0 ? empty : settle(at, t, w);
    }

    /// The first reaction that is at different branches in two motions which both satisfy the law,
    /// where the y of the reactions marked inside are zero; `no_reaction` where one motion or none
    /// does. Only a W with a principal minor that is not positive allows several.
    [[nodiscard]] std::size_t undetermined(const Branches& at, double t, const Vector& w) const;

    /// The branches that follow from the signs of y; inside where y is zero up to rounding.
    [[nodiscard]] Branches zero_branches(double t, const Vector& w) const;

    /// Moves every held y to zero, along the reactions that hold it.
    void hold(const Branches& branches, double t, Vector& w) const;

    /// y = E w - s(t).
    [[nodiscard]] Reaction observed(double t, const Vector& w) const
    {
        Reaction y;
        for (Eigen::Index i = 0; i < M; ++i) y[i] = terms_.observed(i, w);
        if (moves()) y -= offset(t);
        return y;
    }

    /// Row i of E times a vector.
    [[nodiscard]] double rate_of(Eigen::Index i, const Vector& v) const
    {
        return terms_.observed(i, v);
    }

    /// @throws std::invalid_argument where a bound jumps at y = 0, from (t, w) onto it.
    void check_bounds(double t, const Vector& w) const;

    /// The first reaction whose bounds form no interval; -1 if all do.
    [[nodiscard]] int faulty(double t, const Vector& w) const
    {
        LinearInequality<M> inequality;
        matrices_.inclusion().bounds(t, w, inequality.lower, inequality.upper);
        return inequality.faulty();
    }

    /// Reads one component at a time, as steps write it: see components.hpp.
    [[nodiscard]] static Vector vector(const State& x)
    {
        Vector w;
        for_each_component(x, [&](auto i) { w[static_cast<Eigen::Index>(i)] = x[i]; });
        return w;
    }

private:
    [[nodiscard]] bool moves() const noexcept { return matrices_.traits().moves; }

    void prepare(std::size_t mask)
    {
        auto& hold = terms_.holds[mask];
        hold.inverse.setZero();
        std::array<Eigen::Index, static_cast<std::size_t>(M)> held{};
        Eigen::Index count = 0;
        for (Eigen::Index i = 0; i < M; ++i) {
            if (!(mask >> i & 1)) continue;
            if (first_with(i, mask) == i) {
                held[static_cast<std::size_t>(count++)] = i;
            } else {
                hold.joint = joins_ = true;
            }
        }
        if (count == 0) return;
        Eigen::MatrixXd block(count, count);
        const auto at = [&](Eigen::Index k) { return held[static_cast<std::size_t>(k)]; };
        for (Eigen::Index i = 0; i < count; ++i) {
            for (Eigen::Index j = 0; j < count; ++j) block(i, j) = terms_.delassus(at(i), at(j));
        }
        is_unique_ = is_unique_ && block.determinant() > 0;
        hold.determined = invert(block, block) == count;
        if (!hold.determined) return;
        hold.largest = block.cwiseAbs().maxCoeff();
        for (Eigen::Index i = 0; i < count; ++i) {
            for (Eigen::Index j = 0; j < count; ++j) hold.inverse(at(i), at(j)) = block(i, j);
        }
    }

    [[nodiscard]] static constexpr bool is_held(Eigen::Index i, Mode mode) noexcept
    {
        return branch(static_cast<std::size_t>(i), mode) == Branch::inside;
    }
    [[nodiscard]] static constexpr std::size_t mask_of(Mode mode) noexcept
    {
        std::size_t mask = 0;
        for (std::size_t i = 0; i < static_cast<std::size_t>(M); ++i, mode /= 3) {
            if (mode % 3 == 1) mask |= std::size_t{1} << i;
        }
        return mask;
    }

    [[nodiscard]] Reaction offset(double t) const
    {
        Reaction s;
        matrices_.offset(t, s);
        return s;
    }
    [[nodiscard]] Reaction offset_rate(double t) const
    {
        Reaction rate;
        if (matrices_.traits().gives_offset_rate) {
            matrices_.inclusion().offset_rate(t, rate);
        } else if (moves()) {
            const double step = 1e-5 * std::max(1.0, std::abs(t));
            rate = (offset(t + step) - offset(t - step)) / (2 * step);
        } else {
            rate.setZero();
        }
        return rate;
    }

    [[nodiscard]] double bound(double t, const Vector& w, Eigen::Index i, Branch side) const
    {
        return matrices_.inclusion().bound(t, w, i, side);
    }

    [[nodiscard]] Motion motion(Mode mode, double t, const Vector& w) const
    {
        Motion out;
        find_motion(mode, t, w, out);
        return out;
    }
    void find_motion(Mode mode, double t, const Vector& w, Motion& out) const
    {
        state_(matrices_.inclusion().system(), terms_, mode, t, w, out);
        if (matrices_.traits().gives_static_bound) {
            for (Eigen::Index i = 0; i < count(); ++i) {
                if (!is_held(i, mode)) continue;
                out.upper[i] = matrices_.inclusion().static_bound(t, w, i);
                out.lower[i] = -out.upper[i];
            }
        }
        if (joins_ && holds(mode)) divide(mask_of(mode), out.lower, out.upper, out.reaction);
    }

    // --- reactions with the same effect, such as those of two contacts of one block ---
    //
    // The first of them that is held stands for all: it has what all have together, between the
    // sums of their bounds.

    /// Whether all with the effect of reaction i that `at` marks inside have finite bounds.
    [[nodiscard]] bool join_bounds(const Branches& at, LinearInequality<M>& of) const;
    /// Sets the branches of those that `mask` holds as their first one has them.
    void follow_first(std::size_t mask, Branches& branches) const
    {
        if (!joins_) return;
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (!(mask >> i & 1)) continue;
            const Eigen::Index first = first_with(i, mask);
            const int side = static_cast<int>(branches[first]);
            branches[i] = static_cast<Branch>(times_effect(i, first) > 0 ? side : -side);
        }
    }

    // --- static bounds, see static_bounds.hpp ---

    /// How many times the effect of reaction j reaction i has, on the motion and on y; 0 where
    /// their effects are different ones.
    [[nodiscard]] double times_effect(Eigen::Index i, Eigen::Index j) const;
    /// The first of the reactions of a mask with the effect of reaction i, which is one of them.
    [[nodiscard]] Eigen::Index first_with(Eigen::Index i, std::size_t mask) const
    {
        if (!may_join()) return i;
        Eigen::Index j = 0;
        while (!(mask >> j & 1) || times_effect(i, j) == 0) ++j;
        return j;
    }
    /// Reactions of bodies on belts of different speeds have the same effect, and other y.
    [[nodiscard]] bool may_join() const noexcept
    {
        return matrices_.traits().gives_static_bound || !has_own_offset_;
    }
    /// Divides what one held reaction has for all with its effect so that all are at the same part
    /// of the way between their bounds, and meet them together; those without a bound have all.
    void divide(std::size_t mask, const Reaction& lower, const Reaction& upper, Reaction& r) const;

    /// What acts on reactions whose y is zero.
    struct Loads {
        Reaction rate;          ///< y' without reactions
        Reaction lower, upper;  ///< kinetic bounds
        Reaction most;          ///< static bounds

        [[nodiscard]] double kinetic(Eigen::Index i, Branch side) const
        {
            return side == Branch::lower ? lower[i] : upper[i];
        }
    };
    /// @throws std::invalid_argument for a static bound below the kinetic one.
    [[nodiscard]] Loads static_loads(double t, const Vector& w) const;
    /// The reactions where those not inside are `known`.
    [[nodiscard]] Reaction held_by(const Branches& at, const Reaction& known,
                                   const Loads& loads) const;
    /// Whether the room of held reaction i below its upper, or above its lower bound will fall from
    /// here: the first of its first two derivatives that is not rounding is negative.
    /// @param noise  below which a change is rounding, in units of `rounding_of_held`
    [[nodiscard]] bool room_falls(Eigen::Index i, bool upper, Mode mode, double t, const Vector& w,
                                  double noise) const;
    /// Whether a held reaction that has met its bound leaves it. It may stay there, or turn back.
    [[nodiscard]] bool leaves_bound(Eigen::Index i, bool upper, Mode mode, double t,
                                    const Vector& w) const
    {
        const Motion now = motion(mode, t, w);
        const Slacks room = slacks(now.lower[i], now.upper[i], now.reaction[i]);
        const bool beyond = !(std::abs(room[upper ? 1 : 0]) <= rounding_at_bound(mode, now));
        return beyond || room_falls(i, upper, mode, t, w, 1.0 / 16);
    }
    /// As `settle`; bit i of `fired`: held reaction i has met its static bound.
    [[nodiscard]] Mode settle_static(Branches at, std::size_t fired, double t,
                                     const Vector& w) const;
    /// Whether every reaction that was inside before and is not after moves to its side.
    [[nodiscard]] bool leads(const Branches& before, const Branches& after, const Reaction& r,
                             const Reaction& rate) const;
    [[nodiscard]] Mode reset_static(const FiredGuards& fired, Branches branches, double t,
                                    Vector& w) const;

    /// How far a reaction is above its lower bound and below its upper one; for an infinite bound 1
    /// if the reaction is inside it, else -1.
    [[nodiscard]] static Slacks slacks(double lower, double upper, double r) noexcept
    {
        return {std::isinf(lower) ? std::copysign(1.0, -lower) : r - lower,
                std::isinf(upper) ? std::copysign(1.0, upper) : upper - r};
    }

    /// Same as `find_motion`, but without the rate in a mode that holds nothing, which needs none.
    void find_bounded_motion(Mode mode, double t, const Vector& w, Motion& out) const
    {
        if (holds(mode)) return find_motion(mode, t, w, out);
        matrices_.inclusion().branch_bounds(t, w, out.lower, out.upper);
        for (Eigen::Index i = 0; i < M; ++i, mode /= 3) {
            out.reaction[i] = mode % 3 == 0 ? out.lower[i] : out.upper[i];
        }
    }

    [[nodiscard]] Slacks slacks(Eigen::Index i, Mode mode, double t, const Vector& w) const
    {
        const Motion here = motion(mode, t, w);
        return slacks(here.lower[i], here.upper[i], here.reaction[i]);
    }

    /// 1 where the bounds of reaction i form an interval, else -1. Beyond y = 0, where the
    /// branch ends, bounds that depend on y need not form one.
    [[nodiscard]] static double is_set(Mode mode, Eigen::Index i, double lower, double upper,
                                       double y) noexcept
    {
        if (lower <= upper) return 1;
        const Branch side = branch(static_cast<std::size_t>(i), mode);
        return (side == Branch::lower && y < 0) || (side == Branch::upper && y > 0) ? 1 : -1;
    }

    /// y', or zero where rounding decides its sign: the curvature of a motion that is tangent
    /// to y = 0 then determines its direction.
    [[nodiscard]] double observed_rate(Eigen::Index i, Mode mode, double t, const Vector& w,
                                       const Vector& dwdt) const
    {
        double rate = terms_.observed(i, dwdt);
        if (moves()) rate -= offset_rate(t)[i];
        double size = 0;
        Mode rest = mode;
        for (Eigen::Index j = 0; j < count(); ++j, rest /= 3) {
            if (terms_.delassus(i, j) == 0 || rest % 3 == 1) continue;
            const auto at = static_cast<Branch>(static_cast<int>(rest % 3) - 1);
            size += std::abs(terms_.delassus(i, j) * bound(t, w, j, at));
        }
        return std::abs(rate) <= 64 * std::numeric_limits<double>::epsilon() * size ? 0 : rate;
    }

    /// @param now  the motion there
    [[nodiscard]] Slacks slack_rates(Eigen::Index i, Mode mode, double t, const Vector& w,
                                     const Vector& dwdt, const Motion& now) const
    {
        const double lower = now.lower[i];
        const double upper = now.upper[i];
        if (std::isinf(lower) && std::isinf(upper)) return {0, 0};
        const double width = upper - lower;
        const Slacks here = slacks(lower, upper, now.reaction[i]);
        const double size =
            std::isfinite(width) ? width : std::max({std::abs(here[0]), std::abs(here[1]), 1.0});
        if (!(size > 0)) return {0, 0};
        const TimeScales times(t, largest_component(w), largest_component(dwdt));
        Vector there;
        const auto later = [&](double s) {
            move(there, w, s, dwdt);
            return slacks(i, mode, t + s, there);
        };
        return fitted_rates(later, here, size, times);
    }

    /// The inequality for the y' of the reactions marked inside. The others are at their bounds.
    void state(const Branches& at, double t, const Vector& w, LinearInequality<M>& out) const
    {
        Vector f;
        matrices_.smooth(t, w, f);
        out.unknowns = count();
        out.w = terms_.delassus;
        out.y0.noalias() = times(terms_.observe, times(terms_.inverse_mass, f));
        if (moves()) out.y0 -= offset_rate(t);
        matrices_.inclusion().branch_bounds(t, w, out.lower, out.upper);
        for (Eigen::Index i = 0; i < M; ++i) {
            if (at[i] == Branch::lower) out.upper[i] = out.lower[i];
            if (at[i] == Branch::upper) out.lower[i] = out.upper[i];
        }
    }

    [[nodiscard]] Mode checked(Mode mode) const noexcept { return flows(mode) ? mode : no_flow; }

    /// The branches that follow where the y of those marked inside are zero. The rates decide, by a
    /// linear inequality; where the reaction is at a bound and y does not move, the curvature does.
    [[nodiscard]] Mode settle(const Branches& at, double t, const Vector& w) const
    {
        const Mode mode = mode_of(at);
        if (mask_of(mode) == 0) return mode;
        if (is_static(at)) return settle_static(at, 0, t, w);
        LinearInequality<M> inequality;
        state(at, t, w, inequality);
        const std::size_t mask = mask_of(mode);
        if (joins_ && !join_bounds(at, inequality)) return no_flow;
        for (Eigen::Index i = 0; i < M; ++i) {
            // A reaction without influence on y' is at one bound or the other.
            if (terms_.delassus(i, i) == 0) inequality.w(i, i) = inequality.no_influence;
        }
        Branches next = at;
        Reaction r = inequality.lower;
        Reaction rate = r;
        if (!inequality.solve(r, rate, next)) return several;
        int doubtful = 0;
        Eigen::Index which = 0;
        double size = 0;
        for (Eigen::Index i = 0; i < M; ++i) {
            if (at[i] != Branch::inside) {
                next[i] = at[i];
                continue;
            }
            if (terms_.delassus(i, i) == 0 && rate[i] == 0) return no_flow;
            const double terms = inequality.terms(i, r);
            const double room = std::min(r[i] - inequality.lower[i], inequality.upper[i] - r[i]);
            const bool clear = next[i] == Branch::inside ? room > negligible * std::abs(r[i])
                                                         : std::abs(rate[i]) > negligible * terms;
            if (clear) continue;
            ++doubtful;
            which = i;
            size = terms;
        }
        if (doubtful > 1) return several;
        if (doubtful == 1) {
            const bool up = r[which] - inequality.lower[which] > inequality.upper[which] - r[which];
            next[which] = up ? Branch::upper : Branch::lower;
        }
        follow_first(mask, next);
        if (doubtful == 0 || bends(mode_of(next), which, size, t, w)) return checked(mode_of(next));
        next[which] = Branch::inside;
        follow_first(mask, next);
        return checked(mode_of(next));
    }

    /// Whether static bounds hold the reactions inside, each of which acts on its y.
    [[nodiscard]] bool is_static(const Branches& at) const
    {
        if (!matrices_.traits().gives_static_bound) return false;
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (at[i] == Branch::inside && terms_.delassus(i, i) == 0) return false;
        }
        return true;
    }

    /// Whether y_i, which does not move, leaves zero where reaction i is at its bound in the mode
    /// `leaving`: it bends away by more than the rounding of its `terms`.
    [[nodiscard]] bool bends(Mode leaving, Eigen::Index i, double terms, double t,
                             const Vector& w) const
    {
        State x;
        State dxdt;
        Eigen::Map<Vector>(x.data()) = w;
        flow(leaving, t, x, dxdt);
        const Vector rate = vector(dxdt);
        const TimeScales times(t, largest_component(w), largest_component(rate));
        const double step = 1e-5 * times.shortest;
        const auto rate_of_y = [&](double s) {
            Eigen::Map<Vector>(x.data()) = w + s * rate;
            flow(leaving, t + s, x, dxdt);
            double y = terms_.observed(i, vector(dxdt));
            if (moves()) y -= offset_rate(t + s)[i];
            return y;
        };
        const double bending = rate_of_y(step) - rate_of_y(-step);
        const double noise = 4 * negligible * terms;
        return branch(static_cast<std::size_t>(i), leaving) == Branch::upper ? bending < -noise
                                                                             : bending > noise;
    }

    /// Whether the pairs marked inside in `at` lie on these branches by more than rounding.
    [[nodiscard]] bool fits_clearly(const LinearInequality<M>& inequality, const Branches& at,
                                    const Branches& branches) const
    {
        Reaction r, rate;
        if (!inequality.solve_on(branches, r, rate)) return false;
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (at[i] != Branch::inside) continue;
            const double terms = inequality.terms(i, r);
            const double size =
                branches[i] == Branch::inside
                    ? std::max(std::abs(r[i]), terms / std::abs(terms_.delassus(i, i)))
                    : terms;
            if (!(inequality.slack(i, branches[i], r[i], rate[i]) > negligible * size))
                return false;
        }
        return true;
    }

    /// Rounding of the terms of a rate or a reaction: 64 units in the last place.
    static constexpr double negligible = 64 * std::numeric_limits<double>::epsilon();

    Matrices matrices_;
    BranchTerms<N, M> terms_;
    bool is_unique_ = true;  ///< all principal minors of W are positive
    bool joins_ = false;     ///< some reactions have the same effect
    bool has_own_offset_ = false;
    typename Inclusion::Flow::Function flow_ = nullptr;
    typename Inclusion::Table::BranchState state_ = nullptr;
};

template <int N, int M>
AnyModes<N, M>::AnyModes(const AnyInclusion<N, M>& inclusion) : matrices_(inclusion)
{
    terms_.observe = matrices_.observe();
    terms_.inverse_mass = matrices_.inverse_mass();
    terms_.inverse_diagonal = terms_.inverse_mass.diagonal();
    terms_.diagonal = terms_.inverse_mass.isDiagonal(0);
    flow_ = inclusion.branch_flow(terms_.diagonal);
    state_ = inclusion.branch_state(terms_.diagonal);
    terms_.lever = times(matrices_.inverse_mass(), matrices_.act());
    terms_.delassus = times(matrices_.observe(), terms_.lever);
    for (Eigen::Index i = 0; i < M; ++i) terms_.selected[i] = matrices_.selected(i);
    has_own_offset_ = inclusion.has_own_offset();
    for (std::size_t mask = 0; mask >> count() == 0; ++mask) prepare(mask);
}

template <int N, int M>
Mode AnyModes<N, M>::mode_at(double t, Vector& w) const
{
    (void)minimal_selection(matrices_, t, w);
    const Branches held = zero_branches(t, w);
    hold(held, t, w);
    return settle(held, t, w);
}

template <int N, int M>
Mode AnyModes<N, M>::mode_after(StateWithReaction<N, M>& end, double error) const
{
    (void)minimal_selection(matrices_, end.t, end.w);
    LinearInequality<M> inequality;
    matrices_.inclusion().bounds(end.t, end.w, inequality.lower, inequality.upper);
    const Reaction y = observed(end.t, end.w);
    Branches held = zero_branches(end.t, end.w);
    for (Eigen::Index i = 0; i < M; ++i) {
        const double r = end.reaction[i];
        const bool inside = r > inequality.lower[i] && r < inequality.upper[i];
        if (inside && std::abs(y[i]) <= error) held[i] = Branch::inside;
    }
    hold(held, end.t, end.w);
    return settle(held, end.t, end.w);
}

template <int N, int M>
std::size_t AnyModes<N, M>::undetermined(const Branches& at, double t, const Vector& w) const
{
    if (is_unique_ || mask_of(mode_of(at)) == 0) return no_reaction;
    LinearInequality<M> inequality;
    state(at, t, w, inequality);
    Branches found, branches;
    bool any = false;
    for (Mode b = 0; b < branch_modes; ++b) {
        branches = branches_of(b);
        bool allowed = true;
        for (Eigen::Index i = 0; i < M; ++i) {
            allowed = allowed && (at[i] == Branch::inside || branches[i] == at[i]);
        }
        if (!allowed || !fits_clearly(inequality, at, branches)) continue;
        for (Eigen::Index i = 0; any && i < count(); ++i) {
            if (branches[i] != found[i]) return static_cast<std::size_t>(i);
        }
        found = branches;
        any = true;
    }
    return no_reaction;
}

template <int N, int M>
auto AnyModes<N, M>::zero_branches(double t, const Vector& w) const -> Branches
{
    const Reaction y = observed(t, w);
    const Reaction size =
        times(matrices_.observe().cwiseAbs(), w.cwiseAbs()) + offset(t).cwiseAbs();
    Branches out;
    for (Eigen::Index i = 0; i < M; ++i) {
        const double rounding = 16 * std::numeric_limits<double>::epsilon() * size[i];
        const bool zero = std::abs(y[i]) <= rounding;
        out[i] = zero ? Branch::inside : y[i] > 0 ? Branch::lower : Branch::upper;
    }
    return out;
}

template <int N, int M>
void AnyModes<N, M>::hold(const Branches& branches, double t, Vector& w) const
{
    const auto& mine = terms_.holds[mask_of(mode_of(branches))];
    Reaction y = observed(t, w);
    bool any = false;
    for (Eigen::Index i = 0; i < M; ++i) {
        if (branches[i] != Branch::inside) y[i] = 0;
        any = any || (branches[i] == Branch::inside && matrices_.selected(i) < 0);
    }
    if (any && mine.determined) w -= times(terms_.lever, times(mine.inverse, y));
    const Reaction s = offset(t);
    for (Eigen::Index i = 0; i < M; ++i) {
        if (branches[i] == Branch::inside) matrices_.hold(i, 0, s[i], w);
    }
}

/// Stands for the modes of an inclusion without branches.
struct NoModes {
    template <class Inclusion>
    explicit NoModes(const Inclusion& /*inclusion*/)
    {
    }
};

}  // namespace detail

/// The modes of a system.
template <Branching System>
class BranchModes : public detail::AnyModes<state_size<System>, reaction_size<System>> {
public:
    /// The modes of `system`, by solvers of its own size.
    explicit BranchModes(const System& system)
        : BranchModes::AnyModes(detail::exact_inclusion(system))
    {
        static_assert(detail::check_own_size<state_size<System>, reaction_size<System>>());
    }
};

}  // namespace ricochet

#include "ricochet/nonsmooth/detail/branch_guards.hpp"
#include "ricochet/nonsmooth/detail/static_bounds.hpp"
