// Gases whose laws are known: the equation of state of hard discs, Tonks' gas, Sinai's billiard and
// Haff's law, with the errors that their statistics have.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "ricochet/scene/measure.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::known_gases_test {

namespace {

/// A gas of discs in the unit torus that cover this fraction of it, of mass 1, with Maxwell's
/// velocities at kT = 1 and no momentum.
Scene torus_gas(std::size_t columns, double fraction, double restitution, unsigned seed)
{
    const std::size_t count = columns * columns;
    const double radius = std::sqrt(fraction / (static_cast<double>(count) * std::numbers::pi));
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<Vector2> velocities(count);
    Vector2 mean{};
    for (Vector2& v : velocities) {
        v = {normal(generator), normal(generator)};
        for (std::size_t c = 0; c < 2; ++c) mean[c] += v[c] / static_cast<double>(count);
    }
    Scene scene({.period = {1, 1}});
    const MaterialId material = scene.material({.restitution = restitution});
    const double pitch = 1 / static_cast<double>(columns);
    for (std::size_t k = 0; k < count; ++k) {
        const Vector2& v = velocities[k];
        scene.disc({.at = {(static_cast<double>(k % columns) + 0.5) * pitch,
                           (static_cast<double>(k / columns) + 0.5) * pitch},
                    .velocity = {v[0] - mean[0], v[1] - mean[1]},
                    .radius = radius,
                    .material = material});
    }
    return scene;
}

/// p A / (N kT) of hard discs that cover a fraction of the area, from the virial coefficients B_2
/// to B_10 over powers of B_2 (N. Clisby and B. M. McCoy, Ninth and tenth order virial coefficients
/// for hard spheres in D dimensions, Journal of Statistical Physics 122, 2006); the terms beyond
/// follow their last ratio.
double equation_of_state(double fraction)
{
    const std::vector<double> coefficients{1,         0.78200440, 0.53223180, 0.33355604, 0.1988425,
                                           0.1148728, 0.0649930,  0.0362193,  0.0199537};
    const double y = 2 * fraction;
    double sum = 1;
    double power = 1;
    for (const double b : coefficients) {
        power *= y;
        sum += b * power;
    }
    const double ratio = y * coefficients.back() / coefficients[coefficients.size() - 2];
    return sum + coefficients.back() * power * ratio / (1 - ratio);
}

}  // namespace

TEST(KnownGases, HardDiscsHaveTheirEquationOfState)
{
    // 256 discs: the mean over blocks within 4 standard errors, and 1 / N for the finite number.
    for (const double fraction : {0.1, 0.2, 0.3, 0.4}) {
        const Scene scene = torus_gas(16, fraction, 1, 5);
        SceneMeasure measure(scene, {.t_start = 0.5, .t_end = 3, .blocks = 20});
        SceneOptions options{.t_end = 3, .record_events = false};
        options.observe = [&](const SceneEvent& event) { measure.add(event); };
        const SceneRun run = simulate(scene, options);
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        const SceneMeasures found = measure.result();
        const double ideal = 256 * found.temperature.mean;
        const double z = found.virial_pressure.mean / ideal;
        const double error = found.virial_pressure.error / ideal;
        const double exact = equation_of_state(fraction);
        EXPECT_NEAR(z, exact, 4 * error + exact / 256) << fraction;
        EXPECT_LT(error, 0.01 * exact) << fraction;
        // Boltzmann's collisions at contact: the virial is their rate times sqrt(pi m kT) sigma
        // / 2.
        const double diameter = 2 * scene.bodies()[0].radius;
        const double by_rate = 1 + found.collision_rate.mean * diameter *
                                       std::sqrt(std::numbers::pi / found.temperature.mean) /
                                       (2 * 256);
        EXPECT_NEAR(by_rate, exact, 4 * error + exact / 256) << fraction;
    }
}

TEST(KnownGases, TonksGasGoesEventByEvent)
{
    // Equal rods on a line exchange their velocities: without their lengths they are points that
    // pass each other. The times of all impacts are those at which two of the lines x + v t cross.
    // An error of 1e-16 t in the places, which grows with the number of impacts before, is one of
    // 1e-16 t / dv in a time, where dv is the difference of the velocities.
    constexpr std::size_t count = 40;
    constexpr double diameter = 0.25;
    std::mt19937_64 generator(11);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Scene scene;
    std::vector<double> x;
    std::vector<double> v;
    double at = 0;
    for (std::size_t k = 0; k < count; ++k) {
        at += 0.5 * (1.1 + uniform(generator));
        x.push_back(at);
        v.push_back(uniform(generator));
        scene.disc({.at = {at + static_cast<double>(k) * diameter, 0},
                    .velocity = {v.back(), 0},
                    .radius = diameter / 2});
    }
    constexpr double t_end = 500;
    std::vector<std::pair<double, double>> exact;  // times, and differences of velocities
    for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t l = 0; l < k; ++l) {
            const double dv = v[l] - v[k];
            const double t = (x[k] - x[l]) / dv;
            if (t > 0 && t < t_end) exact.emplace_back(t, dv);
        }
    }
    std::ranges::sort(exact);
    ASSERT_GT(exact.size(), 300U);
    const SceneRun run = simulate(scene, {.t_end = t_end});
    ASSERT_EQ(run.events.size(), exact.size());
    for (std::size_t k = 0; k < exact.size(); ++k) {
        const auto [t, dv] = exact[k];
        ASSERT_NEAR(run.events[k].t, t, 1e-14 * (1 + t) / dv) << k;
        ASSERT_NEAR(run.events[k].approach(), dv, 1e-14) << k;
    }
    std::vector<double> last;
    for (const BodyState& body : run.bodies) last.push_back(body.velocity[0]);
    std::ranges::sort(last);
    std::ranges::sort(v);
    for (std::size_t k = 0; k < count; ++k) EXPECT_NEAR(last[k], v[k], 1e-14);
}

TEST(KnownGases, SinaisBilliardHasItsMeanFreePath)
{
    // Points among fixed discs that leave the area A and have the perimeter P: pi A / P (L. A.
    // Santalo). Two pins in the unit torus, of radii 0.4 and 0.25, leave no line free, so that
    // flights have a variance. The points are independent: within 4 standard errors.
    Scene scene({.period = {1, 1}});
    scene.arc({.centre = {0.5, 0.5}, .radius = 0.4});
    scene.arc({.centre = {0, 0}, .radius = 0.25});
    std::mt19937_64 generator(4);
    std::uniform_real_distribution<double> uniform(0, 1);
    constexpr std::size_t count = 100;
    while (scene.bodies().size() < count) {
        const Vector2 at{uniform(generator), uniform(generator)};
        const double angle = 2 * std::numbers::pi * uniform(generator);
        const auto is_free = [&](double x, double y, double radius) {
            return std::hypot(at[0] - x, at[1] - y) > radius;
        };
        if (!is_free(0.5, 0.5, 0.41) || !is_free(0, 0, 0.26) || !is_free(1, 0, 0.26) ||
            !is_free(0, 1, 0.26) || !is_free(1, 1, 0.26)) {
            continue;
        }
        scene.point({.at = at, .velocity = {std::cos(angle), std::sin(angle)}});
    }
    constexpr double length = 100;
    const SceneRun run = simulate(scene, {.t_end = length});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    std::vector<double> rates(count, 0.0);
    for (const SceneEvent& event : run.events) rates[event.body] += 1 / length;
    const Measured rate = mean_of(rates);
    const double area = 1 - std::numbers::pi * (0.16 + 0.0625);
    const double exact = 2 * std::numbers::pi * 0.65 / (std::numbers::pi * area);
    EXPECT_NEAR(rate.mean, exact, 4 * rate.error);
    EXPECT_LT(rate.error, 0.01 * exact);
    for (const BodyState& body : run.bodies) {
        EXPECT_NEAR(std::hypot(body.velocity[0], body.velocity[1]), 1, 1e-13);
    }
}

TEST(KnownGases, AGranularGasCoolsAsHaffSays)
{
    // A collision takes (1 - e^2) kT on the mean, so kT falls by exp(-(1 - e^2) / N) with each; and
    // kT = kT0 / (1 + t / tau)^2 with 1 / tau = (1 - e^2) w0 / 4, where w0 = 2 n sigma chi
    // sqrt(pi kT0) is Enskog's rate (P. K. Haff, Journal of Fluid Mechanics 134, 1983). The
    // velocities are not quite Maxwell's: 1 % at e = 0.9; and one run of 400 discs with 20
    // collisions each fluctuates by 1 / sqrt(8000).
    constexpr double e = 0.9;
    constexpr double fraction = 0.1;
    constexpr double count = 400;
    const Scene scene = torus_gas(20, fraction, e, 8);
    const double t_end = 2.5;
    const SceneRun run =
        simulate(scene, {.t_end = t_end, .record_events = false, .sample_times = {0}});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    const double kept = energy(scene, run.bodies) / energy(scene, run.samples[0]);
    const double each = static_cast<double>(run.statistics.impacts) / count;
    EXPECT_GT(each, 5);
    EXPECT_NEAR(std::log(kept) / (-(1 - e * e) * each), 1, 0.04);
    const double hot = energy(scene, run.samples[0]) / (count - 1);
    const double diameter = 2 * scene.bodies()[0].radius;
    const double chi = (1 - 7 * fraction / 16) / std::pow(1 - fraction, 2);
    const double rate = 2 * count * diameter * chi * std::sqrt(std::numbers::pi * hot);
    const double haff = 1 + t_end * (1 - e * e) * rate / 4;
    EXPECT_NEAR(1 / std::sqrt(kept) / haff, 1, 0.04);
}

TEST(KnownGases, WallsAreStruckByAnIdealGas)
{
    // One point between walls 2 m apart and 3 m long, at 4 m/s: m v^2 / (2 * 3) on each, with the
    // one impact more or less that a block may have.
    Scene scene;
    const SurfaceId left = scene.wall({.point = {0, 0}, .normal = {1, 0}});
    scene.wall({.point = {2, 0}, .normal = {-1, 0}});
    scene.point({.at = {1, 0}, .velocity = {4, 0}, .mass = 0.5});
    scene.point({.at = {1, 9}, .velocity = {-4, 0}, .mass = 0.5});
    const SceneRun run = simulate(scene, {.t_end = 100});
    SceneMeasure measure(scene, {.t_end = 100, .blocks = 4, .area = 6});
    measure.length_of(left, 3);
    measure.add(run);
    const SceneMeasures found = measure.result();
    EXPECT_NEAR(found.surface_pressure[0].mean, 2 * 0.5 * 16 / 6.0, 2 * 2 * 0.5 * 4 / (3 * 25.0));
    EXPECT_TRUE(std::isnan(found.surface_pressure[1].mean));
    EXPECT_NEAR(found.wall_rate.mean, 4, 0.05);
    EXPECT_EQ(found.collision_rate.mean, 0);
    EXPECT_NEAR(found.temperature.mean, 0.5 * 16 * 2 / 2, 1e-12);
}

TEST(KnownGases, PairsBelowADiameterAreAbsentAndFarOnesAreEven)
{
    const Scene scene = torus_gas(12, 0.3, 1, 3);
    std::vector<double> times;
    for (int k = 1; k <= 40; ++k) times.push_back(0.1 * k);
    const SceneRun run =
        simulate(scene, {.t_end = 4, .record_events = false, .sample_times = times});
    const double diameter = 2 * scene.bodies()[0].radius;
    const PairDistribution g = pair_distribution(scene, run, 0.5, 100);
    ASSERT_EQ(g.values.size(), 100U);
    for (std::size_t k = 0; k < 100; ++k) {
        if (g.distances[k] + 0.0025 >= diameter) continue;
        EXPECT_EQ(g.values[k].mean, 0) << k;
    }
    // At contact g is above (Z - 1) / (2 fraction) of a first bin of 0.09 diameters, and far
    // away 1.
    const auto first = static_cast<std::size_t>(diameter / 0.005) + 1;
    const double contact = (equation_of_state(0.3) - 1) / 0.6;
    EXPECT_NEAR(g.values[first].mean, contact, 0.25 * contact);
    double far = 0;
    for (std::size_t k = 80; k < 100; ++k) far += g.values[k].mean / 20;
    EXPECT_NEAR(far, 1, 0.02);
}

TEST(KnownGases, ATemperatureProfileFollowsItsSlices)
{
    // Two bodies at rest on the mean in each slice: m v^2 / 1 of one, and of three slices the last
    // is empty. Drift of a slice is no temperature.
    Scene scene;
    scene.disc({.at = {0.25, 0}, .velocity = {6, 0}, .radius = 0.1, .mass = 2});
    scene.disc({.at = {0.75, 5}, .velocity = {4, 0}, .radius = 0.1, .mass = 2});
    scene.disc({.at = {1.25, 0}, .velocity = {0, 3}, .radius = 0.1});
    scene.disc({.at = {1.75, 5}, .velocity = {0, -3}, .radius = 0.1});
    const SceneRun run = simulate(scene, {.t_end = 0.01, .sample_times = {0, 0.005}});
    const TemperatureProfile profile = temperature_profile(scene, run, 0, 0, 3, 3);
    ASSERT_EQ(profile.values.size(), 3U);
    EXPECT_EQ(profile.places[1], 1.5);
    EXPECT_EQ(profile.values[0].mean, 2);
    EXPECT_EQ(profile.values[0].error, 0);
    EXPECT_EQ(profile.values[1].mean, 9);
    EXPECT_TRUE(std::isnan(profile.values[2].mean));
    EXPECT_THROW((void)temperature_profile(scene, run, 2, 0, 1, 1), std::invalid_argument);
    EXPECT_THROW((void)temperature_profile(scene, run, 0, 1, 1, 1), std::invalid_argument);
}

TEST(KnownGases, HeatFlowsBetweenThermalWalls)
{
    // Points that meet nothing but two thermal walls, of temperatures 1 and 4: those on the way
    // from a wall are Maxwell's of it. Of each temperature T there are as many as fly for 1 /
    // sqrt(T), so the mean of v^2 across is (sqrt(1) + sqrt(4)) / (1 + 1/2) = 2 everywhere: within
    // 4 standard errors over independent points, for which the mean over time is taken.
    Scene scene;
    scene.wall({.point = {0, 0}, .normal = {1, 0}, .temperature = 1});
    scene.wall({.point = {1, 0}, .normal = {-1, 0}, .temperature = 4});
    for (int i = 0; i < 50; ++i) {
        scene.point({.at = {0.02 * i + 0.01, 0}, .velocity = {1, 0}});
    }
    std::vector<double> times;
    for (int k = 0; k < 2000; ++k) times.push_back(20 + 0.25 * k);
    const SceneRun run =
        simulate(scene, {.t_end = 520, .record_events = false, .sample_times = times});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    std::vector<double> across;
    for (std::size_t i = 0; i < 50; ++i) {
        double sum = 0;
        for (const auto& states : run.samples) sum += std::pow(states[i].velocity[1], 2);
        across.push_back(sum / 2000);
    }
    const Measured mean = mean_of(across);
    EXPECT_NEAR(mean.mean, 2, 4 * mean.error);
    EXPECT_LT(mean.error, 0.05);
}

TEST(KnownGases, MeasuresThatCannotBeTakenAreRefused)
{
    const Scene scene = torus_gas(2, 0.1, 1, 1);
    EXPECT_THROW(SceneMeasure(scene, {.t_start = 1, .t_end = 1}), std::invalid_argument);
    EXPECT_THROW(SceneMeasure(scene, {.t_end = 1, .blocks = 1}), std::invalid_argument);
    EXPECT_THROW(SceneMeasure(Scene(), {.t_end = 1}), std::invalid_argument);
    EXPECT_THROW(SceneMeasure(Scene({.gravity = {0, -1}}), {.t_end = 1, .area = 1}),
                 std::invalid_argument);
    EXPECT_THROW((void)pair_distribution(scene, SceneRun(), 0.4, 10), std::invalid_argument);
    EXPECT_THROW((void)pair_distribution(scene, SceneRun(), 0.6, 10), std::invalid_argument);
}

}  // namespace ricochet::known_gases_test
