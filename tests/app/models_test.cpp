// `ricochet inspect`, and model files that do not fit.
#include "app.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::models_test {
namespace {

Model any_step_model()
{
    return load_model(RICOCHET_MODELS "/bouncing-ball.safetensors");
}

std::string bytes_of(const Model& model, const LoadOptions& options = {})
{
    const std::vector<std::byte> bytes = to_safetensors(model, options);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The file with its JSON header changed by `change`, and the tensors as they were.
std::string with_header(const std::string& file, const std::function<void(nlohmann::json&)>& change)
{
    std::uint64_t length = 0;
    for (std::size_t i = 8; i-- > 0;) {
        length = length << 8 | static_cast<unsigned char>(file[i]);
    }
    nlohmann::json header = nlohmann::json::parse(file.substr(8, length));
    change(header);
    const std::string text = header.dump();
    std::string out;
    for (unsigned i = 0; i < 8; ++i) out += static_cast<char>(text.size() >> (8 * i) & 0xff);
    return out + text + file.substr(8 + length);
}

// --- inspect ---

TEST_F(App, InspectTellsWhatAModelFileIs)
{
    const Model model = any_step_model();
    const nlohmann::json found = json({"inspect", "bouncing-ball", "--json"});
    EXPECT_TRUE(found["file"].get<std::string>().ends_with("/bouncing-ball.safetensors"));
    EXPECT_EQ(found["bytes"], fs::file_size(RICOCHET_MODELS "/bouncing-ball.safetensors"));
    EXPECT_EQ(found["kind"], "event-classifier");
    EXPECT_EQ(found["system"], "bouncing-ball");
    EXPECT_TRUE(found["parameters"].empty());
    EXPECT_EQ(found["recipe"], "ballistic");
    ASSERT_EQ(found["features"].size(), 2U);
    EXPECT_EQ(found["features"][1]["offset"], model.offset[1]);
    EXPECT_EQ(found["features"][1]["scale"], model.scale[1]);
    EXPECT_EQ(found["features"][1]["domain"][0], model.domain[1].lower);
    ASSERT_EQ(found["layers"].size(), model.layers.size());
    EXPECT_EQ(found["layers"][0]["inputs"], 2);
    EXPECT_EQ(found["layers"][0]["outputs"], model.layers[0].outputs);
    EXPECT_EQ(found["activation"], "relu");
    EXPECT_EQ(found["precision"], "f32");
    EXPECT_EQ(found["weights"], 2 * 16 + 16 + 16 + 1);
    EXPECT_EQ(found["threshold"], model.threshold);
    EXPECT_EQ(found["step_range"], nlohmann::json::array({model.step_min, model.step_max}));
    EXPECT_EQ(found["seed"], model.seed);
    EXPECT_EQ(found["self_test"]["reproduced"], true);
    EXPECT_EQ(found["self_test"]["input"], model.self_test.input);
    EXPECT_EQ(found["self_test"]["recorded"], model.self_test.output);
    EXPECT_TRUE(found["certificate"].is_null());
    EXPECT_GT(found["cost"]["nanoseconds"]["median"], 0.1);
    EXPECT_LT(found["cost"]["nanoseconds"]["median"], 1e5);
    EXPECT_EQ(found["cost"]["instruction_set"], name(best_instruction_set()));
}

TEST_F(App, InspectTakesPathsAndPrintsText)
{
    write("mine", bytes_of(load_model(RICOCHET_MODELS "/bouncing-ball-step-0.01.safetensors")));
    const Result result = run({"inspect", "mine"});
    EXPECT_EQ(result.status, 0) << result.err;
    for (const char* piece : {"gravity = 9.81", "0.01 s only", "u [m]", "v [m/s]",
                              "2 - 16 - 16 - 16 - 16 - 16 - 1", "reproduced", "none", "ns"}) {
        EXPECT_NE(result.out.find(piece), std::string::npos) << piece << " in:\n" << result.out;
    }
}

TEST_F(App, InspectShowsModelsForSystemsAndRecipesNotKnownHere)
{
    Model model = any_step_model();
    model.system = "pendu\x1b[2Jlum";  // would clear the terminal
    model.recipe = "polar";
    model.certificate = "by hand";
    write("foreign", bytes_of(model));
    const Result result = run({"inspect", "foreign"});
    EXPECT_EQ(result.status, 0) << result.err;
    for (const char* piece :
         {"pendu?[2Jlum (not known here)", "polar (not known here)", "feature 1", "by hand"}) {
        EXPECT_NE(result.out.find(piece), std::string::npos) << piece << " in:\n" << result.out;
    }
    EXPECT_EQ(result.out.find('\x1b'), std::string::npos);
    EXPECT_EQ(json({"inspect", "foreign", "--json"})["system"], model.system);
}

// --- models that do not suit the run ---

TEST_F(App, ModelsForSomethingElseAreRefused)
{
    expect_refused(simulate({"--model", "missing.safetensors"}),
                   {"missing.safetensors", "searched"});
    expect_refused({"inspect", "missing"}, {"missing", "searched"});
    expect_refused({"inspect"}, {"MODEL"});

    const auto refuse = [&](const Model& model, const Words& pieces) {
        write("other", bytes_of(model));
        for (const char* detector : {"network", "verified"}) {
            expect_refused(simulate({"--model", "other", "--detector", detector}), pieces);
        }
    };
    Model other = any_step_model();
    other.system = "pendulum";
    refuse(other, {"'other'", "pendulum", "bouncing-ball"});
    other.system = "pendu\nlum";  // and the refusal stays one line
    refuse(other, {"'other'", "pendu?lum"});

    other = any_step_model();
    other.recipe = "polar";
    refuse(other, {"'other'", "polar", "known are state, ballistic"});

    other = any_step_model();
    other.parameters = {{"mass", 1}};
    refuse(other, {"'other'", "mass", "bouncing-ball"});

    other = any_step_model();
    other.layers.back() = {
        .inputs = 16, .outputs = 2, .weight = std::vector<double>(32), .bias = {0, 0}};
    other.self_test = {};
    refuse(other, {"'other'", "2 outputs", "expected 1"});

    other = any_step_model();
    other.layers = {{.inputs = 3, .outputs = 1, .weight = {1, 2, 3}, .bias = {0}}};
    other.offset = {0, 0, 0};
    other.scale = {1, 1, 1};
    other.domain = {{0, 1}, {0, 1}, {0, 1}};
    other.recipe = "state";
    other.self_test = {};
    refuse(other, {"'other'", "3 features", "2 of a state of bouncing-ball"});
}

TEST_F(App, ModelsForOtherStepsAndParametersAreRefused)
{
    const std::string fixed = "bouncing-ball-step-0.01";
    for (const char* detector : {"network", "verified"}) {
        const auto with = [&](Words more) {
            more.insert(more.end(), {"--detector", detector});
            return simulate(more);
        };
        expect_refused(with({"--model", fixed, "--step", "0.02"}), {fixed, "0.01", "0.02"});
        expect_refused(with({"--model", fixed}), {fixed, "--step 0.01"});
        expect_refused(with({"--model", fixed, "--step", "0.01", "--set", "gravity=2"}),
                       {fixed, "gravity = 9.81", "2"});
        expect_refused(with({"--step", "1000"}), {"[1e-06, 100]", "1000"});
    }
    expect_refused(simulate({"--model", fixed, "--detector", "ends"}), {"--model", "ends"});
    expect_refused(simulate({"--model", fixed, "--detector", "line"}), {"--model", "line"});
}

TEST_F(App, AGateForFixedStepsIsRefusedUnderErrorControl)
{
    Model gate = load_model(RICOCHET_MODELS "/pendulum-gate.safetensors");
    gate.step_min = gate.step_max;
    write("gate", bytes_of(gate));
    expect_refused({"simulate", "pendulum", "--gate", "calibrated", "--model", "gate"},
                   {"model 'gate' is for fixed steps of 0.01 s; expected --step 0.01, or a gate "
                    "trained for error control"});
}

TEST_F(App, AModelThatIsNotFoundNamesEveryPlaceOnce)
{
    expect_refused({"inspect", "models/none.safetensors"},
                   {"searched for models/none.safetensors;", "share/ricochet/models"});
    const std::string places = run({"inspect", "none.safetensors"}).err;
    EXPECT_NE(places.find("share/ricochet/models/none.safetensors"), std::string::npos) << places;
    EXPECT_EQ(places.find(".safetensors.safetensors"), std::string::npos) << places;
}

// --- files that are no models, or not to be believed ---

TEST_F(App, FilesThatAreNoModelsAreRefused)
{
    write("text", "this is not a model, whatever its name says");
    write("empty", "");
    const std::string whole = bytes_of(any_step_model());
    write("cut", whole.substr(0, whole.size() - 1));
    for (const char* name : {"text", "empty", "cut"}) {
        expect_refused(simulate({"--model", name}), {name});
        expect_refused({"inspect", name}, {name});
    }
    expect_refused(simulate({"--model", "."}), {"."});
    expect_refused({"inspect", "."}, {"."});
}

TEST_F(App, ModelsThatDoNotFitTheFormatAreRefused)
{
    struct Case {
        std::function<void(nlohmann::json&)> change;
        Words pieces;
    };
    const auto metadata = [](const char* key, const char* value) {
        return [=](nlohmann::json& header) { header["__metadata__"][key] = value; };
    };
    const auto tensor = [](const char* name, const char* key, const nlohmann::json& value) {
        return [=](nlohmann::json& header) { header[name][key] = value; };
    };
    const std::vector<Case> cases{
        {tensor("layers.0.weight", "dtype", "F16"), {"layers.0.weight", "dtype", "F32", "F16"}},
        {tensor("layers.0.weight", "shape", {2, 16}), {"layers.0.bias", "[2]", "[16]"}},
        {tensor("layers.1.weight", "shape", {16, 1}), {"layers.1.weight", "16]", "[16, 1]"}},
        {tensor("layers.0.weight", "shape", {32, 2}), {"layers.0.weight", "bytes"}},
        {metadata("activation", "gelu"), {"activation", "relu", "tanh", "gelu"}},
        {metadata("kind", "oracle"), {"kind", "event-classifier", "oracle"}},
        {metadata("step_range", "2 1"), {"step_range", "2 and 1"}},
        {metadata("scale", "0.25"), {"scale", "2 numbers", "1"}},
        {metadata("self_test_output", "-829"), {"self-test", "-829", "-829.05"}},
        {[](nlohmann::json& header) { header["__metadata__"].erase("recipe"); }, {"recipe"}},
    };
    const std::string sound = bytes_of(any_step_model());
    write("sound", with_header(sound, [](nlohmann::json&) {}));
    EXPECT_EQ(run({"inspect", "sound"}).status, 0);
    for (const Case& c : cases) {
        write("broken", with_header(sound, c.change));
        Words pieces = c.pieces;
        pieces.emplace_back("broken: ");
        expect_refused(simulate({"--model", "broken"}), pieces);
        expect_refused({"inspect", "broken"}, pieces);
    }
}

TEST_F(App, NonFiniteWeightsAreRefused)
{
    for (const double value :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        Model model = any_step_model();
        model.layers[0].weight[3] = value;
        model.self_test = {};
        write("spoilt", bytes_of(model, {.allow_non_finite = true}));
        const Words pieces{"spoilt", "layers.0.weight", "value 3", "finite"};
        expect_refused(simulate({"--model", "spoilt"}), pieces);
        expect_refused(simulate({"--model", "spoilt", "--detector", "verified"}), pieces);
        expect_refused({"inspect", "spoilt"}, pieces);
    }
}

// --- networks that are wrong ---

/// The any-step model with a last layer that returns the same for every step.
Model constant_model(double logit)
{
    Model model = any_step_model();
    model.layers.back().weight.assign(model.layers.back().weight.size(), 0);
    model.layers.back().bias = {logit};
    model.self_test = {};
    return model;
}

TEST_F(App, VerifiedFindsTheEventsOfExtremumWhateverTheNetworkSays)
{
    Model backward = any_step_model();
    for (double& weight : backward.layers.back().weight) weight = -weight;
    backward.self_test = {};
    write("good", bytes_of(any_step_model()));
    write("clear", bytes_of(constant_model(-1e6)));
    write("alarm", bytes_of(constant_model(1e6)));
    write("backward", bytes_of(backward));

    const std::vector<Words> steppings{{"--step", "0.01"},
                                       {"--step", "0.3", "--stepper", "dopri5"},
                                       {"--stepper", "dopri5"},
                                       {"--stepper", "fehlberg78", "--rtol", "1e-5"}};
    for (const Words& stepping : steppings) {
        const auto with = [&](Words more) {
            more.insert(more.end(), stepping.begin(), stepping.end());
            more.emplace_back("--json");
            return json(simulate(more));
        };
        // Every number in the JSON round-trips, so equal JSON is equal bits.
        const nlohmann::json exact = with({"--detector", "extremum"});
        ASSERT_EQ(exact["events"].size(), 13U);
        for (const char* model : {"good", "clear", "alarm", "backward"}) {
            SCOPED_TRACE(std::string(model) + ' ' + stepping[1]);
            const nlohmann::json run = with({"--detector", "verified", "--model", model});
            EXPECT_EQ(run["events"], exact["events"]);
            EXPECT_EQ(run["state"], exact["state"]);
            EXPECT_EQ(run["outcome"], exact["outcome"]);
            EXPECT_EQ(run["statistics"]["steps"], exact["statistics"]["steps"]);
            EXPECT_EQ(run["statistics"]["checks_deferred"], 0);
        }
    }
}

TEST_F(App, MissesAndFalseAlarmsOfAWrongNetworkAreCounted)
{
    write("clear", bytes_of(constant_model(-1e6)));
    write("alarm", bytes_of(constant_model(1e6)));
    const auto statistics = [&](const char* detector, const char* model) -> nlohmann::json {
        return json(simulate(
            {"--json", "--step", "0.01", "--detector", detector, "--model", model}))["statistics"];
    };
    EXPECT_EQ(statistics("verified", "clear")["missed_events"], 13);
    EXPECT_EQ(statistics("verified", "clear")["late_events"], 0);
    const nlohmann::json alarmed = statistics("network", "alarm");
    EXPECT_EQ(alarmed["checks_deferred"], 0);
    EXPECT_EQ(alarmed["false_alarms"], alarmed["steps"].get<int>() - 13);
    const nlohmann::json cleared = statistics("network", "clear");
    EXPECT_EQ(cleared["checks_deferred"], cleared["steps"]);
}

}  // namespace
}  // namespace ricochet::models_test
