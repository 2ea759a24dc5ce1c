// Reactions of which one acts on what others hold: rectifiers of four diodes, whose voltages add up
// to zero around the bridge, and three relays in a plane. Their reactions are not unique where all
// are held; the motion is, and must not depend on which of them the solver takes.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "random_inclusions.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::dependent_reactions_test {
namespace {

using Vector = Eigen::Matrix<double, 6, 1>;
using Plane = Eigen::Matrix<double, 3, 2>;

/// Capacitors to ground at the nodes a, b (behind the source), p and n (of the load): w[0] to w[3].
/// The source with its inductor lies between a and b: w[4] is its current. Diodes lead from a and b
/// to p, and from n to a and b.
struct Bridge {
    static constexpr int state_size = 6;
    static constexpr int reaction_size = 4;
    static constexpr std::array<std::pair<int, int>, 4> diodes{{{0, 2}, {1, 2}, {3, 0}, {3, 1}}};

    std::array<double, 4> capacity{1, 1, 1, 1};
    double inductance = 1, resistance = 1, load = 1, amplitude = 1, frequency = 1, phase = 0;
    Vector start = Vector::Zero();

    explicit Bridge(std::uint64_t seed)
    {
        test::Draw draw(seed);
        for (double& c : capacity) c = draw.uniform(0.5, 2);
        inductance = draw.uniform(0.3, 2);
        resistance = draw.uniform(0.1, 1);
        load = draw.uniform(0.2, 2);
        amplitude = draw.uniform(1, 3);
        frequency = draw.uniform(0.5, 4);
        phase = draw.uniform(0, 6);
        if (draw.coin()) start[4] = draw.uniform(-1, 1);
        if (draw.coin()) start[2] = draw.uniform(0, 1), start[3] = -draw.uniform(0, 1);
    }

    void smooth(double t, const Vector& w, Vector& f) const
    {
        const double leak = load * (w[2] - w[3]);
        const double source = amplitude * std::sin(frequency * t + phase);
        f << w[4] / capacity[0], -w[4] / capacity[1], -leak / capacity[2], leak / capacity[3],
            (source - (w[0] - w[1]) - resistance * w[4]) / inductance, 0;
    }
    void observe(Eigen::Matrix<double, 4, 6>& e) const
    {
        e.setZero();
        for (int k = 0; k < 4; ++k) {
            const auto [from, to] = diodes[static_cast<std::size_t>(k)];
            e(k, to) = 1, e(k, from) = -1;
        }
    }
    void act(Eigen::Matrix<double, 6, 4>& g) const
    {
        g.setZero();
        for (int k = 0; k < 4; ++k) {
            const auto [from, to] = diodes[static_cast<std::size_t>(k)];
            g(to, k) = 1 / capacity[static_cast<std::size_t>(to)];
            g(from, k) = -1 / capacity[static_cast<std::size_t>(from)];
        }
    }
    [[nodiscard]] sets::Box<4> reaction_set(double, const Vector&) const
    {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        return sets::Box<4>({0, 0, 0, 0}, {infinity, infinity, infinity, infinity});
    }
    static constexpr Crossing crossing = Crossing::falling;
    /// The diodes block where y > 0, and no motion has y < 0.
    [[nodiscard]] static double bound(std::size_t, double) { return 0; }
};

/// Two components that two sines move, and relays on three combinations of them.
struct Relays {
    static constexpr int state_size = 6;
    static constexpr int reaction_size = 3;

    Eigen::Matrix2d linear;
    Plane seen;
    std::array<double, 2> amplitude{}, frequency{}, phase{};
    std::array<double, 3> lower{}, upper{};
    Vector start = Vector::Zero();

    explicit Relays(std::uint64_t seed)
    {
        test::Draw draw(seed);
        for (int i = 0; i < 2; ++i) {
            const auto k = static_cast<std::size_t>(i);
            linear.row(i) << draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5);
            seen.row(i) << draw.uniform(-1, 1), draw.uniform(-1, 1);
            amplitude[k] = draw.uniform(-2, 2);
            frequency[k] = draw.uniform(0.7, 10);
            phase[k] = draw.uniform(0, 6);
            if (draw.coin()) start[i] = draw.uniform(-1, 1);
        }
        seen.row(2) = draw.uniform(-1.5, 1.5) * seen.row(0) + draw.uniform(-1.5, 1.5) * seen.row(1);
        for (double& bound : lower) bound = -draw.uniform(0.3, 1);
        for (double& bound : upper) bound = draw.uniform(0.3, 1);
    }

    void smooth(double t, const Vector& w, Vector& f) const
    {
        f.setZero();
        f.head<2>() = linear * w.head<2>();
        for (int i = 0; i < 2; ++i) {
            const auto k = static_cast<std::size_t>(i);
            f[i] += amplitude[k] * std::sin(frequency[k] * t + phase[k]);
        }
    }
    void observe(Eigen::Matrix<double, 3, 6>& e) const
    {
        e.setZero();
        e.leftCols<2>() = seen;
    }
    void act(Eigen::Matrix<double, 6, 3>& g) const
    {
        g.setZero();
        g.topRows<2>() = seen.transpose();
    }
    [[nodiscard]] sets::Box<3> reaction_set(double, const Vector&) const
    {
        return sets::Box<3>(lower, upper);
    }
    static constexpr Crossing crossing = Crossing::either;
    [[nodiscard]] double bound(std::size_t k, double y) const
    {
        return y > 0 ? lower[k] : upper[k];
    }
};

/// The same as a hybrid system, with a guard on each y.
template <class Set>
struct Hybrid {
    using State = std::array<double, 6>;
    static constexpr bool resets = false;
    static constexpr std::size_t guard_count = Set::reaction_size;
    Set set;

    [[nodiscard]] Eigen::Matrix<double, Set::reaction_size, 1> y(const State& x) const
    {
        Eigen::Matrix<double, Set::reaction_size, 6> e;
        set.observe(e);
        return e * Eigen::Map<const Vector>(x.data());
    }
    void flow(double t, const State& x, State& dxdt) const
    {
        Vector f;
        set.smooth(t, Eigen::Map<const Vector>(x.data()), f);
        Eigen::Matrix<double, 6, Set::reaction_size> g;
        set.act(g);
        const auto sides = y(x);
        for (int k = 0; k < Set::reaction_size; ++k) {
            f += g.col(k) * set.bound(static_cast<std::size_t>(k), sides[k]);
        }
        Eigen::Map<Vector>(dxdt.data()) = f;
    }
    [[nodiscard]] double guard(std::size_t which, double, const State& x) const
    {
        return y(x)[static_cast<Eigen::Index>(which)];
    }
    [[nodiscard]] static GuardInfo guard_info(std::size_t) { return {.crossing = Set::crossing}; }
    [[nodiscard]] Set set_valued() const { return set; }
};

/// Runs a system by the inclusion alone, and by the loop, and returns by how much the ends differ.
template <class Set>
double difference(const Set& set, double t_end)
{
    HandOverOptions options{.t_end = t_end};
    options.set_valued.step = t_end / 1000;
    const auto alone = hand_over(set, set.start, options);
    EXPECT_EQ(alone.outcome, Outcome::reached_end);
    typename Hybrid<Set>::State x;
    std::copy_n(set.start.data(), 6, x.begin());
    const auto run = integrate(Hybrid<Set>{set}, x, Options{.t_end = t_end});
    EXPECT_EQ(run.outcome, Outcome::reached_end) << run.reason;
    return (Eigen::Map<const Vector>(run.x.data()) - alone.x).cwiseAbs().maxCoeff();
}

TEST(DependentReactions, RectifiersOfFourDiodesRunToTheirEnd)
{
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
        SCOPED_TRACE(seed);
        // The steps are located at their changes, and the motion between them is smooth: what is
        // left is the error of some hundred steps at the default tolerances, 1e-6 and 1e-9.
        EXPECT_LT(difference(Bridge(seed), 10), 1e-5);
    }
}

TEST(DependentReactions, ThreeRelaysInAPlaneRunToTheirEnd)
{
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
        SCOPED_TRACE(seed);
        // A thousandth of the run is a step of both where all are held, of order 2: (6e-3)^2 times
        // a second derivative of up to amplitude x frequency^2 = 200, of which sines leave a tenth.
        EXPECT_LT(difference(Relays(seed), 6), 1e-3);
    }
}

}  // namespace
}  // namespace ricochet::dependent_reactions_test
