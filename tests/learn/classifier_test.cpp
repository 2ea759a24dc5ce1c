#include "ricochet/learn/classifier.hpp"

#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "learn/checkpoint.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn::classifier_test {
namespace {

/// Points of a square; inside a disc of radius 1 they are events. A ring of a
/// tenth around it is left empty.
DataSet disc(std::size_t n, std::uint64_t seed)
{
    DataSet data{.columns = {{"x", "m"}, {"y", "m"}}};
    Random random(seed);
    while (data.size() < n) {
        const std::array<double, 2> point{random.uniform(-2, 2), random.uniform(-2, 2)};
        const double margin = (std::hypot(point[0], point[1]) - 1) / 2;
        if (margin > 0 && margin < 0.05) continue;
        data.append(point, margin <= 0, margin);
    }
    return data;
}

/// Every state twice, once with each label.
DataSet contradictory()
{
    DataSet data{.columns = {{"x", "1"}}};
    for (int i = 0; i < 400; ++i) {
        const double x = i / 400.0;
        data.append({&x, 1}, true, -1);
        data.append({&x, 1}, false, 1);
    }
    return data;
}

TrainingOptions small()
{
    return {.hidden = {12}, .iterations = 1500, .batch = 64, .evaluate_every = 100};
}

class TemporaryFile {
public:
    explicit TemporaryFile(const std::string& name)
        : path_(std::filesystem::temp_directory_path() /
                (name + '-' + std::to_string(Random(std::random_device{}()).bits())))
    {
    }
    ~TemporaryFile() { std::filesystem::remove(path_); }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

std::vector<double> weights(const Model& model)
{
    std::vector<double> all{model.threshold};
    for (const DenseLayer& layer : model.layers) {
        all.insert(all.end(), layer.weight.begin(), layer.weight.end());
        all.insert(all.end(), layer.bias.begin(), layer.bias.end());
    }
    return all;
}

TEST(Train, SmallNetworkMissesNothingOnADisc)
{
    const Trained trained = train(disc(3000, 1), small());
    EXPECT_EQ(trained.report.outcome, TrainingOutcome::finished);
    EXPECT_TRUE(trained.misses_none());
    EXPECT_EQ(trained.report.iterations, 1500U);
    EXPECT_GT(trained.report.held_out.cleared_share, 0.9);

    const Assessment fresh = assess(trained.model, disc(3000, 2));
    EXPECT_EQ(fresh.confusion.missed, 0U);
}

TEST(Train, TanhLearnsTheDiscToo)
{
    TrainingOptions options = small();
    options.activation = Activation::tanh;
    const Trained trained = train(disc(3000, 1), options);
    EXPECT_TRUE(trained.misses_none());
    EXPECT_GT(trained.report.held_out.cleared_share, 0.9);
    EXPECT_EQ(trained.model.activation, Activation::tanh);
}

TEST(Train, SameSeedGivesTheSameBits)
{
    const DataSet data = disc(1000, 1);
    TrainingOptions options = small();
    options.iterations = 400;
    const Model first = train(data, options).model;
    EXPECT_EQ(weights(first), weights(train(data, options).model));
    options.seed = 2;
    EXPECT_NE(weights(first), weights(train(data, options).model));
}

TEST(Train, WeightsAreFloats)
{
    TrainingOptions options = small();
    options.iterations = 200;
    const Model model = train(disc(1000, 1), options).model;
    EXPECT_EQ(model.precision, Precision::f32);
    for (const DenseLayer& layer : model.layers) {
        for (const double w : layer.weight)
            EXPECT_EQ(w, static_cast<double>(static_cast<float>(w)));
        for (const double b : layer.bias) EXPECT_EQ(b, static_cast<double>(static_cast<float>(b)));
    }
}

TEST(Train, ModelRepeatsItsSelfTestAndKnowsItsDomain)
{
    TrainingOptions options = small();
    options.iterations = 200;
    const Model model = train(disc(1000, 1), options).model;
    EXPECT_EQ(Classifier(model).logit(model.self_test.input.data()), model.self_test.output[0]);
    ASSERT_EQ(model.domain.size(), 2U);
    EXPECT_NEAR(model.domain[0].lower, -2, 0.05);
    EXPECT_NEAR(model.domain[1].upper, 2, 0.05);
}

TEST(Train, ThresholdLiesBelowEveryValidationEventByTheMargin)
{
    TrainingOptions options = small();
    options.logit_margin = 0.75;
    const Trained trained = train(disc(3000, 1), options);
    EXPECT_LE(trained.model.threshold, trained.report.validation.lowest_event - 0.75 + 1e-5);
}

TEST(Train, ContradictoryLabelsAreSaidToBeMissed)
{
    TrainingOptions options = small();
    options.iterations = 300;
    const Trained trained = train(contradictory(), options);
    EXPECT_EQ(trained.report.outcome, TrainingOutcome::misses_remain);
    EXPECT_FALSE(trained.misses_none());
    EXPECT_FALSE(trained.model.layers.empty());
    // The classifier does not simply announce an event in every state.
    EXPECT_GE(trained.report.validation.cleared_share, options.cleared_at_least);
}

TEST(Train, DivergedTrainingKeepsWhatWasGood)
{
    TrainingOptions options = small();
    options.rate = 1e200;
    options.final_rate = 1e200;
    const Trained trained = train(disc(1000, 1), options);
    EXPECT_EQ(trained.report.outcome, TrainingOutcome::diverged);
    for (const double w : weights(trained.model)) EXPECT_TRUE(std::isfinite(w));
}

TEST(Train, CallbackSeesEveryEvaluationAndMayStopAtTheBestSoFar)
{
    const DataSet data = disc(3000, 1);
    std::vector<Progress> seen;
    const Trained stopped = train(data, small(), [&seen](const Progress& progress) {
        seen.push_back(progress);
        return progress.iteration < 1000;
    });
    ASSERT_EQ(seen.size(), 11U);  // 0, 100, ..., 1000
    EXPECT_EQ(seen.back().iteration, 1000U);
    EXPECT_EQ(seen.back().total, 1500U);
    EXPECT_LT(seen.back().loss, seen.front().loss);
    EXPECT_GE(seen.back().seconds, seen.front().seconds);
    EXPECT_EQ(stopped.report.outcome, TrainingOutcome::stopped);
    EXPECT_EQ(stopped.report.iterations, 1000U);
    EXPECT_TRUE(stopped.misses_none());
}

TEST(Train, InterruptedTrainingResumesToTheSameBits)
{
    const DataSet data = disc(1000, 1);
    const TemporaryFile file("ricochet-checkpoint");
    TrainingOptions options = small();
    options.hard_every = 150;  // the checkpoint falls between two searches
    const std::vector<double> whole = weights(train(data, options).model);

    options.checkpoint = file.path();
    (void)train(data, options, [](const Progress& progress) { return progress.iteration < 700; });
    options.resume = true;
    std::size_t first = std::numeric_limits<std::size_t>::max();
    const Trained resumed = train(data, options, [&first](const Progress& progress) {
        first = std::min(first, progress.iteration);
        return true;
    });
    EXPECT_EQ(first, 700U);
    EXPECT_EQ(weights(resumed.model), whole);
}

TEST(Train, CancelledTrainingStopsBeforeItsNextIterationAndResumesToTheSameBits)
{
    const DataSet data = disc(1000, 1);
    const TemporaryFile file("ricochet-checkpoint");
    TrainingOptions options = small();
    const std::vector<double> whole = weights(train(data, options).model);

    std::atomic<bool> cancelled = false;
    options.checkpoint = file.path();
    options.cancelled = &cancelled;
    const Trained part = train(data, options, [&](const Progress& progress) {
        cancelled = progress.iteration == 700;
        return true;
    });
    EXPECT_EQ(part.report.iterations, 700U);
    EXPECT_FALSE(part.model.layers.empty());
    cancelled = false;
    options.resume = true;
    EXPECT_EQ(weights(train(data, options).model), whole);
}

TEST(Train, CheckpointOfOtherDataOrOptionsIsRefused)
{
    const TemporaryFile file("ricochet-checkpoint");
    TrainingOptions options = small();
    options.iterations = 100;
    options.checkpoint = file.path();
    (void)train(disc(1000, 1), options);
    options.resume = true;
    EXPECT_NO_THROW((void)train(disc(1000, 1), options));
    EXPECT_THROW((void)train(disc(1000, 2), options), std::runtime_error);
    options.batch = 32;
    EXPECT_THROW((void)train(disc(1000, 1), options), std::runtime_error);
}

TEST(Train, MissingOrDamagedCheckpointIsRefusedByName)
{
    const TemporaryFile file("ricochet-checkpoint");
    EXPECT_THROW((void)load_checkpoint(file.path()), std::runtime_error);
    TrainingOptions options = small();
    options.iterations = 100;
    options.checkpoint = file.path();
    (void)train(disc(1000, 1), options);

    std::string bytes;
    {
        std::ifstream in(file.path(), std::ios::binary);
        bytes.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    }
    const auto refused = [&file](const std::string& content) {
        std::ofstream(file.path(), std::ios::binary | std::ios::trunc) << content;
        try {
            (void)load_checkpoint(file.path());
            return false;
        } catch (const std::runtime_error& error) {
            return std::string(error.what()).find(file.path().string()) != std::string::npos;
        }
    };
    for (std::size_t n = 0; n < bytes.size(); n += 97) EXPECT_TRUE(refused(bytes.substr(0, n)));
    std::string altered = bytes;
    altered[bytes.size() / 2] ^= 1;
    EXPECT_TRUE(refused(altered));
    EXPECT_FALSE(refused(bytes));
}

TEST(Train, OptionsOutsideTheirRangeAreRefused)
{
    const DataSet data = disc(100, 1);
    const auto refused = [&data](const TrainingOptions& options) {
        try {
            (void)train(data, options);
            return false;
        } catch (const std::invalid_argument&) {
            return true;
        }
    };
    EXPECT_TRUE(refused({.hidden = {0}}));
    EXPECT_TRUE(refused({.offset = {1}}));
    EXPECT_TRUE(refused({.scale = {1, 0}}));
    EXPECT_TRUE(refused({.batch = 0}));
    EXPECT_TRUE(refused({.rate = -1}));
    EXPECT_TRUE(refused({.adam = {.beta1 = 2}}));
    EXPECT_TRUE(refused({.test_share = 1}));
    EXPECT_TRUE(refused({.logit_margin = std::numeric_limits<double>::quiet_NaN()}));
    EXPECT_TRUE(refused({.resume = true}));
    DataSet one_class = data;
    for (std::uint8_t& label : one_class.labels) label = 0;
    EXPECT_THROW((void)train(one_class, {}), std::invalid_argument);
    EXPECT_THROW((void)train(DataSet{}, {}), std::invalid_argument);
}

TEST(Train, ReportIsJson)
{
    TrainingOptions options = small();
    options.iterations = 200;
    const Trained trained = train(disc(1000, 1), options);
    const auto json = nlohmann::json::parse(to_json(trained.report));
    EXPECT_EQ(json["iterations"], 200);
    EXPECT_EQ(json["held_out"]["missed"], trained.report.held_out.confusion.missed);
    EXPECT_TRUE(json["fresh"].is_null());
}

}  // namespace
}  // namespace ricochet::learn::classifier_test
