#include "checkpoint_file.hpp"

#include <cerrno>
#include <cstddef>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <system_error>

#include "base/read_file.hpp"

namespace ricochet::learn {

std::uint64_t checksum(std::string_view bytes) noexcept
{
    std::uint64_t hash = 0xcbf29ce484222325U;
    for (const char c : bytes) {
        hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
    }
    return hash;
}

void Writer::put(std::uint64_t value)
{
    for (unsigned shift = 0; shift < 64; shift += 8) {
        bytes_.push_back(static_cast<char>((value >> shift) & 0xffU));
    }
}

void Writer::put(float value)
{
    const auto bits = std::bit_cast<std::uint32_t>(value);
    for (unsigned shift = 0; shift < 32; shift += 8) {
        bytes_.push_back(static_cast<char>((bits >> shift) & 0xffU));
    }
}

void Reader::get(std::uint64_t& value)
{
    if (bytes_.size() < 8) refuse_checkpoint(file_, "is cut short");
    value = 0;
    for (unsigned i = 0; i < 8; ++i) {
        value |= std::uint64_t{static_cast<unsigned char>(bytes_[i])} << (8 * i);
    }
    bytes_.remove_prefix(8);
}

void Reader::get(double& value)
{
    std::uint64_t bits = 0;
    get(bits);
    value = std::bit_cast<double>(bits);
}

void Reader::get(float& value)
{
    if (bytes_.size() < 4) refuse_checkpoint(file_, "is cut short");
    std::uint32_t bits = 0;
    for (unsigned i = 0; i < 4; ++i) {
        bits |= std::uint32_t{static_cast<unsigned char>(bytes_[i])} << (8 * i);
    }
    value = std::bit_cast<float>(bits);
    bytes_.remove_prefix(4);
}

std::size_t Reader::length(std::size_t least_bytes)
{
    std::uint64_t n = 0;
    get(n);
    if (n > bytes_.size() / least_bytes) refuse_checkpoint(file_, "is cut short");
    return static_cast<std::size_t>(n);
}

void Reader::finish() const
{
    if (!bytes_.empty()) refuse_checkpoint(file_, "is longer than it should be");
}

void refuse_checkpoint(const std::filesystem::path& file, const std::string& what)
{
    throw std::runtime_error("checkpoint '" + file.string() + "' " + what);
}

namespace {

/// Half of a checkpoint is useless, and is refused.
[[noreturn]] void refuse_unwritten(const std::filesystem::path& file,
                                   const std::filesystem::path& fresh, const std::string& why)
{
    std::error_code ignored;
    std::filesystem::remove(fresh, ignored);
    refuse_checkpoint(file, "cannot be written: " + why);
}

}  // namespace

void write_checkpoint(std::string_view first_line, const Writer& writer,
                      const std::filesystem::path& file)
{
    Writer tail;
    tail.put(checksum(writer.bytes()));

    const std::filesystem::path fresh = file.string() + ".part";
    {
        std::ofstream out(fresh, std::ios::binary | std::ios::trunc);
        out << first_line << writer.bytes() << tail.bytes();
        out.close();
        if (!out) refuse_unwritten(file, fresh, std::generic_category().message(errno));
    }
    std::error_code error;
    std::filesystem::rename(fresh, file, error);
    if (error) refuse_unwritten(file, fresh, error.message());
}

Keeper::Keeper(const std::filesystem::path& file) : keeps_(!file.empty())
{
    if (!keeps_) return;
    std::filesystem::path part = file;
    part += ".part";
    std::error_code ignored;
    const bool there = std::filesystem::exists(part, ignored);
    if (!std::ofstream(part, std::ios::binary | std::ios::app)) {
        refuse_checkpoint(file, "cannot be written: " + std::generic_category().message(errno));
    }
    if (!there) std::filesystem::remove(part, ignored);
}

std::string read_checkpoint(std::string_view first_line, const std::filesystem::path& file)
{
    const std::string bytes = ricochet::detail::read_file(
        file, [&](const std::string& why) { refuse_checkpoint(file, "cannot be read: " + why); },
        std::numeric_limits<std::ptrdiff_t>::max(), first_line);
    std::string_view rest = bytes;
    if (!rest.starts_with(first_line)) {
        refuse_checkpoint(file, "is not a training checkpoint of this version");
    }
    rest.remove_prefix(first_line.size());
    if (rest.size() < 8) refuse_checkpoint(file, "is cut short");

    std::uint64_t stored = 0;
    Reader(rest.substr(rest.size() - 8), file).get(stored);
    rest.remove_suffix(8);
    if (stored != checksum(rest)) {
        refuse_checkpoint(file, "is cut short or has been altered");
    }
    return std::string(rest);
}

}  // namespace ricochet::learn
