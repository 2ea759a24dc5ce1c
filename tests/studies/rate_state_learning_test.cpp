// Learned potentials of friction: the pair, its file, its derivatives, its training.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "additive_pairs.hpp"
#include "learn_steps/friction_models.hpp"
#include "ricochet/learn_steps/train_friction.hpp"
#include "studies/along_history.hpp"
#include "studies/friction_study.hpp"

namespace ricochet::rate_state_learning_test {
namespace {

AdditivePair::Parameters in_domain(AdditivePair::Parameters p)
{
    p.domain = {.v_min = 1e-7, .v_max = 1e-3, .xi_min = -4, .xi_max = 12};
    return p;
}

/// The exact ageing law as a pair.
AdditivePair::Parameters exact_parameters()
{
    return in_domain(test::linear_nets());
}

/// Nonlinear units.
AdditivePair::Parameters crooked_parameters()
{
    return in_domain(test::crooked_nets());
}

double central(const std::function<double(double)>& f, double x, double h)
{
    return (f(x - 2 * h) - 8 * f(x - h) + 8 * f(x + h) - f(x + 2 * h)) / (12 * h);
}

TEST(AdditivePair, OfLinearNetsIsTheAgeingLaw)
{
    const AdditivePair pair(exact_parameters());
    const AgeingLaw<DirectEffect::log> law;
    for (const double v : {1e-7, 1e-4, 1e-3}) {
        for (const double xi : {-2.0, 0.0, 6.0}) {
            const FrictionAndRate found = pair.evaluate(v, 1.6 * xi);
            EXPECT_NEAR(found.friction, law.friction(v, xi), 1e-15);
            const double sides = 1.6 * (v + 1e-4 * std::exp(-xi)) / 1e-6;
            EXPECT_NEAR(found.rate, 1.6 * law.state_rate(v, xi), 1e-14 * sides);
        }
    }
    const auto history = make_histories(2, 4);
    for (const FrictionHistory& h : history) {
        // 64 steps of order 4 between samples; a change of V takes a thousandth of a second.
        EXPECT_LE(relative_error(friction_along(pair, h, 0, 64), h.friction), 1e-6);
    }
}

TEST(AdditivePair, RefusesWhatIsNotConvex)
{
    const auto refusal = [](auto change) -> std::string {
        AdditivePair::Parameters p = crooked_parameters();
        change(p);
        try {
            AdditivePair pair(p);
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "";
    };
    const auto says = [](const std::string& text, const std::string& piece) {
        EXPECT_NE(text.find(piece), std::string::npos) << text;
    };
    EXPECT_EQ(refusal([](auto&) {}), "");
    says(refusal([](auto& p) { p.state.weight[1] = -0.2; }),
         "net 'state': a convex potential needs weight x scale >= 0, found -0.22");
    says(refusal([](auto& p) { p.rate.slope = -1; }), "net 'rate': the slope");
    says(refusal([](auto& p) { p.direct.shift[0] = std::nan(""); }), "unit 0 is not finite");
    says(refusal([](auto& p) { p.beta = 0; }), "beta must be positive");
    EXPECT_THROW((void)AdditivePair(crooked_parameters()).evaluate(0, 0), std::invalid_argument);
}

TEST(PairFile, KeepsItsBits)
{
    const AdditivePair pair(crooked_parameters());
    const AdditivePair again = parse_pair(to_json(pair), "memory");
    EXPECT_EQ(to_json(again), to_json(pair));
    EXPECT_EQ(again.evaluate(3e-5, 0.7).friction, pair.evaluate(3e-5, 0.7).friction);
    EXPECT_EQ(again.evaluate(3e-5, 0.7).rate, pair.evaluate(3e-5, 0.7).rate);
}

TEST(PairFile, RefusesWhatItIsNot)
{
    const nlohmann::json good = nlohmann::json::parse(to_json(AdditivePair(crooked_parameters())));
    const auto refusal = [&](auto change) -> std::string {
        nlohmann::json bad = good;
        change(bad);
        try {
            (void)parse_pair(bad.dump(), "pair.json");
        } catch (const PotentialFileError& error) {
            return error.what();
        }
        return "";
    };
    const auto says = [](const std::string& text, const std::string& piece) {
        EXPECT_NE(text.find("pair.json: "), std::string::npos) << text;
        EXPECT_NE(text.find(piece), std::string::npos) << text;
    };
    EXPECT_EQ(refusal([](auto&) {}), "");
    says(refusal([](auto& j) { j["state"]["scale"][0] = -0.4; }),
         "claims to be convex: AdditivePair: net 'state'");
    says(refusal([](auto& j) { j["convex"] = false; }), "expected \"convex\": true, found false");
    says(refusal([](auto& j) { j["format"] = "x"; }), "expected format");
    says(refusal([](auto& j) { j["version"] = 7; }), "expected version 1, found 7");
    says(refusal([](auto& j) { j["rate"].erase("shift"); }), "\"rate\".\"shift\"");
    says(refusal([](auto& j) { j["rate"]["shift"] = {1}; }), "expected 3 numbers, found 1");
    says(refusal([](auto& j) { j["direct"]["offset"] = 0.6; }), "self test: friction");
    says(refusal([](auto& j) { j["v_star"] = "fast"; }), "expected a number");
    // The value has another type than it should.
    says(refusal([](auto& j) { j["format"] = 3; }), "expected format");
    says(refusal([](auto& j) { j["version"] = "1"; }), "expected version 1, found \"1\"");
    says(refusal([](auto& j) { j["version"] = 1.5; }), "expected version 1, found 1.5");
    says(refusal([](auto& j) { j["version"] = nullptr; }), "expected version 1, found null");
    says(refusal([](auto& j) { j["convex"] = 1; }), "expected \"convex\": true, found 1");
    says(refusal([](auto& j) { j["self_test"]["v"] = -1; }), "self test: \"v\" must be positive");
    says(refusal([](auto& j) { j["state"]["scale"] = true; }), "expected at most 8 numbers");
    says(refusal([](auto& j) { j["state"]["scale"][0] = nullptr; }), "expected numbers");
    // A domain is absent, or an interval of slip rates and one of states.
    const auto domain = [&](double v_min, double v_max, double xi_min, double xi_max) {
        return refusal([=](auto& j) {
            j["domain"] = {
                {"v_min", v_min}, {"v_max", v_max}, {"xi_min", xi_min}, {"xi_max", xi_max}};
        });
    };
    const std::string rates = "expected 0 < v_min < v_max";
    const std::string states = "xi_min < xi_max";
    says(domain(1e-3, 1e-9, -5, 25), rates);
    says(domain(1e-9, 1e-9, -5, 25), rates);
    says(domain(-1e-9, 1e-3, -5, 25), rates);
    says(domain(0, 1e-3, -5, 25), rates);
    says(domain(1e-9, 1e300, -5, 25), rates);
    says(domain(1e-9, 1e-3, 25, -5), states);
    says(domain(1e-9, 1e-3, -5, 1e4), states);
    // Deeper and longer than any valid file.
    const std::string deep = std::string(100'000, '[') + std::string(100'000, ']');
    for (const std::string& text : {deep, "{\"format\": " + deep + '}'}) {
        try {
            (void)parse_pair(text, "pair.json");
            ADD_FAILURE();
        } catch (const PotentialFileError& error) {
            says(error.what(), "nested deeper");
        }
    }
    EXPECT_LT(refusal([](auto& j) { j["format"] = std::string(100'000, 'x'); }).size(), 200u);
    // Units with which quotients or products overflow or underflow.
    says(refusal([](auto& j) { j["v_star"] = 5e-324; }), "v_star");
    says(refusal([](auto& j) { j["beta"] = 1e308; }), "beta");
    EXPECT_THROW((void)parse_pair("[", "x"), PotentialFileError);
    const std::string twice =
        to_json(AdditivePair(crooked_parameters())).replace(0, 1, "{\"beta\": 1,");
    EXPECT_THROW((void)parse_pair(twice, "x"), PotentialFileError);
    EXPECT_THROW((void)load_pair("."), PotentialFileError);
    EXPECT_THROW((void)load_pair("/dev/zero"), PotentialFileError);
    EXPECT_THROW((void)load_pair("no-such-file.json"), PotentialFileError);
    EXPECT_THROW((void)load_pair("/"), PotentialFileError);
}

/// Gradients of a model by its parameters against central differences of order four.
void check_model(learn::detail::FrictionModel& model)
{
    learn::Random random(3);
    Eigen::VectorXd p(static_cast<Eigen::Index>(model.size()));
    model.start(p, 0.5, 0.02, random);
    const std::vector<double> xi{0.7, -0.4};
    std::vector<double> by_xi(2), ignored(2);
    const double y = -1.3;
    const double u = std::exp(y);
    model.set(p);
    std::vector<double> g(model.size());
    (void)model.friction(y, xi.data(), by_xi.data(), g.data());
    const auto friction = [&](Eigen::Index k) {
        return [&, k](double value) {
            Eigen::VectorXd q = p;
            q[k] = value;
            model.set(q);
            return model.friction(y, xi.data(), ignored.data(), nullptr);
        };
    };
    for (Eigen::Index k = 0; k < p.size(); ++k) {
        EXPECT_NEAR(central(friction(k), p[k], 1e-3), g[static_cast<std::size_t>(k)], 1e-11);
    }
    for (std::size_t j = 0; j < model.internals(); ++j) {
        const auto block = model.block(j);
        std::vector<double> own(block.size);
        model.set(p);
        const auto rate = model.rate(j, y, u, xi[j], own.data());
        const double slope =
            central([&](double x) { return model.rate(j, y, u, x, nullptr).value; }, xi[j], 1e-3);
        EXPECT_NEAR(slope, rate.slope, 1e-9 * std::abs(rate.slope));
        EXPECT_LT(rate.slope, 0);
        for (std::size_t k = 0; k < block.size; ++k) {
            const auto at = static_cast<Eigen::Index>(block.first + k);
            const auto by = [&](double value) {
                Eigen::VectorXd q = p;
                q[at] = value;
                model.set(q);
                return model.rate(j, y, u, xi[j], nullptr).value;
            };
            EXPECT_NEAR(central(by, p[at], 1e-3), own[k], 1e-9 * std::abs(rate.value) + 1e-8);
        }
    }
}

TEST(FrictionModels, HaveTheDerivativesTheySay)
{
    learn::detail::AdditiveModel additive(8, 7, 7, 2);
    check_model(additive);
    learn::detail::GeneralModel general(6, 3, 4);
    check_model(general);
}

/// Half the gradient of the sum of squares along random directions, against differences.
void check_sum(learn::detail::FrictionModel& model)
{
    auto histories = make_histories(2, 8);
    learn::Random random(5);
    Eigen::VectorXd p(static_cast<Eigen::Index>(model.size()));
    model.start(p, 0.5, 0.02, random);
    const std::vector<const FrictionHistory*> all{&histories[0], &histories[1]};
    Eigen::MatrixXd normal(p.size(), p.size());
    Eigen::VectorXd gradient(p.size());
    const double sum = learn::detail::sum_of_squares(model, all, p, &normal, &gradient);
    EXPECT_NEAR((normal - normal.transpose()).norm(), 0, 1e-12 * normal.norm());
    for (int k = 0; k < 6; ++k) {
        Eigen::VectorXd direction(p.size());
        for (double& d : direction) d = random.uniform(-1, 1);
        const auto along = [&](double s) {
            return learn::detail::sum_of_squares(model, all, p + s * direction, nullptr, nullptr);
        };
        // Differences of order four with a step of 1e-3 in parameters of order one.
        EXPECT_NEAR(central(along, 0, 1e-3) / 2, gradient.dot(direction),
                    1e-7 * (gradient.norm() * direction.norm() + sum));
    }
}

TEST(TrainFriction, GradientIsThatOfTheComputedFriction)
{
    learn::detail::AdditiveModel additive(8, 7, 7, 2);
    check_sum(additive);
    learn::detail::GeneralModel general(6, 3, 4);
    check_sum(general);
}

TEST(TrainFriction, FindsAStateThatItIsNotTold)
{
    const auto histories = make_histories(4, 21);
    const learn::LearnedFriction fit =
        learn::train_friction(histories, {.iterations = 20, .seconds = 100});
    EXPECT_EQ(fit.parameters(), 71U);
    EXPECT_LT(fit.training_error, 2e-3);  // the best function of V alone leaves 2e-2
    ASSERT_TRUE(fit.pair().has_value());
    EXPECT_EQ(fit.pair()->fitted(), 71U);
    // The pair, run with other steps, agrees with the fit.
    const auto along = friction_along(*fit.pair(), histories[1], 0, 32);
    EXPECT_LE(relative_error(along, fit.friction(histories[1], 2)), 1e-5);
    EXPECT_EQ(fit.internal(histories[0]).size(), 1U);
    const learn::LearnedFriction again =
        learn::train_friction(histories, {.iterations = 20, .seconds = 100});
    EXPECT_EQ(again.friction(histories[2]), fit.friction(histories[2]));
}

TEST(TrainFriction, WithoutStateIsAFunctionOfTheSlipRate)
{
    const auto histories = make_histories(20, 21);
    const learn::LearnedFriction fit =
        learn::train_friction(histories, {.internal = 0, .iterations = 40});
    EXPECT_GT(fit.training_error, 1e-2);
    EXPECT_LT(fit.training_error, 4e-2);
    EXPECT_FALSE(fit.pair().has_value());
}

TEST(TrainFriction, GoesOnFromAFitAndByAdam)
{
    const auto histories = make_histories(2, 21);
    const learn::LearnedFriction rough = learn::train_friction(
        histories, {.iterations = 2, .adam_iterations = 5, .adam_rate = 1e-2});
    const learn::LearnedFriction fine = learn::train_further(rough, histories, {.iterations = 6});
    EXPECT_LT(fine.training_error, rough.training_error);
}

TEST(TrainFriction, RefusesWhatMakesNoSense)
{
    const auto histories = make_histories(2, 1);
    using learn::train_friction;
    EXPECT_THROW((void)train_friction({}), std::invalid_argument);
    EXPECT_THROW((void)train_friction(histories, {.internal = 3}), std::invalid_argument);
    EXPECT_THROW((void)train_friction(histories, {.direct_units = 9}), std::invalid_argument);
    EXPECT_THROW((void)train_friction(histories, {.v_star = 0}), std::invalid_argument);
    auto bare = histories;
    bare[1].friction.clear();
    EXPECT_THROW((void)train_friction(bare), std::invalid_argument);
}

TEST(FrictionStudy, MethodsAgreeOnASliderThatSlidesSteadily)
{
    const auto cases = slider_cases(1);
    ASSERT_GT(cases[40].stiffness_ratio, 1);
    const auto reference = learn::slider_velocities(cases[40], 4, 128);
    ASSERT_TRUE(reference.stable);
    EXPECT_EQ(reference.velocity.size(), 128U);
    const auto explicit_run =
        learn::slider_velocities(cases[40], BaselineOptions{.method = Baseline::rk4}, 128);
    ASSERT_TRUE(explicit_run.stable);
    // RK4 at 2^-13 s has an error of 1e-8 to 1e-6 on these, by its stability.
    EXPECT_LE(relative_error(explicit_run.velocity, reference.velocity), 1e-6);
    EXPECT_LE(
        relative_error(learn::slider_velocities(cases[40], 2, 128).velocity, reference.velocity),
        1e-4);
}

TEST(FrictionStudy, TheExactPairMovesSlidersAsTheLawDoes)
{
    // The pair of linear nets is the law: they differ only by rounding.
    SliderState a = slider_case_start();
    SliderState b = a;
    const SliderCase c = slider_cases(1)[40];
    const VariationalStep<AgeingLaw<DirectEffect::log>> law(AgeingLaw<DirectEffect::log>(),
                                                            c.slider.block, 4);
    const VariationalStep<AdditivePair> pair(AdditivePair(exact_parameters()), c.slider.block, 4);
    for (int i = 0; i < 2000; ++i) {
        (void)law.take(a, 1e-4, c.slider.load);
        (void)pair.take(b, 1e-4, c.slider.load);
    }
    EXPECT_NEAR(b.v / a.v, 1, 1e-10);
    EXPECT_NEAR(b.xi, 1.6 * a.xi, 1e-10);
}

TEST(StoredPair, IsTheAgeingLawToFiveMillionths)
{
    const AdditivePair pair = load_pair(RICOCHET_MODELS "/ageing-friction.json");
    EXPECT_EQ(pair.fitted(), 71U);
    double mean = 0;
    const auto histories = make_histories(10, 77);
    for (const FrictionHistory& h : histories) {
        const double error = relative_error(friction_along(pair, h, 0, 32), h.friction);
        EXPECT_LE(error, 5e-5);
        mean += error / 10;
    }
    EXPECT_LE(mean, 5e-6);
}

}  // namespace
}  // namespace ricochet::rate_state_learning_test
