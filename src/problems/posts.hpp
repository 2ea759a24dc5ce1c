// A mass on two springs among thin posts: a guard that is back on its side after a few steps.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>

#include "problems/opaque.hpp"
#include "ricochet/guard.hpp"

namespace ricochet {

/// A point mass on springs of stiffness 1 and 2 [N/m] that bounces off six round posts.
///
/// State (x, y, v, w): position [m] and velocity [m/s].
///
///     flow    x'' = -x,  y'' = -2 y
///     guard   distance to the nearest post's centre minus its radius, falling
///     reset   the velocity is reflected: elastic
///
/// The posts stand on a spiral of radii 0.35 to 0.85 m, flattened by 0.8 in y. From `start` the
/// amplitudes are about 1 m, and with steps of `step` an event comes about every 2000 steps, while
/// a straight passage through a post lasts about 8: checks at every k-th step lose events as soon
/// as they save much. The energy is constant. Functions are generic in the state.
class Posts {
public:
    using State = std::array<double, 4>;
    static constexpr std::string_view name = "posts";
    static constexpr std::size_t count = 6;
    static constexpr double radius = 0.03;  ///< [m]
    static constexpr double step = 5e-3;    ///< [s] of the measurements

    struct Centre {
        double x, y;  ///< [m]
    };

    Posts();

    /// Initial state of run `which`, from 0: the velocities differ, the positions repeat.
    [[nodiscard]] static State start(std::size_t which = 0) noexcept;
    /// Corners of the box from which random starts are drawn: those that are inside a post, or
    /// nearer to it than 0.02 m, are rejected.
    static constexpr State lowest{-1.2, -0.9, -1.2, -1.2};
    static constexpr State highest{1.2, 0.9, 1.2, 1.2};

    [[nodiscard]] const std::array<Centre, count>& centres() const noexcept { return centres_; }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "post"};
    }

    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0];
        dxdt[3] = -2 * x[1];
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return nearest(x[0], x[1]).distance - radius;
    }

    template <class X>
    void reset(double /*t*/, X& x) const noexcept
    {
        const Nearest post = nearest(x[0], x[1]);
        const double away = x[2] * post.x + x[3] * post.y;
        if (away >= 0) return;
        x[2] -= 2 * away * post.x;
        x[3] -= 2 * away * post.y;
    }

    /// Speed [m/s], by which the distance changes at most.
    template <class X>
    [[nodiscard]] double speed_bound(double /*t*/, const X& x) const noexcept
    {
        return std::hypot(x[2], x[3]);
    }

    /// The largest acceleration [m/s²] at this energy: |(x, 2 y)| <= sqrt(2 (v² + w² + x² + 2 y²)).
    template <class X>
    [[nodiscard]] double acceleration_bound(double /*t*/, const X& x) const noexcept
    {
        return std::sqrt(2 * (x[2] * x[2] + x[3] * x[3] + x[0] * x[0] + 2 * x[1] * x[1]));
    }

private:
    struct Nearest {
        double distance;  ///< [m] to the centre
        double x, y;      ///< unit vector from the centre
    };
    [[nodiscard]] Nearest nearest(double x, double y) const noexcept;

    std::array<Centre, count> centres_;
};

/// Posts of which only whether the mass is outside of all of them is known.
class SignOfPosts : public BlackBox<Posts> {
public:
    static constexpr std::string_view name = "posts";
    /// `cost` [s] of a call, spent waiting.
    explicit SignOfPosts(double cost = 0) : BlackBox<Posts>(Posts(), cost) {}
};

/// A random start outside of the posts.
template <class Random>
[[nodiscard]] Posts::State random_start(const Posts& posts, Random& random)
{
    Posts::State x{};
    do {
        for (std::size_t i = 0; i < x.size(); ++i) {
            x[i] = random.uniform(Posts::lowest[i], Posts::highest[i]);
        }
    } while (posts.guard(0, x) < 0.02);
    return x;
}

}  // namespace ricochet
