// Cache of the last result of an expensive query, kept by the system that answers it.
//
// A guard and its rate need the same nearest point, and successive queries are close together. The
// cache returns a result only for exactly the same query, or a hint for a similar one; neither
// changes a result, so systems stay values that threads may share.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>

namespace ricochet::detail {

/// Threads that share a system find their own results again, unless the hashes of their numbers
/// coincide: of these threads one at a time uses the cache, and the others compute without it.
template <class Question, class Answer>
class LastAnswers {
public:
    struct Memory {
        bool known = false;  ///< whether there was a query
        Question question{};
        Answer answer{};
    };

private:
    struct alignas(64) Slot {
        std::atomic<bool> lent{false};
        Memory memory{};
    };

public:
    LastAnswers() = default;
    /// A copy starts with an empty cache.
    LastAnswers(const LastAnswers& /*other*/) noexcept {}
    LastAnswers& operator=(const LastAnswers& /*other*/) noexcept { return *this; }

    /// The last query of the calling thread, in exclusive use.
    class Loan {
    public:
        explicit Loan(LastAnswers& all) noexcept : slot_(&all.slots_[number_of_thread()])
        {
            if (slot_->lent.exchange(true, std::memory_order_acquire)) {
                slot_ = nullptr;
                own_.emplace();
            }
        }
        ~Loan()
        {
            if (slot_) slot_->lent.store(false, std::memory_order_release);
        }
        Loan(const Loan&) = delete;
        Loan& operator=(const Loan&) = delete;

        [[nodiscard]] Memory* operator->() noexcept { return slot_ ? &slot_->memory : &*own_; }

    private:
        Slot* slot_;
        std::optional<Memory> own_{};
    };

private:
    static constexpr std::size_t count = 8;

    [[nodiscard]] static std::size_t number_of_thread() noexcept
    {
        const auto id =
            static_cast<std::uint64_t>(std::hash<std::thread::id>{}(std::this_thread::get_id()));
        return static_cast<std::size_t>((id * 0x9e3779b97f4a7c15u) >> 61);  // Fibonacci hashing
    }

    std::array<Slot, count> slots_{};
};

}  // namespace ricochet::detail
