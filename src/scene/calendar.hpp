// Next body to act: a heap of four children a node, with one entry for each body that is awake.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/world.hpp"

namespace ricochet::detail {

class Calendar {
public:
    explicit Calendar(std::size_t bodies) : place_(bodies, none) {}

    void clear()
    {
        for (const Entry& entry : heap_) place_[entry.body] = none;
        heap_.clear();
    }
    [[nodiscard]] bool empty() const noexcept { return heap_.empty(); }
    [[nodiscard]] std::uint32_t first() const noexcept { return heap_[0].body; }
    [[nodiscard]] const Instant& first_time() const noexcept { return heap_[0].t; }

    /// The entry of a body; an infinite time takes it out.
    void set(std::uint32_t body, const Instant& t)
    {
        std::uint32_t at = place_[body];
        if (!(t.value < never)) {
            if (at != none) erase(at);
            return;
        }
        if (at == none) {
            at = static_cast<std::uint32_t>(heap_.size());
            heap_.push_back({t, body});
            place_[body] = at;
            up(at);
            return;
        }
        const bool earlier = before(t, heap_[at].t);
        heap_[at].t = t;
        earlier ? up(at) : down(at);
    }

private:
    struct Entry {
        Instant t;
        std::uint32_t body;
    };
    /// Of two at one time the lower label, which decides nothing but the order of the work.
    [[nodiscard]] static bool precedes(const Entry& a, const Entry& b) noexcept
    {
        if (a.t.value != b.t.value) return a.t.value < b.t.value;
        if (a.t.remainder != b.t.remainder) return a.t.remainder < b.t.remainder;
        return a.body < b.body;
    }
    void put(std::uint32_t at, const Entry& entry)
    {
        heap_[at] = entry;
        place_[entry.body] = at;
    }
    void up(std::uint32_t at)
    {
        const Entry entry = heap_[at];
        while (at > 0) {
            const std::uint32_t parent = (at - 1) / 4;
            if (!precedes(entry, heap_[parent])) break;
            put(at, heap_[parent]);
            at = parent;
        }
        put(at, entry);
    }
    void down(std::uint32_t at)
    {
        const Entry entry = heap_[at];
        const auto size = static_cast<std::uint32_t>(heap_.size());
        for (;;) {
            const std::uint32_t child = 4 * at + 1;
            if (child >= size) break;
            std::uint32_t best = child;
            const std::uint32_t last = std::min(child + 4, size);
            for (std::uint32_t c = child + 1; c < last; ++c) {
                if (precedes(heap_[c], heap_[best])) best = c;
            }
            if (!precedes(heap_[best], entry)) break;
            put(at, heap_[best]);
            at = best;
        }
        put(at, entry);
    }
    void erase(std::uint32_t at)
    {
        place_[heap_[at].body] = none;
        const Entry last = heap_.back();
        heap_.pop_back();
        if (at == heap_.size()) return;
        put(at, last);
        up(at);
        down(place_[last.body]);
    }

    std::vector<Entry> heap_;
    std::vector<std::uint32_t> place_;
};

}  // namespace ricochet::detail
