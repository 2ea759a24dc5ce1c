// Expected run of a random system, from its closed form and the semantics of the library
// alone: polynomials in long double, their roots between their extrema by bisection,
// and the rules for sets, resets and cascades.
//
// A problem whose answer depends on tiny differences is no test of an integrator: it is run
// again with its states moved by a billionth at every event, and must have the same
// events. Their displacement shows how accurately each of them can be known.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "random_systems.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::test {

using detail::counts;
using detail::opposite;
using detail::side_of;

using Real = long double;

/// A polynomial of degree three.
struct Cubic {
    std::array<Real, 4> c{};

    [[nodiscard]] Real operator()(Real s) const noexcept
    {
        return c[0] + s * (c[1] + s * (c[2] + s * c[3]));
    }
};

/// The points in (0, `end`) at which p turns, ascending.
[[nodiscard]] inline std::vector<Real> extrema(const Cubic& p, Real end)
{
    std::vector<Real> out;
    const Real a = 3 * p.c[3];
    const Real b = p.c[2];  // half the middle coefficient
    const Real discriminant = b * b - a * p.c[1];
    const auto add = [&](Real s) {
        if (s > 0 && s < end) out.push_back(s);
    };
    if (a == 0) {
        if (b != 0) add(-p.c[1] / (2 * b));
    } else if (discriminant > 0) {
        const Real q = -(b + std::copysign(std::sqrt(discriminant), b));
        add(q / a);
        if (q != 0) add(p.c[1] / q);
    }
    std::sort(out.begin(), out.end());
    return out;
}

/// A change of sides: at s, from `left`.
struct Change {
    Real s = 0;
    Side left = Side::plateau;
};

/// Where p, armed on `side`, changes sides in (0, end].
[[nodiscard]] inline std::vector<Change> changes(const Cubic& p, Side side, Real end)
{
    std::vector<Real> pieces = extrema(p, end);
    pieces.push_back(end);
    std::vector<Change> out;
    Real lo = 0;
    for (const Real next : pieces) {
        const Real value = p(next);
        const Side there = value > 0 ? Side::above : value < 0 ? Side::below : opposite(side);
        if (there != side) {
            Real hi = next;  // p is monotone from lo to hi
            for (;;) {
                const Real middle = lo + (hi - lo) / 2;
                if (middle <= lo || middle >= hi) break;
                const bool on_side = side == Side::above ? p(middle) > 0 : p(middle) < 0;
                (on_side ? lo : hi) = middle;
            }
            out.push_back({hi, side});
            side = there;
        }
        lo = next;
    }
    return out;
}

struct ExactEvent {
    Real t = 0;
    EventKind kind = EventKind::crossing;
    std::size_t guard = 0;
    Mode mode_after = 0;
};

struct ExactRun {
    bool regular = true;  ///< the rules determine the result, and no near coincidence exists
    std::vector<ExactEvent> events;
    std::array<Real, 3> x{};
    Mode mode = 0;
    std::size_t sets = 0;      ///< instants at which something was reset
    std::size_t together = 0;  ///< of these, with more than one guard
    std::size_t cascades = 0;  ///< of these, that set off another
};

/// Follows a problem.
class ExactMotion {
public:
    /// `disturbance`: moves every component by up to a billionth at start and at events.
    explicit ExactMotion(const RandomProblem& problem, learn::Random* disturbance = nullptr)
        : system_(&problem.system),
          disturbance_(disturbance),
          sign_(problem.backward() ? -1 : 1),
          t_(problem.t_start),
          t_end_(problem.t_end),
          clock_(problem.t_start),
          sides_(problem.system.guard_count(), Side::plateau)
    {
        for (std::size_t c = 0; c < 3; ++c) run_.x[c] = problem.x0[c];
        run_.mode = mode_left_ = problem.mode;
    }

    [[nodiscard]] ExactRun operator()()
    {
        disturb({});
        if (!arm({}).empty()) give_up();
        while (run_.regular && sign_ * (t_end_ - t_) > 0) fly();
        return run_;
    }

private:
    using Guards = std::vector<std::size_t>;

    static constexpr std::size_t most_sets = 60;
    static constexpr int most_levels = 50;
    static constexpr Real apart = 1e-6L;    ///< [s] sets that are nearer are no test
    static constexpr Real clearly = 1e-5L;  ///< |g| or |rate| that is not zero

    /// |g| that remains of a root, or of a disturbance.
    [[nodiscard]] Real residue() const noexcept { return disturbance_ ? 1e-7L : 1e-15L; }

    /// The components as polynomials of the offset from here, positive in the
    /// direction of the run.
    [[nodiscard]] std::array<Cubic, 3> motion() const
    {
        const RandomSystem::Flow& f = system_->flows[run_.mode];
        const auto integral = [](Real start, const Cubic& rate) {
            return Cubic{{start, rate.c[0], rate.c[1] / 2, rate.c[2] / 3}};
        };
        const auto rate = [this](Real drift, Real c, const Cubic& p, Real d, const Cubic& q) {
            Cubic out;
            for (std::size_t k = 0; k < 4; ++k) out.c[k] = sign_ * (c * p.c[k] + d * q.c[k]);
            out.c[0] += sign_ * drift;
            return out;
        };
        std::array<Cubic, 3> x;
        x[2] = integral(run_.x[2], rate(f.drift[2], 0, {}, 0, {}));
        x[1] = integral(run_.x[1], rate(f.drift[1], f.c12, x[2], 0, {}));
        x[0] = integral(run_.x[0], rate(f.drift[0], f.c01, x[1], f.c02, x[2]));
        return x;
    }

    [[nodiscard]] Cubic guard(std::size_t i, const std::array<Cubic, 3>& x) const
    {
        const RandomSystem::Guard& g = system_->guards_of[i];
        Cubic out;
        for (std::size_t c = 0; c < 3; ++c) {
            for (std::size_t k = 0; k < 4; ++k) out.c[k] += g.a[c] * x[c].c[k];
        }
        out.c[0] += g.of_time * t_ - g.level;
        out.c[1] += sign_ * g.of_time;
        return out;
    }

    /// Advances to the next fired set, the next time event or the end.
    void fly()
    {
        const std::array<Cubic, 3> x = motion();
        const double tick =
            sign_ > 0 ? system_->next_time_event(clock_) : system_->previous_time_event(clock_);
        const bool on_time = sign_ * (t_end_ - tick) >= 0;
        const Real horizon = sign_ * ((on_time ? tick : t_end_) - t_);
        std::vector<std::vector<Change>> all(sides_.size());
        std::vector<Real> first(sides_.size(), std::numeric_limits<Real>::infinity());
        for (std::size_t i = 0; i < sides_.size(); ++i) {
            if (!system_->enabled(i, run_.mode)) continue;
            all[i] = changes(guard(i, x), sides_[i], horizon);
            if (!acts(i)) continue;
            for (const Change& change : all[i]) {
                if (!counts(change.left, info(i).crossing)) continue;
                first[i] = change.s;
                break;
            }
        }
        // Equal guards have the same roots to the last bit.
        const Real end = std::min(horizon, *std::min_element(first.begin(), first.end()));
        Guards members;
        for (std::size_t i = 0; i < first.size(); ++i) {
            if (first[i] == end) members.push_back(i);
        }
        note(all, end);
        const bool at_tick = members.empty() && on_time;
        if (!members.empty() && end < apart) return give_up();
        for (std::size_t c = 0; c < 3; ++c) run_.x[c] = x[c](end);
        t_ += sign_ * end;
        if (members.empty() && !at_tick) {
            t_ = t_end_;
        } else if (at_tick) {
            t_ = clock_ = tick;
            happen({}, true);
        } else {
            happen(members, false);
        }
    }

    /// Records the changes up to the offset `end`, and updates the sides.
    void note(const std::vector<std::vector<Change>>& all, Real end)
    {
        std::vector<ExactEvent> notes;
        for (std::size_t i = 0; i < all.size(); ++i) {
            for (const Change& change : all[i]) {
                if (change.s > end) break;
                sides_[i] = opposite(change.left);
                if (acts(i) || !counts(change.left, info(i).crossing)) continue;
                notes.push_back({.t = t_ + sign_ * change.s, .guard = i, .mode_after = run_.mode});
            }
        }
        std::stable_sort(notes.begin(), notes.end(),
                         [this](const auto& a, const auto& b) { return sign_ * (b.t - a.t) > 0; });
        run_.events.insert(run_.events.end(), notes.begin(), notes.end());
    }

    /// Fires a set, and the sets that are flipped by it.
    void happen(Guards members, bool on_time)
    {
        if (++run_.sets > most_sets) return give_up();
        run_.together += members.size() > 1;
        for (int level = 0; on_time || !members.empty(); ++level, on_time = false) {
            if (level == most_levels) return give_up();
            run_.cascades += level == 1;
            mode_left_ = run_.mode;
            reset(members, on_time);
            if (!run_.regular) return;
            members = arm(members);
            if (!run_.regular) return;
        }
        fired_.clear();
    }

    using Point = std::array<Real, 3>;

    /// x' in a mode, in the direction of the run.
    [[nodiscard]] Point flow(Mode mode, const Point& x) const
    {
        const RandomSystem::Flow& f = system_->flows[mode];
        return {sign_ * (f.drift[0] + f.c01 * x[1] + f.c02 * x[2]),
                sign_ * (f.drift[1] + f.c12 * x[2]), sign_ * f.drift[2]};
    }
    /// Rate of guard i with x' = rate.
    [[nodiscard]] Real rate_of(std::size_t i, const Point& rate) const
    {
        const RandomSystem::Guard& g = system_->guards_of[i];
        Real out = sign_ * g.of_time;
        for (std::size_t c = 0; c < 3; ++c) out += g.a[c] * rate[c];
        return out;
    }

    [[nodiscard]] const RandomSystem::Reset& reset_of(std::size_t i) const
    {
        return i == no_guard ? system_->clock.reset : system_->guards_of[i].reset;
    }
    /// Applies one reset to a state and a mode.
    void apply(std::size_t i, Point& x, Mode& mode) const
    {
        const RandomSystem::Reset& reset = reset_of(i);
        for (std::size_t c = 0; c < 3; ++c) {
            const Write& write = reset.writes[c];
            if (write.kind == Write::keep) continue;
            x[c] = write.kind == Write::put ? Real(write.value) : write.value * x[c];
        }
        if (reset.switches) mode = reset.next;
    }

    /// Whether member i still has its event where others have been reset first.
    [[nodiscard]] bool still_moves(std::size_t i, Mode mode, const Point& x)
    {
        const Real rate = rate_of(i, flow(mode, x));
        if (std::fabs(rate) < clearly) give_up();
        return (sides_[i] == Side::above) == (rate > 0);
    }

    /// The set's resets: those that share a component one after the other, in every order.
    void reset(const Guards& guards, bool on_time)
    {
        Guards members = guards;
        if (on_time) members.push_back(no_guard);
        const Point before = run_.x;
        const Mode mode = run_.mode;
        left_ = flow(mode, before);
        std::array<std::optional<Write>, 3> writes;
        std::array<int, 3> writers{};
        std::optional<Mode> next;
        bool modes_differ = false;
        for (const std::size_t i : members) {
            Point x = before;
            Mode after = mode;
            apply(i, x, after);
            for (std::size_t c = 0; c < 3; ++c) {
                if (reset_of(i).writes[c].kind != Write::keep) writes[c] = reset_of(i).writes[c];
                if (x[c] == before[c]) continue;
                ++writers[c];
                run_.x[c] = x[c];
            }
            if (after == mode) continue;
            modes_differ = modes_differ || (next && *next != after);
            next = after;
        }
        run_.mode = next.value_or(mode);
        Guards sharing;
        for (const std::size_t i : members) {
            Point x = before;
            Mode after = mode;
            apply(i, x, after);
            bool shares = modes_differ && after != mode;
            for (std::size_t c = 0; c < 3; ++c) shares |= writers[c] > 1 && x[c] != before[c];
            if (shares) sharing.push_back(i);
        }
        if (!sharing.empty()) reset_in_every_order(sharing, before, mode);
        if (on_time) record(no_guard, EventKind::time);
        for (const std::size_t i : guards) record(i, EventKind::crossing);
        disturb(writes);
    }

    void reset_in_every_order(Guards members, const Point& before, Mode mode)
    {
        if (members.size() > 4) return give_up();
        std::sort(members.begin(), members.end());
        std::vector<Point> ends;
        std::vector<Mode> modes;
        std::vector<std::vector<Point>> added(system_->guard_count() + 1);
        do {
            Point x = before;
            Mode in = mode;
            for (const std::size_t i : members) {
                if (i != no_guard && !system_->enabled(i, in)) continue;
                Point y = x;
                Mode after = in;
                apply(i, y, after);
                Point more;
                for (std::size_t c = 0; c < 3; ++c) more[c] = y[c] - x[c];
                added[i == no_guard ? added.size() - 1 : i].push_back(more);
                if (i != no_guard && i != members.front() && !still_moves(i, in, x)) continue;
                x = y;
                in = after;
            }
            ends.push_back(x);
            modes.push_back(in);
        } while (std::next_permutation(members.begin(), members.end()));
        const auto is_one = [](Real a, Real b) {
            return std::fabs(a - b) <= 1e-15L * (1 + std::fabs(a));
        };
        for (std::size_t c = 0; c < 3; ++c) {
            bool additive = true, one_end = true;
            Real sum = before[c];
            for (const auto& of_one : added) {
                if (of_one.empty()) continue;
                for (const Point& more : of_one) additive &= is_one(of_one[0][c], more[c]);
                sum += of_one[0][c];
            }
            for (const Point& end : ends) one_end &= is_one(ends[0][c], end[c]);
            if (!additive && !one_end) return give_up();
            if (additive ? sum != before[c] : true) run_.x[c] = additive ? sum : ends[0][c];
        }
        for (const Mode end : modes) {
            if (end != modes[0]) return give_up();
        }
        if (modes[0] != mode) run_.mode = modes[0];
    }

    /// Arms every guard; those that the reset has flipped fire next.
    [[nodiscard]] Guards arm(const Guards& members)
    {
        fired_.insert(fired_.end(), members.begin(), members.end());
        const std::array<Cubic, 3> x = motion();
        Guards flipped;
        for (std::size_t i = 0; i < sides_.size(); ++i) {
            const Side before = sides_[i];
            if (!system_->enabled(i, run_.mode)) {
                sides_[i] = Side::plateau;
                continue;
            }
            const Cubic g = guard(i, x);
            const Real size = std::fabs(g.c[0]);
            const bool fired = std::find(fired_.begin(), fired_.end(), i) != fired_.end();
            const bool on_surface = size <= (fired ? residue() : Real(0));
            if ((on_surface ? std::fabs(g.c[1]) : size) < clearly) give_up();
            // The guard is newly enabled and on its surface: the case is undecidable.
            if (on_surface && before == Side::plateau) give_up();
            sides_[i] = side_of(static_cast<double>(on_surface ? g.c[1] : g.c[0]));
            const bool now = std::find(members.begin(), members.end(), i) != members.end();
            if (on_surface && (now || run_.mode != mode_left_) && leaves_at_once(i)) {
                flipped.push_back(i);
                continue;
            }
            if (now || before == Side::plateau || sides_[i] == before) continue;
            if (!counts(before, info(i).crossing)) continue;
            if (acts(i)) {
                flipped.push_back(i);
            } else {
                record(i, EventKind::crossing);
            }
        }
        return flipped;
    }

    /// Whether guard i moves in its direction along the new flow, and did not along the one left.
    [[nodiscard]] bool leaves_at_once(std::size_t i)
    {
        if (!acts(i) || info(i).crossing == Crossing::either) return false;
        if (!counts(opposite(sides_[i]), info(i).crossing)) return false;
        const Real rate = rate_of(i, left_);
        if (std::fabs(rate) < clearly) give_up();
        return (sides_[i] == Side::above) != (rate > 0);
    }

    void record(std::size_t guard, EventKind kind)
    {
        run_.events.push_back({.t = t_, .kind = kind, .guard = guard, .mode_after = run_.mode});
    }

    /// Moves components that have not just been written.
    void disturb(const std::array<std::optional<Write>, 3>& writes)
    {
        if (!disturbance_) return;
        for (std::size_t c = 0; c < 3; ++c) {
            if (writes[c] && writes[c]->kind == Write::put) continue;
            run_.x[c] += 1e-9L * disturbance_->uniform(-1, 1) * (1 + std::fabs(run_.x[c]));
        }
    }

    void give_up() noexcept { run_.regular = false; }
    [[nodiscard]] const GuardInfo& info(std::size_t i) const { return system_->guards_of[i].info; }
    [[nodiscard]] bool acts(std::size_t i) const { return info(i).resets; }

    const RandomSystem* system_;
    learn::Random* disturbance_;
    Real sign_;  ///< of the run's direction in time
    Real t_;
    Real t_end_;
    Point left_{};  ///< x' before the resets of the last set
    Mode mode_left_ = 0;
    double clock_;  ///< [s] the last time event, or the start
    std::vector<Side> sides_;
    Guards fired_;  ///< at this instant
    ExactRun run_;
};

}  // namespace ricochet::test
