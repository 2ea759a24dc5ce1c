// Gates: their features, their files, and runs that trust them or do not.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::gate_models_test {
namespace {

using Fixed = FixedStep<Rk4>;
constexpr double inf = std::numeric_limits<double>::infinity();

/// A point that goes back and forth between two walls at -1 and 1; only whether it is between them
/// is known.
struct Shuttle {
    using State = std::array<double, 2>;
    static constexpr std::string_view name = "shuttle";
    static constexpr Crossing crossing = Crossing::falling;
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = 0;
    }
    template <class X>
    bool guard(double, const X& x) const
    {
        return std::fabs(x[0]) < 1;
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[1] = -x[1];
    }
};

/// The same with its distance and a bound.
struct Measured {
    using State = std::array<double, 2>;
    static constexpr std::string_view name = "measured";
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = 0;
    }
    template <class X>
    double guard(double, const X& x) const
    {
        return 1 - x[0] * x[0];
    }
    template <class X, class D>
    double guard_rate(double, const X& x, const D& dxdt) const
    {
        return -2 * x[0] * dxdt[0];
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[1] = -x[1];
    }
    template <class X>
    double speed_bound(double, const X& x) const
    {
        return 2.2 * std::fabs(x[1]);  // |g'| = 2 |x v|, a little beyond the walls, too
    }
};

constexpr Shuttle::State at_centre{0, 1};

Model shuttle_model()
{
    Model model;
    model.kind = "gate-horizon";
    model.system = "shuttle";
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.domain = {{-1, 1}, {-2, 2}};
    model.step_min = model.step_max = 0.01;
    model.precision = Precision::f64;
    return model;
}

/// Clears the horizon tau if |x| < 1 - tau: at unit speed no wall is met earlier.
/// Hidden: max(x, 0), max(-x, 0), whose sum is |x|.
Model true_horizons(const std::vector<double>& horizons)
{
    Model model = shuttle_model();
    model.layers = {{2, 2, {1, 0, -1, 0}, {0, 0}}, {2, horizons.size(), {}, {}}};
    for (const double tau : horizons) {
        model.layers[1].weight.insert(model.layers[1].weight.end(), {1, 1});
        model.layers[1].bias.push_back(tau - 0.999);
        model.levels.push_back({.value = tau, .threshold = 0});
    }
    return model;
}

/// logit |x|: below 0.5 the guard 1 - x^2 is above 0.75, and so on.
Model true_levels()
{
    Model model = shuttle_model();
    model.kind = "gate-level";
    model.system = "measured";
    model.layers = {{2, 2, {1, 0, -1, 0}, {0, 0}}, {2, 1, {1, 1}, {0}}};
    for (const double x : {0.95, 0.9, 0.8, 0.5, 0.3}) {
        model.levels.push_back({.value = 0.999 * (1 - x * x), .threshold = x});
    }
    return model;
}

std::string refusal(const std::function<void()>& act)
{
    try {
        act();
    } catch (const std::exception& error) {
        return error.what();
    }
    return "nothing was refused";
}

template <class X>
void expect_same_events(const Run<X>& exact, const Run<X>& gated)
{
    EXPECT_EQ(exact.outcome, gated.outcome) << name(gated.outcome);
    ASSERT_EQ(exact.events.size(), gated.events.size());
    for (std::size_t k = 0; k < exact.events.size(); ++k) {
        ASSERT_EQ(std::bit_cast<std::uint64_t>(exact.events[k].t),
                  std::bit_cast<std::uint64_t>(gated.events[k].t))
            << k;
        ASSERT_EQ(exact.events[k].after, gated.events[k].after) << k;
    }
    EXPECT_EQ(exact.x, gated.x);
}

// --- features ---

TEST(GateRecipe, IsReadAsItIsSpelled)
{
    for (const char* spelled : {"state", "state-rate", "state-phase(0.7)", "angles", "chain", "own",
                                "state mode(3)", "state-phase(2) mode(2)"}) {
        EXPECT_EQ(to_string(gate_recipe(spelled)), spelled);
    }
    EXPECT_EQ(gate_recipe("state-phase(0.7)").frequency, 0.7);
}

TEST(GateRecipe, RefusesWhatItDoesNotKnow)
{
    for (const char* wrong :
         {"", "position", "state-phase", "state(2)", "state-phase(x)", "state mode(0)",
          "state mode(1.5)", "state node(2)", "angles ", "state-phase(0.7", "state-phase(nan)"}) {
        const std::string why = refusal([&] { (void)gate_recipe(wrong); });
        EXPECT_NE(why.find("unknown gate recipe"), std::string::npos) << wrong << ": " << why;
    }
}

TEST(GateRecipe, MakesTheFeaturesThatItNames)
{
    const Shuttle shuttle;
    const std::array<double, 2> x{0.5, -2};
    std::array<double, GateRecipe::most> f{};
    const auto make = [&](const char* spelled) {
        const GateRecipe recipe = gate_recipe(spelled);
        f.fill(99);
        recipe.write(shuttle, 1, 3.0, x, f.data());
        const std::size_t n = feature_count(recipe, shuttle, x);
        EXPECT_EQ(f[n], 99) << spelled;
        return std::vector<double>(f.begin(), f.begin() + static_cast<std::ptrdiff_t>(n));
    };
    using V = std::vector<double>;
    EXPECT_EQ(make("state"), (V{0.5, -2}));
    EXPECT_EQ(make("state-rate"), (V{0.5, -2, -2, 0}));
    EXPECT_EQ(make("state-phase(2)"), (V{0.5, -2, std::sin(6.0), std::cos(6.0)}));
    EXPECT_EQ(make("angles"), (V{std::sin(0.5), std::cos(0.5), -2}));
    EXPECT_EQ(make("state mode(3)"), (V{0.5, -2, 0, 1, 0}));
    const std::array<double, 4> two{0.5, 0.25, -2, 3};
    gate_recipe("chain").write(shuttle, 0, 0.0, two, f.data());
    EXPECT_EQ(V(f.begin(), f.begin() + 6),
              (V{std::sin(0.5), std::cos(0.5), std::sin(0.75), std::cos(0.75), -2, 3}));
    EXPECT_EQ(feature_count(gate_recipe("own"), shuttle, x), 0U);
}

// --- files ---

TEST(GateModel, KeepsLevelsAndCalibrationInItsFile)
{
    Model model = true_horizons({0.02, 0.04, 0.1});
    model.calibration = {
        .events = 30'011, .misses = 2, .miss_bound = 2.1e-4, .steps = 1'000'000'007, .seed = 9};
    const std::vector<std::byte> bytes = to_safetensors(model);
    const Model found = parse_model(bytes, "gate");
    ASSERT_EQ(found.levels.size(), 3U);
    EXPECT_EQ(found.levels[2].value, 0.1);
    EXPECT_EQ(found.levels[1].threshold, model.levels[1].threshold);
    EXPECT_EQ(found.calibration.events, 30'011U);
    EXPECT_EQ(found.calibration.misses, 2U);
    EXPECT_EQ(found.calibration.miss_bound, 2.1e-4);
    EXPECT_EQ(found.calibration.steps, 1'000'000'007U);
    EXPECT_EQ(to_safetensors(found), bytes);
}

TEST(GateModel, WithLevelsThatDoNotFitIsRefusedWithASentence)
{
    Model model = true_horizons({0.02, 0.04});
    model.levels.pop_back();
    EXPECT_NE(refusal([&] { (void)to_safetensors(model); }).find("levels"), std::string::npos);
    EXPECT_NE(refusal([&] { gates::Gate gate(model); }).find("2 outputs and 1 levels"),
              std::string::npos);
    model = true_horizons({0.04, 0.02});
    EXPECT_NE(refusal([&] { gates::Gate gate(model); }).find("do not rise"), std::string::npos);
    EXPECT_NE(refusal([&] { (void)to_safetensors(model); }).find("rise"), std::string::npos);
    model = true_horizons({0.04});
    model.domain.clear();
    EXPECT_NE(refusal([&] { gates::Gate gate(model); }).find("has no domain"), std::string::npos);
    model = true_horizons({0.04});
    model.kind = "event-classifier";
    EXPECT_NE(refusal([&] { gates::Gate gate(model); }).find("expected a gate"), std::string::npos);
    EXPECT_NE(
        refusal([] { Calibrated d{gates::Gate(true_levels())}; }).find("expected a horizon gate"),
        std::string::npos);
    EXPECT_NE(refusal([] {
                  CalibratedBounds d{gates::Gate(true_horizons({1}))};
              }).find("expected a level gate"),
              std::string::npos);
}

TEST(GateModel, IsRefusedForAnotherSystemLayoutOrStep)
{
    const Calibrated gate(gates::Gate(true_horizons({0.02, 0.04})));
    const Options options{.t_end = 1, .step = 0.01};
    EXPECT_NE(refusal([&] {
                  (void)integrate(Measured{}, Measured::State{0, 1}, options, Fixed{}, gate);
              }).find("the model for shuttle cannot be used for measured"),
              std::string::npos);
    Options coarse = options;
    coarse.step = 0.1;
    EXPECT_NE(refusal([&] {
                  (void)integrate(Shuttle{}, at_centre, coarse, Fixed{}, gate);
              }).find("trained for steps in [0.01, 0.01] s, got [0.1, 0.1]"),
              std::string::npos);
    Model wide = true_horizons({0.02});
    wide.recipe = "state-rate";
    EXPECT_NE(refusal([&] {
                  (void)integrate(Shuttle{}, at_centre, options, Fixed{},
                                  Calibrated(gates::Gate(wide)));
              }).find("takes 2 features, but 'state-rate' of this state are 4"),
              std::string::npos);
}

// --- runs ---

TEST(Calibrated, FindsTheEventsOfTheExactDetectorInFewerCalls)
{
    const Options options{.t_end = 50, .step = 0.01};
    const auto exact = integrate(Shuttle{}, at_centre, options, Fixed{});
    const auto gated =
        integrate(Shuttle{}, at_centre, options, Fixed{},
                  Calibrated(gates::Gate(true_horizons({0.02, 0.04, 0.08, 0.16, 0.32}))));
    ASSERT_EQ(exact.events.size(), 25U);
    expect_same_events(exact, gated);
    const Statistics& s = gated.statistics;
    EXPECT_EQ(s.steps, exact.statistics.steps);
    EXPECT_GT(s.evidence.gated, 4000U);  // of 5000 steps
    EXPECT_EQ(s.evidence.gated, s.checks_deferred);
    EXPECT_EQ(s.evidence.proved, 0U);
    EXPECT_GT(s.network_calls, 100U);
    EXPECT_EQ(s.outside_domain, 0U);
    // A flight of 200 steps is covered in at most 0.32 s at a time, and each event is located in
    // some 50 bisections.
    EXPECT_LT(s.guard_calls, exact.statistics.guard_calls / 2);
    EXPECT_EQ(s.rollbacks, 0U);
}

TEST(Calibrated, ComesBackToAnEventThatTheGateDidNotSeeComing)
{
    // Always clears 0.32 s. Beyond a wall the point stays there, so that the check finds it.
    Model bold = true_horizons({0.32});
    bold.levels[0].threshold = 1e9;
    const Options options{.t_end = 50, .step = 0.01};
    const auto exact = integrate(Shuttle{}, at_centre, options, Fixed{});
    const auto gated =
        integrate(Shuttle{}, at_centre, options, Fixed{}, Calibrated(gates::Gate(bold)));
    expect_same_events(exact, gated);
    EXPECT_GT(gated.statistics.rollbacks, 20U);
}

TEST(Calibrated, ChecksEveryStepOutsideOfItsBoxAndCountsThem)
{
    Model model = true_horizons({0.02, 0.04, 0.08});
    model.domain[0] = {-1, 0};  // half of the path
    const Options options{.t_end = 50, .step = 0.01};
    const auto exact = integrate(Shuttle{}, at_centre, options, Fixed{});
    const auto gated =
        integrate(Shuttle{}, at_centre, options, Fixed{}, Calibrated(gates::Gate(model)));
    expect_same_events(exact, gated);
    EXPECT_GT(gated.statistics.outside_domain, 2400U);
    EXPECT_GT(gated.statistics.guard_calls, 2500U);
    model.domain[0] = {5, 6};
    const auto outside =
        integrate(Shuttle{}, at_centre, options, Fixed{}, Calibrated(gates::Gate(model)));
    expect_same_events(exact, outside);
    EXPECT_EQ(outside.statistics.evidence.gated, 0U);
}

TEST(CalibratedBounds, ChecksLessThanThePlannerAlone)
{
    // Without looking ahead; otherwise the planner closes half a flight by two checks.
    const PlannerOptions planning{.two_ended = false};
    const Options options{.t_end = 50, .step = 0.01};
    const Measured::State start{0, 1};
    const auto exact = integrate(Measured{}, start, options, Fixed{});
    const auto planned = integrate(Measured{}, start, options, Fixed{}, Planned(planning));
    const auto gated = integrate(Measured{}, start, options, Fixed{},
                                 CalibratedBounds(gates::Gate(true_levels()), planning));
    expect_same_events(exact, planned);
    expect_same_events(exact, gated);
    EXPECT_LT(gated.statistics.guard_calls, planned.statistics.guard_calls);
    EXPECT_GT(gated.statistics.evidence.gated, 4000U);
    EXPECT_EQ(gated.statistics.evidence.proved, 0U);
}

// --- the verified gate: any weights, the same events ---

std::vector<std::vector<double>> weights_to_try(std::size_t n)
{
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    std::vector<std::vector<double>> out;
    for (int k = 0; k < 6; ++k) {
        std::vector<double> w(n);
        for (double& value : w) value = normal(random) * (k < 4 ? 1 : 1e6);
        out.push_back(w);
    }
    for (const double value : {-1e30, 1e30, std::nan(""), inf, -inf}) {
        out.emplace_back(n, value);
    }
    return out;
}

template <class System>
void expect_verified(const System& system, std::size_t inputs, const Options& options,
                     std::size_t least_events)
{
    const auto exact = integrate(system, system.start(), options, Fixed{});
    EXPECT_GE(exact.events.size(), least_events);
    for (const std::vector<double>& w : weights_to_try(4 * inputs)) {
        Model model;
        model.kind = "gate-horizon";
        model.system = System::name;
        model.recipe = "state";
        model.offset.assign(inputs, 0);
        model.scale.assign(inputs, 1);
        model.domain.assign(inputs, {-inf, inf});
        model.step_max = 1;
        model.layers = {{inputs, 4, w, {0, 0, 0, 0}}};
        for (const double tau : {0.004, 0.016, 0.064, 0.2}) {
            model.levels.push_back({.value = tau, .threshold = 0});
        }
        const auto seen =
            integrate(system, system.start(), options, Fixed{}, Foreseen(gates::Gate(model)));
        expect_same_events(exact, seen);
        EXPECT_EQ(seen.statistics.evidence.gated, 0U);
    }
}

TEST(Foreseen, KeepsTheEventsOfAnArmWithAnyWeights)
{
    expect_verified(PlanarArm<2>(), 4, {.t_end = 5, .step = 2e-3}, 2);
}

TEST(Foreseen, KeepsTheEventsOfACavernWithAnyWeights)
{
    expect_verified(Cavern({.segments = 1000}), 4, {.t_end = 20, .step = 2e-3}, 2);
}

TEST(Foreseen, KeepsTheEventsOfAnEigenvalueWithAnyWeights)
{
    expect_verified(LeastEigenvalue({.level = 1.55}), 4, {.t_end = 6, .step = 4e-3}, 1);
}

}  // namespace
}  // namespace ricochet::gate_models_test
