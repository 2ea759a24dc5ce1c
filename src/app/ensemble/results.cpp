#include "results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "../files.hpp"
#include "../joined.hpp"

namespace ricochet::app {

namespace {

constexpr std::size_t flushed = 1U << 20U;  // [bytes] that are written together

/// A string literal of Python.
std::string quoted_for_python(std::string_view text)
{
    std::string out = "'";
    for (const char c : text) {
        if (c == '\'' || c == '\\') out += '\\';
        out += c;
    }
    return out + '\'';
}

/// "('height', '<f8')", or nothing if NumPy's table lacks the field.
std::string numpy_field(const Field& field)
{
    std::string type;
    switch (field.kind) {
        case FieldKind::count: type = "<u8"; break;
        case FieldKind::number: type = "<f8"; break;
        case FieldKind::text:
            if (field.width == 0) return {};
            type = fmt::format("<U{}", field.width);
            break;
    }
    return fmt::format("({}, '{}'), ", quoted_for_python(field.name), type);
}

/// Header of NumPy's format, as numpy.lib.format describes it: version 1, or 3 with UTF-8.
std::string numpy_header(const std::vector<Field>& fields, std::size_t rows)
{
    std::string text = "{'descr': [";
    for (const Field& field : fields) text += numpy_field(field);
    text += fmt::format("], 'fortran_order': False, 'shape': ({},), }}", rows);
    const bool plain = text.size() < 60'000 && std::all_of(text.begin(), text.end(), [](char c) {
                           return static_cast<unsigned char>(c) < 0x80;
                       });
    const std::size_t before = plain ? 10 : 12;
    constexpr std::size_t alignment = 64;
    text.append(alignment - 1 - (before + text.size()) % alignment, ' ');
    text += '\n';
    std::string out("\x93NUMPY", 6);
    out += plain ? '\x01' : '\x03';
    out += '\0';
    for (std::size_t i = 0; i < before - 8; ++i) {
        out += static_cast<char>(text.size() >> (8 * i) & 0xffU);
    }
    return out + text;
}

/// Appends a text of NumPy: four bytes per character.
void put_characters(std::string_view text, std::size_t width, std::string& out)
{
    for (std::size_t i = 0; i < width; ++i) {
        const char c = i < text.size() ? text[i] : '\0';
        out += static_cast<unsigned char>(c) < 0x80 ? c : '?';
        out.append(3, '\0');
    }
}

std::string csv_header(const std::vector<Field>& fields)
{
    std::string out;
    for (const Field& field : fields) {
        if (!out.empty()) out += ',';
        out += csv_cell(field.unit.empty() || field.unit == "1"
                            ? field.name
                            : fmt::format("{} [{}]", field.name, field.unit));
    }
    return out + '\n';
}

/// Appends a row to both tables.
void put_row(const std::vector<Field>& fields, RowReader& row, std::string& npy, std::string& csv)
{
    std::string_view comma;
    for (const Field& field : fields) {
        csv += comma;
        comma = ",";
        RowWriter binary(npy);
        switch (field.kind) {
            case FieldKind::count: {
                const std::uint64_t value = row.count();
                binary.count(value);
                csv += fmt::format("{}", value);
                break;
            }
            case FieldKind::number: {
                const double value = row.number();
                binary.number(value);
                csv += fmt::format("{}", value);
                break;
            }
            case FieldKind::text: {
                const std::string_view value = row.text();
                put_characters(value, field.width, npy);
                csv += csv_cell(value);
                break;
            }
        }
    }
    csv += '\n';
}

}  // namespace

void AllBlocks::add(const std::filesystem::path& file, const std::vector<BlockPlace>& blocks)
{
    for (const BlockPlace& block : blocks) {
        if (block.block >= places_.size() || has(block.block)) continue;
        places_[block.block] = {.file = static_cast<int>(files_.size()), .at = block};
    }
    files_.push_back(file);
}

std::string AllBlocks::rows(std::size_t block) const
{
    const Place& place = places_[block];
    return read_block(files_[static_cast<std::size_t>(place.file)], place.at);
}

void write_results(const std::filesystem::path& directory, const std::vector<Field>& fields,
                   std::size_t rows, std::size_t shares, const AllBlocks& blocks)
{
    NewFile npy_file(directory / "results.npy");
    NewFile csv_file(directory / "results.csv");
    std::string npy = numpy_header(fields, rows);
    std::string csv = csv_header(fields);
    const auto flush = [&](std::size_t enough) {
        if (npy.size() + csv.size() < enough) return;
        npy_file.write(npy);
        csv_file.write(csv);
        npy.clear();
        csv.clear();
    };
    // The rows of one block of each share follow each other by turns.
    std::vector<std::string> bytes;
    std::vector<RowReader> readers;
    for (std::size_t first = 0; first < blocks.size(); first += shares) {
        const std::size_t count = std::min(shares, blocks.size() - first);
        bytes.clear();
        readers.clear();
        for (std::size_t k = 0; k < count; ++k) bytes.push_back(blocks.rows(first + k));
        for (const std::string& block : bytes) readers.emplace_back(block);
        for (std::size_t k = 0; !readers[k].is_at_end(); k = (k + 1) % count) {
            put_row(fields, readers[k], npy, csv);
            flush(flushed);
        }
    }
    flush(1);
    npy_file.keep();
    csv_file.keep();
}

}  // namespace ricochet::app
