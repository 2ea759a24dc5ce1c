// NumPy's file format, as numpy.lib.format describes it: versions 1 to 3.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include "ricochet/systems/fault_kernel.hpp"

namespace ricochet {

namespace {

[[noreturn]] void refuse(const std::filesystem::path& file, std::string_view why)
{
    throw std::invalid_argument(fmt::format("{}: {}", file.string(), why));
}

/// What follows 'key': in the header, up to `end`.
std::string_view value_of(const std::filesystem::path& file, std::string_view header,
                          std::string_view key, std::string_view end)
{
    const std::size_t at = header.find(fmt::format("'{}':", key));
    if (at == std::string_view::npos) refuse(file, fmt::format("no '{}' in its header", key));
    std::string_view rest = header.substr(at + key.size() + 3);
    rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
    return rest.substr(0, rest.find_first_of(end));
}

/// "(100, 100" to 100; anything but two equal numbers is refused.
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

Header header_of(const std::filesystem::path& file, std::string_view bytes)
{
    constexpr std::string_view magic = "\x93NUMPY";
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
    const std::string_view type = value_of(file, header, "descr", ",}");
    if (type != "'<f8'" && type != "'<f4'") {
        refuse(file, fmt::format("expected numbers of type '<f8' or '<f4', found {}", type));
    }
    return {.side = side_of(file, value_of(file, header, "shape", ")")),
            .fortran = value_of(file, header, "fortran_order", ",}") == "True",
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

}  // namespace

Eigen::MatrixXd read_npy_square(const std::filesystem::path& file)
{
    static_assert(std::endian::native == std::endian::little);
    std::error_code error;
    if (std::filesystem::exists(file, error) && !std::filesystem::is_regular_file(file, error)) {
        refuse(file, "expected a file, found something else");
    }
    std::ifstream in(file, std::ios::binary);
    if (!in) refuse(file, "cannot be read");
    const std::string bytes(std::istreambuf_iterator<char>(in), {});
    const Header header = header_of(file, bytes);
    const std::uint64_t expected = header.side * header.side * (header.single ? 4 : 8);
    if (bytes.size() - header.data != expected) {
        refuse(file, fmt::format("a matrix of {0} x {0} has {1} bytes, found {2}", header.side,
                                 expected, bytes.size() - header.data));
    }
    const char* data = bytes.data() + header.data;
    Eigen::MatrixXd out =
        header.single ? matrix<float>(data, header.side) : matrix<double>(data, header.side);
    if (!header.fortran) out.transposeInPlace();
    return out;
}

}  // namespace ricochet
