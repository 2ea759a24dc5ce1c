// A team of threads that share tasks.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <thread>
#include <vector>

namespace ricochet::detail {

/// Threads that execute one task after another, together with the caller.
///
/// Any thread may do any part, so that parts must not depend on each other. The caller does not
/// wait for threads that have not started a part: on a busy machine it may do all of them.
class Workers {
public:
    /// @param threads  with the caller's; at least 1. Where the system gives fewer,
    ///                 fewer do the same work.
    explicit Workers(unsigned threads);
    ~Workers();
    Workers(const Workers&) = delete;
    Workers& operator=(const Workers&) = delete;

    /// Calls `part(i)` for i = 0 ... n - 1, n < 2^32, and returns when all are done. If a part
    /// throws, parts that have not started are skipped, and of the parts that threw, the
    /// exception of the one with the lowest i is thrown again.
    void run(std::size_t n, const std::function<void(std::size_t)>& part);

private:
    void wait_for_work();
    void work();
    void finish(std::size_t parts);

    const std::function<void(std::size_t)>* part_ = nullptr;
    std::size_t parts_ = 0;
    std::vector<std::exception_ptr> errors_;  ///< one per part
    /// 2^32 times the number of the task, plus the number of its parts not yet taken. A thread that
    /// takes a part by an exchange knows that its task continues, and may read the members above.
    std::atomic<std::uint64_t> ticket_{0};
    std::atomic<std::size_t> unfinished_{0};
    std::atomic<bool> closing_{false};
    std::vector<std::thread> threads_;
};

}  // namespace ricochet::detail
