#include "ricochet/nn/model.hpp"

#include "base/read_file.hpp"
#include "model_metadata.hpp"
#include "safetensors_header.hpp"
#include "self_test.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <random>
#include <span>
#include <string>
#include <system_error>
#include <utility>

namespace ricochet {
namespace {

using nlohmann::json;
using namespace model_file;

constexpr std::size_t length_bytes = 8;
constexpr std::size_t max_header = std::size_t{1} << 20;
/// More than the largest network that `Mlp` takes, and a header.
constexpr std::size_t max_file = std::size_t{1} << 26;

/// Reads a little-endian word on any machine.
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
        model.layers.push_back({static_cast<std::size_t>(shape[1]),
                                static_cast<std::size_t>(shape[0]),
                                read_tensor(weight_name, weight, data, options, refuse),
                                read_tensor(bias_name, bias, data, options, refuse)});
    }
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

    check_version(header, refuse);
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
    // Checked first, so that nothing below reads beyond a vector that is too short.
    static_cast<void>(Outputs(model, refuse));
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
