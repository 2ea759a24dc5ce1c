// Internal: the declarations of this header may change without notice.
//
// Scratch states for a function that must not allocate.
//
// A state of fixed size lives on the stack. One that is sized at run time would
// allocate at every call; its memory belongs to the thread instead, is borrowed
// and kept for the next call. Loans nest, so that a field may itself be a system that
// borrows. The contents are arbitrary at first, except for the size.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/detail/components.hpp"

namespace ricochet::detail {

template <class X, std::size_t n, bool fixed = (fixed_size<X>() > 0)>
class Scratch {
public:
    template <class Like>
    explicit Scratch(const Like& /*like*/) noexcept
    {
    }
    [[nodiscard]] X& operator[](std::size_t i) noexcept { return states_[i]; }

private:
    std::array<X, n> states_;
};

template <class X, std::size_t n>
class Scratch<X, n, false> {
public:
    /// Memory for n states of the size of `like`.
    template <class Like>
    explicit Scratch(const Like& like)
    {
        auto& rooms = loans().rooms;
        if (loans().lent == rooms.size()) rooms.emplace_back(new Room);
        room_ = &*rooms[loans().lent];
        for (X& x : *room_) {
            using Size = decltype(x.size());
            const auto size = static_cast<Size>(like.size());
            if (x.size() != size) x.resize(size);
        }
        ++loans().lent;
    }
    ~Scratch() { --loans().lent; }
    Scratch(const Scratch&) = delete;
    Scratch& operator=(const Scratch&) = delete;

    [[nodiscard]] X& operator[](std::size_t i) noexcept { return (*room_)[i]; }

private:
    using Room = std::array<X, n>;
    struct Loans {
        std::vector<Owner<Room>> rooms;
        std::size_t lent = 0;
    };
    [[nodiscard]] static Loans& loans()
    {
        thread_local Loans loans;
        return loans;
    }

    Room* room_;
};

}  // namespace ricochet::detail
