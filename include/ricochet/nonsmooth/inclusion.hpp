// Differential inclusions, and the convex sets whose normal cones make them set-valued.
#pragma once

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>

namespace ricochet {

// Closed convex sets, their projection, and its derivative.
//
// A set is a value with
//
//     dimension()        dimension of the space that it lies in
//     project(z, p)      p = the point of the set nearest to z; z and p may be the same
//     derivative(z, d)   an element of the generalised Jacobian of the projection at z,
//                        row by row; where faces meet, the mean of theirs or that of
//                        the smallest face
//     fault()            sentence that says why the set is invalid ("is empty"), or empty;
//                        optional
//
// A user's own set with these three functions can be used like those below; `check_projection`
// tests whether its `project` is a projection.

template <class Set>
concept ConvexSet = requires(const Set& set, std::span<const double> z, std::span<double> out)
{
    {
        set.dimension()
        } -> std::convertible_to<std::size_t>;
    set.project(z, out);
    set.derivative(z, out);
};

/// A product of intervals with known bounds.
template <class Set>
concept BoxSet = ConvexSet<Set> && requires(const Set& set, std::size_t i)
{
    {
        set.lower(i)
        } -> std::convertible_to<double>;
    {
        set.upper(i)
        } -> std::convertible_to<double>;
};

namespace detail {

/// Derivative: 1 inside, 0 outside, 1/2 on a bound, 0 where the bounds coincide.
[[nodiscard]] inline double clamp_slope(double z, double lower, double upper) noexcept
{
    if (!(lower < upper) || z < lower || z > upper) return 0;
    return z == lower || z == upper ? 0.5 : 1;
}

template <class Box>
void clamp(const Box& box, std::span<const double> z, std::span<double> p) noexcept
{
    for (std::size_t i = 0; i < p.size(); ++i) {
        p[i] = std::min(std::max(z[i], box.lower(i)), box.upper(i));
    }
}

template <class Box>
void clamp_derivative(const Box& box, std::span<const double> z, std::span<double> d) noexcept
{
    std::fill(d.begin(), d.end(), 0.0);
    for (std::size_t i = 0; i < z.size(); ++i) {
        d[i * z.size() + i] = clamp_slope(z[i], box.lower(i), box.upper(i));
    }
}

/// Sentence that says why an interval is not valid; empty if it is.
[[nodiscard]] constexpr std::string_view interval_fault(double lower, double upper) noexcept
{
    if (lower <= upper) return "";
    return lower > upper ? "is empty: a lower bound lies above the upper one"
                         : "has a bound that is not a number";
}

}  // namespace detail

namespace sets {

/// [lower, upper]; either bound may be infinite. As a set of reactions: a relay
/// (sign), Coulomb friction in one direction. As a set of states: stops, a saturation.
class IntervalSet {
public:
    /// Takes [lower, upper]; lower above upper is a fault, see `fault`.
    constexpr IntervalSet(double lower, double upper) noexcept : lower_(lower), upper_(upper) {}

    /// Returns [-bound, bound]: friction in one direction. A negative bound is a fault.
    [[nodiscard]] static constexpr IntervalSet symmetric(double bound) noexcept
    {
        return {-bound, bound};
    }

    /// Returns [0, infinity): a diode's current, the force of a contact.
    [[nodiscard]] static constexpr IntervalSet half_line() noexcept
    {
        return {0, std::numeric_limits<double>::infinity()};
    }

    [[nodiscard]] static constexpr std::size_t dimension() noexcept { return 1; }
    [[nodiscard]] constexpr double lower(std::size_t = 0) const noexcept { return lower_; }
    [[nodiscard]] constexpr double upper(std::size_t = 0) const noexcept { return upper_; }

    void project(std::span<const double> z, std::span<double> p) const noexcept
    {
        detail::clamp(*this, z, p);
    }
    void derivative(std::span<const double> z, std::span<double> d) const noexcept
    {
        detail::clamp_derivative(*this, z, d);
    }
    [[nodiscard]] constexpr std::string_view fault() const noexcept
    {
        return detail::interval_fault(lower_, upper_);
    }

private:
    double lower_, upper_;
};

/// A product of N intervals.
template <std::size_t N>
class Box {
public:
    /// Takes the bounds of each component, which may be infinite.
    constexpr Box(const std::array<double, N>& lower, const std::array<double, N>& upper) noexcept
        : lower_(lower), upper_(upper)
    {
    }

    [[nodiscard]] static constexpr std::size_t dimension() noexcept { return N; }
    [[nodiscard]] constexpr double lower(std::size_t i) const noexcept { return lower_[i]; }
    [[nodiscard]] constexpr double upper(std::size_t i) const noexcept { return upper_[i]; }

    void project(std::span<const double> z, std::span<double> p) const noexcept
    {
        detail::clamp(*this, z, p);
    }
    void derivative(std::span<const double> z, std::span<double> d) const noexcept
    {
        detail::clamp_derivative(*this, z, d);
    }
    [[nodiscard]] constexpr std::string_view fault() const noexcept
    {
        for (std::size_t i = 0; i < N; ++i) {
            const std::string_view fault = detail::interval_fault(lower_[i], upper_[i]);
            if (!fault.empty()) return fault;
        }
        return "";
    }

private:
    std::array<double, N> lower_, upper_;
};

/// x >= 0 in each of N components: unilateral constraints.
template <std::size_t N>
class Orthant {
public:
    [[nodiscard]] static constexpr std::size_t dimension() noexcept { return N; }
    [[nodiscard]] static constexpr double lower(std::size_t) noexcept { return 0; }
    [[nodiscard]] static constexpr double upper(std::size_t) noexcept
    {
        return std::numeric_limits<double>::infinity();
    }

    void project(std::span<const double> z, std::span<double> p) const noexcept
    {
        detail::clamp(*this, z, p);
    }
    void derivative(std::span<const double> z, std::span<double> d) const noexcept
    {
        detail::clamp_derivative(*this, z, d);
    }
};

/// |x| <= radius in N dimensions: isotropic friction with a known bound.
template <std::size_t N>
class Ball {
public:
    /// Takes the radius, which may be infinite.
    explicit constexpr Ball(double radius) noexcept : radius_(radius) {}

    [[nodiscard]] static constexpr std::size_t dimension() noexcept { return N; }
    [[nodiscard]] constexpr double radius() const noexcept { return radius_; }

    void project(std::span<const double> z, std::span<double> p) const noexcept
    {
        const double length = norm(z);
        const double factor = length > radius_ ? radius_ / length : 1;
        for (std::size_t i = 0; i < N; ++i) {
            p[i] = factor * z[i];
        }
    }

    /// Outside the ball: (radius / |z|) (I - z z' / |z|^2).
    void derivative(std::span<const double> z, std::span<double> d) const noexcept
    {
        const double length = norm(z);
        const bool outside = length > radius_ || radius_ == 0;
        const double factor = !outside ? 1 : length > 0 ? radius_ / length : 0;
        for (std::size_t i = 0; i < N; ++i) {
            for (std::size_t j = 0; j < N; ++j) {
                const double along = outside && length > 0 ? (z[i] / length) * (z[j] / length) : 0;
                d[i * N + j] = factor * ((i == j ? 1.0 : 0.0) - along);
            }
        }
    }

    [[nodiscard]] constexpr std::string_view fault() const noexcept
    {
        if (radius_ >= 0) return "";
        return radius_ < 0 ? "is empty: its radius is negative"
                           : "has a radius that is not a number";
    }

private:
    [[nodiscard]] static double norm(std::span<const double> z) noexcept
    {
        double scale = 0;
        for (std::size_t i = 0; i < N; ++i) {
            scale = std::max(scale, std::abs(z[i]));
        }
        if (scale == 0) return 0;
        double sum = 0;
        for (std::size_t i = 0; i < N; ++i) {
            sum += (z[i] / scale) * (z[i] / scale);
        }
        return scale * std::sqrt(sum);
    }

    double radius_;
};

/// Coulomb's cone |(x1, ..., x_{N-1})| <= friction x0: the force of a contact with its
/// normal component first. Friction 0 reduces it to the half line of the normal.
template <std::size_t N>
class FrictionCone {
    static_assert(N >= 2);

public:
    /// Takes the coefficient of friction, finite.
    explicit constexpr FrictionCone(double friction) noexcept : friction_(friction) {}

    [[nodiscard]] static constexpr std::size_t dimension() noexcept { return N; }
    [[nodiscard]] constexpr double friction() const noexcept { return friction_; }

    /// Outside the cone and its polar the nearest point is
    /// s (1, friction t / |t|), s = (n + friction |t|) / (1 + friction^2).
    void project(std::span<const double> z, std::span<double> p) const noexcept
    {
        const double tangent = tangential(z);
        const double normal = z[0];
        double factor = 1;
        if (friction_ * tangent <= -normal) {
            p[0] = 0;
            factor = 0;
        } else if (tangent <= friction_ * normal) {
            p[0] = normal;
        } else {
            p[0] = on_side(normal, tangent);
            factor = friction_ * p[0] / tangent;
        }
        for (std::size_t i = 1; i < N; ++i) {
            p[i] = factor * z[i];
        }
    }

    void derivative(std::span<const double> z, std::span<double> d) const noexcept
    {
        std::fill(d.begin(), d.end(), 0.0);
        const double tangent = tangential(z);
        if (friction_ * tangent <= -z[0]) return;
        if (tangent <= friction_ * z[0]) {
            for (std::size_t i = 0; i < N; ++i) {
                d[i * N + i] = 1;
            }
            return;
        }
        const double s = on_side(z[0], tangent);
        const double slope = on_side(0, 1);
        d[0] = on_side(1, 0);
        for (std::size_t i = 1; i < N; ++i) {
            const double e = z[i] / tangent;
            d[i] = d[i * N] = slope * e;
            for (std::size_t j = 1; j < N; ++j) {
                const double along = e * z[j] / tangent;
                d[i * N + j] = friction_ * slope * along +
                               friction_ * s / tangent * ((i == j ? 1.0 : 0.0) - along);
            }
        }
    }

    [[nodiscard]] constexpr std::string_view fault() const noexcept
    {
        if (friction_ >= 0 && friction_ < std::numeric_limits<double>::infinity()) return "";
        if (friction_ > 0) return "has an infinite coefficient of friction";
        return friction_ < 0 ? "has a negative coefficient of friction"
                             : "has a coefficient of friction that is not a number";
    }

private:
    /// (normal + friction tangent) / (1 + friction^2), whose square must not overflow.
    [[nodiscard]] double on_side(double normal, double tangent) const noexcept
    {
        if (friction_ > 1) return (normal / friction_ + tangent) / (friction_ + 1 / friction_);
        return (normal + friction_ * tangent) / (1 + friction_ * friction_);
    }

    [[nodiscard]] static double tangential(std::span<const double> z) noexcept
    {
        double length = 0;
        for (std::size_t i = 1; i < N; ++i) {
            length = std::hypot(length, z[i]);
        }
        return length;
    }

    double friction_;
};

/// The product set First x Second x ...
template <class... Sets>
class Product {
public:
    /// Takes the two factors, in the order of their components.
    explicit constexpr Product(const Sets&... sets) noexcept : sets_(sets...) {}

    [[nodiscard]] constexpr std::size_t dimension() const noexcept
    {
        return std::apply([](const auto&... set) { return (set.dimension() + ... + 0); }, sets_);
    }

    void project(std::span<const double> z, std::span<double> p) const
    {
        for_each([&](const auto& set, std::size_t first, std::size_t n) {
            set.project(z.subspan(first, n), p.subspan(first, n));
        });
    }

    void derivative(std::span<const double> z, std::span<double> d) const
    {
        const std::size_t all = dimension();
        std::fill(d.begin(), d.end(), 0.0);
        for_each([&](const auto& set, std::size_t first, std::size_t n) {
            // The block is computed contiguously; its rows are then moved apart, from the last one.
            const auto block = d.subspan(first * all, n * n);
            set.derivative(z.subspan(first, n), block);
            for (std::size_t i = n; i-- > 0;) {
                for (std::size_t j = n; j-- > 0;) {
                    const double value = block[i * n + j];
                    block[i * n + j] = 0;
                    d[(first + i) * all + first + j] = value;
                }
            }
        });
    }

    [[nodiscard]] constexpr double lower(std::size_t i) const noexcept requires(BoxSet<Sets>&&...)
    {
        double bound = 0;
        for_each([&](const auto& set, std::size_t first, std::size_t n) {
            if (i >= first && i < first + n) bound = set.lower(i - first);
        });
        return bound;
    }

    [[nodiscard]] constexpr double upper(std::size_t i) const noexcept requires(BoxSet<Sets>&&...)
    {
        double bound = 0;
        for_each([&](const auto& set, std::size_t first, std::size_t n) {
            if (i >= first && i < first + n) bound = set.upper(i - first);
        });
        return bound;
    }

    [[nodiscard]] constexpr std::string_view fault() const noexcept
    {
        std::string_view found;
        for_each([&](const auto& set, std::size_t, std::size_t) {
            if constexpr (requires { set.fault(); }) {
                if (found.empty()) found = set.fault();
            }
        });
        return found;
    }

private:
    template <class Function>
    constexpr void for_each(const Function& function) const
    {
        std::size_t first = 0;
        const auto one = [&](const auto& set) {
            const std::size_t n = set.dimension();
            function(set, first, n);
            first += n;
        };
        std::apply([&](const auto&... set) { (one(set), ...); }, sets_);
    }

    std::tuple<Sets...> sets_;
};

}  // namespace sets

/// Sentence that says why `set` is not valid; empty if it is valid, or has no `fault`.
template <ConvexSet Set>
[[nodiscard]] std::string_view fault_of(const Set& set) noexcept
{
    if constexpr (requires {
                      {
                          set.fault()
                          } -> std::convertible_to<std::string_view>;
                  }) {
        return set.fault();
    } else {
        return {};
    }
}

namespace detail {
using Projection = std::function<void(std::span<const double>, std::span<double>)>;
void check_projection(std::size_t dimension, const Projection& project,
                      const Projection& derivative);
}  // namespace detail

/// Tests the projection at pairs of random points of several magnitudes: P P z = P z and
/// |P z - P y|^2 <= (P z - P y).(z - y), which hold for every projection on a closed
/// convex set and, together, for no other map; and the derivative against differences of
/// the projection, where these do not straddle a kink.
///
/// @throws std::invalid_argument naming what failed and where.
template <ConvexSet Set>
void check_projection(const Set& set)
{
    detail::check_projection(
        set.dimension(), [&](auto z, auto p) { set.project(z, p); },
        [&](auto z, auto d) { set.derivative(z, d); });
}

// A differential inclusion: smooth motion and set-valued reactions.
//
//     A w' = f(t, w) + G reaction,      y = E w - s(t)
//
// with, for a closed convex set K(t, w) of reactions,
//
//     -y in the normal cone of K at the reaction,
//
// so that the reaction minimises r . y over all r in K, and takes the value in K that
// keeps y at zero if there is one: a relay, dry friction, a diode, a unilateral contact. If
// `confines` is Confines::state instead, K is a set that y must not leave, and -reaction is in
// the normal cone of K at y: stops, a saturated integrator.
//
// A system is a value with
//
//     state_size, reaction_size        static constexpr int, or Eigen::Dynamic with
//     size(), reactions()              member functions that return them
//     smooth(t, w, f)                  writes f
//     reaction_set(t, w)               K, a ConvexSet of dimension reaction_size
//
// and, where they differ from the default,
//
//     confines                         static constexpr Confines, reaction
//     affine                           static constexpr bool: f = B w + g(t), B constant
//     smooth_jacobian(t, w, J)         df/dw; by differences without it
//     mass(A)                          A, constant; the unit matrix
//     observe(E)                       E; selects the first components
//     act(G)                           G; the transpose of E
//     offset(t, s)                     s(t), continuous, the motion that y is relative to; zero
//     offset_rate(t, s)                its rate; else a difference, which is wrong beside a kink
//     branch_bound(t, w, i, branch)    a bound that continues smoothly beyond y = 0, see
//                                      branch_modes.hpp
//     static_bound(t, w, i)            the largest |reaction i| while it holds y_i at zero, at
//                                      least its bounds beside y_i = 0: static friction; of
//                                      discs, the size of the reaction of disc i
//     bound_gradient(t, w, i, g)       d upper_i / dw of a BoxSet of symmetric intervals
//                                      that depend on the state
//
// Vectors and matrices are Eigen's.

/// Quantity that the set of an inclusion restricts.
enum class Confines {
    reaction,  ///< friction, relays, diodes, contacts
    state,     ///< stops
};

template <class System>
requires requires
{
    System::state_size;
}
inline constexpr int state_size = System::state_size;
template <class System>
requires requires
{
    System::reaction_size;
}
inline constexpr int reaction_size = System::reaction_size;

template <class System>
using StateOf = Eigen::Matrix<double, state_size<System>, 1>;
template <class System>
using ReactionOf = Eigen::Matrix<double, reaction_size<System>, 1>;
template <class System>
using SquareOf = Eigen::Matrix<double, state_size<System>, state_size<System>>;

template <class System>
concept Inclusion = requires(const System& system, double t, const StateOf<System>& w,
                             StateOf<System>& f)
{
    system.smooth(t, w, f);
    {
        system.reaction_set(t, w)
        } -> ConvexSet;
};

/// Reactions that hold more than they have where y moves: static friction above kinetic friction.
template <class System>
concept HasStaticBound = requires(const System& system, const StateOf<System>& w)
{
    {
        system.static_bound(0.0, w, 0)
        } -> std::convertible_to<double>;
};

template <class System>
using SetOf = decltype(std::declval<const System&>().reaction_set(
    0.0, std::declval<const StateOf<System>&>()));

namespace detail {

template <class System>
constexpr Confines confines() noexcept
{
    if constexpr (requires { System::confines; }) {
        return System::confines;
    } else {
        return Confines::reaction;
    }
}

/// A state, a set or a matrix with which no motion can start. A type of its own, so that a run in
/// several phases knows it from what a function of the system throws.
struct InclusionRefused : std::invalid_argument {
    using std::invalid_argument::invalid_argument;
};

/// @throws InclusionRefused with the message "inclusion: <what> <given>".
[[noreturn]] void refuse_inclusion(std::string_view what);
[[noreturn]] void refuse_inclusion(std::string_view what, double given);

template <class V>
[[nodiscard]] std::span<double> span_of(V& v) noexcept
{
    return {v.data(), static_cast<std::size_t>(v.size())};
}
template <class V>
[[nodiscard]] std::span<const double> span_of(const V& v) noexcept
{
    return {v.data(), static_cast<std::size_t>(v.size())};
}

}  // namespace detail

}  // namespace ricochet
