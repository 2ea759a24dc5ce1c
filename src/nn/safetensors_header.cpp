#include "safetensors_header.hpp"

#include "base/strict_json.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

namespace ricochet::model_file {
namespace {

using nlohmann::json;

/// The header is an object of objects of arrays.
constexpr int max_depth = 3;

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

}  // namespace

std::string in_quotes(std::string_view text)
{
    return fmt::format("\"{}\"", text);
}

std::string decimal(double value)
{
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return {text.data(), end};
}

std::size_t value_bytes(Precision precision) noexcept
{
    return precision == Precision::f64 ? 8 : 4;
}

std::string_view dtype(Precision precision) noexcept
{
    return precision == Precision::f64 ? "F64" : "F32";
}

std::string describe(const std::vector<std::uint64_t>& shape)
{
    std::string text = "[";
    for (const std::uint64_t extent : shape) {
        if (text.size() > 1) text += ", ";
        text += std::to_string(extent);
    }
    return text + "]";
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

}  // namespace ricochet::model_file
