// The proof of one statement, on several threads.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "branch_and_bound.hpp"
#include "certify_checkpoint.hpp"

namespace ricochet::learn {

enum class Stop { none, interrupted, out_of_time, out_of_memory };

/// Examines the parts below a frontier on several threads, in order. It stops as soon as the
/// finished parts without a gap contain a counterexample or too many unproved boxes, so the result
/// does not depend on the speed of the threads.
class Proof {
public:
    Proof(const Statement& statement, Frontier frontier, std::size_t max_unproved, Started& started)
        : statement_(statement),
          frontier_(std::move(frontier)),
          max_unproved_(max_unproved),
          started_(started),
          total_(frontier_.tally)
    {
        started_.done.resize(frontier_.open.size());
        for (const auto& part : started_.done) {
            if (part) boxes_ += part->boxes;
        }
        boxes_ += total_.boxes;
        advance();
    }

    /// @param wait  called about twenty times a second while the workers are held; not `none`: stop
    template <class Wait>
    void run(unsigned threads, const Wait& wait)
    {
        std::vector<std::thread> workers;
        try {
            for (unsigned i = 0; i < threads; ++i) workers.emplace_back([this] { work(); });
        } catch (const std::system_error&) {
            if (workers.empty()) throw;  // fewer threads suffice
        }
        {
            std::unique_lock lock(mutex_);
            while (!wake_.wait_for(lock, std::chrono::milliseconds(50), [&] { return idle(); })) {
                try {
                    const Stop asked = wait(boxes_);
                    if (asked != Stop::none && stop_ == Stop::none) stop_ = asked;
                } catch (...) {
                    if (!error_) error_ = std::current_exception();
                }
            }
        }
        for (std::thread& worker : workers) worker.join();
        if (error_) std::rethrow_exception(error_);
    }

    [[nodiscard]] Stop stopped() const noexcept { return finished() ? Stop::none : stop_; }
    [[nodiscard]] const Tally& total() const noexcept { return total_; }
    [[nodiscard]] bool refuted() const noexcept { return !total_.counterexample.empty(); }
    [[nodiscard]] bool too_many() const noexcept { return total_.unproved.size() > max_unproved_; }

private:
    [[nodiscard]] bool finished() const noexcept
    {
        return refuted() || too_many() || settled_ == started_.done.size();
    }
    [[nodiscard]] bool idle() const noexcept
    {
        return running_ == 0 &&
               (finished() || stop_ != Stop::none || error_ || next_ >= frontier_.open.size());
    }

    /// Adds up the finished parts without a gap.
    void advance()
    {
        while (!finished() && started_.done[settled_]) {
            const Tally& part = *started_.done[settled_];
            total_.boxes += part.boxes;
            total_.lowest = std::min(total_.lowest, part.lowest);
            total_.unproved.insert(total_.unproved.end(), part.unproved.begin(),
                                   part.unproved.end());
            total_.counterexample = part.counterexample;
            ++settled_;
        }
    }

    [[nodiscard]] std::optional<std::size_t> claim()
    {
        const std::scoped_lock lock(mutex_);
        if (finished() || stop_ != Stop::none || error_) return std::nullopt;
        while (next_ < started_.done.size() && started_.done[next_]) ++next_;
        if (next_ >= started_.done.size()) return std::nullopt;
        ++running_;
        return next_++;
    }

    void work()
    {
        while (const auto part = claim()) {
            Tally tally;
            bool whole = false;
            Stop failed = Stop::none;
            std::exception_ptr error;
            try {
                whole = explore(statement_, frontier_.open[*part], max_unproved_, tally,
                                [this](std::uint64_t boxes) {
                                    const std::scoped_lock lock(mutex_);
                                    boxes_ += boxes;
                                    return finished() || stop_ != Stop::none || error_ != nullptr;
                                });
            } catch (const std::bad_alloc&) {
                failed = Stop::out_of_memory;
            } catch (...) {
                error = std::current_exception();
            }
            const std::scoped_lock lock(mutex_);
            --running_;
            if (failed != Stop::none && stop_ == Stop::none) stop_ = failed;
            if (error && !error_) error_ = error;
            if (whole) {
                started_.done[*part] = std::move(tally);
                advance();
            }
            wake_.notify_all();
        }
        const std::scoped_lock lock(mutex_);
        wake_.notify_all();
    }

    const Statement& statement_;
    Frontier frontier_;
    std::size_t max_unproved_;
    Started& started_;
    Tally total_;  ///< of the frontier and of the first `settled_` parts
    std::size_t settled_ = 0;
    std::size_t next_ = 0;  ///< next part that is not claimed
    unsigned running_ = 0;
    std::uint64_t boxes_ = 0;  ///< for the progress; including parts that are not finished
    Stop stop_ = Stop::none;
    std::exception_ptr error_{};
    std::mutex mutex_;
    std::condition_variable wake_;
};

}  // namespace ricochet::learn
