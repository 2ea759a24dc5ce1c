// Histories of friction: their generator, the exact state along them, identification.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/faults/friction.hpp"
#include "studies/identify_friction.hpp"
#include "theta_reference.hpp"

namespace ricochet::rate_state_histories_test {
namespace {

std::string refusal(const FrictionHistory& history)
{
    try {
        validate(history);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(FrictionHistories, FollowTheProtocol)
{
    const FrictionData data = make_friction_data(5);
    EXPECT_EQ(data.training.size(), 480U);
    EXPECT_EQ(data.validation.size(), 160U);
    EXPECT_EQ(data.test.size(), 160U);
    std::size_t continuous = 0;
    for (const FrictionHistory& h : data.test) {
        ASSERT_EQ(h.t.size(), 100U);
        EXPECT_NO_THROW(validate(h));
        EXPECT_GE(*std::min_element(h.v.begin(), h.v.end()), 1e-7 * (1 - 1e-12));
        EXPECT_LE(*std::max_element(h.v.begin(), h.v.end()), 1e-3 * (1 + 1e-12));
        // Counts jumps and corners.
        std::size_t changes = 0;
        const bool linear = h.between == FrictionHistory::Between::linear;
        for (std::size_t n = linear ? 2 : 1; n < h.v.size(); ++n) {
            const double bend = linear ? h.v[n] - 2 * h.v[n - 1] + h.v[n - 2] : h.v[n] - h.v[n - 1];
            changes += std::abs(bend) > 1e-14;
        }
        continuous += linear;
        EXPECT_GE(changes, linear ? 2U : 1U);
        EXPECT_LE(changes, linear ? 8U : 5U);
        EXPECT_DOUBLE_EQ(h.friction.front(), AgeingLaw<>().friction(h.v.front(), 0));
    }
    EXPECT_EQ(continuous, 80U);
    EXPECT_EQ(make_friction_data(5).test[3].friction, data.test[3].friction);
    EXPECT_NE(make_friction_data(6).test[3].friction, data.test[3].friction);
    EXPECT_NE(data.training[3].friction, data.test[3].friction);
}

TEST(FrictionHistories, ExactStateIsTheIntegratedOne)
{
    // The reference has an error of 1e-17, the exact state a few roundings per interval.
    const RateStateParameters p;
    for (const FrictionHistory& h : make_histories(6, 11)) {
        EXPECT_LE(relative_error(h.friction, test::theta_friction(p, h)), 1e-14);
    }
}

TEST(FrictionHistories, DerivativeByTheSlipDistance)
{
    // Central differences of relative step 1e-5: truncation 1e-10, rounding 1e-11.
    for (const double v1 : {1e-4, 3e-4, 9e-7}) {
        const auto at = [&](double l) {
            return advance_ageing({0.02, 0}, l, 1e-4, v1, 0.02).theta;
        };
        const double h = 1e-5;
        const double expected = (at(1e-6 * std::exp(h)) - at(1e-6 * std::exp(-h))) / (2 * h);
        const AgeingState found = advance_ageing({0.02, 0}, 1e-6, 1e-4, v1, 0.02);
        EXPECT_NEAR(found.by_log_l, expected, 1e-8 * found.theta);
    }
}

TEST(FrictionHistories, RefuseWhatIsNoHistory)
{
    FrictionHistory h{.t = {0, 1, 2}, .v = {1e-4, 1e-4, 1e-4}, .friction = {0.5, 0.5, 0.5}};
    EXPECT_EQ(refusal(h), "");
    auto with = [&](auto change) {
        FrictionHistory bad = h;
        change(bad);
        return refusal(bad);
    };
    const auto says = [](const std::string& text, const std::string& piece) {
        EXPECT_NE(text.find(piece), std::string::npos) << text;
    };
    says(refusal({}), "at least two samples, found 0");
    says(with([](auto& b) { b.t[2] = 1; }), "found 1 s after 1 s at sample 2");
    says(with([](auto& b) { b.v[1] = -1e-4; }), "found -0.0001 m/s at sample 1");
    says(with([](auto& b) { b.v.pop_back(); }), "expected 3 slip rates");
    says(with([](auto& b) { b.friction.pop_back(); }), "expected 3 friction coefficients, found 2");
    says(with([](auto& b) { b.friction[2] = std::nan(""); }), "friction must be finite");
    EXPECT_THROW((void)learn::identify_ageing_law({}), std::invalid_argument);
    EXPECT_THROW((void)learn::identify_ageing_law({h}, -1), std::invalid_argument);
    h.friction.clear();
    EXPECT_THROW((void)learn::identify_ageing_law({h}), std::invalid_argument);
}

TEST(IdentifyAgeingLaw, FindsTheParametersOfCleanHistories)
{
    // Other parameters and another start than the generator's defaults, so that the result
    // is no coincidence.
    const RateStateParameters p{.a = 0.02, .b = 0.013, .f_star = 0.6, .d_rs = 7e-6};
    std::vector<FrictionHistory> histories = make_histories(24, 3, p);
    for (FrictionHistory& h : histories) h.friction = ageing_friction(p, h, 0.8);
    const learn::IdentifiedFriction found = learn::identify_ageing_law(histories);
    EXPECT_TRUE(found.converged);
    EXPECT_NEAR(found.parameters.a / p.a, 1, 1e-8);
    EXPECT_NEAR(found.parameters.b / p.b, 1, 1e-8);
    EXPECT_NEAR(found.parameters.f_star / p.f_star, 1, 1e-8);
    EXPECT_NEAR(found.parameters.d_rs / p.d_rs, 1, 1e-8);
    EXPECT_NEAR(found.xi_start, 0.8, 1e-8);
}

TEST(IdentifyAgeingLaw, IsWithinItsErrorOfNoisyHistories)
{
    std::vector<FrictionHistory> histories = make_histories(24, 3);
    add_noise(histories, 5e-3, 9);
    const learn::IdentifiedFriction found = learn::identify_ageing_law(histories);
    const RateStateParameters p;
    EXPECT_NEAR(found.residual, 5e-3, 3e-4);  // 2400 samples: 1.5 % of it is one deviation
    EXPECT_NEAR(found.parameters.a, p.a, 4 * found.a_error);
    EXPECT_NEAR(found.parameters.b, p.b, 4 * found.b_error);
    EXPECT_NEAR(found.parameters.f_star, p.f_star, 4 * found.f_star_error);
    EXPECT_NEAR(std::log(found.parameters.d_rs / p.d_rs), 0, 4 * found.log_d_rs_error);
    EXPECT_LT(found.a_error, 1e-3);
    double mean = 0;
    const auto tests = make_histories(40, 12);
    for (const FrictionHistory& h : tests) {
        const auto friction = ageing_friction(found.parameters, h, found.xi_start);
        mean += relative_error(friction, h.friction) / static_cast<double>(tests.size());
    }
    EXPECT_LE(mean, 1e-3);
}

}  // namespace
}  // namespace ricochet::rate_state_histories_test
