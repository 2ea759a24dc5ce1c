// Damage to files, drawn at random from a seed.
//
// Random changes of bytes hardly ever get past a parser, so most changes are made to the elements
// of a format: to the nodes of a JSON document, the words of a text, the numbers of a binary file.
// The format then mostly makes lengths and checksums agree.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

namespace ricochet {

class Mutator {
public:
    using Json = nlohmann::json;

    explicit Mutator(std::uint64_t seed) : bits_(seed) {}

    std::uint64_t below(std::uint64_t n) { return bits_() % n; }
    bool one_in(std::uint64_t n) { return below(n) == 0; }

    template <class Container>
    auto& any_of(Container& values)
    {
        return values[below(values.size())];
    }

    /// A number that is small, near a power of two up to 2^64, or arbitrary.
    std::uint64_t size()
    {
        switch (below(4)) {
            case 0: return below(10);
            case 1: return (std::uint64_t{1} << below(64)) + below(3) - 1;
            case 2: return std::uint64_t{0} - below(10);
            default: return bits_() >> below(64);
        }
    }

    /// The bits of a special or an arbitrary number.
    std::uint64_t number()
    {
        static const std::array<double, 10> values{0.0,       -0.0,  1.0,    -1.0,  HUGE_VAL,
                                                   -HUGE_VAL, 1e308, 5e-324, 1e-30, std::nan("")};
        return one_in(4) ? size() : std::bit_cast<std::uint64_t>(any_of(values));
    }

    Json value(int depth)
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
                Json array = Json::array();
                for (std::uint64_t i = below(5); i > 0; --i) array.push_back(value(depth - 1));
                return array;
            }
            default: {
                Json object = Json::object();
                for (std::uint64_t i = below(5); i > 0; --i) object[text()] = value(depth - 1);
                return object;
            }
        }
    }

    std::string text()
    {
        static const std::array<const char*, 26> texts{"",
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
                                                       "18446744073709551616",
                                                       "v_min",
                                                       "weight"};
        return any_of(texts);
    }

    /// One change at some node of the document.
    void change(Json& document)
    {
        Json* node = &document;
        while (!node->empty() && node->is_structured() && !one_in(4)) node = &child(*node);
        if (!node->is_structured() || node->empty() || one_in(6)) {
            *node = changed(*node);
            return;
        }
        Json& part = child(*node);
        switch (below(5)) {
            case 0: erase(*node); break;
            case 1: add(*node, one_in(2) ? Json(part) : value(2)); break;
            case 2: std::swap(part, child(*node)); break;
            default: part = changed(part); break;
        }
    }

    /// Another list of words: one of them replaced, doubled or removed.
    std::string change_words(const std::string& words)
    {
        static const std::array<const char*, 17> numbers{
            "0",     "-0",  "1",     "-1",         "nan",
            "-inf",  "inf", "1e308", "-1e308",     "5e-324",
            "1e-30", "x",   "1p+0",  "-1.8p+1023", "99999999999999999999",
            "'<f8'", "True"};
        const std::size_t begin = below(words.size() + 1);
        const std::size_t end = std::min(words.find_first_of(" \n", begin), words.size());
        std::string changed = words.substr(0, begin);
        if (!one_in(3)) changed += one_in(3) ? std::to_string(size()) : any_of(numbers);
        if (one_in(4)) changed += " ";
        return changed + words.substr(one_in(4) ? begin : end);
    }

    /// Makes a text that may not be valid JSON, or is nested deeper than any file.
    void break_text(std::string& text)
    {
        if (text.size() < 2) return;
        const std::size_t at = below(text.size());
        switch (below(6)) {
            case 0: text[at] = static_cast<char>(below(256)); break;
            case 1: text.erase(at, below(20)); break;
            case 2: text.insert(at, std::string(below(3000), '[')); break;
            case 3:
                text.insert(1, text.substr(1, text.size() - 2) + ",");
                break;  // every key twice
            case 4:
                if (one_in(100)) text.insert(at, std::string(100'000, one_in(2) ? '[' : '{'));
                break;
            default: text += std::string(below(10), ' '); break;
        }
    }

    /// Replaces a few numbers of `width` bytes each, from `first` on, or single bytes.
    void change_numbers(std::string& bytes, std::size_t first, std::size_t width)
    {
        if (bytes.size() < first + width) return;
        for (std::uint64_t i = below(4); i < 4; ++i) {
            const std::size_t at = below(bytes.size() - first - width + 1);
            if (one_in(3)) {
                bytes[first + at] = static_cast<char>(below(256));
            } else {
                const std::uint64_t word = number();
                const float single = static_cast<float>(std::bit_cast<double>(word));
                char* to = bytes.data() + first + at / width * width;
                if (width == 8) std::memcpy(to, &word, 8);
                if (width == 4) std::memcpy(to, &single, 4);
            }
        }
    }

    /// Removes, adds or changes bytes.
    void break_bytes(std::string& bytes)
    {
        if (bytes.empty()) return;
        const std::size_t at = below(bytes.size());
        switch (below(5)) {
            case 0: bytes.resize(at); break;
            case 1: bytes[at] = static_cast<char>(below(256)); break;
            case 2: bytes.erase(at, below(64)); break;
            case 3: bytes.insert(at, bytes.substr(below(bytes.size()), below(64))); break;
            default: bytes.append(below(64), static_cast<char>(below(256))); break;
        }
    }

private:
    Json& child(Json& node)
    {
        auto it = node.begin();
        std::advance(it, static_cast<std::ptrdiff_t>(below(node.size())));
        return *it;
    }

    void erase(Json& node)
    {
        if (node.is_array()) {
            node.erase(below(node.size()));
            return;
        }
        auto it = node.begin();
        std::advance(it, static_cast<std::ptrdiff_t>(below(node.size())));
        node.erase(it);
    }

    void add(Json& node, Json what)
    {
        if (node.is_array()) {
            node.push_back(std::move(what));
        } else {
            node[text()] = std::move(what);
        }
    }

    Json changed(const Json& node)
    {
        if (node.is_string() && !one_in(4)) return change_words(node.get<std::string>());
        if (node.is_number_float() && !one_in(3)) {
            const auto any = std::bit_cast<double>(number());
            return std::isfinite(any) ? Json(any) : Json(size());
        }
        if (node.is_number() && !one_in(4)) return size();
        return value(3);
    }

    std::mt19937_64 bits_;
};

}  // namespace ricochet
