#include "ricochet/nn/mlp.hpp"

#include "nn_models.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace ricochet::classifier_test {
namespace {

/// x -> scale (x - offset), the identity as network.
Model affine(double offset, double scale, Precision precision)
{
    Model model = random_model({1, 1}, Activation::relu, 0);
    model.layers[0].weight = {1};
    model.layers[0].bias = {0};
    model.offset = {offset};
    model.scale = {scale};
    model.precision = precision;
    return model;
}

std::string refusal(const Model& model)
{
    try {
        const Classifier classifier(model);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(Classifier, NormalisesInDoubleBeforeAFloatNetwork)
{
    // 1e6 + 2^-10 and 1e6 are one number in float, whose spacing there is 1/16; the
    // difference is exact in double and in float.
    const Classifier classifier(affine(1e6, 1024, Precision::f32));
    const double feature = 1e6 + 0x1p-10;
    EXPECT_EQ(classifier.logit(&feature), 1.0);
}

TEST(Classifier, EvaluatesInThePrecisionOfTheModel)
{
    const double third = 1.0 / 3;
    EXPECT_EQ(Classifier(affine(0, 1, Precision::f64)).logit(&third), third);
    EXPECT_EQ(Classifier(affine(0, 1, Precision::f32)).logit(&third),
              static_cast<double>(static_cast<float>(third)));
}

TEST(Classifier, ReturnsEveryLogit)
{
    for (const Precision precision : {Precision::f32, Precision::f64}) {
        Model model = random_model({2, 8, 3}, Activation::tanh, 1);
        model.offset = {0.5, -0.25};
        model.scale = {2, 4};
        model.precision = precision;
        const Classifier classifier(model);
        ASSERT_EQ(classifier.inputs(), 2);
        ASSERT_EQ(classifier.outputs(), 3);
        const double features[]{0.75, 0.125};  // normalised: 0.5 and 1.5
        double logits[3];
        classifier.logits(features, logits);
        const long double u =
            precision == Precision::f32 ? unit_roundoff<float> : unit_roundoff<double>;
        const Reference expected = evaluate_by_formula(model, {0.5, 1.5}, u);
        for (std::size_t j = 0; j < 3; ++j) {
            EXPECT_LE(std::abs(logits[j] - expected.value[j]), expected.bound[j]);
        }
        EXPECT_EQ(classifier.logit(features), logits[0]);
    }
}

TEST(Classifier, AnnouncesAnEventAtTheThresholdAboveItAndForNan)
{
    Model model = affine(0, 1, Precision::f64);
    model.threshold = 0.5;
    const Classifier classifier(model);
    EXPECT_FALSE(classifier.alarm(std::nextafter(0.5, 0.0)));
    EXPECT_TRUE(classifier.alarm(0.5));
    EXPECT_TRUE(classifier.alarm(std::numeric_limits<double>::infinity()));
    EXPECT_FALSE(classifier.alarm(-std::numeric_limits<double>::infinity()));
    EXPECT_TRUE(classifier.alarm(std::numeric_limits<double>::quiet_NaN()));
}

TEST(Classifier, ItsDomainIsClosedAndNanLiesOutside)
{
    Model model = random_model({2, 1}, Activation::relu, 2);
    model.domain = {{0, 1}, {-2, 2}};
    const Classifier classifier(model);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const auto inside = [&](double a, double b) {
        const double features[]{a, b};
        return classifier.in_domain(features);
    };
    EXPECT_TRUE(inside(0, -2));
    EXPECT_TRUE(inside(1, 2));
    EXPECT_FALSE(inside(1.5, 0));
    EXPECT_FALSE(inside(0.5, -2.5));
    EXPECT_FALSE(inside(nan, 0));
    EXPECT_FALSE(inside(0.5, nan));
}

TEST(Classifier, AnEmptyDomainIsUnbounded)
{
    Model model = affine(0, 1, Precision::f32);
    model.domain.clear();
    const double far = 1e300;
    EXPECT_TRUE(Classifier(model).in_domain(&far));
}

TEST(Classifier, RefusesOffsetsScalesAndDomainsThatAreNotOnePerInput)
{
    const Model model = random_model({2, 1}, Activation::relu, 3);
    Model changed = model;
    changed.offset.pop_back();
    EXPECT_EQ(refusal(changed), "Classifier: expected one offset for each of 2 inputs, found 1");
    changed = model;
    changed.scale.push_back(1);
    EXPECT_EQ(refusal(changed), "Classifier: expected one scale for each of 2 inputs, found 3");
    changed = model;
    changed.domain.pop_back();
    EXPECT_EQ(refusal(changed), "Classifier: expected one domain for each of 2 inputs, found 1");
}

}  // namespace
}  // namespace ricochet::classifier_test
