// Internal: the declarations of this header may change without notice.
//
// Checks whether a step followed the held reactions.
//
// While everything is held the state stands still, error control accepts any step, and a reaction
// that moves with its load may pass its bound and come back unseen. Hence after each step in
// which a reaction is held its distance to either bound is evaluated inside the step, and compared
// with the cubic through the values and rates at the ends, on which the exit is searched for.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "ricochet/nonsmooth/branch_modes.hpp"

namespace ricochet::detail {

/// A step in a mode.
template <class Vector>
struct HeldStep {
    Mode mode;
    double t0, t1;  ///< [s] its ends
    const Vector &w0, &w1;
    double event_tolerance;  ///< [s] by which it may pass an exit

    [[nodiscard]] double h() const noexcept { return t1 - t0; }
};

/// Remembers the end of the last step, which is the start of the next one.
template <int N, int M>
class RICOCHET_ALIGNED HeldReactions {
    using Modes = AnyModes<N, M>;
    using Vector = typename Modes::Vector;
    using Step = HeldStep<Vector>;
    using Motion = typename Modes::Motion;
    using Rooms = typename Modes::Rooms;

public:
    /// The fraction of a step that would follow the reactions; 1 if the step does.
    /// @param rate, rooms  at the end of the step
    [[nodiscard]] double fraction(const Modes& modes, const Step& step, const Vector& rate,
                                  const Rooms& rooms)
    {
        starts_beyond_ = false;
        if (!(step.t1 > step.t0)) return 1;
        const double h = step.h();
        const bool goes_on = begin(modes, step);
        end_.mode = step.mode;
        end_.rate = rate;
        end_.rooms = rooms;
        find_change(modes, step.t1, step.w1, -h, end_);
        // A step that is much longer than the one before could agree by accident.
        const double growth = goes_on ? h / length_ : std::numeric_limits<double>::infinity();
        if (growth > 2) {
            // The deviation grows with the fourth power of the step.
            const double foreseen = goes_on ? worst_ * (growth * growth) * (growth * growth) : 0;
            worst_ = foreseen > 8 ? foreseen : 0;
            compare(modes, step, 0.13711);
            compare(modes, step, 0.78934);
        } else {
            worst_ = 0;
        }
        compare(modes, step, 0.38196601125010515);
        length_ = h;
        return worst_ <= 1 ? 1 : std::clamp(0.8 / std::sqrt(std::sqrt(worst_)), 0.1, 0.5);
    }

    /// Whether those that are beyond their bounds at the end of a step have passed them once, and
    /// no other has, as far as samples inside it tell: the exit that is found may else not be the
    /// first.
    [[nodiscard]] bool passes_once(const Modes& modes, const Step& step, const Vector& rate,
                                   const Rooms& rooms)
    {
        begin(modes, step);
        End end{step.t1, step.mode, rate, rooms, {}};
        find_change(modes, step.t1, step.w1, -step.h(), end);
        std::array<bool, std::tuple_size_v<Rooms>> beyond{};
        for (const double s : {0.13711, 0.38196601125010515, 0.78934, 1.0}) {
            if (s < 1) go_inside(modes, step, end.rate, s);
            const Rooms& here = s < 1 ? rooms_ : rooms;
            for (std::size_t k = 0; k < here.size(); ++k) {
                if (std::isinf(here[k])) continue;
                if (beyond[k] && here[k] >= 0) return false;
                beyond[k] = here[k] < 0;
                const double h = step.h();
                const double off =
                    std::abs(here[k] - value({start_.rooms[k], end.rooms[k], h * start_.change[k],
                                              h * end.change[k]},
                                             s));
                if (off > std::max(std::abs(start_.rooms[k]), std::abs(end.rooms[k]))) return false;
            }
        }
        return true;
    }

    /// Whether a reaction was beyond its bound at the start of the last step already.
    [[nodiscard]] bool starts_beyond() const noexcept { return starts_beyond_; }

    /// Ratio of the last step's error to the one that is allowed.
    [[nodiscard]] double worst() const noexcept { return worst_; }

    /// Goes on as after a step of length h that has ended at (t, w) in a mode.
    void resume(const Modes& modes, Mode mode, double t, const Vector& w, double h, double worst)
    {
        end_.mode = mode;
        evaluate(modes, t, w, -h, end_);
        length_ = h;
        worst_ = worst;
    }

    void forget() noexcept
    {
        end_.t = std::numeric_limits<double>::quiet_NaN();
        worst_ = 0;
    }

private:
    struct End {
        double t = std::numeric_limits<double>::quiet_NaN();
        Mode mode = 0;
        Vector rate;
        Rooms rooms{}, change{};
    };

    /// Knows the start of a step. Returns whether it is the end of the last one.
    bool begin(const Modes& modes, const Step& step)
    {
        const bool goes_on = end_.t == step.t0 && end_.mode == step.mode;
        if (goes_on) {
            start_ = end_;
        } else {
            start_.mode = step.mode;
            evaluate(modes, step.t0, step.w0, step.h(), start_);
        }
        return goes_on;
    }
    /// Evaluates an end of a step in its mode. `ahead`: the step, with its sign as seen from this
    /// end.
    void evaluate(const Modes& modes, double t, const Vector& w, double ahead, End& end)
    {
        modes.rooms(end.mode, t, w, motion_, end.rooms);
        end.rate = motion_.rate;
        find_change(modes, t, w, ahead, end);
    }
    void find_change(const Modes& modes, double t, const Vector& w, double ahead, End& end)
    {
        end.t = t;
        const double step = nudge * ahead;
        move(inside_, w, step, end.rate);
        modes.rooms(end.mode, t + step, inside_, motion_, end.change);
        for (std::size_t k = 0; k < end.rooms.size(); ++k) {
            const double change = (end.change[k] - end.rooms[k]) / step;
            end.change[k] = std::isfinite(change) ? change : 0;
        }
    }

    /// Evaluates the distances to the bounds at s within the step, which ends with a rate.
    void go_inside(const Modes& modes, const Step& step, const Vector& rate, double s)
    {
        const double h = step.h();
        const std::array<double, 4> at = hermite(s);
        // One component at a time, as they were written: see components.hpp.
        for_each_component(inside_, [&](auto i) {
            inside_[i] = at[0] * step.w0[i] + at[1] * step.w1[i] +
                         h * (at[2] * start_.rate[i] + at[3] * rate[i]);
        });
        modes.rooms(step.mode, step.t0 + s * h, inside_, motion_, rooms_);
    }
    /// Compares the distances to the bounds at s within the step with their cubics.
    void compare(const Modes& modes, const Step& step, double s)
    {
        const double h = step.h();
        go_inside(modes, step, end_.rate, s);
        double rounding = -1;
        for (std::size_t k = 0; k < rooms_.size(); ++k) {
            if (std::isinf(rooms_[k])) continue;
            const std::array<double, 4> ends{start_.rooms[k], end_.rooms[k], h * start_.change[k],
                                             h * end_.change[k]};
            const double size = std::max(std::abs(ends[0]), std::abs(ends[1]));
            const double off = std::abs(rooms_[k] - value(ends, s));
            const double least = std::min({ends[0], ends[1], rooms_[k]});
            if (off <= 1e-9 * size && least > 0) continue;
            if (rounding < 0) {
                // A difference over `nudge` of the step magnifies rounding by this factor.
                rounding = modes.rounding_of_held(step.mode, motion_.rate, motion_.reaction) *
                           (0.01 / nudge);
            }
            const double negligible = std::max(1e-9 * size, rounding);
            // An exit that is an event lies beyond the bound by up to the event's tolerance.
            const double beyond = 1e-6 * size + rounding;
            const double at_end = 2 * step.event_tolerance * std::abs(end_.change[k]) + beyond;
            starts_beyond_ = starts_beyond_ || ends[0] < -beyond;
            if (rooms_[k] < -negligible || ends[1] < -at_end) {
                worst_ = std::max(worst_, missed);
            } else if (off > negligible) {
                worst_ = std::max(worst_, doubt(ends, off / bump(s), negligible));
            }
        }
    }

    [[nodiscard]] static constexpr double bump(double s) noexcept
    {
        return s * s * (1 - s) * (1 - s);
    }

    [[nodiscard]] static constexpr std::array<double, 4> hermite(double s) noexcept
    {
        const double u = 1 - s;
        return {u * u * (1 + 2 * s), s * s * (3 - 2 * s), s * u * u, -s * s * u};
    }
    [[nodiscard]] static constexpr double value(const std::array<double, 4>& ends,
                                                double s) noexcept
    {
        const auto [a, b, c, d] = hermite(s);
        return a * ends[0] + b * ends[1] + c * ends[2] + d * ends[3];
    }

    /// The cubic's error is `off` s^2 (1 - s)^2. Returns four times this error, as a fraction of
    /// the distance to the bound that the cubic leaves.
    [[nodiscard]] static double doubt(const std::array<double, 4>& ends, double off,
                                      double negligible) noexcept
    {
        // s (1 - s)^2 is at most 4/27.
        const double least =
            std::min(ends[0], ends[1]) - (std::abs(ends[2]) + std::abs(ends[3])) * (4.0 / 27);
        if (off * 8 <= least) return 0.25 * off / least;
        double worst = 0;
        for (int i = 1; i < 8; ++i) {
            const double s = i / 8.0;
            worst = std::max(worst, 4 * off * bump(s) / std::max(value(ends, s), negligible));
        }
        return worst;
    }

    static constexpr double nudge = 1e-5;  // of a step, for rates
    static constexpr double missed = 256;

    End start_, end_;
    Vector inside_;
    Motion motion_;
    Rooms rooms_{};
    double worst_ = 0;
    double length_ = 0;
    bool starts_beyond_ = false;
};

}  // namespace ricochet::detail
