// The last answer of a dear question, kept by each thread.
//
// A guard and its rate ask for the same nearest point, and the next question is near the last.
// What is remembered is an answer to exactly the same question, or a hint; neither
// changes a result, so systems stay values without mutable state.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace ricochet::detail {

/// A number that nobody else in this process has. Copies of a value share it.
inline std::uint64_t unique_number() noexcept
{
    static std::atomic<std::uint64_t> last{0};
    return ++last;
}

template <class Question, class Answer>
struct LastAnswer {
    std::uint64_t owner = 0;
    Question question{};
    Answer answer{};

    /// The slot of an owner. Owners may share one, and then only forget.
    [[nodiscard]] static LastAnswer& of(std::uint64_t owner) noexcept
    {
        thread_local constinit std::array<LastAnswer, 8> slots{};
        return slots[owner % slots.size()];
    }
};

}  // namespace ricochet::detail
