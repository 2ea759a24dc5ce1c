// Gradients by the adjoint in random hybrid systems, against differences and forward mode.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "ricochet/sensitivity/adjoint.hpp"
#include "sensitivity_systems.hpp"

namespace ricochet::adjoint_random_test {
namespace {

using X3 = std::array<double, 3>;

/// Two modes, each with a linear flow that a sine bends and the time moves, and a plane that a
/// square bends as guard, whose reset is affine and leads to the other mode.
template <class P>
struct Random {
    using State = X3;
    static constexpr std::size_t mode_count = 2;
    std::array<P, 56> p;

    [[nodiscard]] const P* of(Mode mode) const { return p.data() + 28 * (mode % 2); }

    template <class S>
    void flow(Mode mode, const S& t, const std::array<S, 3>& x, std::array<S, 3>& dxdt) const
    {
        using std::sin;
        const P* a = of(mode);
        const S bend = sin(x[0] + a[9] * t);
        for (std::size_t i = 0; i < 3; ++i) {
            dxdt[i] =
                a[3 * i] * x[0] + a[3 * i + 1] * x[1] + a[3 * i + 2] * x[2] + a[10 + i] * bend;
        }
    }
    template <class S>
    [[nodiscard]] S guard(Mode mode, const S& t, const std::array<S, 3>& x) const
    {
        const P* a = of(mode);
        return 1.0 + a[13] * t + a[14] * x[0] + a[15] * x[1] + x[2] + a[16] * x[0] * x[0];
    }
    template <class S>
    [[nodiscard]] Mode reset(Mode mode, const S& t, std::array<S, 3>& x) const
    {
        const P* a = of(mode);
        const std::array<S, 3> from = x;
        for (std::size_t i = 0; i < 3; ++i) {
            x[i] = a[17 + i] * from[0] + a[20 + i] * from[1] + a[23 + i] * from[2] + a[26] * t;
        }
        x[2] = x[2] + a[27];
        return 1 - mode;
    }
};

struct Drawn {
    std::vector<double> p;
    X3 start;
};

[[nodiscard]] Drawn draw(unsigned seed)
{
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Drawn drawn{std::vector<double>(56), {}};
    for (std::size_t m = 0; m < 2; ++m) {
        double* a = drawn.p.data() + 28 * m;
        for (std::size_t i = 0; i < 28; ++i) a[i] = 0.5 * normal(random);
        a[2] += 1;  // a rotation that carries the third component through the surface
        a[6] -= 1;
        a[8] = -0.2;
        a[27] = 0.5;  // and the reset pushes it back
    }
    for (double& x : drawn.start) x = normal(random);
    return drawn;
}

const auto make_random = [](auto p) {
    Random<typename decltype(p)::value_type> system;
    std::ranges::copy(p, system.p.begin());
    return system;
};

constexpr std::size_t samples = 5;

[[nodiscard]] Options options_of()
{
    Options options{.t_end = 3, .step = 0.04};
    for (std::size_t k = 0; k < samples; ++k) {
        options.sample_times.push_back(0.31 + 0.6 * static_cast<double>(k));
    }
    return options;
}

/// A loss with terms of every kind, linear so that its fifth differences are those of the motion.
const Loss<X3> loss{.sample =
                        [](std::size_t k, double, const X3& x, X3& slope) {
                            slope = {1, static_cast<double>(k), -1};
                            return x[0] + static_cast<double>(k) * x[1] - x[2];
                        },
                    .end =
                        [](double, const X3& x, X3& slope) {
                            slope = {0.5, 0, 1};
                            return 0.5 * x[0] + x[2];
                        },
                    .event =
                        [](std::size_t k, const Event<X3>& event, EventSlope<X3>& slope) {
                            slope.t = k == 0 ? 1 : 0.5;
                            (*slope.before)[1] = 1;
                            (*slope.after)[0] = -1;
                            return slope.t * event.t + event.before[1] - event.after[0];
                        }};

/// The value of the loss, and the modes and the number of events by which neighbours are told.
struct Value {
    double loss;
    std::size_t events;
    Outcome outcome;
};

template <class Stepping>
[[nodiscard]] Value value_of(const std::vector<double>& p, const X3& start, const Options& options,
                             const Stepping& stepping)
{
    const auto run = adjoint(Family{make_random, p}, start, options, stepping);
    return {run.gradient(loss).value, run.run().events.size(), run.run().outcome};
}

// Steps of fixed length: differences are those of the numbers that the sweep differentiates, so
// that only their own error is left, and that is known from two of them: that of h^4 / 30 of the
// fifth derivative falls by 16 when h is halved. Rounding is 1e-14 / h.
TEST(Adjoint, AThousandRandomSystemsHaveTheGradientsOfDifferences)
{
    const Options options = options_of();
    const FixedStep<Rk4> stepping;
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    std::size_t compared = 0, with_several = 0;
    double worst = 0;
    for (unsigned seed = 0; compared < 1000 && seed < 6000; ++seed) {
        const Drawn drawn = draw(seed);
        const auto run = adjoint(Family{make_random, drawn.p}, drawn.start, options, stepping);
        if (run.run().outcome != Outcome::reached_end || run.undefined_at()) continue;
        if (run.run().events.empty()) continue;
        const Gradient by = run.gradient(loss);
        // One random direction in all parameters and the start.
        std::vector<double> direction(drawn.p.size());
        X3 start_direction{};
        double along = 0, size = 1;
        for (std::size_t j = 0; j < direction.size(); ++j) {
            direction[j] = normal(random);
            along += direction[j] * by.parameters[j];
            size = std::max(size, std::fabs(by.parameters[j]));
        }
        for (std::size_t i = 0; i < 3; ++i) {
            start_direction[i] = normal(random);
            along += start_direction[i] * by.start[i];
            size = std::max(size, std::fabs(by.start[i]));
        }
        if (size > 1e3) continue;  // nearly grazing, or unstable
        bool same = true;
        std::map<double, double> known;  // two differences have points in common
        const auto value = [&](double h) {
            const auto found = known.find(h);
            if (found != known.end()) return found->second;
            std::vector<double> p = drawn.p;
            X3 start = drawn.start;
            for (std::size_t j = 0; j < p.size(); ++j) p[j] += h * direction[j];
            for (std::size_t i = 0; i < 3; ++i) start[i] += h * start_direction[i];
            const Value at = value_of(p, start, options, stepping);
            same =
                same && at.events == run.run().events.size() && at.outcome == Outcome::reached_end;
            return at.loss;
        };
        const double difference = test::slope_at_zero(value, 5e-5);
        const double wider = test::slope_at_zero(value, 1e-4);
        // A neighbour has other events, a sample lies between the events of two neighbours, or the
        // differences are not yet those of the derivative.
        if (!same || std::fabs(difference - wider) > 1e-9 * size) continue;
        ++compared;
        if (run.run().events.size() > 1) ++with_several;
        worst = std::max(worst, std::fabs(along - difference) / size);
        EXPECT_NEAR(along, difference, 1e-8 * size) << "seed " << seed;
    }
    EXPECT_EQ(compared, 1000u);
    EXPECT_GE(with_several, 200u);
    RecordProperty("worst_in_1e_12", std::to_string(1e12 * worst));
}

// Error control, and forward mode, whose steps are others: both are within a hundred tolerances.
TEST(Adjoint, UnderErrorControlItAgreesWithForwardMode)
{
    Options options = options_of();
    options.step = 0;
    options.rtol = options.atol = 1e-12;
    std::size_t compared = 0;
    for (unsigned seed = 0; compared < 40 && seed < 200; ++seed) {
        const Drawn drawn = draw(seed);
        using System = Random<double>;
        const System system = make_random(std::span<const double>(drawn.p));
        const auto run = adjoint(Family{make_random, drawn.p}, drawn.start, options);
        const auto forward = sensitivities(system, drawn.start, {}, options);
        ASSERT_EQ(run.undefined_at().has_value(), forward.undefined_at.has_value()) << seed;
        if (run.undefined_at() || forward.run.outcome != Outcome::reached_end) continue;
        if (forward.state.cwiseAbs().maxCoeff() > 100) continue;
        ++compared;
        for (std::size_t i = 0; i < 3; ++i) {
            X3 unit{};
            unit[i] = 1;
            const auto row = static_cast<Eigen::Index>(i);
            const Gradient end = run.gradient(LossSlopes<X3>{.end = unit});
            LossSlopes<X3> last{.samples = std::vector<X3>(samples)};
            last.samples.back() = unit;
            const Gradient sample = run.gradient(last);
            for (std::size_t j = 0; j < 3; ++j) {
                const auto column = static_cast<Eigen::Index>(j);
                EXPECT_NEAR(end.start[j], forward.state(row, column), 1e-8) << seed;
                EXPECT_NEAR(sample.start[j], forward.trajectory.back()(row, column), 1e-7) << seed;
            }
        }
        if (forward.events.empty()) continue;
        const Gradient time = run.gradient(LossSlopes<X3>{.events = {{.event = 0, .t = 1}}});
        for (std::size_t j = 0; j < 3; ++j) {
            EXPECT_NEAR(time.start[j], forward.events[0].dt[static_cast<Eigen::Index>(j)], 1e-8);
        }
    }
    EXPECT_EQ(compared, 40u);
}

// Each method of the library has its own tableau, and samples between its steps.
TEST(Adjoint, EveryMethodOfTheLibrary)
{
    Options options = options_of();
    options.step = 0.05;
    Drawn drawn;
    for (unsigned seed = 0;; ++seed) {  // the first system with several events
        drawn = draw(seed);
        const auto run = adjoint(Family{make_random, drawn.p}, drawn.start, options,
                                 FixedStep<MethodByName>{{MethodName::dopri5}});
        if (run.run().events.size() > 2) break;
    }
    for (const MethodName method : {MethodName::euler, MethodName::rk4, MethodName::cash_karp54,
                                    MethodName::dopri5, MethodName::fehlberg78}) {
        const FixedStep<MethodByName> stepping{{method}};
        const auto run = adjoint(Family{make_random, drawn.p}, drawn.start, options, stepping);
        ASSERT_GE(run.run().events.size(), 1u);
        const Gradient by = run.gradient(loss);
        for (const std::size_t j :
             {std::size_t{0}, std::size_t{9}, std::size_t{14}, std::size_t{20}}) {
            const auto value = [&](double h) {
                std::vector<double> p = drawn.p;
                p[j] += h;
                return value_of(p, drawn.start, options, stepping).loss;
            };
            EXPECT_NEAR(by.parameters[j], test::slope_at_zero(value, 1e-4),
                        1e-8 * (1 + std::fabs(by.parameters[j])))
                << name(method) << " by " << j;
        }
    }
}

}  // namespace
}  // namespace ricochet::adjoint_random_test
