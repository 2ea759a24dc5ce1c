// Work in a second thread, while Python handles signals and draws progress.
#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "python_error.hpp"

namespace ricochet::python {

/// Runs one piece of work in a thread of its own and reports its progress to Python.
///
/// Every 20 ms the caller's thread checks for signals and shows the latest progress. If a handler
/// or the callback raises an exception, or the callback returns False, the work is told to stop.
template <class Progress>
class Background {
public:
    /// Shows the progress, and returns whether to continue.
    using Show = std::function<bool(const Progress&)>;

    explicit Background(Show show) : show_(std::move(show)) {}

    /// Whether the work must stop; to be read by the work.
    [[nodiscard]] const std::atomic<bool>& stopped() const noexcept { return stopped_; }
    /// Reports the progress of the work. @returns false if the work must stop
    [[nodiscard]] bool report(const Progress& progress)
    {
        const std::scoped_lock lock(mutex_);
        latest_ = progress;
        return !stopped_;
    }

    /// Does the work, and returns when it is done.
    /// @throws what it has thrown
    template <class Work>
    void run(const Work& work)
    {
        std::exception_ptr thrown;
        std::thread worker([&] {
            try {
                // one interpreter state for all calls
                const PyGILState_STATE state = PyGILState_Ensure();
                PyThreadState* const saved = PyEval_SaveThread();
                try {
                    work();
                } catch (...) {
                    thrown = std::current_exception();
                }
                PyEval_RestoreThread(saved);
                PyGILState_Release(state);
            } catch (...) {
                thrown = std::current_exception();
            }
            const std::scoped_lock lock(mutex_);
            done_ = true;
            changed_.notify_all();
        });
        while (!wait_a_little()) look();
        {
            const pybind11::gil_scoped_release others;
            worker.join();
        }
        if (!raised_) show_latest();
        if (thrown && !raised_) std::rethrow_exception(thrown);
    }

    /// Exception that a signal's handler or the callback has raised.
    [[nodiscard]] const std::optional<PythonError>& raised() const noexcept { return raised_; }

private:
    [[nodiscard]] bool wait_a_little()
    {
        const pybind11::gil_scoped_release others;
        std::unique_lock lock(mutex_);
        return changed_.wait_for(lock, std::chrono::milliseconds(20), [&] { return done_; });
    }

    void look()
    {
        if (raised_) return;
        if (PyErr_CheckSignals() != 0) return keep();
        show_latest();
    }

    void show_latest()
    {
        std::optional<Progress> latest;
        {
            const std::scoped_lock lock(mutex_);
            latest = std::exchange(latest_, std::nullopt);
        }
        if (!latest || !show_) return;
        try {
            if (!show_(*latest)) stopped_ = true;
        } catch (pybind11::error_already_set& error) {
            error.restore();
            keep();
        }
    }

    void keep()
    {
        raised_.emplace();
        stopped_ = true;
    }

    Show show_;
    std::atomic<bool> stopped_ = false;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Progress> latest_;
    bool done_ = false;
    std::optional<PythonError> raised_;
};

}  // namespace ricochet::python
