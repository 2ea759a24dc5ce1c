// Finds the next body to act, with one entry for each awake body: a heap of four children a node
// or, where there are many, a ring of lists of which only the present one is in the heap (G. Paul,
// A complexity O(1) priority queue for event driven molecular dynamics simulations, Journal of
// Computational Physics 221, 2007). Both give the same order.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "scene/world.hpp"

namespace ricochet::detail {

class EventQueue {
public:
    explicit EventQueue(std::size_t bodies) : place_(bodies, none) {}

    /// Removes all entries; with a ring if there will be many.
    void clear(bool with_ring)
    {
        for (const Entry& entry : heap_) place_[entry.body] = none;
        heap_.clear();
        ring_ = with_ring;
        ahead_ = none;
        if (!ring_) return;
        times_.resize(place_.size(), no_instant);
        is_late_.resize(place_.size(), 0);
        for (const std::uint32_t body : late_) is_late_[body] = 0;
        late_.clear();
        lists_.clear();
        nodes_.clear();
        free_ = none;
        present_ = 0;
        origin_ = inverse_ = 0;
    }
    /// Whether there is no entry. After a call that returns false, `first` precedes all others.
    [[nodiscard]] bool empty()
    {
        return empty([](std::uint32_t /*body*/) {});
    }
    /// The same, and calls `fetch` with a body that acts soon, whose records may be far away in
    /// memory.
    template <class Fetch>
    [[nodiscard]] bool empty(const Fetch& fetch)
    {
        if (ahead_ != none) {
            const auto [body, next] = nodes_[ahead_];
            ahead_ = next;
            if (next != none) __builtin_prefetch(&nodes_[next]);
            __builtin_prefetch(&times_[body]);
            __builtin_prefetch(&place_[body]);
            __builtin_prefetch(&is_late_[body]);
            fetch(body);
        }
        while (ring_ && heap_.empty()) {
            if (present_ + 1 >= lists_.size()) {
                if (!turn()) break;
            } else {
                pour(++present_);
            }
        }
        return heap_.empty();
    }
    [[nodiscard]] std::uint32_t first() const noexcept { return heap_[0].body; }
    [[nodiscard]] const Instant& first_time() const noexcept { return heap_[0].t; }

    /// Sets the entry of a body; an infinite time removes it.
    void set(std::uint32_t body, const Instant& t)
    {
        if (ring_) return set_in_ring(body, t);
        if (!(t.value < never)) return take_out(body);
        set_in_heap(body, t);
    }

private:
    /// Mean number of entries in a list when it becomes the present one: few lists are empty, and
    /// the heap stays in the nearest cache.
    static constexpr double in_a_list = 16;

    /// A node of a list is valid if `times_` agrees when the list is poured; none is ever removed.
    struct Node {
        std::uint32_t body = none;
        std::uint32_t next = none;
    };

    [[nodiscard]] double list_of(const Instant& t) const noexcept
    {
        return (t.value - origin_) * inverse_;
    }
    void set_in_ring(std::uint32_t body, const Instant& t)
    {
        times_[body] = t;
        if (!(t.value < never)) return take_out(body);
        const double list = list_of(t);
        if (list < static_cast<double>(present_ + 1) && !lists_.empty()) {
            return set_in_heap(body, t);
        }
        take_out(body);
        put_in_list(body, list);
    }
    void put_in_list(std::uint32_t body, double list)
    {
        if (list < static_cast<double>(lists_.size())) {
            std::uint32_t node = free_;
            if (node == none) {
                node = static_cast<std::uint32_t>(nodes_.size());
                nodes_.emplace_back();
            } else {
                free_ = nodes_[node].next;
            }
            std::uint32_t& head = lists_[static_cast<std::size_t>(list)];
            nodes_[node] = {body, head};
            head = node;
        } else if (!is_late_[body]) {
            is_late_[body] = 1;
            late_.push_back(body);
        }
    }
    /// Moves the entries of a list into the heap.
    void pour(std::size_t list)
    {
        std::uint32_t node = lists_[list];
        lists_[list] = none;
        while (node != none) {
            const auto [body, next] = nodes_[node];
            const Instant& t = times_[body];
            const bool due = t.value < never && list_of(t) < static_cast<double>(list + 1);
            if (due && place_[body] == none) set_in_heap(body, t);
            nodes_[node].next = free_;
            free_ = node;
            node = next;
        }
        ahead_ = list + 1 < lists_.size() ? lists_[list + 1] : none;
    }
    /// Builds new lists when all entries are late. Their width is such that the first quarter of
    /// the entries fills them with `in_a_list` entries each. A turn of the ring thus has at least a
    /// quarter of the entries, and its cost is divided among as many events. False: there are no
    /// entries.
    bool turn()
    {
        std::erase_if(late_, [&](std::uint32_t body) {
            const bool late = times_[body].value < never;
            is_late_[body] = late ? 1 : 0;
            return !late;
        });
        if (late_.empty()) return false;
        const std::size_t stride = late_.size() / 1024 + 1;
        some_.clear();
        origin_ = never;
        for (std::size_t k = 0; k < late_.size(); ++k) {
            const double t = times_[late_[k]].value;
            origin_ = std::min(origin_, t);
            if (k % stride == 0) some_.push_back(t);
        }
        const auto quarter = some_.begin() + static_cast<std::ptrdiff_t>(some_.size() / 4);
        std::ranges::nth_element(some_, quarter);
        double until = *quarter - origin_;
        if (!(until > 0)) until = std::ranges::max(some_) - origin_;
        const double count = static_cast<double>(late_.size()) / in_a_list;
        inverse_ = 0.25 * count / until;
        if (!std::isfinite(inverse_)) inverse_ = 0;  // all at one time: all go into the heap
        lists_.assign(static_cast<std::size_t>(2 * count) + 2, none);
        present_ = 0;
        waiting_.swap(late_);
        late_.clear();
        for (const std::uint32_t body : waiting_) is_late_[body] = 0;
        for (const std::uint32_t body : waiting_) put_in_list(body, list_of(times_[body]));
        pour(0);
        return true;
    }

    void take_out(std::uint32_t body)
    {
        if (place_[body] != none) erase(place_[body]);
    }
    void set_in_heap(std::uint32_t body, const Instant& t)
    {
        std::uint32_t at = place_[body];
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

    struct Entry {
        Instant t;
        std::uint32_t body;
    };
    /// Orders entries at one time by label, which affects only the order of the work.
    [[nodiscard]] static bool precedes(const Entry& a, const Entry& b) noexcept
    {
        if (a.t.value != b.t.value) return a.t.value < b.t.value;
        if (a.t.remainder != b.t.remainder) return a.t.remainder < b.t.remainder;
        return a.body < b.body;
    }
    /// The first of four children. Which one it is cannot be predicted: it is selected by values,
    /// without branches, unless the times of two are equal.
    [[nodiscard]] std::uint32_t first_of_four(std::uint32_t child) const noexcept
    {
        const double a = heap_[child].t.value, b = heap_[child + 1].t.value;
        const double c = heap_[child + 2].t.value, d = heap_[child + 3].t.value;
        const std::uint32_t ab = child + static_cast<std::uint32_t>(b < a);
        const std::uint32_t cd = child + 2 + static_cast<std::uint32_t>(d < c);
        const double of_ab = std::min(a, b), of_cd = std::min(c, d);
        if ((a == b) | (c == d) | (of_ab == of_cd)) [[unlikely]] {
            return first_of(child, child + 4);
        }
        return of_cd < of_ab ? cd : ab;
    }
    [[nodiscard]] std::uint32_t first_of(std::uint32_t child, std::uint32_t last) const noexcept
    {
        std::uint32_t best = child;
        for (std::uint32_t c = child + 1; c < last; ++c) {
            if (precedes(heap_[c], heap_[best])) best = c;
        }
        return best;
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
            const std::uint32_t best =
                child + 4 <= size ? first_of_four(child) : first_of(child, size);
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
    std::vector<std::uint32_t> place_;  ///< in the heap

    bool ring_ = false;
    std::vector<Instant> times_;  ///< of all entries, in the heap or not
    std::vector<std::uint32_t>
        lists_;  ///< their first nodes; list k begins at origin + k / inverse
    std::vector<Node> nodes_;
    std::uint32_t free_ = none;
    std::uint32_t ahead_ = none;  ///< node of the next list that is fetched next
    std::size_t present_ = 0;
    double origin_ = 0, inverse_ = 0;
    std::vector<std::uint32_t> late_, waiting_;  ///< entries beyond the last list
    std::vector<char> is_late_;
    std::vector<double> some_;
};

}  // namespace ricochet::detail
