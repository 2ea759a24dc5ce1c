#include "model_metadata.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <system_error>
#include <vector>

namespace ricochet::model_file {
namespace {

constexpr std::array<std::string_view, 6> known_kinds{
    "event-classifier", "gate-horizon", "gate-level", "step-policy", "guard", "step-actor"};
constexpr std::array<Activation, 5> activations{
    Activation::relu, Activation::tanh, Activation::softplus, Activation::silu, Activation::sine};

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

    /// A list of numbers of any length.
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

/// Reads the levels of a gate and its calibration.
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

/// Guards have any activation, other networks ReLU or tanh.
Activation read_activation(const Metadata& metadata, bool is_guard, const Refusal& refuse)
{
    const std::string& found = metadata.text("activation");
    const std::size_t count = is_guard ? activations.size() : 2;
    for (std::size_t k = 0; k < count; ++k) {
        if (found == name(activations[k])) return activations[k];
    }
    refuse(
        "metadata \"activation\"",
        is_guard ? "\"relu\", \"tanh\", \"softplus\", \"silu\" or \"sin\"" : "\"relu\" or \"tanh\"",
        in_quotes(found));
}

/// Reads which layers of a guard are residual.
void read_residual(const Metadata& metadata, const Refusal& refuse, Model& model)
{
    const std::string what = "metadata \"residual\"";
    if (model.kind != "guard") refuse(what, "none in a model that is no guard", "this");
    for (const double k : metadata.numbers("residual")) {
        const double before =
            model.residual.empty() ? -1 : static_cast<double>(model.residual.back());
        const double last = static_cast<double>(model.layers.size()) - 1;
        if (!(k > before && k < last && k == std::floor(k))) {
            refuse(what, "numbers of layers before the last that rise", decimal(k));
        }
        model.residual.push_back(static_cast<std::size_t>(k));
    }
}

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

/// Reads how features are normalised, and the box that they are trained in.
void read_features(const Metadata& metadata, const Refusal& refuse, Model& model)
{
    const std::size_t inputs = model.layers.front().inputs;
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
        const ValueRange range{domain[2 * i], domain[2 * i + 1]};
        if (!(range.lower <= range.upper)) {
            refuse("metadata \"domain\" of feature " + std::to_string(i), "lower <= upper",
                   decimal(range.lower) + " and " + decimal(range.upper));
        }
        model.domain.push_back(range);
    }
}

/// Reads the features of the self-test and the outputs that they give.
void read_self_test(const Metadata& metadata, const Refusal& refuse, Model& model)
{
    model.self_test.input = metadata.numbers("self_test_input", model.layers.front().inputs);
    for (const double value : model.self_test.input) {
        if (!std::isfinite(value)) {
            refuse("metadata \"self_test_input\"", "finite numbers", decimal(value));
        }
    }
    model.self_test.output = metadata.numbers("self_test_output", model.layers.back().outputs);
}

}  // namespace

void check_version(const Header& header, const Refusal& refuse)
{
    const std::string& version = Metadata(header, refuse).text("ricochet");
    if (version != format_version) {
        refuse("metadata \"ricochet\"", "format version " + in_quotes(format_version),
               in_quotes(version));
    }
}

void read_metadata(const Header& header, const Refusal& refuse, Model& model)
{
    const Metadata metadata(header, refuse);
    model.kind = metadata.text("kind");
    if (std::ranges::find(known_kinds, model.kind) == known_kinds.end()) {
        refuse("metadata \"kind\"",
               in_quotes(known_kinds[0]) + ", " + in_quotes(known_kinds[1]) + ", " +
                   in_quotes(known_kinds[2]) + ", " + in_quotes(known_kinds[3]) + ", " +
                   in_quotes(known_kinds[4]) + " or " + in_quotes(known_kinds[5]),
               in_quotes(model.kind));
    }
    model.activation = read_activation(metadata, model.kind == "guard", refuse);
    if (metadata.has("residual")) read_residual(metadata, refuse, model);

    model.system = metadata.text("system");
    model.parameters = metadata.named_numbers("parameters");
    model.recipe = metadata.text("recipe");
    model.seed = metadata.integer("seed");

    read_features(metadata, refuse, model);
    model.threshold = metadata.number("threshold");
    if (std::isnan(model.threshold)) refuse("metadata \"threshold\"", "a number", "nan");

    const std::vector<double> steps = metadata.numbers("step_range", 2);
    model.step_min = steps[0];
    model.step_max = steps[1];
    if (!(0 <= model.step_min && model.step_min <= model.step_max)) {
        refuse("metadata \"step_range\"", "0 <= smallest <= largest",
               decimal(model.step_min) + " and " + decimal(model.step_max));
    }

    read_self_test(metadata, refuse, model);
    if (header.metadata.contains("certificate")) model.certificate = metadata.text("certificate");
    if (model.kind.starts_with("gate-")) read_gate(metadata, refuse, model);
}

std::map<std::string, std::string> metadata_of(const Model& model, const SelfTest& self_test,
                                               const Refusal& refuse)
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
    for (const ValueRange& range : model.domain) {
        domain.push_back(range.lower);
        domain.push_back(range.upper);
    }
    std::map<std::string, std::string> metadata{
        {"ricochet", std::string(format_version)},
        {"kind", model.kind},
        {"system", model.system},
        {"parameters", parameters},
        {"recipe", model.recipe},
        {"offset", join(model.offset)},
        {"scale", join(model.scale)},
        {"domain", join(domain)},
        {"activation", std::string(name(model.activation))},
        {"threshold", decimal(model.threshold)},
        {"step_range", join({model.step_min, model.step_max})},
        {"seed", std::to_string(model.seed)},
        {"self_test_input", join(self_test.input)},
        {"self_test_output", join(self_test.output)},
    };
    if (!model.certificate.empty()) metadata["certificate"] = model.certificate;
    if (!model.residual.empty()) {
        metadata["residual"] = join({model.residual.begin(), model.residual.end()});
    }
    if (!model.levels.empty()) metadata["levels"] = join(pairs(model.levels));
    if (const Calibration& c = model.calibration; c.events > 0) {
        metadata["calibration"] = std::to_string(c.events) + ' ' + std::to_string(c.misses) + ' ' +
                                  decimal(c.miss_bound) + ' ' + std::to_string(c.steps) + ' ' +
                                  std::to_string(c.seed);
    }
    return metadata;
}

}  // namespace ricochet::model_file
