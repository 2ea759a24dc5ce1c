#include "ricochet/ensemble.hpp"

#include <fmt/format.h>

#include <algorithm>
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

/// State shared by the threads of one ensemble.
class Progress {
public:
    Progress(std::size_t rows, const EnsembleOptions& options) : rows_(rows), options_(options) {}

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

    void end_chunk(std::size_t first, std::size_t count)
    {
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
    std::vector<RowFailure> failures_;
};

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
    const std::size_t chunks = rows / ensemble_chunk + (rows % ensemble_chunk > 0);
    const std::size_t threads = options.threads == 0 ? cores() : options.threads;
    Workers team(static_cast<unsigned>(std::max<std::size_t>(std::min(threads, chunks), 1)));
    Progress progress(rows, options);
    team.run(chunks, [&](std::size_t chunk) {
        const std::size_t first = chunk * ensemble_chunk;
        const std::size_t count = std::min(ensemble_chunk, rows - first);
        for (std::size_t i = first; i < first + count; ++i) {
            if (progress.is_stopped()) return;
            try {
                run({.index = i, .seed = row_seed(options.seed, i)});
            } catch (...) {
                progress.fail(i, std::current_exception());
            }
        }
        progress.end_chunk(first, count);
    });
    return progress.take();
}

}  // namespace ricochet
