// Internal: the declarations of this header may change without notice.
//
// `ImplicitPhases` of discs and intervals that hold more than they have where y moves: static
// friction of bodies on a plane.
//
// Whether a part of the reactions holds its y is a branch, which is kept from step to step and is
// not read from y = 0. A step in which a held part meets its static bound ends there; then the part
// takes its kinetic set, in which it leaves along the direction that the motion selects. The others
// are asked again, as in static_bounds.hpp. A part is held where its y comes to rest, and where its
// y passes zero exactly although the kinetic set alone would carry it through.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/nonsmooth/detail/false_position.hpp"
#include "ricochet/nonsmooth/detail/implicit_phases.hpp"

namespace ricochet::detail {

template <int N, int M>
class RICOCHET_ALIGNED PhasesOfParts final : public ImplicitPhases<N, M> {
    using Base = ImplicitPhases<N, M>;
    using Vector = typename Base::Vector;
    using Reaction = typename Base::Reaction;
    using State = typename Base::State;
    using Parts = std::vector<bool>;

public:
    using Base::select;

    PhasesOfParts(const AnyInclusion<N, M>& inclusion, const BranchPhasesOptions& options)
        : Base(inclusion, options), by_laws_at_end_(inclusion), sizes_(inclusion.parts())
    {
        laws_.of.assign(sizes_.size(), PartLaw::kinetic);
        laws_at_end_.of = laws_.of;
        by_laws_at_end_.follow(&laws_at_end_);
        laws_.given.setZero(matrices().reactions());
        none_.assign(sizes_.size(), false);
        for (Parts* parts : {&held_, &held_at_end_, &held_before_, &selected_}) *parts = none_;
        located_.end = to_;
        located_.error = error_;
    }

    [[nodiscard]] double reach(const ImplicitStart& from, double h) override
    {
        located_.valid = false;
        place_parts(from);
        if (!take_located(h)) return h;
        const auto at = [&](double s, const auto& value) {
            return take_located(s) ? value() : std::numeric_limits<double>::quiet_NaN();
        };
        located_.change = Change::none;
        for (std::size_t k = 0; k < sizes_.size(); ++k) {
            const auto value = [&] { return held_[k] ? slack(k) : approach(k); };
            const double whole = located_.length;
            double high = whole, at_high = value();
            if (!(at_high < 0)) continue;
            double low = 1e-6 * high;
            double at_low = at(low, value);
            if (!held_[k] && at_low < 0) {
                high = low, at_high = at_low;
                low *= 1e-3, at_low = at(low, value);
            }
            double s = low;
            if (at_low > 0) {
                s = false_position(low, at_low, high, at_high, 0,
                                   [&](double x) { return at(x, value); });
            }
            const bool found = s > 0 && take_located(s);
            if (found && (held_[k] || rests(k))) {
                located_.change = held_[k] ? Change::slip : Change::stop;
                located_.part = k;
            } else if (!take_located(whole)) {
                return h;
            }
        }
        located_.valid = true;
        located_.t = from.t;
        located_.w = from_.w;
        step_.embedded_error(from_, located_.length, located_.end, located_.error);
        return located_.length;
    }

    [[nodiscard]] bool take(const ImplicitStart& from, double h, const ImplicitEnd& end) override
    {
        ++this->attempts_;
        place_parts(from);
        from_is_to_ = from_;
        held_before_ = held_;
        const bool to_end =
            located_.valid && located_.t == from.t && located_.length == h && located_.w == from_.w;
        if (to_end) {
            to_ = located_.end;
            error_ = located_.error;
        } else {
            if (!solve_parts(h, to_)) return false;
            step_.embedded_error(from_, h, to_, error_);
        }
        held_at_end_ = held_;
        if (!settle_end(to_end)) return false;
        this->put(end);
        return true;
    }

    void take_to(const ImplicitStart& from, double, double s, const ImplicitEnd& end) override
    {
        place_parts(from);
        if (!solve_parts(s, probe_)) Base::give_up(probe_);
        this->write(probe_.w, end.x, this->size());
        this->rate(probe_, end.dxdt);
    }

    [[nodiscard]] double law() const override
    {
        for (std::size_t k = 0; k < sizes_.size(); ++k) {
            laws_at_end_.of[k] = held_at_end_[k] ? PartLaw::within_static : PartLaw::kinetic;
        }
        return law_violation(by_laws_at_end_, to_.t, to_.w, to_.reaction, this->options_.step);
    }

    void save(std::vector<double>& memory) const override
    {
        for (std::size_t k = 0; k < sizes_.size(); ++k) memory.push_back(held_at_end_[k] ? 1 : 0);
        Base::save(memory);
    }
    void restore(std::span<const double> memory) override
    {
        for (std::size_t k = 0; k < sizes_.size(); ++k) held_at_end_[k] = memory[k] != 0;
        Base::restore(memory.subspan(sizes_.size()));
        located_.valid = false;
    }

protected:
    /// Chooses among the parts whose y is zero those that are held.
    [[nodiscard]] bool select(State& at) override
    {
        selected_ = none_;
        for (std::size_t k = 0; k < sizes_.size(); ++k) {
            check_bound(k, at);
            selected_[k] = is_zero(k, at, negligible) || stays_at_rest(k, at);
        }
        return settle(at, selected_, none_);
    }
    void keep_selection() override { held_at_end_ = selected_; }

private:
    enum class Change { none, slip, stop };
    /// A step that has been taken to find its length.
    struct Located {
        bool valid = false;
        Change change = Change::none;
        std::size_t part = 0;
        double t = 0, length = 0;
        Vector w;
        State end;
        Vector error;
    };

    using Base::error_, Base::from_, Base::from_is_to_, Base::probe_, Base::step_, Base::to_;
    using Base::matrices;

    [[nodiscard]] Eigen::Index first(std::size_t k) const
    {
        Eigen::Index out = 0;
        for (std::size_t j = 0; j < k; ++j) out += sizes_[j];
        return out;
    }
    /// The scalar product of two vectors of reactions in one part.
    [[nodiscard]] double dot(std::size_t k, const Reaction& a, const Reaction& b) const
    {
        double sum = 0;
        const Eigen::Index from = first(k);
        for (Eigen::Index i = from; i < from + sizes_[k]; ++i) sum += a[i] * b[i];
        return sum;
    }
    [[nodiscard]] double size_of(std::size_t k, const Reaction& a) const
    {
        double size = 0;
        const Eigen::Index from = first(k);
        for (Eigen::Index i = from; i < from + sizes_[k]; ++i) size = std::hypot(size, a[i]);
        return size;
    }
    void scale(std::size_t k, double factor, Reaction& a) const
    {
        const Eigen::Index from = first(k);
        for (Eigen::Index i = from; i < from + sizes_[k]; ++i) a[i] *= factor;
    }
    [[nodiscard]] double bound(std::size_t k, const State& at) const
    {
        return matrices().inclusion().static_bound(at.t, at.w, static_cast<Eigen::Index>(k));
    }

    void place_parts(const ImplicitStart& from)
    {
        switch (Base::place(from)) {
            case Base::Placed::at_end_of_last: held_ = held_at_end_; break;
            case Base::Placed::at_start_of_last: held_ = held_before_; break;
            case Base::Placed::anew: held_ = selected_; break;
        }
    }
    /// Takes a step with the held parts at rest, whatever reactions that needs.
    [[nodiscard]] bool solve_parts(double h, State& to)
    {
        for (std::size_t k = 0; k < sizes_.size(); ++k) {
            laws_.of[k] = held_[k] ? PartLaw::held : PartLaw::kinetic;
        }
        step_.follow(&laws_);
        const bool solved = this->solve(h, to, nullptr);
        step_.follow(nullptr);
        return solved;
    }
    [[nodiscard]] bool take_located(double s)
    {
        located_.length = s;
        return solve_parts(s, located_.end);
    }

    // --- changes within a step ---

    /// How far a held reaction is below its static bound at the end of the located step.
    [[nodiscard]] double slack(std::size_t k) const
    {
        const double most = bound(k, located_.end);
        return most * (1 + negligible) - size_of(k, located_.end.reaction);
    }
    /// Negative where the y of a part points away from where it pointed at the start.
    [[nodiscard]] double approach(std::size_t k) const
    {
        Reaction y0 = from_.reaction, y1 = y0;
        matrices().observed(from_.t, from_.w, y0);
        matrices().observed(located_.end.t, located_.end.w, y1);
        return is_zero(k, from_, at_rest) ? 1 : dot(k, y0, y1);
    }
    [[nodiscard]] bool rests(std::size_t k) const { return is_zero(k, located_.end, at_rest); }
    /// Whether the y of a part is zero up to a fraction of its terms here and at the start of the
    /// step.
    [[nodiscard]] bool is_zero(std::size_t k, const State& at, double fraction) const
    {
        const auto& m = matrices();
        Reaction y = at.reaction, s = y;
        m.observed(at.t, at.w, y);
        m.offset(at.t, s);
        const Vector w = at.w.cwiseAbs() + from_.w.cwiseAbs();
        const Reaction terms = times(m.observe().cwiseAbs(), w) + s.cwiseAbs();
        return size_of(k, y) <= fraction * size_of(k, terms);
    }

    /// Whether a part that was held at the end of the last step has been left as it was there.
    [[nodiscard]] bool stays_at_rest(std::size_t k, const State& at) const
    {
        if (!held_at_end_[k] || !(std::abs(at.t - to_.t) <= negligible * std::abs(at.t)))
            return false;
        const auto& m = matrices();
        Reaction there = to_.reaction, here = there;
        m.observed(to_.t, to_.w, there);
        m.observed(at.t, at.w, here);
        const Vector w = at.w.cwiseAbs() + to_.w.cwiseAbs();
        const Reaction terms = times(m.observe().cwiseAbs(), w);
        return size_of(k, Reaction(here - there)) <= negligible * size_of(k, terms);
    }
    /// Whether the y of a part that moved comes to zero at the end of the step and no farther: up
    /// to a part of its terms that is above the shortest step in which `reach` looks for a stop,
    /// 1e-9 of the step, since what is left would pass zero within that.
    [[nodiscard]] bool arrives(std::size_t k) const
    {
        return is_zero(k, to_, 10 * at_rest) && !is_zero(k, from_, at_rest);
    }

    // --- what is held at the end of a step ---

    [[nodiscard]] bool settle_end(bool to_end)
    {
        Parts fired = none_, candidates = held_;
        bool changes = false;
        for (std::size_t k = 0; k < sizes_.size(); ++k) {
            const bool located = to_end && located_.part == k;
            if (held_[k]) {
                const double most = bound(k, to_) * (1 + negligible);
                fired[k] =
                    (located && located_.change == Change::slip) || size_of(k, to_.reaction) > most;
                changes = changes || fired[k];
            } else if ((located && located_.change == Change::stop) || has_stopped(k) ||
                       arrives(k)) {
                candidates[k] = changes = true;
                come_to_rest(k, to_);
            }
        }
        if (!changes) return true;
        if (!settle(to_, candidates, fired)) return false;
        held_at_end_ = candidates;
        return true;
    }
    /// Whether the kinetic set holds the y of a part: its reaction is inside.
    [[nodiscard]] bool has_stopped(std::size_t k) const
    {
        if (!is_zero(k, to_, at_rest)) return false;
        Reaction z = to_.reaction;
        scale(k, 1 + at_rest, z);
        Reaction p = z;
        matrices().inclusion().project(to_.t, to_.w, z, p);
        z -= p;
        return size_of(k, z) == 0;
    }
    /// Moves a y that is zero up to rounding onto zero, as its reaction would.
    void come_to_rest(std::size_t k, State& at) const
    {
        const auto& m = matrices();
        Reaction y = at.reaction;
        m.observed(at.t, at.w, y);
        const auto columns = times(m.inverse_mass(), m.act()).eval();
        const Eigen::MatrixXd lever = columns.middleCols(first(k), sizes_[k]);
        const Eigen::MatrixXd influence = m.observe().middleRows(first(k), sizes_[k]) * lever;
        at.w -= lever * influence.completeOrthogonalDecomposition().solve(
                            Eigen::VectorXd(y.segment(first(k), sizes_[k])));
    }

    /// Sets the reaction at `at`, where the candidates, whose y is zero, are held if their static
    /// bounds allow it; the others follow their kinetic sets. Those that have `fired` are at their
    /// static bounds up to the resolution of the time.
    [[nodiscard]] bool settle(State& at, Parts& candidates, const Parts& fired)
    {
        Reaction from = at.reaction;
        from.setZero();
        for (;;) {
            if (!reaction_with(at, candidates, nullptr)) return false;
            const Reaction r = at.reaction;
            std::vector<double> way(sizes_.size(), std::numeric_limits<double>::infinity());
            double least = way.front();
            for (std::size_t k = 0; k < sizes_.size(); ++k) {
                if (!candidates[k]) continue;
                const double most = bound(k, at);
                const double doubt = fired[k] ? -1e-9 : negligible;
                if (size_of(k, r) <= most * (1 + doubt)) continue;
                way[k] = part_of_way(k, from, r, most);
                least = std::min(least, way[k]);
            }
            if (std::isinf(least)) {
                selected_ = candidates;
                return true;
            }
            Parts at_bound = none_;
            Reaction given = r;
            for (std::size_t k = 0; k < sizes_.size(); ++k) {
                if (!(way[k] <= least + 1e-9)) continue;
                at_bound[k] = true;
                candidates[k] = false;
                scale(k, bound(k, at) / size_of(k, r), given);
            }
            laws_.given = given;
            if (!reaction_with(at, candidates, &at_bound)) return false;
            from = at.reaction;
        }
    }
    /// Where on the way from a to b the size of a part passes `most`, as a fraction of the way.
    [[nodiscard]] double part_of_way(std::size_t k, const Reaction& a, const Reaction& b,
                                     double most) const
    {
        const Reaction way = b - a;
        const double square = dot(k, way, way), along = dot(k, a, way);
        const double left = most * most - dot(k, a, a);
        if (!(left > 0) || square == 0) return 0;
        const double root = std::sqrt(along * along + square * left);
        return std::clamp(along > 0 ? left / (along + root) : (root - along) / square, 0.0, 1.0);
    }
    /// The reaction that holds the candidates, with those in `at_bound` as `laws_` gives them.
    [[nodiscard]] bool reaction_with(State& at, const Parts& candidates, const Parts* at_bound)
    {
        for (std::size_t k = 0; k < sizes_.size(); ++k) {
            laws_.of[k] = at_bound && (*at_bound)[k] ? PartLaw::given
                          : candidates[k]            ? PartLaw::held
                                                     : PartLaw::kinetic;
        }
        step_.follow(&laws_);
        const bool found = Base::select(at);
        step_.follow(nullptr);
        return found;
    }
    /// @throws std::invalid_argument where a part holds less at rest than it has where y moves.
    void check_bound(std::size_t k, const State& at) const
    {
        constexpr double far = 1e150;
        double kinetic = 0;
        for (Eigen::Index i = first(k); i < first(k) + sizes_[k]; ++i) {
            for (const double side : {-far, far}) {
                Reaction z = at.reaction, p = z;
                z.setZero();
                z[i] = side;
                matrices().inclusion().project(at.t, at.w, z, p);
                kinetic = std::max(kinetic, std::abs(p[i]));
            }
        }
        const double at_rest_bound = bound(k, at);
        if (at_rest_bound >= kinetic * (1 - negligible)) return;
        throw std::invalid_argument("inclusion: part " + std::to_string(k) +
                                    " of the set: its static bound lies below the kinetic one; "
                                    "found " +
                                    std::to_string(at_rest_bound) + " and " +
                                    std::to_string(kinetic));
    }

    /// Rounding of a reaction, in parts of it: 64 units in the last place.
    static constexpr double negligible = 64 * std::numeric_limits<double>::epsilon();
    /// Up to which part of its terms a y that the solver holds at zero is not zero.
    static constexpr double at_rest = 1e-9;

    mutable PartLaws laws_at_end_;
    typename Base::Matrices by_laws_at_end_;
    std::span<const int> sizes_;
    PartLaws laws_;
    Parts none_;
    Parts held_, held_at_end_, held_before_;  ///< at the start of the step, its end, the last start
    Parts selected_;                          ///< by the last selection
    Located located_;
};

}  // namespace ricochet::detail
