#include "studies/table_files.hpp"

#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <boost/crc.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <stdexcept>
#include <system_error>

namespace ricochet::studies {

namespace {

/// Writes everything to an open file and closes it, with the usual permissions of a new file.
/// Returns false on failure; errno has the reason.
bool fill(int descriptor, std::string_view bytes)
{
    std::FILE* out = fdopen(descriptor, "wb");
    if (out == nullptr) return false;
    const mode_t mask = umask(0);
    umask(mask);
    const bool written = fchmod(descriptor, 0666 & ~mask) == 0 &&
                         std::fwrite(bytes.data(), 1, bytes.size(), out) == bytes.size() &&
                         std::fflush(out) == 0;
    const int why = errno;
    const bool closed = std::fclose(out) == 0;
    if (!written) errno = why;
    return written && closed;
}

}  // namespace

std::string to_npy(const TrainingSet& set)
{
    static_assert(std::endian::native == std::endian::little);
    constexpr std::size_t start = 10;  // magic, version, length of the header
    constexpr std::size_t unit = 64;   // the numbers begin at a multiple of it
    std::string header =
        fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}", set.rows(),
                    set.columns.size());
    const std::size_t length = (start + header.size() + 1 + unit - 1) / unit * unit - start;
    header.resize(length - 1, ' ');
    header += '\n';
    std::string bytes = "\x93NUMPY";
    bytes += {'\x01', '\x00', static_cast<char>(length % 256), static_cast<char>(length / 256)};
    bytes += header;
    const std::size_t data = bytes.size();
    bytes.resize(data + set.values.size() * sizeof(double));
    std::memcpy(bytes.data() + data, set.values.data(), set.values.size() * sizeof(double));
    return bytes;
}

std::string to_csv(const TrainingSet& set, std::size_t most_rows)
{
    std::string text;
    for (std::size_t k = 0; k < set.columns.size(); ++k) {
        const auto& [name, unit] = set.columns[k];
        text += k == 0 ? "" : ",";
        text += unit == "1" ? name : fmt::format("{} [{}]", name, unit);
    }
    text += '\n';
    for (std::size_t i = 0; i < std::min(most_rows, set.rows()); ++i) {
        fmt::format_to(std::back_inserter(text), "{}\n", fmt::join(set.row(i), ","));
    }
    return text;
}

std::uint32_t crc32(std::string_view bytes)
{
    boost::crc_32_type crc;
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
}

std::string checksum_line(std::string_view model, const TrainingSet& set, std::string_view npy)
{
    return fmt::format("{},{},{},{},{:08x}", model, set.rows(), set.columns.size(), npy.size(),
                       crc32(npy));
}

void write_whole(const std::filesystem::path& file, std::string_view bytes)
{
    std::string name = file.string() + ".XXXXXX";
    const int descriptor = mkstemp(name.data());
    const bool filled = descriptor >= 0 && fill(descriptor, bytes);
    if (filled && std::rename(name.c_str(), file.c_str()) == 0) return;
    const int why = errno;
    if (descriptor >= 0) unlink(name.c_str());
    throw std::runtime_error(
        fmt::format("cannot write '{}': {}", file.string(), std::generic_category().message(why)));
}

}  // namespace ricochet::studies
