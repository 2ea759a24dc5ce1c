// Internal: the declarations of this header may change without notice.
//
// A mechanism with contacts as a system with phases, for the loop: flights by its flow and impacts,
// contact by Moreau's steps. Compiled in ricochet::nonsmooth (src/nonsmooth/contact_phases.hpp).
#pragma once

#include <cstdint>
#include <vector>

#include "ricochet/detail/core.hpp"
#include "ricochet/nonsmooth/contact_results.hpp"
#include "ricochet/nonsmooth/detail/contact_steps.hpp"
#include "ricochet/nonsmooth/detail/free_flight.hpp"
#include "ricochet/nonsmooth/hand_over_run.hpp"

namespace ricochet::detail {

/// What a run of a mechanism consists of, besides its start and its `Options`.
template <class C>
struct ContactSetup {
    RunBindings<C> flight;
    Owner<ContactSteps> steps;
    ContactPhaseOptions phases{};
    FlightKinds kinds{0};
    std::vector<std::size_t> dry{};  ///< components of the state: velocities under dry friction
    std::size_t contacts = 0;        ///< the first guards are their gaps
    std::size_t event_guards = 0;    ///< those and the guards of the system
    std::size_t modes = 0;           ///< of the system; 0: not declared
    /// Whether steps in contact keep the rounding of the state, as those of small states do; for
    /// vectors that stand for small states.
    bool keeps_rounding = is_small<C>;
};

/// A run of a mechanism.
template <class C>
class ContactRunner {
public:
    ContactRunner() = default;
    ContactRunner(const ContactRunner&) = delete;
    ContactRunner& operator=(const ContactRunner&) = delete;
    virtual ~ContactRunner() = default;

    [[nodiscard]] virtual AnyLoop<C>& loop() noexcept = 0;
    [[nodiscard]] virtual const AnyLoop<C>& loop() const noexcept = 0;
    [[nodiscard]] virtual const std::vector<MotionPhase>& phases() const noexcept = 0;
    /// The counts of the run, by the kind of phase.
    [[nodiscard]] virtual ContactStatistics statistics(const Statistics& run, double t) const = 0;
    [[nodiscard]] virtual const ContactReport& failure() const noexcept = 0;
    /// Of the last step; zero in flight.
    [[nodiscard]] virtual ContactForces forces() const = 0;
};

/// @throws std::invalid_argument for options and starts as `Simulation` does
template <class C>
[[nodiscard]] Owner<ContactRunner<C>> make_contact_run(ContactSetup<C>&& setup, const C& x0,
                                                       const Options& options);
template <>
Owner<ContactRunner<SmallState>> make_contact_run(ContactSetup<SmallState>&& setup,
                                                  const SmallState& x0, const Options& options);
template <>
Owner<ContactRunner<std::vector<double>>> make_contact_run(
    ContactSetup<std::vector<double>>&& setup, const std::vector<double>& x0,
    const Options& options);

}  // namespace ricochet::detail
