// `ricochet-mpi ensemble`: a counter over MPI distributes blocks of rows, for runs that differ so
// much in length that fixed shares would leave processes idle.
#include <fmt/format.h>
#include <mpi.h>

#include <cstddef>
#include <cstdint>
#include <exception>

#include "../input.hpp"
#include "../program.hpp"
#include "../registry.hpp"
#include "ensemble_command.hpp"

namespace ricochet::app {

namespace {

/// A whole number in the memory of rank 0, which every process can read and increase.
class Counter {
public:
    Counter()
    {
        int rank = 0;
        MPI_Comm_rank(MPI_COMM_WORLD, &rank);
        MPI_Win_allocate(rank == 0 ? sizeof(std::int64_t) : 0, sizeof(std::int64_t), MPI_INFO_NULL,
                         MPI_COMM_WORLD, &value_, &window_);
        if (rank == 0) *value_ = 0;
        MPI_Barrier(MPI_COMM_WORLD);
    }
    /// Freeing waits for all processes, and failed ones do not take part.
    ~Counter()
    {
        if (std::uncaught_exceptions() == 0) MPI_Win_free(&window_);
    }
    Counter(const Counter&) = delete;
    Counter& operator=(const Counter&) = delete;

    [[nodiscard]] std::size_t next()
    {
        const std::int64_t one = 1;
        std::int64_t before = 0;
        MPI_Win_lock(MPI_LOCK_SHARED, 0, 0, window_);
        MPI_Fetch_and_op(&one, &before, MPI_INT64_T, 0, 0, MPI_SUM, window_);
        MPI_Win_unlock(0, window_);
        return static_cast<std::size_t>(before);
    }

private:
    std::int64_t* value_ = nullptr;
    MPI_Win window_ = MPI_WIN_NULL;
};

int deal(const EnsembleRequest& request)
{
    const bool scene = request.system.ends_with(".json");
    if (!request.system.empty() && !scene && find_system(request.system).program != "") {
        throw BadInput(
            fmt::format("ricochet-mpi runs the systems of the core, got {}; its shares "
                        "are run by ricochet ensemble",
                        request.system));
    }
    int rank = 0;
    int size = 1;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    Counter counter;
    return run_ensemble_dealt(request, {.place = {.index = static_cast<std::size_t>(rank) + 1,
                                                  .count = static_cast<std::size_t>(size)},
                                        .next = [&] { return counter.next(); },
                                        .wait_for_all = [] { MPI_Barrier(MPI_COMM_WORLD); }});
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    MPI_Init(&count, &arguments);
    const int status = run_program(
        [](CLI::App& app, int& status) { add_ensemble(app, status, deal); }, count, arguments);
    // The other processes may be waiting for this one.
    if (status != 0) MPI_Abort(MPI_COMM_WORLD, status);
    MPI_Finalize();
    return status;
}
