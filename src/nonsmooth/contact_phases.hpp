// The phases of a mechanism with contacts: flights between impacts, and Moreau's steps while
// impacts accumulate, a contact stays closed, an impact has no solution, or dry friction holds a
// coordinate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "../core/phase_table.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/nonsmooth/detail/contact_run.hpp"

namespace ricochet::detail {

/// The table of the mechanism with its phases, and the steppers of these.
template <class C>
class ContactPhases {
public:
    /// @param step  [s] of the steps in contact
    ContactPhases(ContactSetup<C>&& setup, double step);
    ContactPhases(const ContactPhases&) = delete;
    ContactPhases& operator=(const ContactPhases&) = delete;

    [[nodiscard]] const SystemTable<C>& table() const noexcept { return table_; }
    /// The mode in which a run starts in a mode of the system.
    [[nodiscard]] Mode enter(Mode mode, double t, const C& x);
    /// The same where the start is behind a contact.
    [[nodiscard]] Mode enter_stuck(Mode mode, double t);

    [[nodiscard]] const std::vector<MotionPhase>& phases() const noexcept { return phases_listed_; }
    [[nodiscard]] const ContactSteps& steps() const noexcept { return *setup_.steps; }
    [[nodiscard]] std::uint64_t steps_in_contact() const noexcept { return steps_in_contact_; }
    /// Whether the last step was one in contact.
    [[nodiscard]] bool was_in_contact() const noexcept { return was_in_contact_; }

private:
    /// What the rules remember. Numbers, as snapshots are.
    struct Memory {
        double in_contact = 0;
        double since = 0;                         ///< [s] start of the phase
        double patience = 1;                      ///< free steps in a row before a flight is tried
        double free_steps = 0;                    ///< steps in a row that could have been flight
        double events = 0;                        ///< in this flight
        double marked_events = 0, marked_at = 0;  ///< [s] of the watch for chattering
        double listed = 0;                        ///< number of phases
    };
    static constexpr std::size_t remembered = sizeof(Memory) / sizeof(double);

    [[nodiscard]] static ContactPhases& at(void* adapter) noexcept
    {
        return *static_cast<ContactPhases*>(adapter);
    }
    [[nodiscard]] Mode with(Mode kind, Mode mode) const noexcept
    {
        return kind * own_modes + own_mode(mode);
    }
    [[nodiscard]] Mode in_contact(Mode mode) const noexcept
    {
        return with(setup_.kinds.contact(), mode);
    }
    /// Whether no velocity under dry friction is zero, and there are flights.
    [[nodiscard]] bool may_fly(const C& x) const noexcept;
    /// The mode in flight with these velocities.
    [[nodiscard]] Mode in_flight(Mode mode, const C& x) const noexcept;

    [[nodiscard]] Mode decide(const PhaseSet<C>& set, const C& after);
    [[nodiscard]] PhaseVerdict review(const PhaseStep<C>& step);
    [[nodiscard]] PhaseVerdict give_up(const PhaseEnd<C>& end);
    /// Whether events follow each other so closely that locating them does not pay.
    [[nodiscard]] bool chatters(double t) noexcept;
    /// Ends the flight where contact begins, or the run.
    [[nodiscard]] PhaseVerdict touch_down(Mode mode, double t, PhaseCause cause);
    void note(bool in_contact, double t, PhaseCause cause);
    void begin_contact(double t, PhaseCause cause);

    void save(std::vector<double>& memory) const;
    void restore(const std::vector<double>& memory);

    [[nodiscard]] Stepper<C> stepper(Mode mode);
    [[nodiscard]] static ContactStart start(const StepState<C>& step)
    {
        return {own_mode(step.mode), step.start.value, step.x0.data()};
    }
    [[nodiscard]] bool take(StepState<C>& step, double h);
    void depart(const StepState<C>& step, double s, C& w, C& rate);
    void make_kernels();
    void make_phases();

    ContactSetup<C> setup_;
    double step_;  ///< [s]
    StepKernel<C> flight_, contact_;
    SystemTable<C> table_;
    PhaseTable<C> rules_;
    Memory memory_;
    std::vector<MotionPhase> phases_listed_;
    std::uint64_t steps_in_contact_ = 0;
    bool took_ = false;  ///< a step in contact, which the rules have not seen yet
    bool was_in_contact_ = false;
    int driven_in_ = -1;  ///< contact behind which the last set has put a body, or -1
    std::string reason_;
};

}  // namespace ricochet::detail
