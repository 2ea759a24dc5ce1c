#include "rows.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "../files.hpp"
#include "../input.hpp"
#include "table.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t magic = 0x31304b434f4c4252U;  // "RBLOCK01"
constexpr std::uint64_t longest_setup = 1U << 20U;    // [bytes]
constexpr std::uint64_t longest_block = 1ULL << 30U;  // [bytes]
constexpr std::array<std::string_view, 3> kinds{"count", "number", "text"};

struct BlockHead {
    std::uint64_t magic = 0;
    std::uint64_t block = 0;
    std::uint64_t bytes = 0;
    std::uint64_t check = 0;
};

std::uint64_t check_of(std::uint64_t block, std::string_view rows)
{
    return checksum(rows, block + rows.size());
}

/// Reads up to `bytes` bytes, as many as there are.
std::string read_up_to(std::ifstream& in, std::uint64_t bytes)
{
    std::string out(bytes, '\0');
    in.read(out.data(), static_cast<std::streamsize>(bytes));
    out.resize(static_cast<std::size_t>(in.gcount()));
    return out;
}

std::string check_of(const Json& setup)
{
    return fmt::format("{:016x}", checksum(setup.dump()));
}

/// The first line of a share: its set-up and a checksum of it.
std::string first_line(Json setup)
{
    const std::string check = check_of(setup);
    setup["check"] = check;
    return setup.dump() + '\n';
}

/// The set-up in the first line; `in` is left after it.
Json setup_of(const fs::path& file, std::ifstream& in)
{
    std::string line;
    for (char c = 0; line.size() < longest_setup && in.get(c) && c != '\n';) line += c;
    Json setup = Json::parse(line, nullptr, false);
    if (!setup.is_object() || !setup.contains("fields") || !setup.contains("rows")) {
        throw BadInput(fmt::format("'{}' is no share of an ensemble", shortened(file.string())));
    }
    const Json check = setup.value("check", Json());
    setup.erase("check");
    if (check != check_of(setup)) {
        throw BadInput(fmt::format(
            "the first line of '{}' was changed after it was written, or another version wrote it",
            shortened(file.string())));
    }
    return setup;
}

}  // namespace

Json to_json(const std::vector<Field>& fields)
{
    Json out = Json::array();
    for (const Field& field : fields) {
        out.push_back(
            {field.name, field.unit, kinds.at(static_cast<std::size_t>(field.kind)), field.width});
    }
    return out;
}

std::vector<Field> fields_from(const Json& json)
{
    std::vector<Field> out;
    for (const Json& field : json) {
        const auto kind = std::find(kinds.begin(), kinds.end(), field.at(2).get<std::string>());
        if (kind == kinds.end()) throw std::runtime_error("a field is of no known kind");
        out.push_back({.name = field.at(0),
                       .unit = field.at(1),
                       .kind = static_cast<FieldKind>(kind - kinds.begin()),
                       .width = field.at(3)});
    }
    return out;
}

void RowWriter::text(std::string_view value)
{
    count(value.size());
    put(value.data(), value.size());
}

std::string_view RowReader::take(std::size_t bytes)
{
    if (bytes > rest_.size()) throw std::runtime_error("a row ends too early");
    const std::string_view out = rest_.substr(0, bytes);
    rest_.remove_prefix(bytes);
    return out;
}

std::uint64_t RowReader::count()
{
    std::uint64_t value = 0;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
}

double RowReader::number()
{
    double value = 0;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
}

std::string_view RowReader::text()
{
    return take(count());
}

ShareContent read_share(const fs::path& file,
                        const std::function<void(std::string_view rows)>& each)
{
    std::ifstream in(file, std::ios::binary);
    if (!in) {
        throw BadInput(fmt::format("'{}' cannot be read: {}", shortened(file.string()),
                                   std::generic_category().message(errno)));
    }
    ShareContent out{.file = file, .setup = setup_of(file, in), .blocks = {}, .end = 0};
    out.end = static_cast<std::uint64_t>(in.tellg());
    for (;;) {
        BlockHead head;
        const std::string bytes = read_up_to(in, sizeof head);
        if (bytes.size() < sizeof head) break;
        std::memcpy(&head, bytes.data(), sizeof head);
        if (head.magic != magic || head.bytes > longest_block) break;
        const std::string rows = read_up_to(in, head.bytes);
        if (rows.size() < head.bytes || check_of(head.block, rows) != head.check) break;
        each(rows);
        out.blocks.push_back(
            {.block = head.block, .offset = out.end + sizeof head, .bytes = head.bytes});
        out.end += sizeof head + head.bytes;
    }
    return out;
}

std::string read_block(const fs::path& file, const BlockPlace& place)
{
    std::ifstream in(file, std::ios::binary);
    in.seekg(static_cast<std::streamoff>(place.offset));
    std::string rows = read_up_to(in, place.bytes);
    if (rows.size() < place.bytes) {
        throw std::runtime_error(fmt::format("'{}' has changed while it was read", file.string()));
    }
    return rows;
}

std::string file_name(const Share& share)
{
    return fmt::format("share-{}-of-{}.rows", share.index, share.count);
}

std::vector<Share> shares_in(const fs::path& directory)
{
    std::vector<Share> out;
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(directory, error)) {
        const std::string name = entry.path().filename().string();
        unsigned long long index = 0;
        unsigned long long count = 0;
        if (std::sscanf(name.c_str(), "share-%llu-of-%llu.rows", &index, &count) != 2) continue;
        const Share share{.index = index, .count = count};
        if (name == file_name(share) && index >= 1 && index <= count) out.push_back(share);
    }
    std::sort(out.begin(), out.end(), [](const Share& a, const Share& b) {
        return std::pair(a.count, a.index) < std::pair(b.count, b.index);
    });
    return out;
}

std::string difference(const Json& there, const Json& here)
{
    for (const auto& [key, value] : here.items()) {
        if (!there.contains(key)) return fmt::format("{} is not given there", key);
        if (there[key] == value) continue;
        if (value.is_object() && there[key].is_object()) {
            return difference(there[key], value);
        }
        return fmt::format("{} is {} there, and {} here", key, shortened(there[key].dump()),
                           shortened(value.dump()));
    }
    for (const auto& [key, value] : there.items()) {
        if (!here.contains(key)) return fmt::format("{} is given there", key);
    }
    return {};
}

ShareFile::ShareFile(const fs::path& directory, const Share& share, const Json& setup,
                     const std::function<void(std::string_view rows)>& each)
    : file_(directory / file_name(share))
{
    descriptor_ = open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor_ < 0) fail();
    try {
        // Some file systems have no locks.
        if (flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
            throw BadInput(fmt::format("another process runs share {} in '{}'", to_string(share),
                                       shortened(directory.string())));
        }
        begin(first_line(setup));
        // First the set-up: rows of another one have other fields.
        std::ifstream kept(file_, std::ios::binary);
        if (const std::string other = difference(setup_of(file_, kept), setup); !other.empty()) {
            throw BadInput(fmt::format("'{}' keeps an ensemble of another set-up: {}",
                                       shortened(directory.string()), other));
        }
        ShareContent content = read_share(file_, each);
        blocks_ = std::move(content.blocks);
        end_ = content.end;
        const auto end = static_cast<off_t>(end_);
        if (ftruncate(descriptor_, end) != 0 || lseek(descriptor_, end, SEEK_SET) != end) fail();
    } catch (...) {
        close(descriptor_);
        throw;
    }
}

ShareFile::~ShareFile()
{
    close(descriptor_);
}

void ShareFile::fail() const
{
    throw WriteError(fmt::format("cannot write '{}': {}", file_.string(),
                                 std::generic_category().message(errno)));
}

void ShareFile::begin(std::string_view first_line)
{
    std::ifstream in(file_, std::ios::binary);
    const std::string there = read_up_to(in, first_line.size());
    // The file holds nothing, or the part that a killed process has written.
    if (there.size() == first_line.size() || !first_line.starts_with(there)) return;
    if (ftruncate(descriptor_, 0) != 0 || !write_all(descriptor_, first_line)) fail();
}

void ShareFile::append(std::uint64_t block, std::string_view rows)
{
    const BlockHead head{
        .magic = magic, .block = block, .bytes = rows.size(), .check = check_of(block, rows)};
    std::string bytes(reinterpret_cast<const char*>(&head), sizeof head);
    bytes += rows;
    if (!write_all(descriptor_, bytes)) fail();
    blocks_.push_back({.block = block, .offset = end_ + sizeof head, .bytes = rows.size()});
    end_ += bytes.size();
}

}  // namespace ricochet::app
