// Looking after a run that takes long or much.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <thread>

namespace ricochet::app {

/// While it lives, a thread looks every few milliseconds at what the program holds, and raises
/// `Cause::memory` when more would not leave enough to report what there is. After some seconds it
/// says once on standard error that the run continues, and how it is ended.
class RunWatch {
public:
    /// @param share  of the memory that is available now which a run may take: reports are made
    ///               from copies, and a run that has taken all could not be printed any more
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
