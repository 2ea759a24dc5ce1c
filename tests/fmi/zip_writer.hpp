// Archives as a test wants them, valid or hostile: entries are stored, or given as bytes with any
// sizes beside them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::fmi_test {

struct Entry {
    std::string name;
    std::string bytes;             ///< as they lie in the archive
    std::uint16_t method = 0;      ///< 0: stored, 8: deflate
    std::uint32_t mode = 0100644;  ///< of a file; 0120777: a link
    std::int64_t size = -1;        ///< unpacked; -1: that of `bytes`
    std::uint16_t flags = 0;
    std::int64_t checksum = -1;  ///< -1: that of `bytes`
};

[[nodiscard]] inline std::uint32_t crc32(std::string_view bytes)
{
    std::uint32_t crc = 0xffffffffU;
    for (const char c : bytes) {
        crc ^= static_cast<unsigned char>(c);
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320U : 0U);
    }
    return ~crc;
}

[[nodiscard]] inline std::string archive_of(const std::vector<Entry>& entries)
{
    std::string out, list;
    const auto number = [](std::string& to, std::uint64_t value, int bytes) {
        for (int i = 0; i < bytes; ++i) to += static_cast<char>(value >> (8 * i) & 0xff);
    };
    for (const Entry& e : entries) {
        const auto offset = out.size();
        std::string shared;
        number(shared, 20, 2);
        number(shared, e.flags, 2);
        number(shared, e.method, 2);
        number(shared, 0, 4);
        number(shared, e.checksum < 0 ? crc32(e.bytes) : static_cast<std::uint64_t>(e.checksum), 4);
        number(shared, e.bytes.size(), 4);
        number(shared, e.size < 0 ? e.bytes.size() : static_cast<std::uint64_t>(e.size), 4);
        number(shared, e.name.size(), 2);
        number(shared, 0, 2);
        out += "PK\3\4" + shared + e.name + e.bytes;
        list += "PK\1\2";
        number(list, 3 << 8 | 20, 2);  // made by unix
        list += shared;
        number(list, 0, 6);  // comment, disk, internal attributes
        number(list, static_cast<std::uint64_t>(e.mode) << 16, 4);
        number(list, offset, 4);
        list += e.name;
    }
    std::string end = "PK\5\6";
    number(end, 0, 4);
    number(end, entries.size(), 2);
    number(end, entries.size(), 2);
    number(end, list.size(), 4);
    number(end, out.size(), 4);
    number(end, 0, 2);
    return out + list + end;
}

[[nodiscard]] inline std::string bytes_of(const std::filesystem::path& file)
{
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::runtime_error("no file " + file.string());
    return {std::istreambuf_iterator<char>(in), {}};
}

inline void write(const std::filesystem::path& file, std::string_view bytes)
{
    std::ofstream out(file, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (!out) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace ricochet::fmi_test
