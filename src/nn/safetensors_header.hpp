// The header of a safetensors file: names and places of its tensors, and its metadata.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/nn/model.hpp"

namespace ricochet::model_file {

/// Throws an error whose message begins with the name of the file.
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

[[nodiscard]] std::string in_quotes(std::string_view text);

/// The shortest decimal that reads back to the same double.
[[nodiscard]] std::string decimal(double value);

[[nodiscard]] std::size_t value_bytes(Precision precision) noexcept;

[[nodiscard]] std::string_view dtype(Precision precision) noexcept;

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

[[nodiscard]] std::string describe(const std::vector<std::uint64_t>& shape);

[[nodiscard]] Header parse_header(std::string_view text, const Refusal& refuse);

/// Refuses tensors that do not tile the data: each as long as its shape says, each beginning where
/// the one before ends.
void check_places(const Header& header, std::size_t data_size, const Refusal& refuse);

}  // namespace ricochet::model_file
