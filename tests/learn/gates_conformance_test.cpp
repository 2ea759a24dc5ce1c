// Applies the common suite to every gate: those that keep the events of their exact detector, and
// those that are trusted; and checks the answers of gates.
#include "conformance/gates.hpp"

#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/learn/certify.hpp"

namespace ricochet::test::gates_conformance_test {
namespace {

/// |x| below 0.9, 0.8 and 0.6 is proved to mean a guard above 0.1, 0.2 and 0.4.
Model certified_levels()
{
    Model model = shuttle_model("event-classifier", {0});
    model.domain = {{-1, 1}, {-2, 2}};
    model.threshold = 0.9 - 1e-6;
    return learn::certify(model, learn::guard_problem(Shuttle{}, model, Shuttle::State{0, 1}),
                          {.margin = 0.1, .levels = 3, .ratio = 2})
        .model;
}

GateCase keeping(GateCase gate, Evidence deferred)
{
    gate.keeps_events = gate.returns = true;
    gate.deferred = deferred;
    gate.saves = gate.plans = deferred == Evidence::proved;
    return gate;
}

std::vector<GateCase> keeping_gates()
{
    const auto verified = [](const Model& model) { return Verified<>(BareNetwork(model)); };
    const auto foreseen = [](const Model& model) { return Foreseen<>(gates::Gate(model)); };
    const auto certified = [](const Model& model) { return Certified<>(model); };
    // By counts: decisions by a clock differ from run to run.
    const MeterOptions counted{
        .decision = MeterOptions::Decision::counted, .guard = 1e-6, .network = 1e-7, .step = 1e-7};
    std::vector<GateCase> gates{
        // Without a bound to cover an interval it saves nothing: every step is checked.
        keeping(any_gate("Verified", true_prediction(), verified), Evidence::checked),
        keeping(any_gate("Foreseen", true_horizons(), foreseen), Evidence::proved),
        keeping(any_gate("Certified", certified_levels(), certified), Evidence::proved),
        keeping(any_gate("MeteredVerified", true_prediction(),
                         [=](const Model& model) { return Metered(verified(model), counted); }),
                Evidence::checked),
        keeping(any_gate("MeteredForeseen", true_horizons(),
                         [=](const Model& model) { return Metered(foreseen(model), counted); }),
                Evidence::proved)};
    gates[2].refuses_other_weights = true;
    gates[2].returns = false;
    return gates;
}

GateCase trusted(GateCase gate, Evidence deferred)
{
    gate.deferred = deferred;
    return gate;
}

std::vector<GateCase> trusted_gates()
{
    const auto network = [](const Model& model) { return BareNetwork(model); };
    const auto calibrated = [](const Model& model) { return Calibrated<>(gates::Gate(model)); };
    const auto bounds = [](const Model& model) { return CalibratedBounds<>(gates::Gate(model)); };
    std::vector<GateCase> gates{
        trusted(any_gate<Ends>("Network", true_prediction(), network), Evidence::assumed),
        trusted(any_gate("Calibrated", true_horizons(), calibrated), Evidence::gated),
        trusted(any_gate("CalibratedBounds", true_levels(), bounds), Evidence::gated)};
    gates[1].returns = true;
    gates[2].plans = true;
    return gates;
}

INSTANTIATE_TEST_SUITE_P(Keeping, GateSuite, testing::ValuesIn(keeping_gates()),
                         [](const auto& info) { return info.param.name; });
INSTANTIATE_TEST_SUITE_P(Trusted, GateSuite, testing::ValuesIn(trusted_gates()),
                         [](const auto& info) { return info.param.name; });

/// The expected answer of a gate, from |x| and its levels.
double expected(const Model& model, double x)
{
    double cleared = 0;
    for (std::size_t k = 0; k < model.levels.size(); ++k) {
        const std::size_t output = model.layers.back().outputs == 1 ? 0 : k;
        const double logit = std::fabs(x) + model.layers.back().bias[output];
        if (!(logit < model.levels[k].threshold)) break;
        cleared = model.levels[k].value;
    }
    return cleared;
}

TEST(Gate, ClearsTheLargestLevelThatItsNetworkSpeaksFor)
{
    for (const Model& model : {true_horizons(), true_levels()}) {
        const gates::Gate gate(model);
        for (double x = -1.4995; x < 1.5; x += 0.001) {
            const gates::Gate::Answer answer =
                gate.ask(Shuttle{}, 0, 0, std::array<double, 2>{x, 1});
            EXPECT_EQ(answer.cleared, expected(model, x)) << x;
            EXPECT_FALSE(answer.outside);
            // The gate never clears a level above the true guard.
            const double wall = 1 - std::fabs(x);
            EXPECT_LE(answer.cleared, std::max(wall, 0.0));
        }
    }
}

TEST(Gate, AHorizonIsClearedOnlyWithAllShorterOnes)
{
    Model model = true_horizons();
    model.levels[0].threshold = -1e9;
    const gates::Gate gate(model);
    EXPECT_EQ(gate.ask(Shuttle{}, 0, 0, std::array<double, 2>{0, 1}).cleared, 0);
}

TEST(Gate, OutsideOfItsBoxOrOfWhatIsNoNumberNothingIsCleared)
{
    const double nan = std::nan("");
    for (const Model& model : {true_horizons(), true_levels()}) {
        const gates::Gate gate(model);
        for (const std::array<double, 2>& x : {std::array{0.0, 2.1}, std::array{-1.6, 0.0},
                                               std::array{nan, 0.0}, std::array{0.0, nan}}) {
            const gates::Gate::Answer answer = gate.ask(Shuttle{}, 0, 0, x);
            EXPECT_TRUE(answer.outside);
            EXPECT_EQ(answer.cleared, 0);
        }
        Model weights = model;
        weights.layers[0].weight[0] = nan;
        EXPECT_EQ(gates::Gate(weights).ask(Shuttle{}, 0, 0, std::array{0.1, 0.0}).cleared, 0);
    }
}

TEST(CertifiedGate, NeverClearsMoreThanIsProved)
{
    const Certified<> gate(certified_levels());
    const Shuttle shuttle;
    int cleared = 0;
    for (double x = -1; x <= 1; x += 1.0 / 1024) {
        for (const double v : {-2.0, 0.3, 2.0}) {
            const std::array<double, 2> at{x, v};
            const gates::Gate::Answer answer = gate.level(shuttle, 0, 0, 0, at);
            EXPECT_FALSE(answer.outside);
            EXPECT_LE(answer.cleared, std::max(shuttle.guard(0, at), 0.0)) << x;
            cleared += answer.cleared > 0;
            // The gate is for the first guard in the first mode.
            EXPECT_EQ(gate.level(shuttle, 1, 0, 0, at).cleared, 0);
            EXPECT_EQ(gate.level(shuttle, 0, 1, 0, at).cleared, 0);
        }
    }
    EXPECT_GT(cleared, 3 * 1024);
    for (const std::array<double, 2>& at :
         {std::array{1.1, 0.0}, std::array{0.0, 2.1}, std::array{std::nan(""), 0.0}}) {
        EXPECT_TRUE(gate.level(shuttle, 0, 0, 0, at).outside);
        EXPECT_EQ(gate.level(shuttle, 0, 0, 0, at).cleared, 0);
    }
}

}  // namespace
}  // namespace ricochet::test::gates_conformance_test
