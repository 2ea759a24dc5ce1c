// Proofs about networks: bounds, branch and bound, certificates.
#include "ricochet/learn/certify.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "learn/bounds.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/gate.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::certify_test {
namespace {

namespace fs = std::filesystem;
using learn::Random;

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Weights uniform in [-scale, scale] / sqrt(inputs).
Model random_network(const std::vector<std::size_t>& widths, double scale, Precision precision,
                     Random& random)
{
    Model model;
    model.system = "room";
    model.recipe = "state";
    model.precision = precision;
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
        DenseLayer layer{.inputs = widths[k], .outputs = widths[k + 1], .weight = {}, .bias = {}};
        const double limit = scale / std::sqrt(static_cast<double>(widths[k]));
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(random.uniform(-limit, limit));
        }
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            layer.bias.push_back(random.uniform(-limit, limit));
        }
        model.layers.push_back(layer);
    }
    for (std::size_t i = 0; i < widths.front(); ++i) {
        model.offset.push_back(random.uniform(-0.5, 0.5));
        model.scale.push_back(random.uniform(0.5, 2));
        model.domain.push_back({-1, 1});
    }
    return model;
}

/// The network in long double: 11 bits more than the arithmetic of the bounds.
long double exact_logit(const Model& model, const std::vector<double>& features)
{
    std::vector<long double> x;
    for (std::size_t i = 0; i < features.size(); ++i) {
        x.push_back((static_cast<long double>(features[i]) - model.offset[i]) * model.scale[i]);
    }
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const DenseLayer& layer = model.layers[k];
        std::vector<long double> y;
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            const auto weight = [&](double w) {
                return model.precision == Precision::f32
                           ? static_cast<long double>(static_cast<float>(w))
                           : static_cast<long double>(w);
            };
            long double sum = weight(layer.bias[j]);
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                sum += weight(layer.weight[j * layer.inputs + i]) * x[i];
            }
            y.push_back(k + 1 < model.layers.size() ? std::max(sum, 0.0L) : sum);
        }
        x = y;
    }
    return x[0];
}

struct RandomBox {
    std::vector<double> lower, upper;
};

/// Edges from zero to the whole domain.
RandomBox random_box(std::size_t n, Random& random)
{
    RandomBox box;
    for (std::size_t i = 0; i < n; ++i) {
        const double width = random.chance(0.1) ? 0 : random.log_uniform(1e-9, 2);
        const double lower = random.uniform(-1, 1 - width);
        box.lower.push_back(lower);
        box.upper.push_back(std::min(lower + width, 1.0));
    }
    return box;
}

ValueRange bounds_of(const NetworkBounds& bounds, const RandomBox& box)
{
    NetworkBounds::Scratch scratch(bounds);
    std::array<double, NetworkBounds::max_inputs> influence{};
    return bounds.over(box.lower.data(), box.upper.data(), inf, scratch, influence.data());
}

TEST(NetworkBounds, HoldsEverySampledLogitExactAndComputed)
{
    Random random(1);
    for (int n = 1; n <= 9; ++n) {
        for (const Precision precision : {Precision::f32, Precision::f64}) {
            const auto inputs = static_cast<std::size_t>(n);
            const Model model = random_network({inputs, 13, 10, 1}, 2, precision, random);
            const NetworkBounds bounds(model);
            const Classifier classifier(model);
            for (int k = 0; k < 60; ++k) {
                const RandomBox box = random_box(inputs, random);
                const ValueRange range = bounds_of(bounds, box);
                for (int sample = 0; sample < 40; ++sample) {
                    std::vector<double> x(inputs);
                    for (std::size_t i = 0; i < inputs; ++i) {
                        x[i] = sample < 20          ? random.uniform(box.lower[i], box.upper[i])
                               : random.chance(0.5) ? box.lower[i]
                                                    : box.upper[i];
                        x[i] = std::clamp(x[i], box.lower[i], box.upper[i]);
                    }
                    const double computed = classifier.logit(x.data());
                    const long double exact = exact_logit(model, x);
                    ASSERT_LE(range.lower, computed);
                    ASSERT_GE(range.upper, computed);
                    ASSERT_LE(static_cast<long double>(range.lower), exact);
                    ASSERT_GE(static_cast<long double>(range.upper), exact);
                    ASSERT_LE(std::fabs(static_cast<double>(exact - computed)),
                              bounds.evaluation_error());
                }
            }
        }
    }
}

TEST(NetworkBounds, OfOnePointAreAsTightAsTheRoundingOfItsEvaluation)
{
    // At a point no ReLU is undecided (except for one that is zero to rounding), so the bounds
    // are the logit +- the evaluation error, plus rounding in double.
    Random random(2);
    for (const Precision precision : {Precision::f32, Precision::f64}) {
        const Model model = random_network({3, 16, 16, 1}, 2, precision, random);
        const NetworkBounds bounds(model);
        const double allowed = 2 * bounds.evaluation_error() + 1e-11;
        EXPECT_LT(allowed, precision == Precision::f32 ? 1e-3 : 1e-10);
        for (int k = 0; k < 100; ++k) {
            RandomBox box = random_box(3, random);
            box.upper = box.lower;
            const ValueRange range = bounds_of(bounds, box);
            EXPECT_LE(range.upper - range.lower, 2 * allowed);
            EXPECT_GT(range.upper - range.lower, 0);
        }
    }
}

TEST(NetworkBounds, AreOutwardWhereThereIsNothingButRounding)
{
    // Without a hidden layer the range over a box is attained at two corners; the bounds must hold
    // these in long double, and may be wider by a few units in the last place of the terms only.
    Random random(3);
    for (int k = 0; k < 300; ++k) {
        const Model model = random_network({4, 1}, 1e3, Precision::f64, random);
        const NetworkBounds bounds(model);
        const RandomBox box = random_box(4, random);
        std::vector<double> low(4), high(4);
        double size = std::fabs(model.layers[0].bias[0]);
        for (std::size_t i = 0; i < 4; ++i) {
            const bool rises = model.layers[0].weight[i] > 0;
            low[i] = rises ? box.lower[i] : box.upper[i];
            high[i] = rises ? box.upper[i] : box.lower[i];
            size += std::fabs(model.layers[0].weight[i]) * 3;  // |x| <= (1 + 0.5) 2
        }
        const ValueRange range = bounds_of(bounds, box);
        const auto lowest = static_cast<double>(exact_logit(model, low));
        const auto highest = static_cast<double>(exact_logit(model, high));
        ASSERT_LE(range.lower, lowest);
        ASSERT_GE(range.upper, highest);
        ASSERT_GE(range.lower, lowest - 200 * 0x1p-53 * size);
        ASSERT_LE(range.upper, highest + 200 * 0x1p-53 * size);
    }
}

TEST(NetworkBounds, OfPartsAreInsideThoseOfTheWholeUpToTheRelaxation)
{
    // Repeated halving of a box must converge to the true range: bounds that do not converge prove
    // nothing. At 2^-12 of the domain hardly a ReLU is undecided.
    Random random(4);
    const Model model = random_network({2, 16, 16, 1}, 2, Precision::f64, random);
    const NetworkBounds bounds(model);
    for (int k = 0; k < 100; ++k) {
        RandomBox box;
        for (int i = 0; i < 2; ++i) {
            box.lower.push_back(random.uniform(-1, 0.9));
            box.upper.push_back(box.lower.back() + 0x1p-12);
        }
        double low = inf, high = -inf;
        for (const double x : {box.lower[0], box.upper[0]}) {
            for (const double y : {box.lower[1], box.upper[1]}) {
                const auto z = static_cast<double>(exact_logit(model, {x, y}));
                low = std::min(low, z);
                high = std::max(high, z);
            }
        }
        const ValueRange range = bounds_of(bounds, box);
        // Slopes are at most some 30 here, and a bend changes the range by a fraction of that.
        EXPECT_GE(range.lower, low - 30 * 0x1p-12);
        EXPECT_LE(range.upper, high + 30 * 0x1p-12);
    }
}

template <class Error, class Make>
std::string sentence(const Make& make)
{
    try {
        make();
    } catch (const Error& error) {
        return error.what();
    }
    return "accepted";
}

TEST(NetworkBounds, RefusesHostileNetworks)
{
    Random random(5);
    const Model good = random_network({2, 8, 1}, 1, Precision::f32, random);
    const auto refusal = [&](const auto& spoil) {
        Model model = good;
        spoil(model);
        return sentence<std::invalid_argument>([&] { NetworkBounds{model}; });
    };
    for (const double w : {nan, inf, -inf, 1e39}) {  // 1e39 is infinite as float
        EXPECT_NE(refusal([w](Model& m) { m.layers[1].weight[3] = w; }).find("layer 1"),
                  std::string::npos);
        EXPECT_NE(refusal([w](Model& m) { m.layers[0].bias[3] = w; }).find("layer 0"),
                  std::string::npos);
    }
    EXPECT_NE(refusal([](Model& m) {
                  for (double& w : m.layers[0].weight) w = 1e30;
                  for (double& w : m.layers[1].weight) w = 1e30;
              }).find("could overflow"),
              std::string::npos);
    EXPECT_NE(refusal([](Model& m) { m.activation = Activation::tanh; }).find("ReLU"),
              std::string::npos);
    EXPECT_NE(refusal([](Model& m) { m.domain[1].upper = inf; }).find("feature 1"),
              std::string::npos);
    EXPECT_NE(refusal([](Model& m) { m.domain.clear(); }).find("domain"), std::string::npos);
    EXPECT_NE(refusal([](Model& m) { m.scale[0] = nan; }).find("feature 0"), std::string::npos);
    EXPECT_EQ(refusal([](Model&) {}), "accepted");
}

// --- a room with a pillar ---

/// Distance to the walls of a square room and to a pillar in it; a state of two components.
struct Room {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    static constexpr std::string_view name = "room";
    double pillar = 0.3;  ///< radius
    double slack = 1;     ///< of the guard per unit of distance

    static void flow(double, const State&, State& dxdt) { dxdt = {1, 0.3}; }
    [[nodiscard]] double guard(double, const State& x) const
    {
        const double wall = 1 - std::max(std::fabs(x[0]), std::fabs(x[1]));
        return std::min(wall, std::hypot(x[0], x[1]) - pillar);
    }
    [[nodiscard]] double guard_slack(const State& half) const
    {
        return slack * std::hypot(half[0], half[1]) + 1e-14;
    }
    [[nodiscard]] static std::optional<double> parameter(std::string_view name)
    {
        return name == "size" ? std::optional(1.0) : std::nullopt;
    }
};
static_assert(SlackedGuard<Room, Room::State>);

/// logit = max of a(|x|), b(|y|) and a roof over the pillar, constructed by hand: below -0.25 the
/// guard is clear by about a quarter.
Model room_model()
{
    Model model;
    model.system = "room";
    model.recipe = "state";
    model.parameters = {{"size", 1.0}};
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.domain = {{-1, 1}, {-1, 1}};
    model.threshold = 0.5;
    // Hidden: relu(|x|'s parts - 0.6) for the walls, relu(0.7 - |x| - |y|) by its four faces is
    // not affine, so the second layer makes it from |x| and |y|.
    model.layers.push_back(
        {.inputs = 2, .outputs = 4, .weight = {1, 0, -1, 0, 0, 1, 0, -1}, .bias = {0, 0, 0, 0}});
    model.layers.push_back({.inputs = 4,
                            .outputs = 3,
                            .weight = {1, 1, 0, 0, 0, 0, 1, 1, -1, -1, -1, -1},
                            .bias = {-0.6, -0.6, 0.8}});
    model.layers.push_back({.inputs = 3, .outputs = 1, .weight = {5, 5, 5}, .bias = {0}});
    return model;
}

learn::GuardProblem room_problem(const Room& room = {})
{
    return learn::guard_problem(room, room_model(), Room::State{});
}

TEST(Certify, ProvesARoomAndSearchFindsNoState)
{
    // A guard of at most 0.05 needs |x| or |y| >= 0.95, or a distance of at most 0.35 from the
    // middle: there |x| + |y| <= 0.35 sqrt 2 < 0.495. So the lowest logit within the margin is
    // 5 min(0.35, 0.305) = 1.525, at the pillar.
    const learn::CertifiedModel out =
        learn::certify(room_model(), room_problem(), {.margin = 0.05});

    ASSERT_EQ(out.report.outcome, learn::CertifyOutcome::proved);
    EXPECT_LE(out.model.threshold, 1.5252);
    EXPECT_GE(out.model.threshold, 1.4);
    EXPECT_EQ(why_void(out.model), "");
    const learn::LowestLogit worst =
        learn::lowest_logit(out.model, room_problem(), 0.05, 200'000, 7);
    EXPECT_GE(worst.logit, out.model.threshold);
    EXPECT_LE(worst.logit, 1.54);  // the search does come near

    const CertifiedClassifier certified(out.model);
    Random random(3);
    const Room room;
    int clears = 0;
    int far = 0;
    for (int i = 0; i < 20'000; ++i) {
        const Room::State x{random.uniform(-1.2, 1.2), random.uniform(-1.2, 1.2)};
        const bool inside = std::max(std::fabs(x[0]), std::fabs(x[1])) <= 1;
        if (inside && room.guard(0, x) > 0.2) ++far;
        if (!certified.clears(x.data())) {
            EXPECT_EQ(certified.lower_bound(x.data()), -inf);
            continue;
        }
        ++clears;
        EXPECT_TRUE(inside);
        EXPECT_GT(room.guard(0, x), 0.05);
        EXPECT_EQ(certified.lower_bound(x.data()), 0.05);
    }
    EXPECT_GT(clears, far / 2);
    const Room::State unknown{nan, 0};
    EXPECT_FALSE(certified.clears(unknown.data()));
}

TEST(Certify, LevelsBoundTheGuardByTheirMargins)
{
    const learn::CertifiedModel out =
        learn::certify(room_model(), room_problem(), {.margin = 0.02, .levels = 4});
    ASSERT_EQ(out.report.outcome, learn::CertifyOutcome::proved);
    const CertifiedClassifier certified(out.model);
    ASSERT_EQ(certified.certificate().levels.size(), 4U);
    EXPECT_EQ(certified.certificate().levels[3].margin, 0.16);
    Random random(4);
    const Room room;
    std::array<int, 5> seen{};
    for (int i = 0; i < 20'000; ++i) {
        const Room::State x{random.uniform(-1, 1), random.uniform(-1, 1)};
        const double bound = certified.lower_bound(x.data());
        EXPECT_GT(room.guard(0, x), bound);
        ++seen[bound < 0 ? 0 : static_cast<std::size_t>(std::lround(std::log2(bound / 0.01)))];
    }
    EXPECT_GT(seen[0], 0);
    EXPECT_GT(seen[4], 1000);  // far states get the largest bound
}

TEST(Certify, RefutesAThresholdThatIsTooHighWithAState)
{
    Model model = room_model();
    model.threshold = 1.7;  // above 1.525, see above
    const auto problem = room_problem();
    const learn::CertifiedModel out =
        learn::certify(model, problem, {.margin = 0.05, .search = false});
    ASSERT_EQ(out.report.outcome, learn::CertifyOutcome::refuted);
    ASSERT_EQ(out.report.counterexample.size(), 2U);
    EXPECT_LT(Classifier(model).logit(out.report.counterexample.data()), 1.7);
    EXPECT_LE(problem.guard(out.report.counterexample.data()), 0.05);
    EXPECT_TRUE(out.model.certificate.empty());
}

TEST(Certify, ListsUnprovedBoxesThatAreAskedExactly)
{
    // So near to the provable limit that boxes of 1/32 of the domain do not suffice.
    Model model = room_model();
    model.threshold = 1.45;
    const learn::CertifiedModel out = learn::certify(
        model, room_problem(), {.margin = 0.05, .search = false, .smallest = 1.0 / 32});
    ASSERT_EQ(out.report.outcome, learn::CertifyOutcome::partly_proved);
    EXPECT_EQ(out.model.threshold, 1.45);
    const auto& level = out.report.levels.front();
    ASSERT_FALSE(level.unproved.empty());

    const CertifiedClassifier certified(out.model);
    ASSERT_EQ(certified.certificate().levels[0].unproved.size(), level.unproved.size());
    int kept_back = 0;
    for (const auto& box : level.unproved) {
        EXPECT_LE(box[0].upper - box[0].lower, 2.0 / 32);
        for (const double x : {box[0].lower, box[0].upper}) {
            for (const double y : {box[1].lower, box[1].upper}) {
                const Room::State corner{x, y};
                EXPECT_FALSE(certified.clears(corner.data()));
                if (certified.classifier().logit(corner.data()) < 1.45) ++kept_back;
            }
        }
    }
    EXPECT_GT(kept_back, 0);  // otherwise the list would be useless

    const learn::CertifiedModel fewer =
        learn::certify(model, room_problem(),
                       {.margin = 0.05, .search = false, .smallest = 1.0 / 32, .max_unproved = 1});
    EXPECT_EQ(fewer.report.outcome, learn::CertifyOutcome::not_provable);
    EXPECT_TRUE(fewer.model.certificate.empty());
}

TEST(Certify, AWrongSlackIsNamedWithBothStates)
{
    const std::string said = sentence<std::invalid_argument>([] {
        static_cast<void>(learn::certify(room_model(), room_problem({.slack = 0.3}),
                                         {.margin = 0.05, .threads = 2}));
    });
    EXPECT_NE(said.find("guard_slack is wrong: the guard is "), std::string::npos) << said;
    EXPECT_NE(said.find("is declared"), std::string::npos) << said;
}

/// The room, which also knows its least guard over a box.
struct MeasuredRoom : Room {
    double raised = 0;  ///< added to the bound

    [[nodiscard]] double guard_least(const State& lower, const State& upper) const
    {
        double furthest = 0;
        State nearest{};  // to the middle of the room
        for (std::size_t i = 0; i < 2; ++i) {
            furthest = std::max({furthest, std::fabs(lower[i]), std::fabs(upper[i])});
            nearest[i] = std::clamp(0.0, lower[i], upper[i]);
        }
        const double pillar_gap = std::hypot(nearest[0], nearest[1]) - pillar;
        return std::min(1 - furthest, pillar_gap) - 1e-14 + raised;
    }
};
static_assert(LeastGuard<MeasuredRoom, Room::State> && !LeastGuard<Room, Room::State>);

learn::GuardProblem measured_problem(double raised = 0)
{
    MeasuredRoom room;
    room.raised = raised;
    return learn::guard_problem(room, room_model(), Room::State{});
}

TEST(Certify, ALeastGuardProvesTheSameWithFewerBoxes)
{
    const learn::CertifyOptions options{.margin = 0.05, .search = false};
    Model model = room_model();
    model.threshold = 1.45;
    const auto by_slack = learn::certify(model, room_problem(), options);
    const auto by_least = learn::certify(model, measured_problem(), options);
    ASSERT_EQ(by_slack.report.outcome, learn::CertifyOutcome::proved);
    ASSERT_EQ(by_least.report.outcome, learn::CertifyOutcome::proved);
    EXPECT_LT(by_least.report.levels[0].boxes, by_slack.report.levels[0].boxes);
    model.threshold = 1.7;  // a state with a guard of 0.05 has a logit of 1.525
    EXPECT_EQ(learn::certify(model, measured_problem(), options).report.outcome,
              learn::CertifyOutcome::refuted);
}

TEST(Certify, AWrongLeastGuardIsNamedAndOneThatIsNoNumberProvesNothing)
{
    const std::string said = sentence<std::invalid_argument>([] {
        static_cast<void>(
            learn::certify(room_model(), measured_problem(0.4), {.margin = 0.01, .closest = 1e-3}));
    });
    EXPECT_NE(said.find("guard_least is wrong: the guard is "), std::string::npos) << said;

    Model model = room_model();
    model.threshold = 1;
    const auto out = learn::certify(model, measured_problem(nan),
                                    {.margin = 0.05, .search = false, .smallest = 1.0 / 16});
    ASSERT_EQ(out.report.outcome, learn::CertifyOutcome::partly_proved);
    const CertifiedClassifier certified(out.model);
    Random random(6);
    for (int i = 0; i < 1000; ++i) {
        const Room::State x{random.uniform(-1, 1), random.uniform(-1, 1)};
        EXPECT_FALSE(certified.clears(x.data()));
    }
}

/// The room's network as a gate, whose thresholds are far too high.
Model gate_model()
{
    Model model = room_model();
    model.kind = "gate-level";
    model.levels = {{.value = 0.03, .threshold = 3}, {.value = 0.1, .threshold = 2.5}};
    model.calibration = {.events = 100, .misses = 0, .miss_bound = 0.03, .steps = 1000, .seed = 1};
    return model;
}

TEST(Certify, AGateOfLevelsKeepsWhatIsProvedOfEachLevel)
{
    for (const auto& problem : {room_problem(), measured_problem()}) {
        const auto out = learn::certify(gate_model(), problem, {});
        ASSERT_TRUE(out.proved());
        ASSERT_EQ(out.model.levels.size(), 2U);
        EXPECT_EQ(out.model.levels[0].value, 0.03);
        EXPECT_EQ(out.model.levels[1].value, 0.1);
        // At the pillar a guard of r has a logit of at least 5 (0.8 - (0.3 + r) sqrt 2), which is
        // 1.67 and 1.17.
        EXPECT_LE(out.model.levels[0].threshold, 1.6667);
        EXPECT_LE(out.model.levels[1].threshold, 1.1717);
        EXPECT_GE(out.model.levels[1].threshold, 0.9);
        EXPECT_EQ(out.model.calibration.events, 0U);
        EXPECT_EQ(why_void(out.model), "");

        const gates::Gate gate(out.model);
        const CertifiedClassifier certified(out.model);
        Random random(9);
        int far = 0;
        for (int i = 0; i < 20'000; ++i) {
            const Room::State x{random.uniform(-1, 1), random.uniform(-1, 1)};
            const double cleared = gate.cleared(x.data());
            EXPECT_TRUE(cleared == 0 || Room{}.guard(0, x) > cleared);
            EXPECT_EQ(std::max(certified.lower_bound(x.data()), 0.0), cleared);
            far += cleared == 0.1 ? 1 : 0;
        }
        EXPECT_GT(far, 5000);

        Model bolder = out.model;
        bolder.levels[1].threshold += 0.01;
        EXPECT_NE(why_void(bolder).find("above 0.1"), std::string::npos);
        bolder = out.model;
        bolder.levels[1].value = 0.2;
        EXPECT_NE(why_void(bolder), "");
        Model shier = out.model;
        shier.levels[1].threshold -= 0.01;
        EXPECT_EQ(why_void(shier), "");
    }
}

TEST(Certify, AGateOfHorizonsIsRefused)
{
    Model model = gate_model();
    model.kind = "gate-horizon";
    EXPECT_NE(sentence<std::invalid_argument>([&] {
                  static_cast<void>(learn::certify(model, room_problem(), {}));
              }).find("horizons"),
              std::string::npos);
    EXPECT_NE(sentence<std::invalid_argument>([&] {
                  static_cast<void>(
                      learn::certify(room_model(), room_problem(), {.margins = {0.1, 0.05}}));
              }).find("rise"),
              std::string::npos);
}

TEST(Certify, DoesNotTrustASlackOrGuardThatIsNotANumber)
{
    // The logit is then the only means of proof: states that may be cleared remain unproved.
    Model model = room_model();
    model.threshold = 1;
    auto no_slack = room_problem();
    no_slack.slack = [](const double*) { return nan; };
    auto no_guard = room_problem();
    no_guard.guard = [](const double*) { return nan; };
    for (const auto& problem : {no_slack, no_guard}) {
        const learn::CertifiedModel out =
            learn::certify(model, problem, {.margin = 0.05, .search = false, .smallest = 1.0 / 16});
        ASSERT_EQ(out.report.outcome, learn::CertifyOutcome::partly_proved);
        const CertifiedClassifier certified(out.model);
        Random random(6);
        for (int i = 0; i < 1000; ++i) {
            const Room::State x{random.uniform(-1, 1), random.uniform(-1, 1)};
            EXPECT_FALSE(certified.clears(x.data()));
        }
    }
}

std::string without_times(const Model& model)
{
    Certificate certificate = parse_certificate(model.certificate);
    for (CertificateLevel& level : certificate.levels) level.seconds = 0;
    return to_text(certificate);
}

class CertifyFiles : public testing::Test {
protected:
    CertifyFiles()
    {
        fs::remove_all(directory_);
        fs::create_directories(directory_);
    }
    ~CertifyFiles() override { fs::remove_all(directory_); }

    const fs::path directory_ =
        fs::temp_directory_path() / (std::string("ricochet-certify-") +
                                     testing::UnitTest::GetInstance()->current_test_info()->name());
    const fs::path checkpoint_ = directory_ / "checkpoint";
};

TEST_F(CertifyFiles, StoppedAndResumedItGivesTheSameRecordOnAnyNumberOfThreads)
{
    // Fine enough for some 1e5 boxes, so that the proof can be stopped.
    learn::CertifyOptions options{
        .margin = 0.01, .levels = 2, .closest = 1e-3, .smallest = 1.0 / 65536, .threads = 1};
    const std::string whole =
        without_times(learn::certify(room_model(), room_problem(), options).model);

    options.threads = 3;
    options.checkpoint = checkpoint_;
    learn::CertifiedModel out;
    int stops = 0;
    for (;;) {
        int calls = 0;
        out = learn::certify(room_model(), room_problem(), options,
                             [&](const learn::CertifyProgress& now) {
                                 EXPECT_EQ(now.levels, 2U);
                                 EXPECT_GT(now.estimate.boxes, 0);
                                 return ++calls < 3;
                             });
        if (out.report.outcome != learn::CertifyOutcome::interrupted) break;
        ASSERT_LT(++stops, 100);
        options.resume = true;
    }
    ASSERT_TRUE(out.proved());
    EXPECT_GT(stops, 0);
    EXPECT_EQ(without_times(out.model), whole);
}

TEST_F(CertifyFiles, OutOfTimeKeepsAPartialRecord)
{
    learn::CertifyOptions options{.margin = 0.01,
                                  .levels = 2,
                                  .closest = 1e-3,
                                  .smallest = 1.0 / 65536,
                                  .time_limit = 1e-6,
                                  .checkpoint = checkpoint_};
    const learn::CertifiedModel partial = learn::certify(room_model(), room_problem(), options);
    EXPECT_EQ(partial.report.outcome, learn::CertifyOutcome::out_of_time);
    EXPECT_TRUE(partial.model.certificate.empty());
    ASSERT_TRUE(fs::exists(checkpoint_));

    options.time_limit = inf;
    options.resume = true;
    const learn::CertifiedModel all = learn::certify(room_model(), room_problem(), options);
    EXPECT_TRUE(all.proved());

    // A checkpoint of another model or of another guard is refused, and so is a truncated one.
    const auto refusal = [&](const Model& model, const learn::GuardProblem& problem) {
        return sentence<std::runtime_error>(
            [&] { static_cast<void>(learn::certify(model, problem, options)); });
    };
    Model other = room_model();
    other.layers[0].bias[0] = 1e-3;
    EXPECT_NE(refusal(other, room_problem()).find("another model"), std::string::npos);
    EXPECT_NE(refusal(room_model(), room_problem({.pillar = 0.2})).find("another guard"),
              std::string::npos);
    fs::resize_file(checkpoint_, fs::file_size(checkpoint_) / 2);
    EXPECT_NE(refusal(room_model(), room_problem()).find("cut short"), std::string::npos);
    fs::remove(checkpoint_);
    EXPECT_NE(refusal(room_model(), room_problem()).find("cannot be read"), std::string::npos);
}

TEST_F(CertifyFiles, OutOfMemoryKeepsAPartialRecord)
{
    learn::CertifyOptions options{.margin = 0.01, .closest = 1e-3, .smallest = 1.0 / 65536};
    std::atomic<std::uint64_t> asked = 0;
    learn::GuardProblem counted = room_problem();
    counted.guard = [&, guard = counted.guard](const double* x) {
        ++asked;
        return guard(x);
    };
    const learn::CertifiedModel whole = learn::certify(room_model(), counted, options);
    ASSERT_TRUE(whole.proved());
    const std::uint64_t all = asked;

    // A guard that runs out of memory, at any time from the first call to the last but one in a
    // hundred: in a search, an estimate or a proof.
    options.checkpoint = checkpoint_;
    int partial = 0;
    for (const double share : {0.0, 0.3, 0.7, 0.99}) {
        options.resume = false;
        fs::remove(checkpoint_);
        std::atomic<bool> starved = true;
        asked = 0;
        learn::GuardProblem hungry = room_problem();
        hungry.guard = [&, guard = hungry.guard](const double* x) {
            // The first four calls compute the key of the checkpoint.
            if (starved && ++asked > 4 + static_cast<std::uint64_t>(share * (double(all) - 4))) {
                throw std::bad_alloc();
            }
            return guard(x);
        };
        const learn::CertifiedModel cut = learn::certify(room_model(), hungry, options);
        ASSERT_EQ(cut.report.outcome, learn::CertifyOutcome::out_of_memory);
        EXPECT_TRUE(cut.model.certificate.empty());
        EXPECT_NE(learn::describe(cut.report.outcome).find("memory"), std::string_view::npos);
        ASSERT_TRUE(fs::exists(checkpoint_));
        partial += fs::file_size(checkpoint_) > 1000 ? 1 : 0;
        starved = false;
        options.resume = true;
        const learn::CertifiedModel out = learn::certify(room_model(), hungry, options);
        EXPECT_TRUE(out.proved());
        EXPECT_EQ(without_times(out.model), without_times(whole.model));
    }
    EXPECT_GT(partial, 0);  // some of it was kept
}

TEST(Certify, EstimatesTheNumberOfBoxes)
{
    // Within a factor of two of the boxes that a proof then takes.
    for (const double threshold : {1.0, 1.3, 1.5, 1.52}) {
        Model model = room_model();
        model.threshold = threshold;
        const learn::CertifyOptions options{
            .margin = 0.05, .search = false, .smallest = 1.0 / 65536, .max_unproved = 100'000};
        const learn::Estimate e = learn::estimate(model, room_problem(), 0.05, threshold, options);
        const learn::CertifiedModel out = learn::certify(model, room_problem(), options);
        ASSERT_EQ(out.report.levels.size(), 1U);
        const auto boxes = static_cast<double>(out.report.levels[0].boxes);
        EXPECT_GT(e.boxes, boxes / 2);
        EXPECT_LT(e.boxes, boxes * 2);
    }
}

TEST(Certify, IsRefusedAboveTheLimit)
{
    const learn::CertifiedModel out = learn::certify(
        room_model(), room_problem(), {.margin = 0.05, .search = false, .limit = 1e-9});
    EXPECT_EQ(out.report.outcome, learn::CertifyOutcome::too_long);
    ASSERT_EQ(out.report.estimates.size(), 1U);
    EXPECT_GT(out.report.estimates[0].boxes, 0);
}

TEST(Certificate, IsVoidOnAnyChange)
{
    const Model good =
        learn::certify(room_model(), room_problem(), {.margin = 0.05, .levels = 2}).model;
    ASSERT_EQ(why_void(good), "");
    const auto why = [&](const auto& change) {
        Model model = good;
        change(model);
        EXPECT_THROW(CertifiedClassifier{model}, std::invalid_argument);
        return why_void(model);
    };
    EXPECT_NE(why([](Model& m) { m.threshold = std::nextafter(m.threshold, 9); }).find("threshold"),
              std::string::npos);
    EXPECT_NE(why([](Model& m) {
                  double& w = m.layers[1].weight[2];
                  w = static_cast<double>(std::nextafter(static_cast<float>(w), 9.0F));
              }).find("weights"),
              std::string::npos);
    EXPECT_NE(why([](Model& m) { m.layers[2].bias[0] = 1e-30; }).find("weights"),
              std::string::npos);
    EXPECT_NE(why([](Model& m) { m.parameters["size"] = 2; }).find("parameters"),
              std::string::npos);
    EXPECT_NE(why([](Model& m) { m.system = "cave"; }).find("cave"), std::string::npos);
    EXPECT_NE(why([](Model& m) { m.domain[1].upper = 1.5; }).find("domain"), std::string::npos);
    EXPECT_NE(why([](Model& m) { m.scale[0] = 2; }), "");
    EXPECT_NE(why([](Model& m) { m.offset[0] = 1e-9; }), "");
    EXPECT_NE(why([](Model& m) { m.precision = Precision::f64; }), "");
    EXPECT_NE(why([](Model& m) { m.activation = Activation::tanh; }), "");

    // A file preserves it.
    const Model again = parse_model(to_safetensors(good), "room");
    EXPECT_EQ(again.certificate, good.certificate);
    EXPECT_EQ(why_void(again), "");
    EXPECT_EQ(to_text(parse_certificate(good.certificate)), good.certificate);
}

TEST(Certificate, RefusesWhatIsNone)
{
    const std::string good =
        learn::certify(room_model(), room_problem(), {.margin = 0.05}).model.certificate;
    EXPECT_THROW(static_cast<void>(parse_certificate("yes")), std::invalid_argument);
    EXPECT_THROW(static_cast<void>(parse_certificate("{}")), std::invalid_argument);
    for (const std::string member : {"tool", "fingerprint", "system", "parameters", "box", "levels",
                                     "margin", "threshold", "boxes", "seconds", "unproved"}) {
        std::string spoilt = good;
        const auto at = spoilt.find('"' + member + '"');
        ASSERT_NE(at, std::string::npos);
        spoilt.replace(at + 1, 1, "#");
        EXPECT_NE(sentence<std::invalid_argument>([&] {
                      static_cast<void>(parse_certificate(spoilt));
                  }).find("'" + member + "'"),
                  std::string::npos);
    }
    for (std::size_t length = 0; length < good.size(); length += 7) {
        EXPECT_THROW(static_cast<void>(parse_certificate(std::string_view(good).substr(0, length))),
                     std::invalid_argument);
    }
    Model without = room_model();
    EXPECT_THROW(CertifiedClassifier{without}, std::invalid_argument);
}

TEST(Certify, RefusesWhatDoesNotFit)
{
    const auto refusal = [](const Model& model, const learn::CertifyOptions& options) {
        return sentence<std::invalid_argument>(
            [&] { static_cast<void>(learn::certify(model, room_problem(), options)); });
    };
    Model ballistic = room_model();
    ballistic.recipe = "ballistic";
    EXPECT_NE(refusal(ballistic, {}).find("'ballistic'"), std::string::npos);
    EXPECT_NE(refusal(room_model(), {.margin = -1}).find("margin"), std::string::npos);
    EXPECT_NE(refusal(room_model(), {.margin = nan}).find("margin"), std::string::npos);
    EXPECT_NE(refusal(room_model(), {.levels = 2}).find("positive margin"), std::string::npos);
    EXPECT_NE(refusal(room_model(), {.limit = 0}).find("limit"), std::string::npos);

    const auto misfit = [](const auto& change) {
        Model model = room_model();
        change(model);
        return sentence<std::invalid_argument>(
            [&] { static_cast<void>(learn::guard_problem(Room{}, model, Room::State{})); });
    };
    EXPECT_NE(misfit([](Model& m) { m.system = "hall"; }).find("'hall'"), std::string::npos);
    EXPECT_NE(misfit([](Model& m) { m.parameters["size"] = 3; }).find("size = 3"),
              std::string::npos);
    EXPECT_NE(misfit([](Model& m) { m.parameters["depth"] = 3; }).find("'depth'"),
              std::string::npos);
    EXPECT_NE(misfit([](Model& m) { m.recipe = "ballistic"; }).find("'ballistic'"),
              std::string::npos);
}

}  // namespace
}  // namespace ricochet::certify_test
