#include "workers.hpp"

#include <exception>
#include <system_error>

namespace ricochet::learn {

namespace {

// A task follows another within a fraction of a millisecond; falling asleep and
// being woken takes a good part of that.
constexpr int spins = 4000;

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
        // The caller does it with those that there are.
    }
}

Workers::~Workers()
{
    closing_ = true;
    ++round_;
    round_.notify_all();
    for (std::thread& thread : threads_) thread.join();
}

void Workers::run(std::size_t n, const std::function<void(std::size_t)>& part)
{
    part_ = &part;
    parts_ = n;
    errors_.assign(n, nullptr);
    next_ = 0;
    busy_ = static_cast<unsigned>(threads_.size());
    ++round_;
    round_.notify_all();
    work();
    for (unsigned left = busy_; left > 0; left = busy_) await_change(busy_, left);
    for (const std::exception_ptr& error : errors_) {
        if (error) std::rethrow_exception(error);
    }
}

void Workers::wait_for_work()
{
    for (unsigned seen = 0;;) {
        await_change(round_, seen);
        ++seen;  // no round begins before the last one is over
        if (closing_) return;
        work();
        if (--busy_ == 0) busy_.notify_one();
    }
}

void Workers::work() noexcept
{
    for (std::size_t i = next_++; i < parts_; i = next_++) {
        try {
            (*part_)(i);
        } catch (...) {
            errors_[i] = std::current_exception();
            next_ = parts_;
        }
    }
}

}  // namespace ricochet::learn
