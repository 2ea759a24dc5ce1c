#include "ricochet/nn/safetensors.hpp"

#include "../files/read_file.hpp"
#include "../files/strict_json.hpp"
#include "ricochet/detail/classifier.hpp"
#include "ricochet/detail/pack.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <span>
#include <string>
#include <system_error>
#include <utility>

namespace ricochet {
namespace {

using nlohmann::json;

constexpr std::string_view format_version = "1";
constexpr std::array<std::string_view, 5> known_kinds{"event-classifier", "gate-horizon",
                                                      "gate-level", "step-policy", "step-actor"};

constexpr std::size_t length_bytes = 8;
constexpr std::size_t max_header = std::size_t{1} << 20;
/// More than the largest network that `Mlp` takes, and a header.
constexpr std::size_t max_file = std::size_t{1} << 26;
/// The header is an object of objects of arrays.
constexpr int max_depth = 3;

/// Ends the work on one file with a sentence that begins with its name.
class Refusal {
public:
    explicit Refusal(std::string_view file) : file_(file) {}

    [[noreturn]] void operator()(const std::string& what) const
    {
        throw ModelError(file_ + ": " + what);
    }
    [[noreturn]] void operator()(std::string_view where, std::string_view expected,
                                 std::string_view found) const
    {
        (*this)(std::string(where) + ": expected " + std::string(expected) + ", found " +
                std::string(found));
    }

private:
    std::string file_;
};

std::string in_quotes(std::string_view text)
{
    return "\"" + std::string(text) + "\"";
}

/// The shortest decimal that reads back to the same double.
std::string decimal(double value)
{
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return {text.data(), end};
}

/// Little-endian, whatever the machine.
template <class Word>
Word read_word(const std::byte* from)
{
    Word word = 0;
    for (std::size_t i = 0; i < sizeof(Word); ++i) {
        word |= static_cast<Word>(std::to_integer<Word>(from[i]) << (8 * i));
    }
    return word;
}

template <class Word>
void append_word(std::vector<std::byte>& to, Word word)
{
    for (std::size_t i = 0; i < sizeof(Word); ++i) {
        to.push_back(static_cast<std::byte>((word >> (8 * i)) & 0xff));
    }
}

double read_value(const std::byte* from, Precision precision)
{
    if (precision == Precision::f64) return std::bit_cast<double>(read_word<std::uint64_t>(from));
    return static_cast<double>(std::bit_cast<float>(read_word<std::uint32_t>(from)));
}

void append_values(std::vector<std::byte>& to, const std::vector<double>& values,
                   Precision precision)
{
    for (const double value : values) {
        if (precision == Precision::f64) {
            append_word(to, std::bit_cast<std::uint64_t>(value));
        } else {
            append_word(to, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
        }
    }
}

std::size_t value_bytes(Precision precision)
{
    return precision == Precision::f64 ? 8 : 4;
}

std::string_view dtype(Precision precision)
{
    return precision == Precision::f64 ? "F64" : "F32";
}

// Header ---------------------------------------------------------------------

struct Tensor {
    Precision precision = Precision::f32;
    std::vector<std::uint64_t> shape;
    std::uint64_t begin = 0;  ///< in bytes after the header
    std::uint64_t end = 0;
};

struct Header {
    std::map<std::string, std::string, std::less<>> metadata;
    std::map<std::string, Tensor, std::less<>> tensors;
};

std::string describe(const std::vector<std::uint64_t>& shape)
{
    std::string text = "[";
    for (const std::uint64_t extent : shape) {
        if (text.size() > 1) text += ", ";
        text += std::to_string(extent);
    }
    return text + "]";
}

json parse_json(std::string_view text, const Refusal& refuse)
{
    try {
        return detail::parse_strictly(text, max_depth);
    } catch (const detail::JsonTrouble& trouble) {
        refuse(std::string("header: ") + trouble.what());
    }
}

std::uint64_t parse_size(const json& value, const std::string& where, const Refusal& refuse)
{
    if (!value.is_number_unsigned()) refuse(where, "a size below 2^64", value.type_name());
    return value.get<std::uint64_t>();
}

Tensor parse_tensor(const std::string& name, const json& entry, const Refusal& refuse)
{
    const std::string where = "tensor " + in_quotes(name);
    if (!entry.is_object()) refuse(where, "an object", entry.type_name());
    for (const char* key : {"dtype", "shape", "data_offsets"}) {
        if (!entry.contains(key)) refuse(where, in_quotes(key), "none");
    }
    if (entry.size() != 3) refuse(where, "dtype, shape and data_offsets only", "other keys");

    Tensor tensor;
    const json& type = entry["dtype"];
    if (type == "F64") {
        tensor.precision = Precision::f64;
    } else if (type != "F32") {
        refuse(where + ": dtype", "\"F32\" or \"F64\"",
               type.is_string() ? in_quotes(type.get_ref<const std::string&>()) : type.type_name());
    }

    const json& shape = entry["shape"];
    if (!shape.is_array()) refuse(where + ": shape", "an array", shape.type_name());
    for (const json& extent : shape) {
        tensor.shape.push_back(parse_size(extent, where + ": shape", refuse));
    }

    const json& offsets = entry["data_offsets"];
    if (!offsets.is_array() || offsets.size() != 2) {
        refuse(where + ": data_offsets", "an array of two", "something else");
    }
    tensor.begin = parse_size(offsets[0], where + ": data_offsets", refuse);
    tensor.end = parse_size(offsets[1], where + ": data_offsets", refuse);
    return tensor;
}

Header parse_header(std::string_view text, const Refusal& refuse)
{
    const json document = parse_json(text, refuse);
    if (!document.is_object()) refuse("header", "an object", document.type_name());
    Header header;
    for (const auto& [name, entry] : document.items()) {
        if (name != "__metadata__") {
            header.tensors.emplace(name, parse_tensor(name, entry, refuse));
            continue;
        }
        if (!entry.is_object()) refuse("metadata", "an object", entry.type_name());
        for (const auto& [key, value] : entry.items()) {
            if (!value.is_string())
                refuse("metadata " + in_quotes(key), "a string", value.type_name());
            header.metadata.emplace(key, value.get<std::string>());
        }
    }
    return header;
}

/// Whether the tensors tile the data: each as long as its shape says, each
/// beginning where the one before ends.
void check_places(const Header& header, std::size_t data_size, const Refusal& refuse)
{
    std::vector<const decltype(header.tensors)::value_type*> by_place;
    for (const auto& entry : header.tensors) {
        const auto& [name, tensor] = entry;
        const std::string where = "tensor " + in_quotes(name);
        if (tensor.begin > tensor.end || tensor.end > data_size) {
            refuse(where + ": data_offsets",
                   "a range within " + std::to_string(data_size) + " bytes of data",
                   std::to_string(tensor.begin) + " to " + std::to_string(tensor.end));
        }
        std::uint64_t bytes = value_bytes(tensor.precision);
        for (const std::uint64_t extent : tensor.shape) {
            // Bounded by the data at every step, so the product cannot overflow.
            if (extent != 0 && bytes > data_size / extent) {
                refuse(where + ": shape",
                       "at most the " + std::to_string(data_size) + " bytes of data",
                       describe(tensor.shape));
            }
            bytes *= extent;
        }
        if (tensor.end - tensor.begin != bytes) {
            refuse(where, std::to_string(bytes) + " bytes for shape " + describe(tensor.shape),
                   std::to_string(tensor.end - tensor.begin));
        }
        by_place.push_back(&entry);
    }
    std::ranges::sort(by_place, {}, [](const auto* entry) {
        return std::pair(entry->second.begin, entry->second.end);
    });
    std::uint64_t end = 0;
    for (const auto* entry : by_place) {
        const auto& [name, tensor] = *entry;
        if (tensor.begin != end) {
            refuse("tensor " + in_quotes(name),
                   "to begin at byte " + std::to_string(end) +
                       " of the data, where the one before ends",
                   std::to_string(tensor.begin));
        }
        end = tensor.end;
    }
    if (end != data_size) {
        refuse("data", std::to_string(end) + " bytes as the tensors take",
               std::to_string(data_size));
    }
}

// Layers ---------------------------------------------------------------------

bool is_layer_tensor(std::string_view name)
{
    constexpr std::string_view prefix = "layers.";
    if (!name.starts_with(prefix)) return false;
    name.remove_prefix(prefix.size());
    const std::size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
    name.remove_prefix(digits);
    return digits > 0 && (name == ".weight" || name == ".bias");
}

/// The values of a tensor whose place has been checked.
std::vector<double> read_tensor(const std::string& name, const Tensor& tensor,
                                std::span<const std::byte> data, const LoadOptions& options,
                                const Refusal& refuse)
{
    const std::size_t bytes = value_bytes(tensor.precision);
    std::vector<double> values((tensor.end - tensor.begin) / bytes);
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = read_value(data.data() + tensor.begin + i * bytes, tensor.precision);
        if (!std::isfinite(values[i]) && !options.allow_non_finite) {
            refuse("tensor " + in_quotes(name) + ": value " + std::to_string(i), "a finite number",
                   decimal(values[i]));
        }
    }
    return values;
}

void read_layers(const Header& header, std::span<const std::byte> data, const LoadOptions& options,
                 const Refusal& refuse, Model& model)
{
    constexpr std::size_t max_tensors = 2 * Mlp<float>::max_layers;
    if (header.tensors.empty() || header.tensors.size() > max_tensors) {
        refuse("header", "2 to " + std::to_string(max_tensors) + " tensors",
               std::to_string(header.tensors.size()));
    }
    for (const auto& [name, tensor] : header.tensors) {
        if (!is_layer_tensor(name)) {
            refuse("tensor " + in_quotes(name), "the name layers.<k>.weight or layers.<k>.bias",
                   "this");
        }
    }
    const auto tensor_of = [&](const std::string& name) -> const Tensor& {
        const auto found = header.tensors.find(name);
        if (found == header.tensors.end()) refuse("tensor " + in_quotes(name) + " is missing");
        return found->second;
    };
    model.precision = tensor_of("layers.0.weight").precision;
    const auto expect = [&](const std::string& name, const Tensor& tensor, const std::string& shape,
                            bool fits) {
        if (tensor.precision != model.precision) {
            refuse("tensor " + in_quotes(name) + ": dtype",
                   in_quotes(dtype(model.precision)) + " as layers.0.weight has",
                   in_quotes(dtype(tensor.precision)));
        }
        if (!fits) refuse("tensor " + in_quotes(name) + ": shape", shape, describe(tensor.shape));
    };

    const std::size_t count = (header.tensors.size() + 1) / 2;
    for (std::size_t k = 0; k < count; ++k) {
        const std::string prefix = "layers." + std::to_string(k);
        const std::string weight_name = prefix + ".weight";
        const std::string bias_name = prefix + ".bias";
        const Tensor& weight = tensor_of(weight_name);
        const Tensor& bias = tensor_of(bias_name);
        const auto& shape = weight.shape;
        if (k == 0) {
            expect(weight_name, weight, "[outputs, inputs]", shape.size() == 2);
        } else {
            const std::size_t inputs = model.layers.back().outputs;
            expect(weight_name, weight, "[outputs, " + std::to_string(inputs) + "]",
                   shape.size() == 2 && shape[1] == inputs);
        }
        expect(bias_name, bias, describe({shape[0]}),
               bias.shape.size() == 1 && bias.shape[0] == shape[0]);
        model.layers.push_back({shape[1], shape[0],
                                read_tensor(weight_name, weight, data, options, refuse),
                                read_tensor(bias_name, bias, data, options, refuse)});
    }
}

// Metadata -------------------------------------------------------------------

class Metadata {
public:
    Metadata(const Header& header, const Refusal& refuse) : header_(header), refuse_(refuse) {}

    [[nodiscard]] const std::string& text(std::string_view key) const
    {
        const auto found = header_.metadata.find(key);
        if (found == header_.metadata.end()) refuse_("metadata " + in_quotes(key) + " is missing");
        return found->second;
    }

    [[nodiscard]] bool has(std::string_view key) const { return header_.metadata.contains(key); }

    [[nodiscard]] double number(std::string_view key) const { return numbers(key, 1).front(); }

    [[nodiscard]] std::vector<double> numbers(std::string_view key, std::size_t count) const
    {
        std::vector<double> values;
        for (const std::string_view word : words(key)) values.push_back(parse<double>(key, word));
        if (values.size() != count) {
            refuse_("metadata " + in_quotes(key),
                    std::to_string(count) + (count == 1 ? " number" : " numbers"),
                    std::to_string(values.size()));
        }
        return values;
    }

    [[nodiscard]] std::uint64_t integer(std::string_view key) const
    {
        return parse<std::uint64_t>(key, text(key));
    }

    /// As many as there are.
    [[nodiscard]] std::vector<double> numbers(std::string_view key) const
    {
        return numbers(key, words(key).size());
    }

    [[nodiscard]] std::map<std::string, double> named_numbers(std::string_view key) const
    {
        std::map<std::string, double> values;
        for (const std::string_view word : words(key)) {
            const std::size_t equals = word.find('=');
            if (equals == 0 || equals == word.npos) {
                refuse_("metadata " + in_quotes(key), "name=value", in_quotes(word));
            }
            const auto value = parse<double>(key, word.substr(equals + 1));
            if (!values.emplace(word.substr(0, equals), value).second) {
                refuse_("metadata " + in_quotes(key) + ": " + std::string(word.substr(0, equals)) +
                        " appears twice");
            }
        }
        return values;
    }

private:
    [[nodiscard]] std::vector<std::string_view> words(std::string_view key) const
    {
        std::string_view rest = text(key);
        std::vector<std::string_view> found;
        while (!rest.empty()) {
            const std::size_t length = std::min(rest.find(' '), rest.size());
            if (length > 0) found.push_back(rest.substr(0, length));
            rest.remove_prefix(std::min(length + 1, rest.size()));
        }
        return found;
    }

    template <class Number>
    [[nodiscard]] Number parse(std::string_view key, std::string_view word) const
    {
        Number value{};
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        if (error != std::errc{} || end != word.data() + word.size()) {
            refuse_("metadata " + in_quotes(key), "a number", in_quotes(word));
        }
        return value;
    }

    const Header& header_;
    const Refusal& refuse_;
};

/// The levels of a gate and what was seen of it.
void read_gate(const Metadata& metadata, const Refusal& refuse, Model& model)
{
    const std::string levels = "metadata \"levels\"";
    const std::vector<double> values = metadata.numbers("levels");
    const std::size_t outputs = model.layers.back().outputs;
    const std::size_t wanted = model.kind == "gate-horizon" ? outputs : values.size() / 2;
    if (wanted == 0 || values.size() != 2 * wanted) {
        refuse(levels, "a value and a threshold for each of " + std::to_string(wanted) + " levels",
               std::to_string(values.size()) + " numbers");
    }
    if (model.kind == "gate-level" && outputs != 1) {
        refuse("tensor of the last layer", "1 output", std::to_string(outputs));
    }
    for (std::size_t k = 0; k < wanted; ++k) {
        const GateLevel level{.value = values[2 * k], .threshold = values[2 * k + 1]};
        const double before = k == 0 ? 0 : model.levels.back().value;
        if (!(level.value > before && std::isfinite(level.value))) {
            refuse(levels, "values that are positive and rise", decimal(level.value));
        }
        if (std::isnan(level.threshold)) refuse(levels, "thresholds that are numbers", "nan");
        model.levels.push_back(level);
    }
    if (!metadata.has("calibration")) return;
    const std::vector<double> counts = metadata.numbers("calibration", 5);
    for (const double count : counts) {
        if (!(count >= 0 && count < 0x1p53)) {
            refuse("metadata \"calibration\"", "numbers from 0 to 2^53", decimal(count));
        }
    }
    const auto whole = [&](std::size_t i) { return static_cast<std::uint64_t>(counts[i]); };
    model.calibration = {.events = whole(0),
                         .misses = whole(1),
                         .miss_bound = counts[2],
                         .steps = whole(3),
                         .seed = whole(4)};
    if (!(model.calibration.misses <= model.calibration.events && counts[2] <= 1)) {
        refuse("metadata \"calibration\"", "no more misses than events, and a share",
               decimal(counts[1]) + " of " + decimal(counts[0]) + ", " + decimal(counts[2]));
    }
}

void read_metadata(const Header& header, const Refusal& refuse, Model& model)
{
    const Metadata metadata(header, refuse);
    const std::size_t inputs = model.layers.front().inputs;
    const std::size_t outputs = model.layers.back().outputs;

    model.kind = metadata.text("kind");
    if (std::ranges::find(known_kinds, model.kind) == known_kinds.end()) {
        refuse("metadata \"kind\"",
               in_quotes(known_kinds[0]) + ", " + in_quotes(known_kinds[1]) + ", " +
                   in_quotes(known_kinds[2]) + ", " + in_quotes(known_kinds[3]) + " or " +
                   in_quotes(known_kinds[4]),
               in_quotes(model.kind));
    }
    const std::string& activation = metadata.text("activation");
    if (activation != "relu" && activation != "tanh") {
        refuse("metadata \"activation\"", "\"relu\" or \"tanh\"", in_quotes(activation));
    }
    model.activation = activation == "relu" ? Activation::relu : Activation::tanh;

    model.system = metadata.text("system");
    model.parameters = metadata.named_numbers("parameters");
    model.recipe = metadata.text("recipe");
    model.seed = metadata.integer("seed");

    model.offset = metadata.numbers("offset", inputs);
    model.scale = metadata.numbers("scale", inputs);
    for (std::size_t i = 0; i < inputs; ++i) {
        if (!std::isfinite(model.offset[i])) {
            refuse("metadata \"offset\"", "finite numbers", decimal(model.offset[i]));
        }
        if (!std::isfinite(model.scale[i]) || model.scale[i] == 0) {
            refuse("metadata \"scale\"", "finite numbers other than zero", decimal(model.scale[i]));
        }
    }

    const std::vector<double> domain = metadata.numbers("domain", 2 * inputs);
    for (std::size_t i = 0; i < inputs; ++i) {
        const Interval range{domain[2 * i], domain[2 * i + 1]};
        if (!(range.lower <= range.upper)) {
            refuse("metadata \"domain\" of feature " + std::to_string(i), "lower <= upper",
                   decimal(range.lower) + " and " + decimal(range.upper));
        }
        model.domain.push_back(range);
    }

    model.threshold = metadata.number("threshold");
    if (std::isnan(model.threshold)) refuse("metadata \"threshold\"", "a number", "nan");

    const std::vector<double> steps = metadata.numbers("step_range", 2);
    model.step_min = steps[0];
    model.step_max = steps[1];
    if (!(0 <= model.step_min && model.step_min <= model.step_max)) {
        refuse("metadata \"step_range\"", "0 <= smallest <= largest",
               decimal(model.step_min) + " and " + decimal(model.step_max));
    }

    model.self_test.input = metadata.numbers("self_test_input", inputs);
    for (const double value : model.self_test.input) {
        if (!std::isfinite(value)) {
            refuse("metadata \"self_test_input\"", "finite numbers", decimal(value));
        }
    }
    model.self_test.output = metadata.numbers("self_test_output", outputs);
    if (header.metadata.contains("certificate")) model.certificate = metadata.text("certificate");
    if (model.kind.starts_with("gate-")) read_gate(metadata, refuse, model);
}

// Self-test ------------------------------------------------------------------

/// How far two evaluations of the model may lie apart, per output.
///
/// With unit roundoff u, a sum of n products and a bias in any order is off by at
/// most (n + 2) u (|W| |x| + |b|) to first order. Errors e of its input arrive as
/// |W| e, and neither activation amplifies them; 8 u |y| allows for the tanh itself.
/// The first e allows for features that are normalised in the network's precision.
/// Twice the bound, as both evaluations may be off.
std::vector<double> self_test_tolerance(const Model& model)
{
    const bool single = model.precision == Precision::f32;
    const double u = single ? 0x1p-24 : 0x1p-53;
    const double tiny =
        single ? std::numeric_limits<float>::min() : std::numeric_limits<double>::min();

    const std::vector<double>& features = model.self_test.input;
    std::vector<double> x(features.size());
    std::vector<double> e(features.size());
    for (std::size_t i = 0; i < features.size(); ++i) {
        const double scale = model.scale[i];
        x[i] = (features[i] - model.offset[i]) * scale;
        e[i] = 4 * u * (std::abs(features[i]) + std::abs(model.offset[i])) * std::abs(scale);
    }
    for (const DenseLayer& layer : model.layers) {
        const bool last = &layer == &model.layers.back();
        std::vector<double> y(layer.outputs);
        std::vector<double> e_y(layer.outputs);
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            double sum = layer.bias[j];
            double magnitude = std::abs(layer.bias[j]);
            double inherited = 0;
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                const double w = layer.weight[j * layer.inputs + i];
                sum += w * x[i];
                magnitude += std::abs(w) * (std::abs(x[i]) + e[i]);
                inherited += std::abs(w) * e[i];
            }
            y[j] = sum;
            if (!last)
                y[j] = model.activation == Activation::relu ? std::max(0.0, sum) : std::tanh(sum);
            e_y[j] = inherited + static_cast<double>(layer.inputs + 2) * u * magnitude +
                     8 * u * std::abs(y[j]) + tiny;
        }
        x = std::move(y);
        e = std::move(e_y);
    }
    for (double& value : e) value *= 2;
    return e;
}

/// Classifiers are made of models that have been checked, so what they still
/// refuse, such as a layer too wide, is refused in the name of the file.
Classifier classifier_of(const Model& model, const Refusal& refuse)
{
    try {
        return Classifier(model);
    } catch (const std::invalid_argument& error) {
        refuse(error.what());
    }
}

void repeat_self_test(const Model& model, const Refusal& refuse)
{
    const Classifier classifier = classifier_of(model, refuse);
    std::vector<double> found(classifier.outputs());
    classifier.logits(model.self_test.input.data(), found.data());
    const std::vector<double> tolerance = self_test_tolerance(model);
    for (std::size_t j = 0; j < found.size(); ++j) {
        const double expected = model.self_test.output[j];
        const bool same = found[j] == expected || (std::isnan(found[j]) && std::isnan(expected));
        const bool close =
            std::isfinite(tolerance[j]) && std::abs(found[j] - expected) <= tolerance[j];
        if (!same && !close) {
            refuse("self-test: output " + std::to_string(j), decimal(expected), decimal(found[j]));
        }
    }
}

/// A point inside the domain, off its middle, where normalised features may all
/// be zero, and at another fraction for each feature, so that no two can be
/// exchanged unnoticed.
SelfTest make_self_test(const Model& model, const Refusal& refuse)
{
    const Classifier classifier = classifier_of(model, refuse);
    SelfTest test;
    for (std::size_t i = 0; i < classifier.inputs(); ++i) {
        const double fraction = std::fmod(0.6180339887498949 * static_cast<double>(i + 1), 1.0);
        double value = model.offset[i] + fraction / model.scale[i];
        if (i < model.domain.size()) {
            const Interval& range = model.domain[i];
            const double inside = range.lower + fraction * (range.upper - range.lower);
            if (std::isfinite(inside)) value = inside;
        }
        test.input.push_back(std::isfinite(value) ? value : model.offset[i]);
    }
    test.output.resize(classifier.outputs());
    classifier.logits(test.input.data(), test.output.data());
    return test;
}

// Writing --------------------------------------------------------------------

std::string join(const std::vector<double>& values)
{
    std::string text;
    for (const double value : values) {
        if (!text.empty()) text += ' ';
        text += decimal(value);
    }
    return text;
}

std::vector<double> pairs(const std::vector<GateLevel>& levels)
{
    std::vector<double> values;
    for (const GateLevel& level : levels) {
        values.push_back(level.value);
        values.push_back(level.threshold);
    }
    return values;
}

json metadata_of(const Model& model, const SelfTest& self_test, const Refusal& refuse)
{
    std::string parameters;
    for (const auto& [name, value] : model.parameters) {
        if (name.empty() || name.find_first_of(" =") != std::string::npos) {
            refuse("parameter", "a name without blanks and equals signs", in_quotes(name));
        }
        if (!parameters.empty()) parameters += ' ';
        parameters += name + '=' + decimal(value);
    }
    std::vector<double> domain;
    for (const Interval& range : model.domain) {
        domain.push_back(range.lower);
        domain.push_back(range.upper);
    }
    json metadata{
        {"ricochet", format_version},
        {"kind", model.kind},
        {"system", model.system},
        {"parameters", parameters},
        {"recipe", model.recipe},
        {"offset", join(model.offset)},
        {"scale", join(model.scale)},
        {"domain", join(domain)},
        {"activation", model.activation == Activation::relu ? "relu" : "tanh"},
        {"threshold", decimal(model.threshold)},
        {"step_range", join({model.step_min, model.step_max})},
        {"seed", std::to_string(model.seed)},
        {"self_test_input", join(self_test.input)},
        {"self_test_output", join(self_test.output)},
    };
    if (!model.certificate.empty()) metadata["certificate"] = model.certificate;
    if (!model.levels.empty()) metadata["levels"] = join(pairs(model.levels));
    if (const Calibration& c = model.calibration; c.events > 0) {
        metadata["calibration"] = std::to_string(c.events) + ' ' + std::to_string(c.misses) + ' ' +
                                  decimal(c.miss_bound) + ' ' + std::to_string(c.steps) + ' ' +
                                  std::to_string(c.seed);
    }
    return metadata;
}

/// A file that is removed again unless it was renamed.
class TemporaryFile {
public:
    explicit TemporaryFile(std::filesystem::path path) : path_(std::move(path)) {}
    ~TemporaryFile()
    {
        std::error_code ignored;
        if (!path_.empty()) std::filesystem::remove(path_, ignored);
    }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

    [[nodiscard]] std::error_code rename_to(const std::filesystem::path& path)
    {
        std::error_code error;
        std::filesystem::rename(path_, path, error);
        if (!error) path_.clear();
        return error;
    }

private:
    std::filesystem::path path_;
};

std::string last_error()
{
    return std::generic_category().message(errno);
}

}  // namespace

Model parse_model(std::span<const std::byte> bytes, std::string_view name,
                  const LoadOptions& options)
{
    const Refusal refuse(name);
    if (bytes.size() < length_bytes) {
        refuse("length of header", "8 bytes", std::to_string(bytes.size()));
    }
    const auto length = read_word<std::uint64_t>(bytes.data());
    const std::span rest = bytes.subspan(length_bytes);
    if (length > max_header) {
        refuse("length of header", "at most " + std::to_string(max_header), std::to_string(length));
    }
    if (length > rest.size()) {
        refuse("header", std::to_string(length) + " bytes", std::to_string(rest.size()));
    }
    const std::span header_bytes = rest.first(static_cast<std::size_t>(length));
    const std::span data = rest.subspan(static_cast<std::size_t>(length));
    const Header header = parse_header(
        {reinterpret_cast<const char*>(header_bytes.data()), header_bytes.size()}, refuse);

    const std::string& version = Metadata(header, refuse).text("ricochet");
    if (version != format_version) {
        refuse("metadata \"ricochet\"", "format version " + in_quotes(format_version),
               in_quotes(version));
    }
    check_places(header, data.size(), refuse);
    Model model;
    read_layers(header, data, options, refuse, model);
    read_metadata(header, refuse, model);
    repeat_self_test(model, refuse);
    return model;
}

Model load_model(const std::string& path, const LoadOptions& options)
{
    const Refusal refuse(path);
    const std::string text = detail::read_file(path, refuse, max_file);
    return parse_model(std::as_bytes(std::span(text)), path, options);
}

std::vector<std::byte> to_safetensors(const Model& model, const LoadOptions& options)
{
    const Refusal refuse("model");
    // Nothing below may index beyond vectors that are too short.
    static_cast<void>(classifier_of(model, refuse));
    const bool tested = !model.self_test.input.empty() || !model.self_test.output.empty();
    const SelfTest self_test = tested ? model.self_test : make_self_test(model, refuse);

    json header{{"__metadata__", metadata_of(model, self_test, refuse)}};
    std::vector<std::byte> data;
    const auto add = [&](const std::string& name, const std::vector<std::size_t>& shape,
                         const std::vector<double>& values) {
        const std::size_t begin = data.size();
        append_values(data, values, model.precision);
        header[name] = {{"dtype", dtype(model.precision)},
                        {"shape", shape},
                        {"data_offsets", {begin, data.size()}}};
    };
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const DenseLayer& layer = model.layers[k];
        const std::string prefix = "layers." + std::to_string(k);
        add(prefix + ".weight", {layer.outputs, layer.inputs}, layer.weight);
        add(prefix + ".bias", {layer.outputs}, layer.bias);
    }

    std::string text;
    try {
        text = header.dump();
    } catch (const json::exception&) {
        refuse("metadata", "text in UTF-8", "other bytes");
    }
    // The data begin at a multiple of eight, as other readers like to map them.
    text.append((length_bytes - text.size() % length_bytes) % length_bytes, ' ');

    std::vector<std::byte> bytes;
    append_word(bytes, static_cast<std::uint64_t>(text.size()));
    for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
    bytes.insert(bytes.end(), data.begin(), data.end());
    static_cast<void>(parse_model(bytes, "model", options));
    return bytes;
}

void save_model(const Model& model, const std::string& path, const LoadOptions& options)
{
    const Refusal refuse(path);
    const std::vector<std::byte> bytes = to_safetensors(model, options);

    const std::string beside = path + "." + std::to_string(std::random_device{}()) + ".tmp";
    TemporaryFile temporary(beside);
    {
        std::ofstream file(temporary.path(), std::ios::binary);
        file.write(reinterpret_cast<const char*>(bytes.data()),
                   static_cast<std::streamsize>(bytes.size()));
        file.close();
        if (!file) refuse("cannot be written: " + last_error());
    }
    if (const std::error_code error = temporary.rename_to(path)) {
        refuse("cannot be written: " + error.message());
    }
}

}  // namespace ricochet
