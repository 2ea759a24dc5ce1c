#include "contact_phases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "ricochet/detail/refusals.hpp"
#include "ricochet/options.hpp"

namespace ricochet::detail {

template <class C>
ContactPhases<C>::ContactPhases(ContactSetup<C>&& setup, double step)
    : setup_(std::move(setup)),
      step_(step),
      flight_(*setup_.flight.kernel),
      table_(*setup_.flight.system)
{
    make_kernels();
    make_phases();
    table_.phases = &rules_;
    setup_.flight.system = &table_;
}

// --- modes ---

template <class C>
bool ContactPhases<C>::may_fly(const C& x) const noexcept
{
    return setup_.kinds.flies() && std::none_of(setup_.dry.begin(), setup_.dry.end(),
                                                [&](std::size_t i) { return x[i] == 0; });
}

template <class C>
Mode ContactPhases<C>::in_flight(Mode mode, const C& x) const noexcept
{
    Mode kind = 0;
    for (std::size_t k = 0; k < setup_.dry.size(); ++k) {
        if (x[setup_.dry[k]] < 0) kind |= Mode{1} << k;
    }
    return with(kind, mode);
}

template <class C>
Mode ContactPhases<C>::enter(Mode mode, double t, const C& x)
{
    const std::size_t modes = setup_.modes;
    if (mode >= (modes > 0 ? modes : own_modes - 1)) throw_unknown_mode("integrate", mode, modes);
    while (!phases_listed_.empty() && phases_listed_.back().from > t) phases_listed_.pop_back();
    if (phases_listed_.empty()) note(false, t, PhaseCause::start);
    if (may_fly(x) && !setup_.steps->will_push({mode, t, x.data()}, step_)) {
        if (memory_.in_contact != 0) note(false, t, PhaseCause::released);
        return in_flight(mode, x);
    }
    begin_contact(t, PhaseCause::held);
    return in_contact(mode);
}

template <class C>
Mode ContactPhases<C>::enter_stuck(Mode mode, double t)
{
    begin_contact(t, PhaseCause::stuck);
    return in_contact(mode);
}

// --- rules ---

template <class C>
void ContactPhases<C>::note(bool in_contact, double t, PhaseCause cause)
{
    memory_.in_contact = in_contact;
    memory_.since = memory_.marked_at = t;
    memory_.free_steps = memory_.events = memory_.marked_events = 0;
    phases_listed_.push_back({.from = t, .set_valued = in_contact, .cause = cause});
    memory_.listed = static_cast<double>(phases_listed_.size());
}

template <class C>
void ContactPhases<C>::begin_contact(double t, PhaseCause cause)
{
    // A phase that is re-entered immediately is kept longer each time.
    constexpr double most = 1 << 20;
    const bool at_once = t - memory_.since < 10 * step_;
    memory_.patience = at_once ? std::min(2 * memory_.patience, most) : 1;
    note(true, t, cause);
}

template <class C>
Mode ContactPhases<C>::decide(const PhaseSet<C>& set, const C& after)
{
    if (driven_in_ < 0) driven_in_ = setup_.steps->driven_in(set.t, set.x.data(), after.data());
    if (!setup_.kinds.is_flight(set.before) || driven_in_ >= 0) return set.after;
    for (const std::size_t i : set.fired) memory_.events += i < setup_.event_guards;
    memory_.events += set.on_time;
    if (may_fly(after)) return in_flight(set.after, after);
    if (setup_.phases.events_only) return set.after;
    begin_contact(set.t, PhaseCause::held);
    return in_contact(set.after);
}

template <class C>
bool ContactPhases<C>::chatters(double t) noexcept
{
    constexpr double most_events = 200;
    if (memory_.events < memory_.marked_events + most_events) return false;
    const bool chatters = t - memory_.marked_at < step_ / 100;
    memory_.marked_events = memory_.events;
    memory_.marked_at = t;
    return chatters;
}

template <class C>
PhaseVerdict ContactPhases<C>::touch_down(Mode mode, double t, PhaseCause cause)
{
    if (setup_.phases.events_only) {
        return {.kind = PhaseVerdict::Kind::ends, .outcome = Outcome::not_handed_over};
    }
    begin_contact(t, cause);
    return {.kind = PhaseVerdict::Kind::changes, .mode = in_contact(mode), .h = step_};
}

template <class C>
PhaseVerdict ContactPhases<C>::review(const PhaseStep<C>& step)
{
    if (step.has_advanced) was_in_contact_ = std::exchange(took_, false);
    if (driven_in_ >= 0) {
        reason_ = fmt::format("a reset drives contact {} into its obstacle at t = {}",
                              std::exchange(driven_in_, -1), step.t);
        return {.kind = PhaseVerdict::Kind::ends, .outcome = Outcome::outside_mode};
    }
    if (setup_.kinds.is_flight(step.mode)) {
        if (!may_fly(step.x)) return touch_down(step.mode, step.t, PhaseCause::held);
        if (chatters(step.t)) return touch_down(step.mode, step.t, PhaseCause::chattering);
        return {};
    }
    if (setup_.phases.events_only) {
        return {.kind = PhaseVerdict::Kind::ends, .outcome = Outcome::not_handed_over};
    }
    if (!step.has_advanced) return {};
    ++steps_in_contact_;
    const bool is_free = may_fly(step.x) && setup_.steps->is_free(step.t, step.x.data());
    memory_.free_steps = is_free ? memory_.free_steps + 1 : 0;
    if (memory_.free_steps < memory_.patience) {
        // The next step is as long as ever.
        if (!setup_.steps->was_halved()) return {};
        return {.kind = PhaseVerdict::Kind::changes, .mode = step.mode, .h = step_};
    }
    note(false, step.t, PhaseCause::released);
    return {.kind = PhaseVerdict::Kind::changes, .mode = in_flight(step.mode, step.x)};
}

/// Contact follows where impacts cannot go on. A guard that the system declares ends the run.
template <class C>
PhaseVerdict ContactPhases<C>::give_up(const PhaseEnd<C>& end)
{
    if (setup_.kinds.is_flight(end.mode)) {
        const bool is_declared = end.guard != no_guard && end.guard >= setup_.contacts &&
                                 end.guard < setup_.event_guards;
        const auto cause = cause_after(end.outcome);
        return cause && !is_declared ? touch_down(end.mode, end.t, *cause) : PhaseVerdict{};
    }
    const bool failed =
        end.outcome == Outcome::non_finite || end.outcome == Outcome::step_underflow;
    if (!failed || !setup_.steps->has_failed()) return {};
    const ContactReport& failure = setup_.steps->failure();
    reason_ = fmt::format("contact {} failed by {:.3g}", failure.contact, failure.residual);
    const bool finite = std::isfinite(failure.residual);
    return {.kind = PhaseVerdict::Kind::ends,
            .outcome = finite ? Outcome::not_converged : Outcome::non_finite};
}

template <class C>
void ContactPhases<C>::save(std::vector<double>& memory) const
{
    memory.resize(remembered);
    std::memcpy(memory.data(), &memory_, sizeof memory_);
    setup_.steps->save(memory);
}

template <class C>
void ContactPhases<C>::restore(const std::vector<double>& memory)
{
    std::memcpy(static_cast<void*>(&memory_), memory.data(), sizeof memory_);
    setup_.steps->restore(memory.data() + remembered);
    reason_.clear();
    const auto listed = static_cast<std::size_t>(memory_.listed);
    if (phases_listed_.size() > listed) phases_listed_.resize(listed);
}

// --- steps ---

template <class C>
Stepper<C> ContactPhases<C>::stepper(Mode mode)
{
    if (setup_.kinds.is_flight(mode)) {
        return {&flight_, setup_.flight.adapter, table_.flow};
    }
    // Where a step starts, the rate of its first one.
    return {&contact_, this, [](void* adapter, Mode of, double t, const C& x, C& dxdt) {
                ContactPhases& me = at(adapter);
                me.setup_.steps->mean_rate({own_mode(of), t, x.data()}, me.step_, dxdt.data());
                return true;
            }};
}

/// The motion between the ends of the step is a straight line, which is as accurate as they are.
template <class C>
bool ContactPhases<C>::take(StepState<C>& step, double h)
{
    step.h = h;
    step.has_middle = false;
    step.asked_alone = 0;
    took_ = true;
    if (!setup_.steps->take(start(step), h, step.x1.data())) return false;
    for_each_component(step.x1, [&](auto i) {
        step.rate0[i] = step.rate1[i] = (step.x1[i] - step.x0[i]) / h;
        step.w[i] = (step.x1[i] - step.x0[i]) - h * step.rate0[i];
        step.w_rate1[i] = step.error[i] = 0;
    });
    if constexpr (!is_small<C>) step.large.remainder1 = step.zero;
    if (!setup_.keeps_rounding) return true;
    for_each_component(step.x1, [&](auto i) {
        const TwoSum sum = two_sum(step.x0[i], h * step.rate0[i] + (step.w[i] + step.remainder[i]));
        step.x1[i] = sum.value;
        if constexpr (!is_small<C>) step.large.remainder1[i] = sum.remainder;
    });
    return true;
}

template <class C>
void ContactPhases<C>::depart(const StepState<C>& step, double s, C& w, C& rate)
{
    assign(w, step.x1);
    assign(rate, step.zero);
    if (!setup_.steps->take_to(start(step), s, w.data())) {
        for_each_component(w, [&](auto i) { w[i] = step.x0[i] + s * step.rate0[i]; });
    }
    for_each_component(w, [&](auto i) { w[i] = (w[i] - step.x0[i]) - s * step.rate0[i]; });
}

template <class C>
void ContactPhases<C>::make_kernels()
{
    // Power series are only those of flows.
    flight_.guard_series = nullptr;
    flight_.cross = nullptr;
    contact_.order = contact_.error_order = 1;
    contact_.end_rate = true;
    contact_.take = [](void* adapter, StepState<C>& step, double h) {
        return at(adapter).take(step, h);
    };
    contact_.attempt = [](void* adapter, StepState<C>& step, double h, double, double) {
        return at(adapter).take(step, h) ? 0 : std::numeric_limits<double>::quiet_NaN();
    };
    contact_.depart = [](void* adapter, StepState<C>& step, double s, C& w, C& rate) {
        at(adapter).depart(step, s, w, rate);
    };
    contact_.departure = [](void*, const StepState<C>& step, double s, C& w) {
        assign(w, step.w);
        for_each_component(w, [&](auto i) { w[i] *= s / step.h; });
    };
    contact_.reach = [](void* adapter, StepState<C>& step, double h, double, double) {
        ContactPhases& me = at(adapter);
        return me.setup_.steps->reach(start(step), std::min(h, me.step_));
    };
    // Steps of fixed length are shortened only by steppers that locate changes.
    contact_.ends_at_change = [](void*, const StepState<C>&) { return false; };
}

template <class C>
void ContactPhases<C>::make_phases()
{
    PhaseTable<C>& t = rules_;
    t.adapter = this;
    t.own_guards = [](void* adapter) { return at(adapter).setup_.event_guards; };
    t.stepper = [](void* adapter, Mode mode) { return at(adapter).stepper(mode); };
    t.enter = [](void* adapter, Mode mode, double time, C& x) {
        return at(adapter).enter(mode, time, x);
    };
    t.decide = [](void* adapter, const PhaseSet<C>& set, C& after) {
        return at(adapter).decide(set, after);
    };
    t.changes = [](void*) { return std::span<const ReactionChange>(); };
    t.records = [](void* adapter, std::size_t i) { return i < at(adapter).setup_.event_guards; };
    t.review = [](void* adapter, const PhaseStep<C>& step, C&) { return at(adapter).review(step); };
    t.give_up = [](void* adapter, const PhaseEnd<C>& end, C&) { return at(adapter).give_up(end); };
    t.reason = [](void* adapter) { return std::string_view(at(adapter).reason_); };
    t.save = [](void* adapter, std::vector<double>& memory) { at(adapter).save(memory); };
    t.restore = [](void* adapter, const std::vector<double>& memory) {
        at(adapter).restore(memory);
    };
}

namespace {

template <class C>
class ContactRunnerOf final : public ContactRunner<C> {
public:
    ContactRunnerOf(ContactSetup<C>&& setup, const C& x0, const Options& options)
        : setup_(setup.flight),
          phases_(std::move(setup), step_of(setup.phases, options)),
          loop_(begin(x0, options))
    {
    }

    [[nodiscard]] AnyLoop<C>& loop() noexcept override { return *loop_; }
    [[nodiscard]] const AnyLoop<C>& loop() const noexcept override { return *loop_; }
    [[nodiscard]] const std::vector<MotionPhase>& phases() const noexcept override
    {
        return phases_.phases();
    }
    [[nodiscard]] ContactStatistics statistics(const Statistics& run, double t) const override
    {
        ContactStatistics out{.event_driven = run, .time_stepping = phases_.steps().statistics()};
        out.time_stepping.steps = phases_.steps_in_contact();
        out.event_driven.steps -= std::min(out.time_stepping.steps, run.steps);
        const std::vector<MotionPhase>& phases = this->phases();
        for (std::size_t k = 0; k < phases.size(); ++k) {
            if (!phases[k].set_valued) {
                out.to_flight += k > 0;
                continue;
            }
            ++out.to_contact;
            out.contact_time += (k + 1 < phases.size() ? phases[k + 1].from : t) - phases[k].from;
        }
        return out;
    }
    [[nodiscard]] const ContactReport& failure() const noexcept override
    {
        return phases_.steps().failure();
    }
    [[nodiscard]] ContactForces forces() const override
    {
        ContactForces out = phases_.steps().forces();
        if (phases_.was_in_contact()) return out;
        out.contacts.setZero();
        out.coordinates.setZero();
        return out;
    }

private:
    [[nodiscard]] static double step_of(const ContactPhaseOptions& phases, const Options& options)
    {
        if (phases.step > 0) return phases.step;
        const double span = options.t_end - options.t_start;
        if (std::isinf(span)) {
            throw std::invalid_argument(
                "ContactMotion: found an infinite t_end and no step, which is then no thousandth "
                "of the run; expected the length [s] of the steps in contact");
        }
        return span > 0 ? 1e-3 * span : 1;
    }
    [[nodiscard]] Owner<AnyLoop<C>> begin(const C& x0, const Options& options)
    {
        setup_.system = &phases_.table();
        setup_.quiet = nullptr;
        setup_.quiet_on_series = false;
        Options inner = options;
        inner.mode = phases_.enter(options.mode, options.t_start, x0);
        try {
            return make_loop(setup_, x0, inner);
        } catch (const StartRefused&) {
            // Behind a contact by more than rounding.
            inner.mode = phases_.enter_stuck(options.mode, options.t_start);
            return make_loop(setup_, x0, inner);
        }
    }

    RunBindings<C> setup_;
    ContactPhases<C> phases_;
    Owner<AnyLoop<C>> loop_;
};

}  // namespace

template <>
Owner<ContactRunner<SmallState>> make_contact_run(ContactSetup<SmallState>&& setup,
                                                  const SmallState& x0, const Options& options)
{
    return Owner<ContactRunner<SmallState>>(
        new ContactRunnerOf<SmallState>(std::move(setup), x0, options));
}

template <>
Owner<ContactRunner<std::vector<double>>> make_contact_run(
    ContactSetup<std::vector<double>>&& setup, const std::vector<double>& x0,
    const Options& options)
{
    return Owner<ContactRunner<std::vector<double>>>(
        new ContactRunnerOf<std::vector<double>>(std::move(setup), x0, options));
}

}  // namespace ricochet::detail
