// Square matrices from files: NumPy's format, as numpy.lib.format describes it (versions 1 to 3),
// and safetensors.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/read_file.hpp"
#include "fault_kernel.hpp"
#include "nn/safetensors_header.hpp"

namespace ricochet {

namespace {

[[noreturn]] void refuse(const std::filesystem::path& file, std::string_view why)
{
    throw std::invalid_argument(fmt::format("{}: {}", file.string(), why));
}

/// Text after 'key': in the header, up to `end`.
std::string_view value_of(const std::filesystem::path& file, std::string_view header,
                          std::string_view key, std::string_view end)
{
    const std::string name = fmt::format("'{}':", key);
    const std::size_t at = header.find(name);
    if (at == std::string_view::npos) refuse(file, fmt::format("no '{}' in its header", key));
    std::string_view rest = header.substr(at + name.size());
    if (rest.find(name) != std::string_view::npos) {
        refuse(file, fmt::format("'{}' appears twice in its header", key));
    }
    rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
    const std::string_view value = rest.substr(0, rest.find_first_of(end));
    return value.substr(0, value.find_last_not_of(' ') + 1);
}

/// "(100, 100" becomes 100; anything but two equal numbers is refused.
std::uint64_t side_of(const std::filesystem::path& file, std::string_view shape)
{
    const std::string text(shape.substr(std::min<std::size_t>(1, shape.size())));
    unsigned long long rows = 0;
    unsigned long long columns = 0;
    int used = 0;
    if (std::sscanf(text.c_str(), "%llu , %llu%n", &rows, &columns, &used) != 2 ||
        static_cast<std::size_t>(used) != text.size() || rows != columns || rows == 0 ||
        rows > 1'000'000) {
        refuse(file, fmt::format("expected a square matrix, found shape {})", shape));
    }
    return rows;
}

struct Header {
    std::uint64_t side = 0;
    bool fortran = false;
    bool single = false;
    std::size_t data = 0;  ///< offset
};

constexpr std::string_view magic = "\x93NUMPY";

Header header_of(const std::filesystem::path& file, std::string_view bytes)
{
    if (bytes.size() < 12 || !bytes.starts_with(magic)) refuse(file, "is no NumPy file (.npy)");
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(bytes[i]); };
    if (byte(6) < 1 || byte(6) > 3) {
        refuse(file, fmt::format("is of format {}, expected 1, 2 or 3", byte(6)));
    }
    const bool wide = byte(6) > 1;
    std::size_t length = byte(8) + 256U * byte(9);
    if (wide) length += (std::size_t{byte(10)} << 16) + (std::size_t{byte(11)} << 24);
    const std::size_t start = wide ? 12 : 10;
    if (length > bytes.size() - start) refuse(file, "ends within its header");
    const std::string_view header = bytes.substr(start, length);
    if (!header.starts_with('{') || header.find('}') == std::string_view::npos) {
        refuse(file, "expected a header in braces");
    }
    const std::string_view type = value_of(file, header, "descr", ",}");
    if (type != "'<f8'" && type != "'<f4'") {
        refuse(file, fmt::format("expected numbers of type '<f8' or '<f4', found {}", type));
    }
    const std::string_view order = value_of(file, header, "fortran_order", ",}");
    if (order != "True" && order != "False") {
        refuse(file, fmt::format("expected a fortran_order of True or False, found {}", order));
    }
    return {.side = side_of(file, value_of(file, header, "shape", ")")),
            .fortran = order == "True",
            .single = type == "'<f4'",
            .data = start + length};
}

template <class Number>
Eigen::MatrixXd matrix(const char* data, std::uint64_t side)
{
    const auto n = static_cast<Eigen::Index>(side);
    Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic> out(n, n);
    std::memcpy(out.data(), data, side * side * sizeof(Number));
    return out.template cast<double>();
}

void require_finite(const std::filesystem::path& file, const Eigen::MatrixXd& matrix)
{
    if (!matrix.allFinite()) refuse(file, "has entries that are not numbers, or infinite");
}

}  // namespace

Eigen::MatrixXd read_npy_square(const std::filesystem::path& file)
{
    static_assert(std::endian::native == std::endian::little);
    const std::string bytes = detail::read_file(
        file, [&](const std::string& why) { refuse(file, "cannot be read: " + why); },
        std::numeric_limits<std::ptrdiff_t>::max(), magic);
    const Header header = header_of(file, bytes);
    const std::uint64_t expected = header.side * header.side * (header.single ? 4 : 8);
    if (bytes.size() - header.data != expected) {
        refuse(file, fmt::format("a matrix of {0} x {0} has {1} bytes, found {2}", header.side,
                                 expected, bytes.size() - header.data));
    }
    const char* data = bytes.data() + header.data;
    Eigen::MatrixXd out =
        header.single ? matrix<float>(data, header.side) : matrix<double>(data, header.side);
    require_finite(file, out);
    if (!header.fortran) out.transposeInPlace();
    return out;
}

Eigen::MatrixXd read_safetensors_square(const std::filesystem::path& file)
{
    constexpr std::size_t length_bytes = 8;
    constexpr std::size_t longest_header = std::size_t{1} << 20;
    const std::string bytes = detail::read_file(
        file, [&](const std::string& why) { refuse(file, "cannot be read: " + why); });
    std::uint64_t length = 0;
    if (bytes.size() < length_bytes) refuse(file, "ends before its header");
    std::memcpy(&length, bytes.data(), length_bytes);
    if (length > std::min(longest_header, bytes.size() - length_bytes)) {
        refuse(file, fmt::format("expected a header of at most {} bytes within the file, found {}",
                                 longest_header, length));
    }
    const std::string_view data = std::string_view(bytes).substr(length_bytes + length);
    const model_file::Refusal refuse_header(file.string());
    try {
        const auto header = model_file::parse_header(
            std::string_view(bytes).substr(length_bytes, length), refuse_header);
        model_file::check_places(header, data.size(), refuse_header);
        if (header.tensors.size() != 1) {
            refuse(file, fmt::format("expected one tensor, found {}", header.tensors.size()));
        }
        const model_file::Tensor& tensor = header.tensors.begin()->second;
        if (tensor.shape.size() != 2 || tensor.shape[0] != tensor.shape[1] ||
            tensor.shape[0] == 0) {
            refuse(file, fmt::format("expected a square matrix, found shape {}",
                                     model_file::describe(tensor.shape)));
        }
        const bool single = tensor.precision == Precision::f32;
        Eigen::MatrixXd out = single ? matrix<float>(data.data(), tensor.shape[0])
                                     : matrix<double>(data.data(), tensor.shape[0]);
        require_finite(file, out);
        out.transposeInPlace();
        return out;
    } catch (const ModelError& error) {
        throw std::invalid_argument(error.what());
    }
}

Eigen::MatrixXd read_kernel(const std::filesystem::path& file)
{
    return file.extension() == ".safetensors" ? read_safetensors_square(file)
                                              : read_npy_square(file);
}

}  // namespace ricochet
