// Internal: the declarations of this header may change without notice.
//
// A hybrid system and its inclusion as one system with phases, for the loop: what a run of a system
// with set_valued() is made of. Compiled in ricochet::nonsmooth (src/nonsmooth/phased_system.hpp).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "ricochet/detail/core.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nonsmooth/detail/branch_phases.hpp"
#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"
#include "ricochet/nonsmooth/hand_over_run.hpp"

namespace ricochet::detail {

/// Number of modes of which each may have an inclusion of its own.
inline constexpr std::size_t most_inclusions = 4096;

/// What a run of an inclusion alone has besides its options.
struct AloneOptions {
    double step = 0;                 ///< [s] of implicit steps
    bool events_only = false;        ///< it ends where those would begin
    bool until_released = false;     ///< see `HandOverOptions`
    std::uint64_t stall_steps = 0;   ///< likewise
    std::vector<double> reaction{};  ///< of the earlier run from whose end it goes on
};
/// Branch modes before and after an event.
struct BranchChange {
    Mode before, after;
};
/// How a run of an inclusion alone has ended.
struct EndInBranches {
    Mode mode;                          ///< `several` in a phase of implicit steps
    std::vector<double> reaction;       ///< there
    std::vector<BranchChange> changes;  ///< one for each event
};

/// What a run with phases consists of, besides its start and its options.
template <class C>
struct PhasedSetup {
    RunBindings<C> user;  ///< of the system without its inclusion
    /// One for each mode, or null; or one for all modes.
    std::vector<Owner<BranchPhases>> inclusions;
    bool by_mode = false;
    std::optional<AloneOptions> alone{};     ///< there is no flow but that of the inclusion
    MethodName method = MethodName::dopri5;  ///< of the explicit phases
    /// The mode in which a system continues by itself from (t, x); null if its mode stays.
    Mode (*start_mode)(void* adapter, Mode mode, double t, const C& x) = nullptr;
    /// The reset of a stick, a slip or a mode; null if there is none.
    Mode (*change)(void* adapter, std::size_t reaction, EventKind kind, Mode mode, double t,
                   C& x) = nullptr;
};

/// A run in phases.
template <class C>
class PhasedRun {
public:
    PhasedRun() = default;
    PhasedRun(const PhasedRun&) = delete;
    PhasedRun& operator=(const PhasedRun&) = delete;
    virtual ~PhasedRun() = default;

    [[nodiscard]] virtual AnyLoop<C>& loop() noexcept = 0;
    /// Of an inclusion alone, after the end.
    [[nodiscard]] virtual EndInBranches end_in_branches() const = 0;
};

/// What solves the inclusion of a run with these options.
/// @throws std::invalid_argument for options that a run with phases does not have.
[[nodiscard]] BranchPhasesOptions branch_options(const Options& options);
[[nodiscard]] BranchPhasesOptions branch_options(const HandOverOptions& completed);
/// Options of the loop for those of a hand-over.
[[nodiscard]] Options loop_options(const HandOverOptions& completed);

/// @throws std::invalid_argument for options that a run with phases does not have, and for a start
/// from which no reaction follows.
template <class C>
[[nodiscard]] Owner<PhasedRun<C>> make_phased_run(PhasedSetup<C>&& setup, const C& x0,
                                                  const Options& options);
template <>
Owner<PhasedRun<SmallState>> make_phased_run(PhasedSetup<SmallState>&& setup, const SmallState& x0,
                                             const Options& options);
template <>
Owner<PhasedRun<std::vector<double>>> make_phased_run(PhasedSetup<std::vector<double>>&& setup,
                                                      const std::vector<double>& x0,
                                                      const Options& options);

/// Defined where solvers are compiled (nonsmooth/solvers.hpp). Null where the inclusion has no
/// modes of branches.
template <int N, int M>
[[nodiscard]] Owner<BranchPhases> make_branch_phases(const AnyInclusion<N, M>& inclusion,
                                                     const BranchPhasesOptions& options);

}  // namespace ricochet::detail
