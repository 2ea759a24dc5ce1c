// Runs of one system by solvers of two sizes, which must agree to the last bit.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::test {

using detail::AnyMotion;
using detail::inclusion_of;
using detail::resized;

[[nodiscard]] inline bool same(double a, double b)
{
    return a == b || (std::isnan(a) && std::isnan(b));
}

template <class V>
[[nodiscard]] bool same(const V& a, const V& b)
{
    for (Eigen::Index i = 0; i < a.size(); ++i) {
        if (!same(a[i], b[i])) return false;
    }
    return a.size() == b.size();
}

/// The hand-over of a system by the solvers of N components and M reactions.
template <int N, int M, class System>
auto run_in(const System& system, const StateOf<System>& w0, const HandOverOptions& options)
{
    return detail::RunOfInclusion<System, ErrorControlled<Dopri5>, N, M>(system, w0, options)
        .take();
}

template <class Run>
void expect_same_run(const Run& a, const Run& b)
{
    EXPECT_EQ(a.outcome, b.outcome);
    EXPECT_EQ(a.mode, b.mode);
    EXPECT_EQ(a.t, b.t);
    EXPECT_TRUE(same(a.x, b.x)) << a.x << "\nand\n" << b.x;
    EXPECT_EQ(a.reaction, b.reaction);
    ASSERT_EQ(a.events.size(), b.events.size());
    for (std::size_t i = 0; i < a.events.size(); ++i) {
        const auto &p = a.events[i], &q = b.events[i];
        EXPECT_EQ(p.t, q.t) << i;
        EXPECT_EQ(p.guard, q.guard) << i;
        EXPECT_EQ(p.kind, q.kind) << i;
        EXPECT_EQ(p.mode_before, q.mode_before) << i;
        EXPECT_EQ(p.mode_after, q.mode_after) << i;
        EXPECT_TRUE(same(p.before, q.before) && same(p.after, q.after)) << i;
        EXPECT_TRUE(same(p.slope, q.slope) && same(p.error, q.error)) << i;
        EXPECT_TRUE(p.bracket.lo == q.bracket.lo && p.bracket.hi == q.bracket.hi) << i;
    }
    ASSERT_EQ(a.phases.size(), b.phases.size());
    for (std::size_t i = 0; i < a.phases.size(); ++i) {
        EXPECT_EQ(a.phases[i].from, b.phases[i].from) << i;
        EXPECT_EQ(a.phases[i].cause, b.phases[i].cause) << i;
        EXPECT_EQ(a.phases[i].set_valued, b.phases[i].set_valued) << i;
    }
    ASSERT_EQ(a.trajectory.t, b.trajectory.t);
    for (std::size_t i = 0; i < a.trajectory.x.size(); ++i) {
        EXPECT_TRUE(same(a.trajectory.x[i], b.trajectory.x[i])) << i;
    }
    EXPECT_EQ(a.statistics.steps, b.statistics.steps);
    EXPECT_EQ(a.statistics.rejected, b.statistics.rejected);
    EXPECT_EQ(a.set_valued.attempted, b.set_valued.attempted);
    EXPECT_EQ(a.set_valued.iterations, b.set_valued.iterations);
    EXPECT_EQ(a.set_valued.switches, b.set_valued.switches);
}

/// Every step of a set-valued motion.
template <int N, int M, int N2, int M2, class System>
void expect_same_steps(const System& system, const StateOf<System>& w0,
                       const SetValuedOptions& options)
{
    AnyMotion<N, M> a(inclusion_of<N, M>(system), resized<N>(w0), options);
    AnyMotion<N2, M2> b(inclusion_of<N2, M2>(system), resized<N2>(w0), options);
    int steps = 0;
    Outcome outcome = Outcome::running;
    while (outcome == Outcome::running) {
        outcome = a.advance();
        ASSERT_EQ(b.advance(), outcome) << steps;
        ASSERT_EQ(a.state().t, b.state().t) << steps;
        ASSERT_TRUE(same(resized<N>(b.state().w), a.state().w)) << steps;
        ASSERT_TRUE(same(resized<M>(b.state().reaction), a.state().reaction)) << steps;
        ASSERT_EQ(a.error(), b.error()) << steps;
        ++steps;
    }
    EXPECT_EQ(outcome, Outcome::reached_end);
    EXPECT_GT(steps, 10);
    EXPECT_EQ(a.statistics().iterations, b.statistics().iterations);
    for (Eigen::Index i = N; i < N2; ++i) EXPECT_EQ(b.state().w[i], 0);
    for (Eigen::Index i = M; i < M2; ++i) EXPECT_EQ(b.state().reaction[i], 0);
}

/// The ways in which a stage is solved, an error estimated and a change treated.
[[nodiscard]] inline std::vector<SetValuedOptions> ways(double t_end, double step, bool box,
                                                        Eigen::Index n)
{
    const SetValuedOptions plain{.t_end = t_end, .step = step};
    std::vector<SetValuedOptions> all;
    for (const Scheme scheme : {Scheme::bathe, Scheme::backward_euler, Scheme::theta}) {
        for (const StageMethod method : {StageMethod::automatic, StageMethod::newton}) {
            all.push_back(plain);
            all.back().scheme = {.scheme = scheme, .stage = {.method = method}};
        }
    }
    all.push_back(plain);
    all.back().scheme.first_stage = FirstStage::at_end;
    all.push_back(plain);
    all.back().controller = FilteredStep::h211b(4);
    all.back().estimate = ErrorEstimate::doubling;
    all.push_back(all.back());
    all.back().estimate = ErrorEstimate::embedded;
    all.push_back(all.back());
    all.back().fields = {{.first = 0, .count = n, .rtol = 1e-4, .floor = 1}};
    if (box) {
        all.push_back(plain);
        all.back().switches = Switches::located;
        all.back().scheme.first_stage = FirstStage::switch_aware;
    }
    return all;
}

/// Every entry of every matrix is used, so that no sum has a single term.
template <int n, int m>
struct Dense {
    static constexpr int state_size = n;
    static constexpr int reaction_size = m;
    using Vector = Eigen::Matrix<double, n, 1>;
    using Reaction = Eigen::Matrix<double, m, 1>;

    double strength = 0.6;  ///< of the reactions

    /// Numbers without a pattern, below 1.
    [[nodiscard]] static double number(Eigen::Index i, Eigen::Index j)
    {
        return std::sin(12.9898 * static_cast<double>(i + 1) + 78.233 * static_cast<double>(j + 1));
    }
    void smooth(double t, const Vector& w, Vector& f) const
    {
        for (Eigen::Index i = 0; i < n; ++i) {
            f[i] = -w[i] + 1.5 * std::sin(t * (1 + 0.3 * static_cast<double>(i)));
            for (Eigen::Index j = 0; j < n; ++j) f[i] += 0.4 * number(i, j) * std::sin(w[j]);
        }
    }
    void mass(Eigen::Matrix<double, n, n>& a) const
    {
        for (Eigen::Index i = 0; i < n; ++i) {
            for (Eigen::Index j = 0; j < n; ++j) {
                a(i, j) = (i == j ? 2 : 0) + 0.1 * (number(i, j) + number(j, i));
            }
        }
    }
    template <class Observation>
    void observe(Observation& e) const
    {
        for (Eigen::Index i = 0; i < m; ++i) {
            for (Eigen::Index j = 0; j < n; ++j)
                e(i, j) = (i == j ? 1 : 0) + 0.2 * number(i + 7, j);
        }
    }
    void offset(double t, Reaction& s) const
    {
        for (Eigen::Index i = 0; i < m; ++i) s[i] = 0.1 * std::cos(t + static_cast<double>(i));
    }
    [[nodiscard]] auto reaction_set(double, const Vector& w) const
    {
        std::array<double, m> upper{}, lower{};
        for (std::size_t i = 0; i < m; ++i) {
            upper[i] = strength + 0.1 * static_cast<double>(i) + 0.05 * std::cos(w[0]);
            lower[i] = -upper[i];
        }
        return sets::Box<m>(lower, upper);
    }
    [[nodiscard]] static Vector start()
    {
        Vector w;
        for (Eigen::Index i = 0; i < n; ++i) w[i] = number(i, 3);
        return w;
    }
};

/// The same with reactions in a ball, or with a state that does not leave a box or a ball.
template <int n, int m>
struct DenseInBall : Dense<n, m> {
    using Vector = typename Dense<n, m>::Vector;
    [[nodiscard]] sets::Ball<m> reaction_set(double, const Vector&) const
    {
        return sets::Ball<m>(this->strength);
    }
};
template <int n, int m>
struct DenseWithStops : Dense<n, m> {
    static constexpr Confines confines = Confines::state;
    using Vector = typename Dense<n, m>::Vector;
    void offset(double, typename Dense<n, m>::Reaction& s) const { s.setZero(); }
    [[nodiscard]] sets::Box<m> reaction_set(double, const Vector&) const
    {
        std::array<double, m> lower, upper;
        lower.fill(-0.3);
        upper.fill(0.4);
        return sets::Box<m>(lower, upper);
    }
    [[nodiscard]] static Vector start() { return Vector::Zero(); }
};

template <int N, int M, int N2, int M2, class System>
void compare(const System& system, const StateOf<System>& w0, double t_end, double step)
{
    SCOPED_TRACE("(" + std::to_string(N2) + ", " + std::to_string(M2) + ")");
    HandOverOptions options{.t_end = t_end, .rtol = 1e-8, .atol = 1e-8};
    options.set_valued.step = step;
    for (int i = 1; i <= 7; ++i) options.sample_times.push_back(t_end * i / 7.3);
    const auto exact = run_in<N, M>(system, w0, options);
    expect_same_run(exact, run_in<N2, M2>(system, w0, options));
    for (const SetValuedOptions& way : ways(t_end, step, BoxSet<SetOf<System>>, w0.size())) {
        SCOPED_TRACE("scheme " + std::to_string(static_cast<int>(way.scheme.scheme)) + ", method " +
                     std::to_string(static_cast<int>(way.scheme.stage.method)) + ", estimate " +
                     std::to_string(static_cast<int>(way.estimate)));
        expect_same_steps<N, M, N2, M2>(system, w0, way);
    }
}

}  // namespace ricochet::test
