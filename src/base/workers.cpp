#include "workers.hpp"

#include <system_error>

namespace ricochet::detail {

namespace {

// Tasks follow each other within a fraction of a millisecond, and being woken takes a good part of
// that, so threads spin first.
constexpr int spins = 4000;

constexpr std::uint64_t task = std::uint64_t{1} << 32U;

constexpr std::uint64_t parts_left(std::uint64_t ticket) noexcept
{
    return ticket % task;
}

/// Returns when `value` is no longer `old`.
template <class T>
void await_change(std::atomic<T>& value, T old)
{
    for (int i = 0; i < spins; ++i) {
        if (value.load(std::memory_order_acquire) != old) return;
    }
    value.wait(old, std::memory_order_acquire);
}

}  // namespace

Workers::Workers(unsigned threads)
{
    try {
        for (unsigned i = 1; i < threads; ++i) threads_.emplace_back([this] { wait_for_work(); });
    } catch (const std::system_error&) {
        // The remaining work is done by the threads that exist and the caller.
    }
}

Workers::~Workers()
{
    closing_ = true;
    ticket_ += task;
    ticket_.notify_all();
    for (std::thread& thread : threads_) thread.join();
}

void Workers::run(std::size_t n, const std::function<void(std::size_t)>& part)
{
    part_ = &part;
    parts_ = n;
    errors_.assign(n, nullptr);
    unfinished_ = n;
    ticket_ += task + n;  // all parts of the last task were taken
    ticket_.notify_all();
    work();
    for (std::size_t left = unfinished_; left > 0; left = unfinished_) {
        await_change(unfinished_, left);
    }
    for (const std::exception_ptr& error : errors_) {
        if (error) std::rethrow_exception(error);
    }
}

void Workers::wait_for_work()
{
    while (!closing_) {
        const std::uint64_t seen = ticket_;
        if (parts_left(seen) > 0) {
            work();
        } else if (!closing_) {
            await_change(ticket_, seen);
        }
    }
}

void Workers::work()
{
    for (std::uint64_t ticket = ticket_; parts_left(ticket) > 0; ticket = ticket_) {
        if (!ticket_.compare_exchange_weak(ticket, ticket - 1)) continue;
        const auto i = parts_ - static_cast<std::size_t>(parts_left(ticket));
        try {
            (*part_)(i);
        } catch (...) {
            errors_[i] = std::current_exception();
            std::uint64_t rest = ticket_;
            while (!ticket_.compare_exchange_weak(rest, rest - parts_left(rest))) {
            }
            finish(static_cast<std::size_t>(parts_left(rest)));
        }
        finish(1);
    }
}

void Workers::finish(std::size_t parts)
{
    if (unfinished_.fetch_sub(parts) == parts) unfinished_.notify_all();
}

}  // namespace ricochet::detail
