// Stress tests: properties that must hold whatever is done to a run, in classes with one oracle.
//
// A class counts its cases and reports for each that failed how to repeat it. The short form of
// all of them takes seconds and is a quick test; the long form is for scripts/stress.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/run.hpp"

namespace ricochet::stress {

struct Size {
    bool long_form = false;
    std::uint64_t seed = 1;

    [[nodiscard]] std::uint64_t cases(std::uint64_t brief, std::uint64_t lengthy) const noexcept
    {
        return long_form ? lengthy : brief;
    }
};

/// Shows on a terminal, once a second, how many cases of the class that runs are done.
void show(std::uint64_t cases);

struct Tally {
    std::uint64_t cases = 0;
    std::uint64_t wrong = 0;
    std::vector<std::string> first_wrong;  ///< descriptions of the first of them
    std::string said;                      ///< counts of interest

    void expect(bool holds, const auto& describe)
    {
        show(++cases);
        if (holds) return;
        ++wrong;
        if (first_wrong.size() < 10) first_wrong.push_back(describe());
    }
};

[[nodiscard]] inline bool same_bits(double a, double b) noexcept
{
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

template <class X>
[[nodiscard]] bool same_bits(const X& a, const X& b)
{
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (!same_bits(a[i], b[i])) return false;
    }
    return true;
}

/// Whether two runs have the same motion, to the last bit.
template <class X>
[[nodiscard]] bool same(const Run<X>& a, const Run<X>& b)
{
    if (a.outcome != b.outcome || !same_bits(a.t, b.t) || !same_bits(a.x, b.x) ||
        a.mode != b.mode || a.events.size() != b.events.size()) {
        return false;
    }
    for (std::size_t i = 0; i < a.events.size(); ++i) {
        const auto& p = a.events[i];
        const auto& q = b.events[i];
        if (p.guard != q.guard || p.kind != q.kind || !same_bits(p.t, q.t) ||
            !same_bits(p.after, q.after)) {
            return false;
        }
    }
    return true;
}

template <class X>
[[nodiscard]] bool all_finite(const X& x)
{
    for (const double value : x) {
        if (!std::isfinite(value)) return false;
    }
    return true;
}

Tally bounces(const Size& size);      ///< balls that bounce for very long, under several laws
Tally scales(const Size& size);       ///< times, lengths, masses, steps of every size
Tally poison(const Size& size);       ///< NaN and infinity, at any call
Tally rates(const Size& size);        ///< invalid rates of guards, at any call
Tally bounds(const Size& size);       ///< invalid bounds
Tally memory(const Size& size);       ///< no memory at the n-th allocation
Tally saves(const Size& size);        ///< saved and restored at every event
Tally cancels(const Size& size);      ///< ended at every step
Tally oscillators(const Size& size);  ///< random impact oscillators against their closed form
Tally crowds(const Size& size);       ///< random balls in one state against their closed form

}  // namespace ricochet::stress
