#include "share.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "../input.hpp"

namespace ricochet::app {

namespace {

constexpr std::uint64_t most_shares = 1'000'000;

std::optional<std::uint64_t> variable(const Environment& environment, const char* name,
                                      std::uint64_t lowest)
{
    const char* text = environment(name);
    if (text == nullptr || *text == '\0') return std::nullopt;
    return whole_number(name, text, lowest, lowest + 4'000'000'000);
}

/// Rank and size by one launcher.
/// @throws BadInput where one of the two is missing, or the rank is not valid for the size.
std::optional<Share> launched_by(const Environment& environment, const char* rank_name,
                                 const char* size_name)
{
    const auto rank = variable(environment, rank_name, 0);
    const auto size = variable(environment, size_name, 1);
    if (!rank && !size) return std::nullopt;
    if (!rank || !size) {
        throw BadInput(fmt::format("{} is {}, and {} is not set; expected both, or --share k/n",
                                   rank ? rank_name : size_name, rank ? *rank : *size,
                                   rank ? size_name : rank_name));
    }
    if (*rank >= *size) {
        throw BadInput(
            fmt::format("{} is {} and {} is {}; expected a rank below the size, or --share k/n",
                        rank_name, *rank, size_name, *size));
    }
    return Share{.index = *rank + 1, .count = *size};
}

[[noreturn]] void refuse_contradiction(std::string_view one, const Share& a, std::string_view other,
                                       const Share& b)
{
    throw BadInput(
        fmt::format("{} gives rank {} of {}, and {} rank {} of {}; expected one, or --share k/n",
                    one, a.index - 1, a.count, other, b.index - 1, b.count));
}

std::optional<Share> slurm_task(const Environment& environment)
{
    const auto rank = variable(environment, "SLURM_PROCID", 0);
    const auto size = variable(environment, "SLURM_NTASKS", 1);
    // Variables of the batch script itself: srun sets the number of tasks, sbatch need not. The
    // number of tasks alone is also left by salloc in its shell.
    if (environment("SLURM_JOB_ID") != nullptr && rank.value_or(0) == 0 && (!rank || !size)) {
        return std::nullopt;
    }
    return launched_by(environment, "SLURM_PROCID", "SLURM_NTASKS");
}

/// The rank of Open MPI, PMI or Slurm. Slurm's is the rank of the process that started the MPI
/// processes, if these have ranks of their own: usually 0, or with another size.
std::optional<Share> rank_of(const Environment& environment)
{
    constexpr std::string_view open_mpi = "Open MPI";
    const auto mpi = launched_by(environment, "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE");
    const auto pmi = launched_by(environment, "PMI_RANK", "PMI_SIZE");
    if (mpi && pmi && *mpi != *pmi) refuse_contradiction(open_mpi, *mpi, "PMI", *pmi);
    const auto own = mpi ? mpi : pmi;
    if (!own) return slurm_task(environment);
    const auto rank = variable(environment, "SLURM_PROCID", 0).value_or(0);
    const auto size = variable(environment, "SLURM_NTASKS", 1).value_or(0);
    if (rank > 0 && size == own->count && rank + 1 != own->index) {
        refuse_contradiction(mpi ? open_mpi : "PMI", *own, "Slurm",
                             {.index = rank + 1, .count = size});
    }
    return own;
}

std::optional<Share> array_task(const Environment& environment)
{
    const auto id = variable(environment, "SLURM_ARRAY_TASK_ID", 0);
    const auto count = variable(environment, "SLURM_ARRAY_TASK_COUNT", 1);
    if (!id && !count) return std::nullopt;
    if (!id || !count) {
        (void)launched_by(environment, "SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT");
    }
    const auto lowest = variable(environment, "SLURM_ARRAY_TASK_MIN", 0).value_or(0);
    const auto step = variable(environment, "SLURM_ARRAY_TASK_STEP", 1).value_or(1);
    const auto highest =
        variable(environment, "SLURM_ARRAY_TASK_MAX", 0).value_or(lowest + (*count - 1) * step);
    const bool even = highest == lowest + (*count - 1) * step && *id >= lowest && *id <= highest &&
                      (*id - lowest) % step == 0;
    if (!even) {
        throw BadInput(fmt::format(
            "task {} of a Slurm array of {} tasks from {} to {} in steps of {} gives no "
            "share; expected an array without gaps, or --share k/n",
            *id, *count, lowest, highest, step));
    }
    return Share{.index = (*id - lowest) / step + 1, .count = *count};
}

Share checked(const Share& share)
{
    if (share.count <= most_shares) return share;
    throw BadInput(
        fmt::format("there can be {} shares, and these are {}", most_shares, share.count));
}

}  // namespace

std::string to_string(const Share& share)
{
    return fmt::format("{}/{}", share.index, share.count);
}

Share parse_share(const std::string& text)
{
    const std::size_t slash = text.find('/');
    if (slash == std::string::npos) {
        throw BadInput(fmt::format("--share must be k/n, such as 3/16, got '{}'", shortened(text)));
    }
    const std::uint64_t count =
        whole_number("n of --share k/n", text.substr(slash + 1), 1, most_shares);
    const std::uint64_t index = whole_number("k of --share k/n", text.substr(0, slash), 1, count);
    return {.index = index, .count = count};
}

Share share_from(const Environment& environment)
{
    const Share outer = array_task(environment).value_or(Share{});
    const Share inner = rank_of(environment).value_or(Share{});
    return checked({.index = (outer.index - 1) * inner.count + inner.index,
                    .count = outer.count * inner.count});
}

Share chosen_share(const std::optional<std::string>& given)
{
    if (given) return parse_share(*given);
    return share_from([](const char* name) -> const char* { return std::getenv(name); });
}

}  // namespace ricochet::app
