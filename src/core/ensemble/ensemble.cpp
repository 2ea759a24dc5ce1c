#include "ricochet/ensemble.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <thread>

#ifdef __linux__
#include <sched.h>
#endif

#include "base/workers.hpp"
#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet {

namespace {

constexpr unsigned most_threads = 1024;

/// Rows that a thread takes together: this part of its even share of what is left, so that the last
/// rows are taken one by one.
constexpr std::size_t row_parts = 8;

/// A thread that has spent this long on the rows that it has taken gives the others back. A row of
/// a ball that bounces takes a few microseconds, and to wake a thread some fifty.
constexpr std::chrono::microseconds row_patience{100};

/// Number of cores that the process may use; a launcher may bind its processes to some of them.
unsigned cores()
{
#ifdef __linux__
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0) {
        return static_cast<unsigned>(std::max(CPU_COUNT(&set), 1));
    }
#endif
    return std::max(std::thread::hardware_concurrency(), 1U);
}

std::string message_of(const std::exception_ptr& thrown)
{
    try {
        std::rethrow_exception(thrown);
    } catch (const std::exception& error) {
        return error.what();
    } catch (...) {
        return "an exception that is no std::exception";
    }
}

/// Rows from `first` to before `end`.
struct RowRange {
    std::size_t first = 0;
    std::size_t end = 0;
};

/// Deals the rows to the threads: many together where rows are cheap, and one by one where they
/// have proved to be expensive.
class RowDealer {
public:
    RowDealer(std::size_t rows, std::size_t threads) : rows_(rows), threads_(threads) {}

    /// The next rows, or nothing where there are none. Waits while another thread may give rows
    /// back. What is taken must be released.
    [[nodiscard]] std::optional<RowRange> take()
    {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return !returned_.empty() || next_ < rows_ || holders_ == 0; });
        RowRange out;
        if (!returned_.empty()) {
            RowRange& some = returned_.back();
            out = {some.first, some.first + 1};
            if (++some.first == some.end) returned_.pop_back();
        } else if (next_ < rows_) {
            const std::size_t part = (rows_ - next_) / (row_parts * threads_);
            out = {next_, next_ + std::clamp<std::size_t>(part, 1, ensemble_chunk)};
            next_ = out.end;
        } else {
            return {};
        }
        ++holders_;
        return out;
    }
    /// Ends the use of rows that were taken; those in `left` are given back.
    void release(const RowRange& left)
    {
        const std::scoped_lock lock(mutex_);
        if (left.first < left.end) returned_.push_back(left);
        --holders_;
        changed_.notify_all();
    }

private:
    std::size_t rows_;
    std::size_t threads_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::vector<RowRange> returned_;
    std::size_t next_ = 0;     ///< the first row that has not been taken
    std::size_t holders_ = 0;  ///< threads that have rows
};

/// State shared by the threads of one ensemble.
class Progress {
public:
    Progress(std::size_t rows, const EnsembleOptions& options)
        : rows_(rows), options_(options), left_(rows / ensemble_chunk + 1)
    {
        for (std::size_t chunk = 0; chunk < left_.size(); ++chunk) {
            left_[chunk] = std::min(ensemble_chunk, rows - chunk * ensemble_chunk);
        }
    }

    [[nodiscard]] bool is_stopped() const noexcept
    {
        return stopped_ ||
               (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed));
    }

    void fail(std::size_t row, const std::exception_ptr& thrown)
    {
        const std::scoped_lock lock(mutex_);
        failures_.push_back({.row = row, .exception = thrown, .message = message_of(thrown)});
    }

    /// Reports a chunk if this was the last of its rows.
    void end_row(std::size_t row)
    {
        const std::size_t chunk = row / ensemble_chunk;
        if (--left_[chunk] > 0) return;
        const std::size_t first = chunk * ensemble_chunk;
        const std::size_t count = std::min(ensemble_chunk, rows_ - first);
        const std::scoped_lock lock(mutex_);
        done_ += count;
        if (!options_.progress || stopped_) return;
        const EnsembleProgress now{.first = first, .count = count, .done = done_, .rows = rows_};
        try {
            if (!options_.progress(now)) stopped_ = true;
        } catch (...) {
            stopped_ = true;
            throw;
        }
    }

    [[nodiscard]] detail::RowsRun take()
    {
        std::sort(failures_.begin(), failures_.end(),
                  [](const RowFailure& a, const RowFailure& b) { return a.row < b.row; });
        return {.failures = std::move(failures_), .complete = done_ == rows_};
    }

private:
    std::size_t rows_;
    const EnsembleOptions& options_;
    std::mutex mutex_;
    std::atomic<bool> stopped_ = false;
    std::size_t done_ = 0;
    std::vector<std::atomic<std::size_t>> left_;  ///< rows of each chunk that have not ended
    std::vector<RowFailure> failures_;
};

using RowFunction = std::function<void(const EnsembleRow&)>;

/// Runs rows until they are done, the ensemble is stopped or, where others could help, they have
/// taken long. Removes those that need not be run any more from the range.
void run_range(RowRange& range, const RowFunction& run, std::uint64_t seed, bool alone,
               Progress& progress)
{
    const auto start = std::chrono::steady_clock::now();
    while (range.first < range.end) {
        if (progress.is_stopped()) {
            range.first = range.end;
            return;
        }
        const std::size_t i = range.first++;
        try {
            run({.index = i, .seed = row_seed(seed, i)});
        } catch (...) {
            progress.fail(i, std::current_exception());
        }
        progress.end_row(i);
        const bool others = !alone && range.first < range.end;
        if (others && std::chrono::steady_clock::now() - start > row_patience) return;
    }
}

}  // namespace

std::uint64_t row_seed(std::uint64_t seed, std::size_t index) noexcept
{
    // Number `index` of the stream of splitmix64 that starts at the mixed seed: without the mixing
    // the rows of seed s + k 0x9e37... would be those of seed s, shifted.
    constexpr std::uint64_t stride = 0x9e3779b97f4a7c15U;
    return detail::SplitMix(detail::SplitMix(seed).bits() + index * stride).bits();
}

detail::RowsRun detail::run_rows(std::size_t rows,
                                 const std::function<void(const EnsembleRow&)>& run,
                                 const EnsembleOptions& options)
{
    if (options.threads > most_threads) {
        throw std::invalid_argument(fmt::format("ensemble: found {} threads, expected at most {}",
                                                options.threads, most_threads));
    }
    const std::size_t wanted = options.threads == 0 ? cores() : options.threads;
    const std::size_t threads = std::clamp<std::size_t>(rows, 1, wanted);
    Workers team(static_cast<unsigned>(threads));
    RowDealer dealer(rows, threads);
    Progress progress(rows, options);
    team.run(threads, [&](std::size_t) {
        while (auto range = dealer.take()) {
            try {
                run_range(*range, run, options.seed, threads == 1, progress);
            } catch (...) {
                dealer.release({});
                throw;
            }
            dealer.release(*range);
        }
    });
    return progress.take();
}

}  // namespace ricochet
