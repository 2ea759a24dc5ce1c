// Reading whole files.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>

namespace ricochet::detail {

/// The bytes of a file. A file that does not begin with `first` is read no further than that.
///
/// @param refuse  called with the reason if the file cannot be read, is longer than `longest`, or
/// is a directory, a device or a pipe, which might never end; must not return
template <class Refuse>
[[nodiscard]] std::string read_file(
    const std::filesystem::path& file, const Refuse& refuse,
    std::uintmax_t longest = std::numeric_limits<std::ptrdiff_t>::max(),
    std::string_view first = {})
{
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
        refuse(error ? error.message() : "expected a file, found something else");
    }
    const std::uintmax_t size = std::filesystem::file_size(file, error);
    if (error) refuse(error.message());
    if (size > longest) {
        std::string text = "file: expected at most ";
        text += std::to_string(longest) + " bytes, found " + std::to_string(size);
        refuse(text);
    }
    std::ifstream in(file, std::ios::binary);
    const auto last_error = [] { return std::generic_category().message(errno); };
    if (!in) refuse("cannot be opened: " + last_error());
    std::string bytes(std::min<std::uintmax_t>(size, first.size()), '\0');
    const auto read_from = [&](std::size_t begin) {
        in.read(bytes.data() + begin, static_cast<std::streamsize>(bytes.size() - begin));
        if (!in) refuse("cannot be read: " + last_error());
    };
    read_from(0);
    if (bytes != first) return bytes;
    bytes.resize(static_cast<std::size_t>(size));
    read_from(first.size());
    return bytes;
}

}  // namespace ricochet::detail
