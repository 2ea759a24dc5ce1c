// Supervision of a run that takes long or much memory.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <thread>

namespace ricochet::app {

/// During its life a thread checks every few milliseconds how much memory the program holds, and
/// raises `Cause::memory` when more would not leave enough for a report. After some seconds it
/// prints once on standard error that the run continues, and how to end it.
class RunWatch {
public:
    /// @param share  fraction of the memory available now that a run may take: reports are made
    ///               from copies, and a run that has taken everything could not be printed any more
    explicit RunWatch(double share);
    ~RunWatch();
    RunWatch(const RunWatch&) = delete;
    RunWatch& operator=(const RunWatch&) = delete;

private:
    void watch();

    double most_;         ///< [bytes] resident
    bool ended_ = false;  ///< under the mutex
    std::mutex mutex_;
    std::condition_variable condition_;
    std::thread thread_;
};

}  // namespace ricochet::app
