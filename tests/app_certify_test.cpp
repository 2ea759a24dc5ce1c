// `ricochet certify`, and what `inspect` says of a certificate.
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "app.hpp"
#include "ricochet/nn/certificate.hpp"
#include "ricochet/nn/safetensors.hpp"

namespace ricochet {
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
    EXPECT_NE(result.out.find("proved over the whole domain"), std::string::npos);
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

}  // namespace
}  // namespace ricochet
