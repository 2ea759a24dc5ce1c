// RICOCHET_TEST_FIXTURES is the folder of the stored files. RICOCHET_PYTHON_WITH_TORCH,
// if it exists, is a Python with PyTorch, and RICOCHET_EXPORT_SCRIPT is the script
// that it runs.
#include "ricochet/nn/model.hpp"

#include "nn_models.hpp"
#include "ricochet/nn/mlp.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace ricochet::safetensors_test {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// 3 features, 5 hidden values, 2 logits, and an entry of every kind.
Model example()
{
    Model model = random_model({3, 5, 2}, Activation::tanh, 1);
    model.system = "bouncing-ball";
    model.parameters = {{"gravity", 9.81}, {"restitution", 0.8}};
    model.recipe = "state";
    model.offset = {0.1, -1.0 / 3, 1e-300};
    model.scale = {2, -0.7, 1e-5};
    model.domain = {{0, 1}, {-2, 0.1}, {-infinity, infinity}};
    model.threshold = -0.3;
    model.step_min = 1e-4;
    model.step_max = 0.1;
    model.seed = 18446744073709551615U;
    model.certificate = "margin 0.1,\n\"quoted\"";
    return model;
}

/// The parts of a file, which tests can change.
struct File {
    explicit File(const Model& model, const LoadOptions& options = {})
    {
        const std::vector<std::byte> bytes = to_safetensors(model, options);
        std::uint64_t length = 0;
        std::memcpy(&length, bytes.data(), 8);
        header = json::parse(reinterpret_cast<const char*>(bytes.data()) + 8,
                             reinterpret_cast<const char*>(bytes.data()) + 8 + length);
        data.assign(bytes.begin() + 8 + static_cast<std::ptrdiff_t>(length), bytes.end());
    }

    json header;
    std::vector<std::byte> data;
};

std::vector<std::byte> join(std::uint64_t length, const std::string& header,
                            const std::vector<std::byte>& data)
{
    std::vector<std::byte> bytes;
    for (int i = 0; i < 64; i += 8) bytes.push_back(static_cast<std::byte>((length >> i) & 0xff));
    for (const char c : header) bytes.push_back(static_cast<std::byte>(c));
    bytes.insert(bytes.end(), data.begin(), data.end());
    return bytes;
}

std::vector<std::byte> join(const std::string& header, const std::vector<std::byte>& data)
{
    return join(header.size(), header, data);
}

std::vector<std::byte> join(const File& file)
{
    return join(file.header.dump(), file.data);
}

/// The message about a file that is refused, or "".
std::string refusal(const std::vector<std::byte>& bytes, const LoadOptions& options = {})
{
    try {
        static_cast<void>(parse_model(bytes, "m.safetensors", options));
    } catch (const ModelError& error) {
        return error.what();
    }
    return "";
}

std::string refusal_after(const std::function<void(File&)>& change)
{
    File file(example());
    change(file);
    return refusal(join(file));
}

std::string refusal_with_metadata(const std::string& key, const std::string& value)
{
    return refusal_after([&](File& file) { file.header["__metadata__"][key] = value; });
}

void expect_same(const Model& a, const Model& b)
{
    const auto same_bits = [](double x, double y) {
        return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
    };
    const auto expect_same_bits = [&](const std::vector<double>& x, const std::vector<double>& y) {
        ASSERT_EQ(x.size(), y.size());
        for (std::size_t i = 0; i < x.size(); ++i)
            EXPECT_TRUE(same_bits(x[i], y[i])) << x[i] << ' ' << y[i];
    };
    EXPECT_EQ(a.kind, b.kind);
    EXPECT_EQ(a.system, b.system);
    EXPECT_EQ(a.parameters, b.parameters);
    EXPECT_EQ(a.recipe, b.recipe);
    expect_same_bits(a.offset, b.offset);
    expect_same_bits(a.scale, b.scale);
    ASSERT_EQ(a.domain.size(), b.domain.size());
    for (std::size_t i = 0; i < a.domain.size(); ++i) {
        EXPECT_EQ(a.domain[i].lower, b.domain[i].lower);
        EXPECT_EQ(a.domain[i].upper, b.domain[i].upper);
    }
    EXPECT_EQ(a.activation, b.activation);
    EXPECT_EQ(a.precision, b.precision);
    EXPECT_TRUE(same_bits(a.threshold, b.threshold));
    EXPECT_TRUE(same_bits(a.step_min, b.step_min));
    EXPECT_TRUE(same_bits(a.step_max, b.step_max));
    EXPECT_EQ(a.seed, b.seed);
    EXPECT_EQ(a.certificate, b.certificate);
    ASSERT_EQ(a.layers.size(), b.layers.size());
    for (std::size_t k = 0; k < a.layers.size(); ++k) {
        EXPECT_EQ(a.layers[k].inputs, b.layers[k].inputs);
        EXPECT_EQ(a.layers[k].outputs, b.layers[k].outputs);
        expect_same_bits(a.layers[k].weight, b.layers[k].weight);
        expect_same_bits(a.layers[k].bias, b.layers[k].bias);
    }
}

/// A folder of its own for each test, removed at its end.
class SafetensorsFile : public testing::Test {
protected:
    void SetUp() override
    {
        folder_ = fs::path(testing::TempDir()) /
                  (std::string("ricochet_") +
                   testing::UnitTest::GetInstance()->current_test_info()->name());
        fs::remove_all(folder_);
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    [[nodiscard]] std::size_t files() const
    {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), {}));
    }

    fs::path folder_;
};

// Round trip -----------------------------------------------------------------

TEST(Safetensors, EveryMemberKeepsItsBits)
{
    for (const Precision precision : {Precision::f32, Precision::f64}) {
        Model model = example();
        model.precision = precision;
        if (precision == Precision::f64) model.layers[0].weight[0] = 1.0 / 3;
        expect_same(parse_model(to_safetensors(model), "m"), model);
    }
}

TEST(Safetensors, AnUntouchedModelOfOneLayerIsAccepted)
{
    const Model model = random_model({2, 1}, Activation::relu, 1);
    expect_same(parse_model(to_safetensors(model), "m"), model);
}

TEST(Safetensors, AnEmptySelfTestIsFilledInAndReproducesToTheBit)
{
    for (const Precision precision : {Precision::f32, Precision::f64}) {
        Model model = example();
        model.precision = precision;
        const Model read = parse_model(to_safetensors(model), "m");
        ASSERT_EQ(read.self_test.input.size(), 3);
        ASSERT_EQ(read.self_test.output.size(), 2);
        std::array<double, 2> logits{};
        Classifier(model).logits(read.self_test.input.data(), logits.data());
        EXPECT_EQ(logits[0], read.self_test.output[0]);
        EXPECT_EQ(logits[1], read.self_test.output[1]);
        EXPECT_TRUE(Classifier(model).in_domain(read.self_test.input.data()));
    }
}

TEST(Safetensors, AGivenSelfTestIsKept)
{
    Model model = example();
    model.self_test = parse_model(to_safetensors(model), "m").self_test;
    model.self_test.input[0] += 1e-9;  // far below the tolerance for rounding to float
    const Model read = parse_model(to_safetensors(model), "m");
    EXPECT_EQ(read.self_test.input, model.self_test.input);
    EXPECT_EQ(read.self_test.output, model.self_test.output);
}

TEST(Safetensors, WeightsOfAFloatModelAreRoundedToFloat)
{
    Model model = example();
    model.layers[0].weight[0] = 1.0 / 3;
    const Model read = parse_model(to_safetensors(model), "m");
    EXPECT_EQ(read.layers[0].weight[0], static_cast<double>(1.0F / 3));
}

TEST(Safetensors, TheDataBeginAtAMultipleOfEightBytes)
{
    const std::vector<std::byte> bytes = to_safetensors(example());
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data(), 8);
    EXPECT_EQ(length % 8, 0);
    EXPECT_EQ(static_cast<char>(bytes[8]), '{');
}

TEST(Safetensors, UnknownMetadataAreIgnored)
{
    // Other tools leave their own entries, e.g. format: pt.
    EXPECT_EQ(refusal_with_metadata("format", "pt"), "");
}

TEST(Safetensors, NonFiniteWeightsAreAcceptedOnRequest)
{
    // max(0, x) keeps the NaN, so both logits are NaN, as stored in the self-test.
    Model model = example();
    model.activation = Activation::relu;
    model.layers[0].weight[4] = nan;
    model.layers[1].bias[1] = -infinity;
    const LoadOptions options{.allow_non_finite = true};
    const Model read = parse_model(to_safetensors(model, options), "m", options);
    EXPECT_TRUE(std::isnan(read.layers[0].weight[4]));
    EXPECT_EQ(read.layers[1].bias[1], -infinity);
    EXPECT_TRUE(std::isnan(read.self_test.output[0]));
}

// PyTorch --------------------------------------------------------------------

void expect_the_exported_model(const fs::path& path, Precision precision)
{
    // The load itself compares with the logits that PyTorch computed.
    const Model model = load_model(path);
    EXPECT_EQ(model.precision, precision);
    ASSERT_EQ(model.layers.size(), 3);
    EXPECT_EQ(model.layers[0].inputs, 2);
    EXPECT_EQ(model.layers[0].outputs, 8);
    EXPECT_EQ(model.layers[2].outputs, 1);
    EXPECT_EQ(model.parameters.at("gravity"), 9.81);
    EXPECT_EQ(model.self_test.input, (std::vector{0.75, -1.5}));
}

TEST(Safetensors, LoadsAStoredExportFromPyTorch)
{
    const fs::path fixtures = RICOCHET_TEST_FIXTURES;
    expect_the_exported_model(fixtures / "pytorch_f32.safetensors", Precision::f32);
    expect_the_exported_model(fixtures / "pytorch_f64.safetensors", Precision::f64);
}

#ifdef RICOCHET_PYTHON_WITH_TORCH
TEST_F(SafetensorsFile, LoadsWhatTheExportScriptWritesNow)
{
    for (const auto& [type, precision] :
         {std::pair("float32", Precision::f32), std::pair("float64", Precision::f64)}) {
        const fs::path path = folder_ / "exported.safetensors";
        const std::string command = std::string("\"") + RICOCHET_PYTHON_WITH_TORCH + "\" \"" +
                                    RICOCHET_EXPORT_SCRIPT + "\" \"" + path.string() + "\" " + type;
        ASSERT_EQ(std::system(command.c_str()), 0) << command;
        expect_the_exported_model(path, precision);
    }
}
#endif

// Refusals: the file as a whole ----------------------------------------------

TEST(Safetensors, RefusesEveryTruncationAndEveryExtension)
{
    const std::vector<std::byte> bytes = to_safetensors(example());
    for (std::size_t size = 0; size < bytes.size(); ++size) {
        EXPECT_NE(refusal({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)}), "")
            << size;
    }
    std::vector<std::byte> longer = bytes;
    longer.push_back(std::byte{0});
    EXPECT_EQ(refusal(longer),
              "m.safetensors: data: expected 128 bytes as the tensors take, found 129");
}

TEST(Safetensors, RefusesAFileShorterThanItsLength)
{
    EXPECT_EQ(refusal({}), "m.safetensors: length of header: expected 8 bytes, found 0");
}

TEST(Safetensors, RefusesAHeaderBeyondTheEndOfTheFile)
{
    EXPECT_EQ(refusal(join(100, "{}", {})), "m.safetensors: header: expected 100 bytes, found 2");
}

TEST(Safetensors, RefusesAHeaderTooLarge)
{
    EXPECT_EQ(refusal(join(std::uint64_t{1} << 63, "{}", {})),
              "m.safetensors: length of header: expected at most 1048576, "
              "found 9223372036854775808");
}

TEST(Safetensors, RefusesAHeaderThatIsNotJson)
{
    EXPECT_EQ(refusal(join("{\"a\": 1,,}", {})),
              "m.safetensors: header: expected JSON, found an error at its byte 9");
    EXPECT_EQ(refusal(join("", {})),
              "m.safetensors: header: expected JSON, found an error at its byte 1");
    EXPECT_EQ(refusal(join("{\"a\": 1e999}", {})),
              "m.safetensors: header: expected JSON, found a number out of range");
}

TEST(Safetensors, RefusesAHeaderThatIsNotAnObject)
{
    EXPECT_EQ(refusal(join("[]", {})), "m.safetensors: header: expected an object, found array");
}

TEST(Safetensors, RefusesJsonNestedDeeply)
{
    const std::string deep = std::string(500000, '[') + std::string(500000, ']');
    EXPECT_EQ(refusal(join("{\"a\": " + deep + "}", {})),
              "m.safetensors: header: expected at most 3 levels of JSON, found more");
}

TEST(Safetensors, RefusesAKeyThatAppearsTwice)
{
    EXPECT_EQ(refusal(join(R"({"a": {}, "b": {"c": 1, "c": 2}})", {})),
              "m.safetensors: header: key \"c\" appears twice");
    // The same key in two objects is no duplicate.
    EXPECT_EQ(refusal(join(R"({"a": {"c": 1}, "b": {"c": 2}})", {})),
              "m.safetensors: tensor \"a\": expected \"dtype\", found none");
}

// Refusals: tensors ----------------------------------------------------------

// The tensors of the example, 128 bytes: weights 5 x 3 and 2 x 5, biases 5 and 2.
const std::string first = "layers.0.weight";     // 0 to 60
const std::string first_bias = "layers.0.bias";  // 60 to 80
const std::string second = "layers.1.weight";    // 80 to 120

TEST(Safetensors, RefusesATensorThatIsNotDescribed)
{
    EXPECT_EQ(refusal_after([](File& file) { file.header[first] = 1; }),
              "m.safetensors: tensor \"layers.0.weight\": expected an object, found number");
    EXPECT_EQ(refusal_after([](File& file) { file.header[first].erase("shape"); }),
              "m.safetensors: tensor \"layers.0.weight\": expected \"shape\", found none");
    EXPECT_EQ(refusal_after([](File& file) { file.header[first]["strides"] = 1; }),
              "m.safetensors: tensor \"layers.0.weight\": expected dtype, shape and data_offsets "
              "only, found other keys");
}

TEST(Safetensors, RefusesAnUnknownType)
{
    EXPECT_EQ(refusal_after([](File& file) { file.header[first]["dtype"] = "BF16"; }),
              "m.safetensors: tensor \"layers.0.weight\": dtype: expected \"F32\" or \"F64\", "
              "found \"BF16\"");
    EXPECT_EQ(refusal_after([](File& file) { file.header[first]["dtype"] = 32; }),
              "m.safetensors: tensor \"layers.0.weight\": dtype: expected \"F32\" or \"F64\", "
              "found number");
}

TEST(Safetensors, RefusesOneTensorInAnotherType)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  // As many bytes, so that only the type is wrong.
                  file.header["layers.1.bias"] = {
                      {"dtype", "F64"}, {"shape", {1}}, {"data_offsets", {120, 128}}};
              }),
              "m.safetensors: tensor \"layers.1.bias\": dtype: expected \"F32\" as "
              "layers.0.weight has, found \"F64\"");
}

TEST(Safetensors, RefusesShapesAndOffsetsThatAreNotSizes)
{
    for (const json& bad : {json(-1), json(1.5), json("1"), json(nullptr), json(true)}) {
        const std::string type = bad.type_name();
        EXPECT_EQ(refusal_after([&](File& file) { file.header[first]["shape"][0] = bad; }),
                  "m.safetensors: tensor \"layers.0.weight\": shape: expected a size below 2^64, "
                  "found " +
                      type);
        EXPECT_EQ(refusal_after([&](File& file) { file.header[first]["data_offsets"][0] = bad; }),
                  "m.safetensors: tensor \"layers.0.weight\": data_offsets: expected a size below "
                  "2^64, found " +
                      type);
    }
    EXPECT_EQ(refusal_after([](File& file) { file.header[first]["shape"] = 15; }),
              "m.safetensors: tensor \"layers.0.weight\": shape: expected an array, found number");
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header[first]["data_offsets"] = {0, 60, 60};
              }),
              "m.safetensors: tensor \"layers.0.weight\": data_offsets: expected an array of two, "
              "found something else");
}

TEST(Safetensors, RefusesOffsetsOutOfRange)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header["layers.1.bias"]["data_offsets"] = {120, 132};
              }),
              "m.safetensors: tensor \"layers.1.bias\": data_offsets: expected a range within 128 "
              "bytes of data, found 120 to 132");
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header[first]["data_offsets"] = {60, 0};
              }),
              "m.safetensors: tensor \"layers.0.weight\": data_offsets: expected a range within "
              "128 bytes of data, found 60 to 0");
}

TEST(Safetensors, RefusesShapesWhoseProductOverflows)
{
    // 2^32 x 2^32 and 2^63 x 2 values are zero bytes modulo 2^64.
    for (const std::vector<std::uint64_t>& shape :
         {std::vector{std::uint64_t{1} << 32, std::uint64_t{1} << 32},
          std::vector{std::uint64_t{1} << 63, std::uint64_t{2}}}) {
        EXPECT_EQ(
            refusal_after([&](File& file) { file.header[first]["shape"] = shape; }),
            "m.safetensors: tensor \"layers.0.weight\": shape: expected at most the 128 bytes "
            "of data, found [" +
                std::to_string(shape[0]) + ", " + std::to_string(shape[1]) + "]");
    }
}

TEST(Safetensors, RefusesOffsetsThatDoNotMatchTheShape)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header[first]["shape"] = {5, 2};
              }),
              "m.safetensors: tensor \"layers.0.weight\": expected 40 bytes for shape [5, 2], "
              "found 60");
}

TEST(Safetensors, RefusesTensorsThatOverlap)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header[first_bias]["data_offsets"] = {56, 76};
              }),
              "m.safetensors: tensor \"layers.0.bias\": expected to begin at byte 60 of the data, "
              "where the one before ends, found 56");
}

TEST(Safetensors, RefusesAHoleBetweenTensors)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  file.data.resize(132);
                  file.header["layers.1.bias"]["data_offsets"] = {124, 132};
              }),
              "m.safetensors: tensor \"layers.1.bias\": expected to begin at byte 120 of the data, "
              "where the one before ends, found 124");
}

TEST(Safetensors, RefusesTensorsOfOtherNames)
{
    for (const std::string name : {"weight", "layers..bias", "layers.1.scale", "layers.a.bias"}) {
        EXPECT_EQ(refusal_after([&](File& file) {
                      file.header[name] = file.header[second];
                      file.header.erase(second);
                  }),
                  "m.safetensors: tensor \"" + name +
                      "\": expected the name layers.<k>.weight or layers.<k>.bias, found this");
    }
}

TEST(Safetensors, RefusesAModelWithoutTensors)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header = {{"__metadata__", file.header["__metadata__"]}};
                  file.data.clear();
              }),
              "m.safetensors: header: expected 2 to 128 tensors, found 0");
}

TEST(Safetensors, RefusesAMissingBias)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header.erase("layers.1.bias");
                  file.data.resize(120);
              }),
              "m.safetensors: tensor \"layers.1.bias\" is missing");
}

TEST(Safetensors, RefusesAMissingLayer)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  for (const std::string part : {"weight", "bias"}) {
                      file.header["layers.2." + part] = file.header["layers.1." + part];
                      file.header.erase("layers.1." + part);
                  }
              }),
              "m.safetensors: tensor \"layers.1.weight\" is missing");
}

TEST(Safetensors, RefusesLayersThatDoNotFitTogether)
{
    // Transposed: 5 x 2 where 2 outputs of 5 hidden values make 2 x 5.
    EXPECT_EQ(
        refusal_after([](File& file) {
            file.header[second]["shape"] = {5, 2};
        }),
        "m.safetensors: tensor \"layers.1.weight\": shape: expected [outputs, 5], found [5, 2]");
    EXPECT_EQ(refusal_after([](File& file) {
                  file.header[first]["shape"] = {3, 5};
              }),
              "m.safetensors: tensor \"layers.0.bias\": shape: expected [3], found [5]");
    EXPECT_EQ(refusal_after([](File& file) { file.header[first]["shape"] = {15}; }),
              "m.safetensors: tensor \"layers.0.weight\": shape: expected [outputs, inputs], "
              "found [15]");
}

TEST(Safetensors, RefusesALayerWithoutOutputs)
{
    EXPECT_EQ(refusal_after([](File& file) {
                  for (auto& [name, tensor] : file.header.items()) {
                      if (name == "__metadata__") continue;
                      tensor["data_offsets"] = {0, 0};
                      tensor["shape"] = {0};
                  }
                  file.header[first]["shape"] = {0, 3};
                  file.header[second]["shape"] = {0, 0};
                  file.header["__metadata__"]["self_test_output"] = "";
                  file.data.clear();
              }),
              "m.safetensors: Mlp: layer 0: expected a width from 1 to 256, found 0");
}

TEST(Safetensors, RefusesALayerThatIsTooWide)
{
    Model model = example();
    model.layers = random_model({3, 257, 2}, Activation::relu, 0).layers;
    EXPECT_THROW(static_cast<void>(to_safetensors(model)), ModelError);
}

TEST(Safetensors, RefusesNonFiniteWeights)
{
    for (const float bad :
         {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity()}) {
        const std::string text = std::isnan(bad) ? "nan" : "-inf";
        EXPECT_EQ(refusal_after([&](File& file) { std::memcpy(&file.data[64], &bad, 4); }),
                  "m.safetensors: tensor \"layers.0.bias\": value 1: expected a finite number, "
                  "found " +
                      text);
    }
}

// Refusals: metadata ---------------------------------------------------------

TEST(Safetensors, RefusesMissingMetadata)
{
    for (const std::string key :
         {"ricochet", "kind", "system", "parameters", "recipe", "offset", "scale", "domain",
          "activation", "threshold", "step_range", "seed", "self_test_input", "self_test_output"}) {
        EXPECT_EQ(refusal_after([&](File& file) { file.header["__metadata__"].erase(key); }),
                  "m.safetensors: metadata \"" + key + "\" is missing");
    }
    EXPECT_EQ(refusal_after([](File& file) { file.header.erase("__metadata__"); }),
              "m.safetensors: metadata \"ricochet\" is missing");
}

TEST(Safetensors, RefusesMetadataThatAreNotStrings)
{
    EXPECT_EQ(refusal_after([](File& file) { file.header["__metadata__"]["threshold"] = 0.5; }),
              "m.safetensors: metadata \"threshold\": expected a string, found number");
    EXPECT_EQ(refusal_after([](File& file) { file.header["__metadata__"] = "none"; }),
              "m.safetensors: metadata: expected an object, found string");
}

TEST(Safetensors, RefusesAnotherVersionKindOrActivation)
{
    EXPECT_EQ(refusal_with_metadata("ricochet", "2"),
              "m.safetensors: metadata \"ricochet\": expected format version \"1\", found \"2\"");
    EXPECT_EQ(
        refusal_with_metadata("kind", "poet"),
        "m.safetensors: metadata \"kind\": expected \"event-classifier\", "
        "\"gate-horizon\", \"gate-level\", \"step-policy\", \"guard\" or \"step-actor\", found "
        "\"poet\"");
    EXPECT_EQ(refusal_with_metadata("activation", "gelu"),
              "m.safetensors: metadata \"activation\": expected \"relu\" or \"tanh\", "
              "found \"gelu\"");
}

TEST(Safetensors, RefusesTextForANumber)
{
    for (const std::string text : {"", "x", "1x", "1 ", "0x1p3", "+1", "1,5"}) {
        EXPECT_EQ(refusal_with_metadata("seed", text),
                  "m.safetensors: metadata \"seed\": expected a number, found \"" + text + "\"");
    }
    EXPECT_EQ(
        refusal_with_metadata("seed", "18446744073709551616"),
        "m.safetensors: metadata \"seed\": expected a number, found \"18446744073709551616\"");
    EXPECT_EQ(refusal_with_metadata("threshold", "half"),
              "m.safetensors: metadata \"threshold\": expected a number, found \"half\"");
    EXPECT_EQ(refusal_with_metadata("threshold", "0.5 0.5"),
              "m.safetensors: metadata \"threshold\": expected 1 number, found 2");
}

TEST(Safetensors, RefusesListsOfAnotherLength)
{
    for (const auto& [key, count] :
         {std::pair("offset", "3"), std::pair("scale", "3"), std::pair("domain", "6"),
          std::pair("step_range", "2"), std::pair("self_test_input", "3"),
          std::pair("self_test_output", "2")}) {
        EXPECT_EQ(refusal_with_metadata(key, "1 1 1 1"), std::string("m.safetensors: metadata \"") +
                                                             key + "\": expected " + count +
                                                             " numbers, found 4");
    }
}

TEST(Safetensors, RefusesParametersWithoutNameOrTwice)
{
    EXPECT_EQ(refusal_with_metadata("parameters", "gravity"),
              "m.safetensors: metadata \"parameters\": expected name=value, found \"gravity\"");
    EXPECT_EQ(refusal_with_metadata("parameters", "=1"),
              "m.safetensors: metadata \"parameters\": expected name=value, found \"=1\"");
    EXPECT_EQ(refusal_with_metadata("parameters", "a=1 a=1"),
              "m.safetensors: metadata \"parameters\": a appears twice");
}

TEST(Safetensors, RefusesAScaleOfZeroAndNonFiniteNormalisation)
{
    EXPECT_EQ(
        refusal_with_metadata("scale", "1 0 1"),
        "m.safetensors: metadata \"scale\": expected finite numbers other than zero, found 0");
    EXPECT_EQ(refusal_with_metadata("scale", "1 1 inf"),
              "m.safetensors: metadata \"scale\": expected finite numbers other than zero, "
              "found inf");
    EXPECT_EQ(refusal_with_metadata("offset", "0 nan 0"),
              "m.safetensors: metadata \"offset\": expected finite numbers, found nan");
}

TEST(Safetensors, RefusesAReversedDomainOrStepRange)
{
    EXPECT_EQ(refusal_with_metadata("domain", "0 1 2 -2 0 1"),
              "m.safetensors: metadata \"domain\" of feature 1: expected lower <= upper, "
              "found 2 and -2");
    EXPECT_EQ(refusal_with_metadata("domain", "0 1 0 nan 0 1"),
              "m.safetensors: metadata \"domain\" of feature 1: expected lower <= upper, "
              "found 0 and nan");
    EXPECT_EQ(refusal_with_metadata("step_range", "0.1 0.01"),
              "m.safetensors: metadata \"step_range\": expected 0 <= smallest <= largest, "
              "found 0.1 and 0.01");
    EXPECT_EQ(refusal_with_metadata("step_range", "-1 1"),
              "m.safetensors: metadata \"step_range\": expected 0 <= smallest <= largest, "
              "found -1 and 1");
}

TEST(Safetensors, RefusesANanThreshold)
{
    EXPECT_EQ(refusal_with_metadata("threshold", "nan"),
              "m.safetensors: metadata \"threshold\": expected a number, found nan");
}

// Refusals: the self-test ----------------------------------------------------

TEST(Safetensors, RefusesASelfTestThatDoesNotReproduce)
{
    Model model = example();
    model.self_test = parse_model(to_safetensors(model), "m").self_test;
    const double found = model.self_test.output[1];
    model.self_test.output[1] = 0.25;
    try {
        static_cast<void>(to_safetensors(model));
        FAIL() << "not refused";
    } catch (const ModelError& error) {
        const std::string message = error.what();
        const std::string begin = "model: self-test: output 1: expected 0.25, found ";
        ASSERT_EQ(message.substr(0, begin.size()), begin);
        EXPECT_EQ(std::stod(message.substr(begin.size())), found);
    }
}

TEST(Safetensors, ASelfTestFindsAnotherActivationAndExchangedFeatures)
{
    EXPECT_NE(refusal_with_metadata("activation", "relu"), "");
    EXPECT_NE(refusal_after([](File& file) {
                  // Columns 0 and 1 of the first layer, exchanged in every row.
                  for (std::size_t row = 0; row < 5; ++row) {
                      for (std::size_t byte = 0; byte < 4; ++byte) {
                          std::swap(file.data[row * 12 + byte], file.data[row * 12 + 4 + byte]);
                      }
                  }
              }),
              "");
}

TEST(Safetensors, ASelfTestBeyondTheBoundOfRoundingIsRefusedAndWithinItIsNot)
{
    // One input, one output, y = x: the bound is 2 (4 u |x| + 3 u |x| (1 + 4 u) + 8 u |x|),
    // about 30 u |x|.
    Model model = random_model({1, 1}, Activation::relu, 0);
    model.layers[0].weight = {1};
    model.layers[0].bias = {0};
    model.precision = Precision::f64;
    const double u = 0x1p-53;
    model.self_test = {{1}, {1 + 28 * u}};
    EXPECT_NO_THROW(static_cast<void>(to_safetensors(model)));
    model.self_test = {{1}, {1 + 32 * u}};
    EXPECT_THROW(static_cast<void>(to_safetensors(model)), ModelError);
}

TEST(Safetensors, RefusesASelfTestWithNonFiniteInput)
{
    EXPECT_EQ(refusal_with_metadata("self_test_input", "0 inf 0"),
              "m.safetensors: metadata \"self_test_input\": expected finite numbers, found inf");
}

// Writing --------------------------------------------------------------------

std::string refusal_to_write(const Model& model)
{
    try {
        static_cast<void>(to_safetensors(model));
    } catch (const ModelError& error) {
        return error.what();
    }
    return "";
}

TEST(Safetensors, DoesNotWriteWhatItWouldNotRead)
{
    Model model = example();
    model.layers[0].weight[0] = nan;
    EXPECT_EQ(refusal_to_write(model),
              "model: tensor \"layers.0.weight\": value 0: expected a finite number, found nan");
    model = example();
    model.layers[0].weight[0] = 1e300;  // infinite in float
    EXPECT_EQ(refusal_to_write(model),
              "model: tensor \"layers.0.weight\": value 0: expected a finite number, found inf");
    model = example();
    model.threshold = nan;
    EXPECT_EQ(refusal_to_write(model),
              "model: metadata \"threshold\": expected a number, found nan");
    model = example();
    model.offset.pop_back();
    EXPECT_EQ(refusal_to_write(model),
              "model: Classifier: expected one offset for each of 3 inputs, found 2");
    model = example();
    model.self_test.input = {1};
    EXPECT_EQ(refusal_to_write(model),
              "model: metadata \"self_test_input\": expected 3 numbers, found 1");
}

TEST(Safetensors, RefusesParameterNamesThatCouldNotBeReadBack)
{
    for (const std::string bad : {"", "two words", "a=b"}) {
        Model model = example();
        model.parameters = {{bad, 1}};
        EXPECT_EQ(refusal_to_write(model),
                  "model: parameter: expected a name without blanks and equals signs, found \"" +
                      bad + "\"");
    }
}

TEST(Safetensors, RefusesTextThatIsNotUtf8)
{
    Model model = example();
    model.certificate = std::string(1, '\xff');
    EXPECT_EQ(refusal_to_write(model),
              "model: metadata: expected text in UTF-8, found other bytes");
}

TEST_F(SafetensorsFile, ASavedModelIsLoadedAsItWas)
{
    const fs::path path = folder_ / "model.safetensors";
    save_model(example(), path);
    expect_same(load_model(path), example());
    EXPECT_EQ(files(), 1);
}

TEST_F(SafetensorsFile, SavingReplacesAFile)
{
    const fs::path path = folder_ / "model.safetensors";
    save_model(random_model({1, 1}, Activation::relu, 0), path);
    save_model(example(), path);
    expect_same(load_model(path), example());
    EXPECT_EQ(files(), 1);
}

TEST_F(SafetensorsFile, AModelThatIsRefusedLeavesTheFileAsItWas)
{
    const fs::path path = folder_ / "model.safetensors";
    save_model(example(), path);
    Model broken = example();
    broken.threshold = nan;
    EXPECT_THROW(save_model(broken, path), ModelError);
    expect_same(load_model(path), example());
    EXPECT_EQ(files(), 1);
}

TEST_F(SafetensorsFile, AFailedRenameLeavesNothingBehind)
{
    const fs::path path = folder_ / "occupied";
    fs::create_directories(path / "inside");
    EXPECT_THROW(save_model(example(), path), ModelError);
    EXPECT_EQ(files(), 1);
}

TEST_F(SafetensorsFile, AFolderThatDoesNotExistIsReported)
{
    const fs::path path = folder_ / "none" / "model.safetensors";
    try {
        save_model(example(), path);
        FAIL() << "not refused";
    } catch (const ModelError& error) {
        EXPECT_EQ(error.what(), path.string() + ": cannot be written: No such file or directory");
    }
}

TEST_F(SafetensorsFile, AMissingFileAFolderAndAHugeFileAreRefused)
{
    const auto refusal_of = [](const fs::path& path) -> std::string {
        try {
            static_cast<void>(load_model(path));
        } catch (const ModelError& error) {
            return error.what();
        }
        return "";
    };
    const fs::path missing = folder_ / "missing";
    EXPECT_EQ(refusal_of(missing), missing.string() + ": No such file or directory");
    EXPECT_EQ(refusal_of(folder_), folder_.string() + ": expected a file, found something else");
    const fs::path huge = folder_ / "huge";
    std::ofstream(huge) << 'x';
    fs::resize_file(huge, std::uintmax_t{1} << 40);  // sparse
    EXPECT_EQ(refusal_of(huge),
              huge.string() + ": file: expected at most 67108864 bytes, found 1099511627776");
}

TEST_F(SafetensorsFile, TheMessageNamesTheFile)
{
    const fs::path path = folder_ / "short";
    std::ofstream(path) << "abc";
    try {
        static_cast<void>(load_model(path));
        FAIL() << "not refused";
    } catch (const ModelError& error) {
        EXPECT_EQ(error.what(), path.string() + ": length of header: expected 8 bytes, found 3");
    }
}

}  // namespace
}  // namespace ricochet::safetensors_test
