// `ricochet certify`, and the output of `inspect` about a certificate.
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "app.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::certify_test {
namespace {

class Certify : public App {
protected:
    /// logit = relu(1 - u): below T where the ball is above 1 - T.
    [[nodiscard]] static Model model()
    {
        Model out;
        out.system = "bouncing-ball";
        out.parameters = {{"gravity", 9.81}};
        out.recipe = "state";
        out.offset = {0, 0};
        out.scale = {1, 1};
        out.domain = {{-1, 2}, {-10, 10}};
        out.threshold = 0.5;
        out.layers = {{.inputs = 2, .outputs = 1, .weight = {-1, 0}, .bias = {1}},
                      {.inputs = 1, .outputs = 1, .weight = {1}, .bias = {0}}};
        return out;
    }

    fs::path store(const Model& model, const std::string& name = "ball.safetensors") const
    {
        save_model(model, work() / name);
        return work() / name;
    }
};

TEST_F(Certify, WritesARecordThatInspectShowsUntilTheModelChanges)
{
    const fs::path file = store(model());
    const Result result = run({"certify", "ball.safetensors", "--margin", "0.1"});
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_NE(result.out.find("guard > 0.1 where the logit is below"), std::string::npos);
    // Of heights from -1 to 2 m it clears those above 0.1 m, 63 %, by 4096 states.
    EXPECT_NE(result.out.find("proved wherever in the domain the network clears the state; it "
                              "clears 6"),
              std::string::npos)
        << result.out;
    EXPECT_NE(result.out.find(" % of the domain: "), std::string::npos) << result.out;
    EXPECT_NE(result.err.find("certifying level 1 of 1, guard > 0.1"), std::string::npos);
    EXPECT_NE(result.err.find("about "), std::string::npos);
    EXPECT_EQ(files(), Words{"ball.safetensors"});

    // u > 0.1 is relu(1 - u) < 0.9; the search stops 1/64 of the logits' spread of at most 0.9
    // short.
    Model certified = load_model(file);
    EXPECT_GT(certified.threshold, 0.88);
    EXPECT_LE(certified.threshold, 0.9);
    EXPECT_EQ(why_void(certified), "");
    const auto shown = json({"inspect", "ball.safetensors", "--json"});
    EXPECT_EQ(shown["certificate"]["holds"], true);
    EXPECT_EQ(shown["certificate"]["record"]["levels"][0]["margin"], 0.1);
    EXPECT_NE(run({"inspect", "ball.safetensors"}).out.find("holds, by ricochet "),
              std::string::npos);

    certified.threshold = 0.9;
    store(certified);
    EXPECT_NE(run({"inspect", "ball.safetensors"}).out.find("void: it is for a threshold"),
              std::string::npos);
    EXPECT_EQ(json({"inspect", "ball.safetensors", "--json"})["certificate"]["holds"], false);
}

TEST_F(Certify, ProvesLevelsAndTheStoredThreshold)
{
    store(model());
    const auto levels = json({"certify", "ball.safetensors", "--margin", "0.1", "--levels", "3",
                              "--keep-threshold", "--out", "other.safetensors", "--json"});
    EXPECT_EQ(levels["outcome"], "proved");
    ASSERT_EQ(levels["levels"].size(), 3U);
    EXPECT_EQ(levels["levels"][0]["threshold"], 0.5);
    EXPECT_EQ(levels["levels"][2]["margin"], 0.4);
    // Heights above 0.5 m, and above 0.4 m with a threshold found 1/64 of the spread short of it;
    // a standard error of 4096 states is 0.8 %.
    EXPECT_NEAR(levels["levels"][0]["clears"], 0.5, 0.032);
    EXPECT_GE(levels["levels"][0]["clears"], levels["levels"][2]["clears"]);
    EXPECT_EQ(load_model(work() / "ball.safetensors").certificate, "");
    EXPECT_EQ(why_void(load_model(work() / "other.safetensors")), "");

    // Clear above 0.5 m does not imply clear above 0.6 m.
    const auto refuted =
        json({"certify", "ball.safetensors", "--margin", "0.6", "--keep-threshold", "--json"}, 1);
    EXPECT_EQ(refuted["outcome"], "refuted");
    EXPECT_EQ(refuted["counterexample"].size(), 2U);
    EXPECT_TRUE(refuted["model"].is_null());
}

TEST_F(Certify, OutOfTimeIsResumed)
{
    store(model());
    const Result stopped =
        run({"certify", "ball.safetensors", "--margin", "0.1", "--time-limit", "1e-9"});
    EXPECT_EQ(stopped.status, 1);
    EXPECT_NE(stopped.err.find("--resume"), std::string::npos);
    EXPECT_TRUE(fs::exists(work() / "ball.safetensors.checkpoint"));
    EXPECT_EQ(load_model(work() / "ball.safetensors").certificate, "");
    EXPECT_EQ(run({"certify", "ball.safetensors", "--margin", "0.1", "--resume"}).status, 0);
    EXPECT_EQ(files(), Words{"ball.safetensors"});
}

TEST_F(Certify, RefusesWhatItCannotProve)
{
    store(model());
    expect_refused({"certify", "ball.safetensors", "--limit", "1e-9"},
                   {"the proof takes about", "above the limit", "--limit"});
    expect_refused({"certify", "ball.safetensors", "--margin", "-1"}, {"margin", "-1"});
    expect_refused({"certify", "ball.safetensors", "--levels", "2"}, {"positive margin"});
    expect_refused({"certify", "ball.safetensors", "--resume"}, {"cannot be read"});
    expect_refused({"certify", "bouncing-ball"}, {"'state'", "'ballistic'"});
    expect_refused({"certify", "nothing"}, {"'nothing' not found"});
    Model other = model();
    other.system = "pendulum";
    store(other);
    expect_refused({"certify", "ball.safetensors"}, {"'pendulum'", "bouncing-ball"});
    other = model();
    other.activation = Activation::tanh;
    store(other);
    expect_refused({"certify", "ball.safetensors"}, {"ReLU", "tanh"});
}

/// logit = |x_first - middle| + |x_second - middle'| of a state, which must lie in `domain`.
Model diamond(std::string system, std::vector<ValueRange> domain, std::size_t first,
              std::size_t second)
{
    Model out;
    const std::size_t n = domain.size();
    out.system = std::move(system);
    out.recipe = "state";
    out.scale.assign(n, 1);
    for (const ValueRange& range : domain) out.offset.push_back(0.5 * (range.lower + range.upper));
    out.domain = std::move(domain);
    DenseLayer fold{.inputs = n, .outputs = 4, .weight = std::vector<double>(4 * n), .bias = {}};
    fold.weight[first] = fold.weight[2 * n + second] = 1;
    fold.weight[n + first] = fold.weight[3 * n + second] = -1;
    fold.bias.assign(4, 0);
    out.layers = {fold, {.inputs = 4, .outputs = 1, .weight = {1, 1, 1, 1}, .bias = {0}}};
    out.threshold = 1;
    return out;
}

TEST_F(Certify, ProvesAModelOfTheCavernThatARunThenReliesOn)
{
    Model model = diamond("cavern", {{-3, 3}, {-3, 3}, {-30, 30}, {-30, 30}}, 0, 1);
    model.parameters = {{"segments", 200}, {"kick", 6}};
    store(model, "cavern.safetensors");
    const auto certified = json({"certify", "cavern.safetensors", "--margin", "1", "--json"});
    EXPECT_EQ(certified["outcome"], "proved");
    // The wall is some 10 m away, and nowhere nearer than 4 m to a corner of the box.
    EXPECT_GT(load_model(work() / "cavern.safetensors").threshold, 2);

    const Words run_it{"simulate", "cavern",  "--set", "segments=200", "--step",
                       "0.001",    "--t-end", "20",    "--json"};
    const nlohmann::json exact = json(run_it);
    Words gated_words = run_it;
    for (const char* word : {"--gate", "certified", "--model", "cavern.safetensors"}) {
        gated_words.emplace_back(word);
    }
    const nlohmann::json gated = json(gated_words);
    ASSERT_GT(exact["events"].size(), 10U);
    EXPECT_EQ(gated["events"], exact["events"]);
    EXPECT_EQ(gated["state"], exact["state"]);
    EXPECT_EQ(gated["statistics"]["evidence"]["gated"], 0);
    EXPECT_GT(gated["statistics"]["evidence"]["proved"], 15'000);
    EXPECT_GT(gated["statistics"]["network_calls"], 10);
    EXPECT_LT(10 * gated["statistics"]["guard_calls"].get<int>(),
              exact["statistics"]["guard_calls"].get<int>());

    gated_words[3] = "segments=300";
    expect_refused(gated_words, {"segments = 200", "300"});
    model.parameters = {{"weight", 1}};
    store(model, "cavern.safetensors");
    expect_refused({"certify", "cavern.safetensors"}, {"'weight'", "cavern"});
}

TEST_F(Certify, ProvesAModelOfTheArm)
{
    // Close around the start, where eight obstacles leave some room.
    const nlohmann::json still =
        json({"simulate", "arm", "--set", "obstacles=8", "--t-end", "1e-9", "--json"});
    std::vector<ValueRange> box;
    for (const auto& q : still["state"]) {
        const double half = box.size() < 4 ? 0.005 : 0.1;
        box.push_back({q.get<double>() - half, q.get<double>() + half});
    }
    Model model = diamond("arm", box, 0, 1);
    model.parameters = {{"obstacles", 8}};
    store(model, "arm.safetensors");
    const Result result = run({"certify", "arm.safetensors", "--margin", "0.005"});
    EXPECT_EQ(result.status, 0) << result.err << result.out;
    EXPECT_EQ(why_void(load_model(work() / "arm.safetensors")), "");
}

}  // namespace
}  // namespace ricochet::certify_test
