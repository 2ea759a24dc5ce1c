// What the library uses of C++20 and libc++ 13, the standard library of Debian's emscripten 3.1.6,
// does not have. Included before every source by -include; empty for any newer library.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <string>
#include <utility>

#if defined(_LIBCPP_VERSION) && _LIBCPP_VERSION < 14000

// NOLINTBEGIN(cert-dcl58-cpp): these are the names that the library asks of std.
namespace std {

template <class To, class From>
constexpr To bit_cast(const From& from) noexcept
{
    return __builtin_bit_cast(To, from);
}

namespace ranges {

/// `f` of a projection, as the algorithms without projections take it.
template <class F, class Projection>
auto projected(F f, Projection projection)
{
    return [f, projection](auto&&... elements) mutable -> decltype(auto) {
        return std::invoke(f, std::invoke(projection, elements)...);
    };
}

#define RICOCHET_BY_PREDICATE(algorithm)                              \
    template <class Range, class F, class Projection = std::identity> \
    auto algorithm(Range&& range, F f, Projection projection = {})    \
    {                                                                 \
        return std::algorithm(std::begin(range), std::end(range),     \
                              ranges::projected(f, projection));      \
    }
RICOCHET_BY_PREDICATE(all_of)
RICOCHET_BY_PREDICATE(any_of)
RICOCHET_BY_PREDICATE(none_of)
RICOCHET_BY_PREDICATE(count_if)
RICOCHET_BY_PREDICATE(find_if)
RICOCHET_BY_PREDICATE(for_each)
#undef RICOCHET_BY_PREDICATE

#define RICOCHET_BY_ORDER(algorithm)                                                   \
    template <class Range, class Less = std::less<>, class Projection = std::identity> \
    auto algorithm(Range&& range, Less less = {}, Projection projection = {})          \
    {                                                                                  \
        return std::algorithm(std::begin(range), std::end(range),                      \
                              ranges::projected(less, projection));                    \
    }
RICOCHET_BY_ORDER(is_sorted)
RICOCHET_BY_ORDER(minmax_element)
RICOCHET_BY_ORDER(sort)
RICOCHET_BY_ORDER(stable_sort)
#undef RICOCHET_BY_ORDER

#define RICOCHET_BY_VALUE(algorithm)                                      \
    template <class Range, class T>                                       \
    auto algorithm(Range&& range, const T& value)                         \
    {                                                                     \
        return std::algorithm(std::begin(range), std::end(range), value); \
    }
RICOCHET_BY_VALUE(binary_search)
RICOCHET_BY_VALUE(count)
RICOCHET_BY_VALUE(fill)
RICOCHET_BY_VALUE(find)
#undef RICOCHET_BY_VALUE

#define RICOCHET_BY_BOUND(algorithm)                                                               \
    template <class Range, class T, class Less = std::less<>, class Projection = std::identity>    \
    auto algorithm(Range&& range, const T& value, Less less = {}, Projection projection = {})      \
    {                                                                                              \
        return std::partition_point(std::begin(range), std::end(range), [&](const auto& element) { \
            return before_##algorithm(less, std::invoke(projection, element), value);              \
        });                                                                                        \
    }
template <class Less, class A, class B>
bool before_lower_bound(Less& less, const A& element, const B& value)
{
    return std::invoke(less, element, value);
}
template <class Less, class A, class B>
bool before_upper_bound(Less& less, const A& element, const B& value)
{
    return !std::invoke(less, value, element);
}
RICOCHET_BY_BOUND(lower_bound)
RICOCHET_BY_BOUND(upper_bound)
#undef RICOCHET_BY_BOUND

template <class Range, class Out>
void copy(Range&& range, Out out)
{
    std::copy(std::begin(range), std::end(range), out);
}

template <class A, class B>
bool equal(const A& a, const B& b)
{
    return std::equal(std::begin(a), std::end(a), std::begin(b), std::end(b));
}

template <class Range, class Iterator, class Less = std::less<>>
void nth_element(Range&& range, Iterator nth, Less less = {})
{
    std::nth_element(std::begin(range), nth, std::end(range), less);
}

template <class Range>
auto max(const Range& range)
{
    return *std::max_element(std::begin(range), std::end(range));
}

template <class Range>
auto minmax(const Range& range)
{
    const auto [least, most] = std::minmax_element(std::begin(range), std::end(range));
    using T = std::decay_t<decltype(*least)>;
    struct {
        T min, max;
    } const both{*least, *most};
    return both;
}

}  // namespace ranges

/// The shortest decimal number that reads back as `value`.
inline to_chars_result to_chars(char* first, char* last, double value)
{
    char text[40];
    int size = 0;
    for (int digits = 1; digits <= 17; ++digits) {
        size = std::snprintf(text, sizeof text, "%.*g", digits, value);
        if (std::strtod(text, nullptr) == value) break;
    }
    if (last - first < size) return {last, errc::value_too_large};
    std::memcpy(first, text, static_cast<size_t>(size));
    return {first + size, errc{}};
}

/// Hexadecimal, without the 0x of printf.
inline to_chars_result to_chars(char* first, char* last, double value, chars_format /*hex*/)
{
    char text[40];
    string digits(text, static_cast<size_t>(std::snprintf(text, sizeof text, "%a", value)));
    if (const auto at = digits.find("0x"); at != string::npos) digits.erase(at, 2);
    if (last - first < static_cast<ptrdiff_t>(digits.size())) return {last, errc::value_too_large};
    std::memcpy(first, digits.data(), digits.size());
    return {first + digits.size(), errc{}};
}

inline from_chars_result from_chars(const char* first, const char* last, double& value,
                                    chars_format format = chars_format::general)
{
    const bool hex = format == chars_format::hex;
    string text(first, last);
    if (hex) text.insert(!text.empty() && text[0] == '-' ? 1 : 0, "0x");
    char* end = nullptr;
    const double read = std::strtod(text.c_str(), &end);
    if (end == text.c_str()) return {first, errc::invalid_argument};
    value = read;
    return {first + ((end - text.c_str()) - (hex ? 2 : 0)), errc{}};
}

}  // namespace std
// NOLINTEND(cert-dcl58-cpp)

#endif
