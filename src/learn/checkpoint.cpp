#include "ricochet/learn/checkpoint.hpp"

#include <bit>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>

namespace ricochet::learn {

namespace {

constexpr std::string_view magic = "ricochet training checkpoint 1\n";
constexpr std::string_view gate_magic = "ricochet gate checkpoint 1\n";

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what)
{
    throw std::runtime_error("checkpoint '" + file.string() + "' " + what);
}

std::uint64_t checksum(std::string_view bytes)
{
    std::uint64_t hash = 0xcbf29ce484222325U;  // FNV-1a
    for (const char c : bytes) {
        hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
    }
    return hash;
}

class Writer {
public:
    void put(std::uint64_t value)
    {
        for (unsigned shift = 0; shift < 64; shift += 8) {
            bytes_.push_back(static_cast<char>((value >> shift) & 0xffU));
        }
    }
    void put(double value) { put(std::bit_cast<std::uint64_t>(value)); }

    template <class Number>
    void put(const std::vector<Number>& values)
    {
        put(std::uint64_t{values.size()});
        for (const Number& value : values) put(value);
    }

    [[nodiscard]] const std::string& bytes() const { return bytes_; }

private:
    std::string bytes_;
};

class Reader {
public:
    Reader(std::string_view bytes, const std::filesystem::path& file) : bytes_(bytes), file_(file)
    {
    }

    void get(std::uint64_t& value)
    {
        if (bytes_.size() < 8) refuse(file_, "is cut short");
        value = 0;
        for (unsigned i = 0; i < 8; ++i) {
            value |= std::uint64_t{static_cast<unsigned char>(bytes_[i])} << (8 * i);
        }
        bytes_.remove_prefix(8);
    }
    void get(double& value)
    {
        std::uint64_t bits = 0;
        get(bits);
        value = std::bit_cast<double>(bits);
    }

    template <class Number>
    void get(std::vector<Number>& values)
    {
        std::uint64_t n = 0;
        get(n);
        if (n > bytes_.size() / 8) refuse(file_, "is cut short");
        values.resize(static_cast<std::size_t>(n));
        for (Number& value : values) get(value);
    }

    [[nodiscard]] bool at_end() const { return bytes_.empty(); }

private:
    std::string_view bytes_;
    const std::filesystem::path& file_;
};

// One list of members for both directions.
template <class Stream, class Member>
void fields(Member&& member, Stream&& c)
{
    member(c.fingerprint);
    member(c.iteration);
    member(c.seconds);
    for (auto& word : c.random) member(word);
    member(c.parameters);
    member(c.adam.steps);
    member(c.adam.first);
    member(c.adam.second);
    member(c.hard);
    member(c.best_parameters);
    member(c.best_threshold);
    member(c.best_score.misses);
    member(c.best_score.false_alarms);
    member(c.best_score.loss);
}

template <class Stream, class Member>
void gate_fields(Member&& member, Stream&& c)
{
    member(c.fingerprint);
    member(c.round);
    member(c.iteration);
    member(c.iterations);
    member(c.since_best);
    member(c.seconds);
    for (auto& word : c.random) member(word);
    member(c.parameters);
    member(c.adam.steps);
    member(c.adam.first);
    member(c.adam.second);
    member(c.best_cost);
    member(c.best_parameters);
    member(c.best_thresholds);
}

/// With a checksum behind it.
void write_file(std::string_view first, const Writer& writer, const std::filesystem::path& file)
{
    Writer tail;
    tail.put(checksum(writer.bytes()));

    const std::filesystem::path fresh = file.string() + ".part";
    {
        std::ofstream out(fresh, std::ios::binary | std::ios::trunc);
        out << first << writer.bytes() << tail.bytes();
        out.close();
        if (!out) refuse(file, "cannot be written");
    }
    std::error_code error;
    std::filesystem::rename(fresh, file, error);
    if (error) refuse(file, "cannot be written: " + error.message());
}

/// The bytes between the first line and the checksum, which fits.
std::string read_file(std::string_view first, const std::filesystem::path& file)
{
    std::ifstream in(file, std::ios::binary);
    if (!in) refuse(file, "cannot be read");
    const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    std::string_view rest = bytes;
    if (!rest.starts_with(first)) refuse(file, "is not a training checkpoint of this version");
    rest.remove_prefix(first.size());
    if (rest.size() < 8) refuse(file, "is cut short");

    std::uint64_t stored = 0;
    Reader(rest.substr(rest.size() - 8), file).get(stored);
    rest.remove_suffix(8);
    if (stored != checksum(rest)) refuse(file, "is cut short or has been altered");
    return std::string(rest);
}

}  // namespace

void save_checkpoint(const Checkpoint& checkpoint, const std::filesystem::path& file)
{
    Writer writer;
    fields([&writer](const auto& member) { writer.put(member); }, checkpoint);
    write_file(magic, writer, file);
}

void save_checkpoint(const GateCheckpoint& checkpoint, const std::filesystem::path& file)
{
    Writer writer;
    gate_fields([&writer](const auto& member) { writer.put(member); }, checkpoint);
    write_file(gate_magic, writer, file);
}

Checkpoint load_checkpoint(const std::filesystem::path& file)
{
    const std::string bytes = read_file(magic, file);
    Checkpoint checkpoint;
    Reader reader(bytes, file);
    fields([&reader](auto& member) { reader.get(member); }, checkpoint);
    if (!reader.at_end()) refuse(file, "is longer than it should be");
    return checkpoint;
}

GateCheckpoint load_gate_checkpoint(const std::filesystem::path& file)
{
    const std::string bytes = read_file(gate_magic, file);
    GateCheckpoint checkpoint;
    Reader reader(bytes, file);
    gate_fields([&reader](auto& member) { reader.get(member); }, checkpoint);
    if (!reader.at_end()) refuse(file, "is longer than it should be");
    return checkpoint;
}

}  // namespace ricochet::learn
