// Broken model files, made from sound ones, by the hundred thousand.
//
//     safetensors_fuzz [count] [seed]
//
// Every file is either refused with a ModelError, or its model evaluates. Anything
// else ends the program; run it under the address and undefined-behaviour
// sanitizers. Each file depends on the seed and its own number only, so that a
// failure can be repeated.
//
// Bytes changed at random hardly ever get past the JSON, so most changes are made
// to the parsed header: numbers become sizes near powers of two, entries are
// exchanged, removed, doubled or retyped, and the lengths are then made to agree.
#include "ricochet/nn/classifier.hpp"
#include "ricochet/nn/safetensors.hpp"

#include "nn_models.hpp"

#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace ricochet;
using nlohmann::json;
using Bytes = std::vector<std::byte>;

class Fuzzer {
public:
    explicit Fuzzer(std::uint64_t seed) : bits_(seed) {}

    std::uint64_t below(std::uint64_t n) { return bits_() % n; }
    bool one_in(std::uint64_t n) { return below(n) == 0; }

    template <class Container>
    auto& any_of(Container& values)
    {
        return values[below(values.size())];
    }

    /// Small, near a power of two up to 2^64, or anything.
    std::uint64_t size()
    {
        switch (below(4)) {
            case 0: return below(10);
            case 1: {
                const std::uint64_t power = std::uint64_t{1} << below(64);
                return power + below(3) - 1;
            }
            case 2: return std::uint64_t{0} - below(10);
            default: return bits_() >> below(64);
        }
    }

    json value(int depth)
    {
        switch (below(depth > 0 ? 9 : 7)) {
            case 0: return nullptr;
            case 1: return one_in(2);
            case 2: return size();
            case 3: return -static_cast<std::int64_t>(size() >> 1);
            case 4: return std::ldexp(1.5, static_cast<int>(below(2000)) - 1000);
            case 5: return text();
            case 6: return std::string(below(40), '%');
            case 7: {
                json array = json::array();
                for (std::uint64_t i = below(5); i > 0; --i) array.push_back(value(depth - 1));
                return array;
            }
            default: {
                json object = json::object();
                for (std::uint64_t i = below(5); i > 0; --i) object[text()] = value(depth - 1);
                return object;
            }
        }
    }

    std::string text()
    {
        static const std::array<const char*, 24> texts{"",
                                                       "F32",
                                                       "F64",
                                                       "F16",
                                                       "I64",
                                                       "relu",
                                                       "tanh",
                                                       "gelu",
                                                       "1",
                                                       "2",
                                                       "0",
                                                       "-1",
                                                       "nan",
                                                       "inf",
                                                       "1e308 1e308",
                                                       "0 0",
                                                       "1 1 1",
                                                       "0 1 0 1 0 1",
                                                       "event-classifier",
                                                       "a=1 b=2",
                                                       "layers.0.weight",
                                                       "layers.1.bias",
                                                       "shape",
                                                       "18446744073709551616"};
        return any_of(texts);
    }

    /// One change somewhere in the header or the data.
    void change(json& header, Bytes& data)
    {
        std::vector<std::string> names;
        for (const auto& item : header.items()) names.push_back(item.key());
        if (names.empty()) return;
        json& entry = header[any_of(names)];
        switch (below(10)) {
            case 0: entry = value(3); break;
            case 1: header.erase(any_of(names)); break;
            case 2: header[one_in(2) ? text() : any_of(names)] = json(entry); break;
            case 3: std::swap(entry, header[any_of(names)]); break;
            case 4: change_data(data); break;
            case 5: data.resize(below(2 * data.size() + 2)); break;
            default: change_entry(entry); break;
        }
    }

    Bytes join(const json& header, const Bytes& data)
    {
        std::string text = header.dump(-1, ' ', false, json::error_handler_t::replace);
        if (one_in(20)) break_text(text);
        std::uint64_t length = text.size();
        if (one_in(30)) length = size();
        if (one_in(30)) length += below(9) - 4;
        Bytes bytes(8 + text.size() + data.size());
        for (std::size_t i = 0; i < 8; ++i)
            bytes[i] = static_cast<std::byte>((length >> (8 * i)) & 0xff);
        if (!text.empty()) std::memcpy(bytes.data() + 8, text.data(), text.size());
        if (!data.empty()) std::memcpy(bytes.data() + 8 + text.size(), data.data(), data.size());
        if (one_in(10)) bytes.resize(below(bytes.size() + 1));
        return bytes;
    }

private:
    void change_entry(json& entry)
    {
        if (!entry.is_object() || entry.empty()) {
            entry = value(3);
            return;
        }
        std::vector<std::string> keys;
        for (const auto& item : entry.items()) keys.push_back(item.key());
        json& part = entry[any_of(keys)];
        switch (below(8)) {
            case 0: entry.erase(any_of(keys)); break;
            case 1: entry[text()] = value(2); break;
            case 2: part = value(2); break;
            case 3: std::swap(part, entry[any_of(keys)]); break;
            default:
                if (part.is_array() && !part.empty()) {
                    any_of(part) = one_in(4) ? value(1) : json(size());
                } else if (part.is_string()) {
                    part = change_words(part.get<std::string>());
                } else {
                    part = value(2);
                }
                break;
        }
    }

    /// Another list of words: one of them replaced, doubled or removed.
    std::string change_words(const std::string& words)
    {
        static const std::array<const char*, 12> numbers{
            "0", "-0", "1", "-1", "nan", "-inf", "inf", "1e308", "-1e308", "5e-324", "1e-30", "x"};
        std::string changed;
        const std::size_t begin = below(words.size() + 1);
        const std::size_t end = std::min(words.find(' ', begin), words.size());
        changed = words.substr(0, begin);
        if (!one_in(3)) changed += any_of(numbers);
        if (one_in(4)) changed += " ";
        return changed + words.substr(one_in(4) ? begin : end);
    }

    void change_data(Bytes& data)
    {
        if (data.size() < 8) return;
        static const std::array<std::uint32_t, 8> floats{0x00000000, 0x80000000, 0x7f800000,
                                                         0xff800000, 0x7fc00000, 0x7f7fffff,
                                                         0x00000001, 0x7f800001};
        for (std::uint64_t i = below(4); i < 4; ++i) {
            const std::size_t at = below(data.size() - 3);
            if (one_in(2)) {
                std::memcpy(&data[at / 4 * 4], &any_of(floats), 4);
            } else {
                data[at] = static_cast<std::byte>(below(256));
            }
        }
    }

    void break_text(std::string& text)
    {
        const std::size_t at = below(text.size());
        switch (below(5)) {
            case 0: text[at] = static_cast<char>(below(256)); break;
            case 1: text.erase(at, below(20)); break;
            case 2: text.insert(at, std::string(below(3000), '[')); break;
            case 3:
                text.insert(1, text.substr(1, text.size() - 2) + ",");
                break;  // every key twice
            default: text += std::string(below(10), ' '); break;
        }
    }

    std::mt19937_64 bits_;
};

struct Parts {
    json header;
    Bytes data;
};

std::vector<Parts> sound_files()
{
    std::vector<Parts> files;
    for (const auto& widths :
         {std::vector<std::size_t>{1, 1}, {3, 5, 2}, {2, 8, 8, 1}, {4, 16, 16, 1}}) {
        for (const Precision precision : {Precision::f32, Precision::f64}) {
            Model model = random_model(
                widths, precision == Precision::f32 ? Activation::relu : Activation::tanh, 1);
            model.precision = precision;
            model.parameters = {{"gravity", 9.81}};
            const Bytes bytes = to_safetensors(model);
            std::uint64_t length = 0;
            std::memcpy(&length, bytes.data(), 8);
            const auto* text = reinterpret_cast<const char*>(bytes.data()) + 8;
            files.push_back(
                {json::parse(text, text + length),
                 {bytes.begin() + 8 + static_cast<std::ptrdiff_t>(length), bytes.end()}});
        }
    }
    return files;
}

struct Counts {
    std::uint64_t refused = 0;
    std::uint64_t loaded = 0;
    std::map<std::string, std::uint64_t> reasons;
};

/// The kind of complaint: its words up to what was found, without names and numbers.
std::string kind_of(std::string_view message)
{
    std::string kind;
    bool quoted = false;
    for (const char c : message.substr(0, message.find("found"))) {
        if (c == '"') quoted = !quoted;
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        if (!quoted && (letter || c == ' ' || c == ':')) kind += c;
    }
    return kind;
}

/// Loads; evaluates what was loaded and writes it again.
void attempt(const Bytes& bytes, bool allow_non_finite, Counts& counts)
{
    const LoadOptions options{.allow_non_finite = allow_non_finite};
    // A copy of exactly this size, so that the sanitizer sees a read beyond it.
    const Bytes exact(bytes.begin(), bytes.end());
    Model model;
    try {
        model = parse_model(exact, "f", options);
    } catch (const ModelError& error) {
        ++counts.refused;
        ++counts.reasons[kind_of(error.what())];
        return;
    }
    const Classifier classifier(model);
    std::vector<double> features(classifier.inputs(), 0.5);
    std::vector<double> logits(classifier.outputs());
    for (const double x : {0.0, 0.5, -1e300, std::numeric_limits<double>::quiet_NaN()}) {
        features[0] = x;
        classifier.logits(features.data(), logits.data());
        static_cast<void>(classifier.alarm(classifier.logit(features.data())));
        static_cast<void>(classifier.in_domain(features.data()));
    }
    static_cast<void>(parse_model(to_safetensors(model, options), "again", options));
    ++counts.loaded;
}

int run(std::uint64_t count, std::uint64_t seed)
{
    const std::vector<Parts> sound = sound_files();
    Counts counts;
    std::uint64_t done = 0;

    // Every truncation of the smallest.
    Fuzzer plain(0);
    const std::string header = sound[0].header.dump();
    Bytes whole(8);
    for (std::size_t i = 0; i < 8; ++i)
        whole[i] = static_cast<std::byte>((header.size() >> (8 * i)) & 0xff);
    for (const char c : header) whole.push_back(static_cast<std::byte>(c));
    whole.insert(whole.end(), sound[0].data.begin(), sound[0].data.end());
    for (std::size_t size = 0; size < whole.size() && done < count; ++size, ++done) {
        attempt({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}, false, counts);
    }
    if (counts.loaded != 0) {
        std::printf("a truncated file was loaded\n");
        return 1;
    }

    for (; done < count; ++done) {
        Fuzzer fuzzer((seed << 32) + done);
        Parts parts = fuzzer.any_of(sound);
        try {
            for (std::uint64_t i = fuzzer.below(3); i < 3; ++i)
                fuzzer.change(parts.header, parts.data);
            const Bytes bytes = fuzzer.join(parts.header, parts.data);
            attempt(bytes, fuzzer.one_in(2), counts);
        } catch (const std::exception& error) {
            std::printf("file %llu with seed %llu: unexpected: %s\n",
                        static_cast<unsigned long long>(done),
                        static_cast<unsigned long long>(seed), error.what());
            return 1;
        }
    }
    std::printf("%llu files: %llu refused for %zu reasons, %llu loaded and evaluated\n",
                static_cast<unsigned long long>(count),
                static_cast<unsigned long long>(counts.refused), counts.reasons.size(),
                static_cast<unsigned long long>(counts.loaded));
    if (std::getenv("RICOCHET_FUZZ_REASONS") != nullptr) {
        for (const auto& [reason, times] : counts.reasons) {
            std::printf("%8llu %s\n", static_cast<unsigned long long>(times), reason.c_str());
        }
    }
    return 0;
}

}  // namespace

int main(int argc, char** argv)
{
    const std::uint64_t count = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 5000;
    const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
    return run(count, seed);
}
