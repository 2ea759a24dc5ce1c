// All guards of a system at the ends of a step.
//
// What every step needs of every guard lies in plain arrays, so that a hundred guards
// are screened in one loop; what only events need lies beside them.
#pragma once

#include <algorithm>
#include <array>
#include <boost/container/small_vector.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "core/step.hpp"
#include "core/wide.hpp"
#include "ricochet/detail/cubic_look.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/finding.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/shrinking_intervals.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/ends.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/hybrid/event.hpp"

namespace ricochet::detail {

/// A T for the one guard of a system that has one.
template <class T>
class ForTheGuard : public std::array<T, 1> {
public:
    explicit ForTheGuard(std::size_t /*guards*/ = 1) : std::array<T, 1>{} {}
    void resize(std::size_t /*guards*/) noexcept {}
    void swap(ForTheGuard& other) noexcept { std::swap((*this)[0], other[0]); }
};

/// A T for every guard; of a few guards without an allocation. Most systems have one guard, and
/// for them the loop is compiled with that known.
template <class T, bool single>
using PerGuard = std::conditional_t<single, ForTheGuard<T>, boost::container::small_vector<T, 8>>;

/// As many elements as there are guards, at most.
template <class T, bool single>
class GuardList {
public:
    explicit GuardList(std::size_t guards) : items_(guards) {}
    void clear() noexcept { size_ = 0; }
    void shrink(std::size_t size) noexcept { size_ = size; }
    void push_back(const T& item) noexcept { items_[size_++] = item; }
    [[nodiscard]] T& add() noexcept { return items_[size_++]; }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
    [[nodiscard]] T& operator[](std::size_t i) noexcept { return items_[i]; }
    [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return items_[i]; }
    [[nodiscard]] T* begin() noexcept { return items_.data(); }
    [[nodiscard]] T* end() noexcept { return items_.data() + size_; }
    [[nodiscard]] const T* begin() const noexcept { return items_.data(); }
    [[nodiscard]] const T* end() const noexcept { return items_.data() + size_; }
    [[nodiscard]] std::span<const T> span() const noexcept { return {items_.data(), size_}; }

private:
    PerGuard<T, single> items_;
    std::size_t size_ = 0;
};

/// What is known of a guard beside its values.
struct GuardRecord {
    GuardInfo info;
    bool enabled = true;
    bool newly_enabled = false;
    bool fired = false;
    bool turned = false;   ///< its last reset has sent it back from the surface
    double departure = 0;  ///< [1/s] its rate after the last reset
    /// [s] scale of that rate; NaN where it is not that of the state in hand.
    double rated_over = std::numeric_limits<double>::quiet_NaN();
    bool again = false;            ///< it is back inside the window of its last event
    Side awaited = Side::plateau;  ///< on a plateau: leaving it away from here is an event
    bool acting = false;           ///< resets, or may end the run; else a notification
    bool asleep = false;           ///< its check is put off: nothing in the bank is of this step
    Side side = Side::plateau;
    Side next = Side::plateau;  ///< at the end of the step, if it stands
    bool jumped = false;        ///< its last event was a jump
    bool departs = false;       ///< the smooth phase in hand started at its event, or enabled it
    double band = 0;            ///< |g| where it fired: it counts as being on its surface
    bool estimated = false;     ///< the band is what location left, not a value of the guard
    double from = 0;            ///< [s] offset in the step up to which it has been looked at
    std::uint64_t events = 0;
    double last = std::numeric_limits<double>::quiet_NaN();  ///< [s] time of its last event
    Side last_side = Side::plateau;                          ///< the side it left then
    ShrinkingIntervals intervals;
};

[[nodiscard]] constexpr double sign_of(Side side) noexcept
{
    return side == Side::above ? 1 : side == Side::below ? -1 : 0;
}

/// What a detector asks of all guards, of a system with bounds or without.
struct BankRules {
    Screening screening = Screening::ends;
    bool uses_rates = false;
    bool puts_off = false;
    /// Whether the scale of a guard is that of its largest value so far: for detectors that do
    /// not ask for the rounding of the state, so that neighbouring steps agree on what a touch
    /// is.
    bool remembers = false;
    /// Whether brackets are not narrowed below the rounding of the sizes that smooth phases
    /// started with: those of guards with declared bounds, which may be expensive.
    bool coarse = false;
    /// Whether guards can be looked at inside a step.
    bool looks = false;
    bool (*suspects)(double, double, double, double, double, double) = nullptr;

    /// Whether sizes are kept from step to step.
    [[nodiscard]] bool keeps_sizes() const noexcept { return remembers || coarse; }

    template <class X>
    [[nodiscard]] static BankRules of(const DetectorTable<X>& detector, const SystemAt<X>& system)
    {
        const bool bounded = system->bounded;
        return {.screening = detector.screening,
                .uses_rates = detector.uses_rates,
                .puts_off = detector.puts_off,
                .remembers = detector.uses_rates && !detector.looks_inside && !bounded,
                .coarse = detector.uses_rates && bounded,
                .looks = detector.looks_inside && !bounded,
                .suspects = detector.suspects};
    }
};

template <class X, bool single>
class GuardBank {
public:
    GuardBank(const SystemAt<X>& system, const BankRules& rules, bool backward)
        : system_(system),
          rules_(rules),
          backward_(backward),
          suspects_(system->guard_count(system.door())),
          marks_(system->guard_count(system.door()))
    {
        const std::size_t count = system->guard_count(system.door());
        if (rules.looks) {
            for (auto* numbers : {&inside_, &further_, &worst_}) numbers->resize(count);
        }
        if (rules.keeps_sizes()) sizes_.resize(count);
        for (auto* numbers : {&sign_, &g0_, &rate0_, &g1_, &rate1_, &behind_}) {
            numbers->resize(count);
        }
        records_.resize(count);
        for (std::size_t i = 0; i < count; ++i) {
            records_[i].info = system->info(system.door(), i);
            bands_ = bands_ || records_[i].info.touch > 0;
        }
        heed_enabled();
    }

    /// What happened before is of no account; events go on to be counted.
    void forget() noexcept
    {
        for (GuardRecord& record : records_) {
            GuardRecord fresh;
            fresh.info = record.info;
            fresh.acting = record.acting;
            fresh.events = record.events;
            record = fresh;
        }
        for (double& size : sizes_) size = 0;
        waiting_ = false;
        forget_screening();
        looked_ = Looked::not_at_all;
    }

    [[nodiscard]] std::size_t size() const noexcept { return single ? 1 : records_.size(); }
    [[nodiscard]] bool looks() const noexcept { return rules_.looks; }
    [[nodiscard]] GuardRecord& operator[](std::size_t i) noexcept { return records_[i]; }
    [[nodiscard]] const GuardRecord& operator[](std::size_t i) const noexcept
    {
        return records_[i];
    }
    [[nodiscard]] bool backward() const noexcept { return backward_; }

    [[nodiscard]] CoreGuard<X> view(std::size_t i, Mode mode, std::uint64_t& calls) const noexcept
    {
        return {system_, calls, i, mode, records_[i].info, backward_};
    }

    /// Samples all guards at the start of a step.
    void sample_start(const Step<X>& step, std::uint64_t& calls, double scale)
    {
        if (rules_.puts_off) {
            sample_values(step.mode(), step.time(0), step.x0(), calls, g0_);
            for (std::size_t i = 0; i < size(); ++i) {
                rate0_[i] = std::numeric_limits<double>::quiet_NaN();  // until somebody asks
                records_[i].asleep = false;
            }
        } else {
            sample(step.mode(), step.time(0), step.x0(), step.rate0(), scale, calls, g0_, rate0_);
        }
        if (rules_.keeps_sizes()) {
            for (std::size_t i = 0; i < size(); ++i) {
                // Beside a pole that it has just passed, a guard has no size of its own.
                if (records_[i].fired && records_[i].jumped) continue;
                sizes_[i] = std::fmax(std::fabs(g0_[i]), sizes_[i]);
            }
        }
    }

    /// All guards take part in the steps from here on. `sampled`: their values are known.
    void wake_all(const Step<X>& step, double scale, std::uint64_t& calls, bool sampled)
    {
        if (!sampled) sample_values(step.mode(), step.time(0), step.x0(), calls, g0_);
        sample_rates(step.mode(), step.time(0), step.x0(), step.rate0(), scale, calls, rate0_);
        for (std::size_t i = 0; i < size(); ++i) {
            records_[i].asleep = false;
            arm(i, records_[i].side);
        }
    }

    /// Samples all guards at the end of a step.
    void sample_end(const Step<X>& step, std::uint64_t& calls)
    {
        sample(step.mode(), step.time(step.h()), step.x1(), step.rate1(), step.h(), calls, g1_,
               rate1_);
        forget_screening();
    }

    /// Evaluates all guards inside a step, at its state `x` there.
    void sample_inside(const Step<X>& step, const X& x, std::uint64_t& calls)
    {
        sample_values(step.mode(), step.time(CubicLook::inside * step.h()), x, calls, inside_);
        looked_ = Looked::inside;
        marked_ = false;
    }

    /// And once more, at the part `CubicLook::further` of the step where the state is `x`.
    void sample_further(const Step<X>& step, const X& x, std::uint64_t& calls)
    {
        const double s = CubicLook::further * step.h();
        sample_values(step.mode(), step.time(s), x, calls, further_);
        looked_ = Looked::further;
    }

    /// And once more, at the part `u` of the step, one of `CubicLook::places`.
    void sample_place(const Step<X>& step, double u, const X& x, std::uint64_t& calls)
    {
        sample_values(step.mode(), step.time(u * step.h()), x, calls, further_);
        const double h = step.h();
        const bool first = looked_ != Looked::everywhere;
        for (std::size_t i = 0; i < size(); ++i) {
            const double e = cubic(i, h).deviation(u, further_[i]);
            worst_[i] = !first && !(worst_[i] <= e) ? worst_[i] : e;  // NaN stays
        }
        looked_ = Looked::everywhere;
    }

    [[nodiscard]] bool looked_everywhere() const noexcept { return looked_ == Looked::everywhere; }

    /// Whether nothing but the values and rates of the guard decides whether a step holds events.
    [[nodiscard]] bool is_steady() const noexcept
    {
        if (size() == 0) return true;
        return single && sign_[0] != 0 && !waiting_ && !bands_ && !selective_;
    }
    void lend(QuietRun& run) const noexcept
    {
        if (size() == 0) return;
        run.sign = sign_[0];
        run.g0 = g0_[0];
        run.rate0 = rate0_[0];
    }
    /// What a quiet run has left: the guard at the start of the step in hand, at its end and
    /// inside.
    void take_back(const QuietRun& run) noexcept
    {
        if (size() == 0) return;
        g0_[0] = run.g0;
        rate0_[0] = run.rate0;
        g1_[0] = run.g1;
        rate1_[0] = run.rate1;
        forget_screening();
        if (!run.looks) return;
        inside_[0] = run.inside;
        looked_ = Looked::inside;
    }

    /// Whether any guard deserves a second evaluation inside the step, or a search.
    [[nodiscard]] bool doubtful(double h) noexcept
    {
        if (looked() && !waiting_ && !bands_) {
            if (are_few()) {
                return with_screen([&](auto screen) __attribute__((always_inline)) {
                    return any_of(in_doubt(screen, h));
                });
            }
            mark(h);
            return !marks_.empty();
        }
        return suspicious(h);
    }

    /// Whether a second evaluation inside the step can change what is thought of a guard: not
    /// where the first met the cubic to nine digits, which is no coincidence.
    [[nodiscard]] bool needs_second_look(double h) const noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
            const CubicLook look = cubic(i, h);
            const double e = look.deviation(CubicLook::inside, inside_[i]);
            if (sign_[i] != 0 && !(0x1p30 * e <= look.size())) return true;
        }
        return false;
    }

    /// Whether any guard deserves a search.
    [[nodiscard]] bool suspicious(double h) noexcept
    {
        if (waiting_ && leaves_plateau()) return true;
        screen(h);
        return !suspects_.empty();
    }

    /// The guards that deserve a search, in ascending order, as `begin_search` found them.
    [[nodiscard]] std::span<const std::size_t> suspects() const noexcept
    {
        return suspects_.span();
    }

    /// Whether guard i may leave its side inside the step without its ends telling.
    [[nodiscard]] bool hides(std::size_t i, double h) const noexcept
    {
        const CubicLook look = cubic(i, h);
        return !(look.lowest(sign_[i]) > CubicLook::most * deviation(look, i));
    }

    /// Whether guard i is in the step what the cubic through its ends says, as far as it has
    /// been evaluated.
    [[nodiscard]] bool is_plain(std::size_t i, double h) const noexcept
    {
        if (!looked()) return true;
        const CubicLook look = cubic(i, h);
        return 0x1p16 * deviation(look, i) <= look.size();
    }

    /// Whether the guards have been evaluated inside the step.
    [[nodiscard]] bool looked() const noexcept { return looked_ != Looked::not_at_all; }

    /// Of one of the `suspects`: it is one still, after what the search has found so far.
    [[nodiscard]] bool still_suspicious(std::size_t i, double h) const noexcept
    {
        return as_screened_ || suspicious(i, h);
    }

    [[nodiscard]] bool suspicious(std::size_t i, double h) const noexcept
    {
        if (sign_[i] == 0) return false;
        const double band = sign_[i] * records_[i].info.touch;  // worth a look if it is reached
        const bool suspected = with_screen([&](auto screen) __attribute__((always_inline)) {
            return screen.suspects(sign_[i], g0_[i] - band, rate0_[i], g1_[i] - band, rate1_[i], h);
        });
        return suspected || !is_finite(g1_[i]) || (looked() && hides(i, h));
    }

    /// The first guard that is not finite at the end of the step, or `no_guard`.
    [[nodiscard]] std::size_t first_not_finite() const noexcept
    {
        if (!any_of([this](std::size_t i)
                        __attribute__((always_inline)) { return !is_finite(g1_[i]); })) {
            return no_guard;
        }
        for (std::size_t i = 0; i < size(); ++i) {
            const bool idle = !records_[i].enabled || records_[i].asleep;
            if (!idle && !std::isfinite(g1_[i])) return i;
        }
        return no_guard;
    }

    /// A smooth phase starts at time t, with guards on their surfaces or not.
    void begin_phase(double t) noexcept { armed_at_ = t; }

    /// What is left to look at of guard i in the step, of which `end` is the end.
    [[nodiscard]] Watch watch(std::size_t i, const Step<X>& step, const GuardSample& end) const
    {
        const GuardRecord& record = records_[i];
        return {.side = record.side,
                .start = start(i),
                .end = end,
                .touch = touch(i, step.h()),
                .scale = scale(i, step.h()),
                .departs = record.departs && record.from == 0 && step.time(0) == armed_at_};
    }

    [[nodiscard]] GuardSample start(std::size_t i) const noexcept
    {
        return {.s = records_[i].from, .value = g0_[i], .rate = known(rate0_[i])};
    }
    [[nodiscard]] GuardSample end(std::size_t i, double h) const noexcept
    {
        return {.s = h, .value = g1_[i], .rate = known(rate1_[i])};
    }

    /// Half the width of the band around the surface that counts as being on it where the
    /// rate is zero, as far as the rounding of the guard's values in the step goes. What the
    /// rounding of the state adds to that is asked for where it matters (`StepProbe::rounding`).
    [[nodiscard]] double touch(std::size_t i, double h) const noexcept
    {
        return touch_of(i, rules_.remembers ? sizes_[i] : scale(i, h));
    }

    /// As `touch`, in a stretch in which |g| reaches `largest`.
    [[nodiscard]] double touch_of(std::size_t i, double largest) const noexcept
    {
        constexpr double ulps = 64 * std::numeric_limits<double>::epsilon();
        return std::fmax(records_[i].info.touch, ulps * largest);
    }

    /// The largest |g| that the ends of a step of length h suggest.
    [[nodiscard]] double scale(std::size_t i, double h) const noexcept
    {
        const double ends = std::fmax(std::fabs(g0_[i]), std::fabs(g1_[i]));
        if (!rules_.uses_rates) return ends;
        return std::fmax(ends, std::fmax(std::fabs(g0_[i] + rate0_[i] * (h / 3)),
                                         std::fabs(g1_[i] - rate1_[i] * (h / 3))));
    }

    void arm(std::size_t i, Side side) noexcept
    {
        records_[i].side = side;
        sign_[i] = records_[i].enabled && !records_[i].asleep ? sign_of(side) : 0;
        as_screened_ = false;
    }

    /// The width [s] below which a bracket in a step of length h is a matter of the guard's
    /// rounding, where it is not narrowed further; else 0.
    [[nodiscard]] double unresolved(std::size_t i, double h) const noexcept
    {
        if (!rules_.coarse) return 0;
        const double size = std::fmax(sizes_[i], std::fmax(std::fabs(g0_[i]), std::fabs(g1_[i])));
        const double rate = std::fmin(std::fabs(rate0_[i]), std::fabs(rate1_[i]));
        const double width = 4 * std::numeric_limits<double>::epsilon() * size / rate;
        return width <= 1e-10 * h ? width : 1e-10 * h;
    }

    /// Guard i is not looked at until it is woken.
    void put_to_sleep(std::size_t i) noexcept
    {
        records_[i].asleep = true;
        sign_[i] = 0;
    }

    /// Guard i takes part in the step, with its samples at both ends.
    void wake(std::size_t i, const GuardSample& start, const GuardSample& end) noexcept
    {
        records_[i].asleep = false;
        forget_screening();
        g0_[i] = start.value;
        rate0_[i] = start.rate;
        g1_[i] = end.value;
        rate1_[i] = end.rate;
        arm(i, records_[i].side);
    }

    /// The rate of guard i, as `sample_start` and `sample_end` compute it.
    [[nodiscard]] double rate_of(std::size_t i, Mode mode, double t, const X& x, const X& dxdt,
                                 double scale, std::uint64_t& calls)
    {
        if (records_[i].info.boolean || !rules_.uses_rates) return 0;
        if (!system_->rates) return view(i, mode, calls).rate(t, x, dxdt, scale);
        rates_together(mode, t, x, dxdt, behind_);
        return behind_[i];
    }

    /// Nothing inside the step has been looked at. What a search changes belongs to `suspects`;
    /// all other guards are at its end what they were at its start.
    void begin_search(double h) noexcept
    {
        // A guard that wakes or leaves its plateau is another than the one that was screened.
        if (rules_.puts_off || waiting_) forget_screening();
        if (!screened_) screen(h);
        for (const std::size_t i : suspects_) records_[i].next = records_[i].side;
    }

    /// The guard goes on from `start` inside the step, on `side`.
    void go_on_from(std::size_t i, Side side, const GuardSample& start) noexcept
    {
        arm(i, side);
        records_[i].next = side;
        records_[i].from = start.s;
        g0_[i] = start.value;
        rate0_[i] = start.rate;
    }

    /// The end of a clear step becomes the start of the next.
    void pass_on() noexcept
    {
        if (rules_.remembers) {
            for (std::size_t i = 0; i < size(); ++i) {
                sizes_[i] = std::fmax(std::fabs(g1_[i]), sizes_[i]);
            }
        }
        const auto on_plateau = [this](std::size_t i) __attribute__((always_inline))
        {
            return sign_[i] == 0;
        };
        const bool plateaus = any_of(on_plateau);
        hand_over(g1_, g0_);
        if (rules_.uses_rates) hand_over(rate1_, rate0_);
        if (!plateaus) return;
        for (std::size_t i = 0; i < size(); ++i) leave_plateau(i, g0_[i]);
    }

    /// A guard on a plateau takes the side that it is on at the end of the step.
    void leave_plateau(std::size_t i) noexcept { leave_plateau(i, g1_[i]); }

    /// As `pass_on`, after events inside the step.
    void pass_on_after_events() noexcept
    {
        for (const std::size_t i : suspects_) {
            records_[i].from = 0;
            arm(i, records_[i].next);
        }
        pass_on();
    }

    /// The rate of a guard at the start of a step.
    [[nodiscard]] double complete_rate0(std::size_t i, const Step<X>& step, double scale,
                                        std::uint64_t& calls)
    {
        if (records_[i].info.boolean) return rate0_[i] = 0;
        const auto guard = view(i, step.mode(), calls);
        rate0_[i] = guard.rate(step.time(0), step.x0(), step.rate0(), scale);
        return rate0_[i];
    }

    [[nodiscard]] double g0(std::size_t i) const noexcept { return g0_[i]; }
    [[nodiscard]] double rate0(std::size_t i) const noexcept { return rate0_[i]; }
    void set_rate0(std::size_t i, double rate) noexcept { rate0_[i] = rate; }

    /// Calls `visit` with every number that is carried from step to step.
    template <class Visit>
    void visit(Visit&& visit)
    {
        for (std::size_t i = 0; i < size(); ++i) {
            GuardRecord& record = records_[i];
            visit(sign_[i]);
            if (rules_.keeps_sizes()) visit(sizes_[i]);
            visit(g0_[i]);
            visit(rate0_[i]);
            visit(record.enabled);
            visit(record.side);
            visit(record.events);
            visit(record.last);
            visit(record.last_side);
            visit(record.band);
            visit(record.turned);
            visit(record.departs);
            visit(record.awaited);
            if (rules_.puts_off) visit(record.asleep);
            record.intervals.visit(visit);
        }
        visit(waiting_);
        visit(armed_at_);
        heed_enabled();
    }

    /// Some guards may have been enabled or disabled.
    void heed_enabled() noexcept
    {
        selective_ = false;
        for (std::size_t i = 0; i < size(); ++i) {
            selective_ = selective_ || records_[i].info.boolean || !records_[i].enabled;
        }
    }

    /// Guard i is on a plateau; if it leaves that away from `side`, it has its event.
    void await(std::size_t i, Side side) noexcept
    {
        records_[i].awaited = side;
        waiting_ = true;
    }
    void await_nobody() noexcept { waiting_ = false; }
    [[nodiscard]] bool waiting() const noexcept { return waiting_; }

    /// Whether guard i, on a plateau, has its event in the step, or is no number at its end.
    [[nodiscard]] bool leaves_plateau(std::size_t i) const noexcept
    {
        const GuardRecord& record = records_[i];
        if (record.side != Side::plateau || !record.enabled || record.asleep) return false;
        if (!std::isfinite(g1_[i])) return true;
        return record.awaited != Side::plateau && side_of(g1_[i]) == opposite(record.awaited) &&
               counts(record.awaited, record.info.crossing);
    }

private:
    [[gnu::noinline]] bool leaves_plateau() const noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
            if (leaves_plateau(i)) return true;
        }
        return false;
    }

    using Doubles = PerGuard<double, single>;

    struct OwnScreen {
        bool (*suspects)(double, double, double, double, double, double);
    };

    /// Calls `use` with the detector's own way of screening, inlined.
    template <class Use>
    [[gnu::always_inline]] auto with_screen(const Use& use) const
    {
        switch (rules_.screening) {
            case Screening::ends: return use(Ends{});
            case Screening::extremum: return use(Extremum{});
            case Screening::every: return use(Bernstein{});
            case Screening::own: break;
        }
        return use(OwnScreen{rules_.suspects});
    }

    /// Guards that are screened together: where one of them is suspected, each is looked at.
    static constexpr std::size_t block = 16;
    [[nodiscard]] bool are_few() const noexcept { return size() < block; }

    /// Whether `condition`, which has no branches, holds for a guard.
    template <class Condition>
    [[nodiscard, gnu::always_inline]] bool any_of(const Condition& condition) const noexcept
    {
        double any = 0;  // a double, so that the loop is vectorised
        for (std::size_t i = 0; i < size(); ++i) any = condition(i) ? 1.0 : any;
        return any != 0;
    }

    /// Calls `visit(i)` for the guards for which `condition`, which has no branches, holds, in
    /// ascending order.
    template <class Condition, class Visit>
    [[gnu::always_inline]] void for_each_that(const Condition& condition,
                                              const Visit& visit) const noexcept
    {
        std::size_t first = 0;
        for (; first + block <= size(); first += block) {
            std::array<double, block> holds;  // doubles, so that the loop is vectorised
            double any = 0;
            for (std::size_t k = 0; k < block; ++k) {
                holds[k] = condition(first + k) ? 1.0 : 0.0;
                any = holds[k] != 0 ? 1.0 : any;
            }
            if (any == 0) continue;
            for (std::size_t k = 0; k < block; ++k) {
                if (holds[k] != 0) visit(first + k);
            }
        }
        for (; first < size(); ++first) {
            if (condition(first)) visit(first);
        }
    }

    [[nodiscard, gnu::always_inline]] CubicLook cubic(std::size_t i, double h) const noexcept
    {
        return {g0_[i], rate0_[i], g1_[i], rate1_[i], h};
    }

    /// Whether the ends of the step tell of guard i that it deserves a search.
    template <class Screen>
    [[nodiscard, gnu::always_inline]] auto shows(const Screen& screen, double h) const noexcept
    {
        return [ this, screen, h ](std::size_t i) __attribute__((always_inline))
        {
            const bool suspected =
                screen.suspects(sign_[i], g0_[i], rate0_[i], g1_[i], rate1_[i], h);
            const bool armed = sign_[i] != 0;
            return suspected & armed;
        };
    }

    /// Whether guard i may leave its side where a deviation is `factor` times as large as at
    /// the part `u`, where the guards are `values`.
    [[nodiscard, gnu::always_inline]] auto strays(double h, double u, double factor,
                                                  const Doubles& values) const noexcept
    {
        return [ this, h, u, factor, &values ](std::size_t i) __attribute__((always_inline))
        {
            const CubicLook look = cubic(i, h);
            const bool clear = look.lowest(sign_[i]) > factor * look.deviation(u, values[i]);
            const bool armed = sign_[i] != 0;
            return !clear & armed;
        };
    }

    /// Whether guard i deserves a second evaluation inside the step, or a search.
    template <class Screen>
    [[nodiscard, gnu::always_inline]] auto in_doubt(const Screen& screen, double h) const noexcept
    {
        return [
            shows = shows(screen, h),
            strays = strays(h, CubicLook::inside, CubicLook::doubt, inside_)
        ](std::size_t i) __attribute__((always_inline))
        {
            const bool shown = shows(i);
            const bool strayed = strays(i);
            return shown | strayed;
        };
    }

    /// The step in hand is another, or what is known of its guards.
    void forget_screening() noexcept { screened_ = marked_ = false; }

    /// Finds the guards in doubt.
    RICOCHET_WIDE void mark(double h) noexcept
    {
        marks_.clear();
        marked_ = true;
        with_screen([&](auto screen) __attribute__((always_inline)) {
            for_each_that(in_doubt(screen, h), [this](std::size_t i) { marks_.push_back(i); });
        });
    }

    /// Finds the guards that deserve a search.
    [[gnu::noinline]] void screen(double h) noexcept
    {
        suspects_.clear();
        screened_ = as_screened_ = true;
        if (are_few() || bands_) {
            for (std::size_t i = 0; i < size(); ++i) add_if_suspicious(i, h);
            return;
        }
        if (looked()) {
            // One that deserves a search is in doubt, or deviates elsewhere.
            if (!marked_) mark(h);
            if (looked_ == Looked::inside)
                return screen_marked(h, [](std::size_t) { return false; });
            if (looked_ == Looked::further) {
                return screen_marked(h, strays(h, CubicLook::further, CubicLook::most, further_));
            }
            return screen_marked(
                h, [ this, h ](std::size_t i) __attribute__((always_inline)) {
                    const bool clear = cubic(i, h).lowest(sign_[i]) > CubicLook::most * worst_[i];
                    const bool armed = sign_[i] != 0;
                    return !clear & armed;
                });
        }
        marks_.clear();
        with_screen([&](auto screen) __attribute__((always_inline)) {
            const auto condition =
                [ this, shows = shows(screen, h) ](std::size_t i) __attribute__((always_inline))
            {
                const bool shown = shows(i);
                const bool armed = sign_[i] != 0;
                const bool lost = !is_finite(g1_[i]);
                return shown | (lost & armed);
            };
            if (any_of(condition)) screen_marked(h, condition);
        });
    }

    /// Looks at each guard that is marked, or for which `condition` holds.
    template <class Condition>
    [[gnu::always_inline]] void screen_marked(double h, const Condition& condition) noexcept
    {
        const std::size_t* mark = marks_.begin();
        const std::size_t* const end = marks_.end();
        for_each_that(condition, [&](std::size_t i) {
            for (; mark != end && *mark <= i; ++mark) {
                if (*mark < i) add_if_suspicious(*mark, h);
            }
            add_if_suspicious(i, h);
        });
        for (; mark != end; ++mark) add_if_suspicious(*mark, h);
    }

    void add_if_suspicious(std::size_t i, double h) noexcept
    {
        if (suspicious(i, h)) suspects_.push_back(i);
    }

    /// What belongs to the end of a step belongs to the start of the next.
    void hand_over(Doubles& from, Doubles& to) const noexcept
    {
        if (size() > 4 && !rules_.puts_off) {
            from.swap(to);
        } else {
            for (std::size_t i = 0; i < size(); ++i) to[i] = from[i];
        }
    }

    void leave_plateau(std::size_t i, double g) noexcept
    {
        if (sign_[i] == 0 && records_[i].enabled && !records_[i].asleep) arm(i, side_of(g));
    }

    [[nodiscard]] static constexpr bool is_finite(double g) noexcept
    {
        return std::fabs(g) <= std::numeric_limits<double>::max();
    }

    /// The largest deviation of guard i from the cubic through its ends that was seen.
    [[nodiscard]] double deviation(const CubicLook& look, std::size_t i) const noexcept
    {
        const double e = look.deviation(CubicLook::inside, inside_[i]);
        if (looked_ == Looked::inside) return e;
        const double other =
            looked_everywhere() ? worst_[i] : look.deviation(CubicLook::further, further_[i]);
        return other <= e ? e : other;  // NaN stays
    }

    [[nodiscard]] double known(double rate) const noexcept
    {
        return rules_.uses_rates ? rate : std::numeric_limits<double>::quiet_NaN();
    }

    [[nodiscard]] std::span<double> all(Doubles& numbers) const noexcept
    {
        return {numbers.data(), size()};
    }

    void sample(Mode mode, double t, const X& x, const X& dxdt, double scale, std::uint64_t& calls,
                Doubles& g, Doubles& rates)
    {
        if (single && system_->point && rules_.uses_rates && !selective_) {
            const GuardPoint at = view(0, mode, calls).point(t, x, dxdt, scale);
            g[0] = at.value;
            rates[0] = at.rate;
            return;
        }
        sample_values(mode, t, x, calls, g);
        sample_rates(mode, t, x, dxdt, scale, calls, rates);
    }

    void sample_values(Mode mode, double t, const X& x, std::uint64_t& calls, Doubles& g)
    {
        if (size() == 0) return;
        system_->guards(system_.door(), mode, t, x, all(g));
        calls += size();
    }

    void sample_rates(Mode mode, double t, const X& x, const X& dxdt, double scale,
                      std::uint64_t& calls, Doubles& rates)
    {
        if (!rules_.uses_rates || size() == 0) return;
        if (system_->rates) return rates_together(mode, t, x, dxdt, rates);
        if (system_->each_rate && !selective_ && !backward_) {
            return system_->each_rate(system_.door(), mode, t, x, dxdt, all(rates));
        }
        if (!system_->each_rate && !system_->guard_alone) {
            difference(mode, t, x, dxdt, scale, rates);
            calls += 2 * size();
            return;
        }
        for (std::size_t i = 0; i < size(); ++i) {
            rates[i] = records_[i].info.boolean || !records_[i].enabled
                           ? 0
                           : view(i, mode, calls).rate(t, x, dxdt, scale);
        }
    }

    /// Rates of all guards at once from the system.
    void rates_together(Mode mode, double t, const X& x, const X& dxdt, Doubles& rates)
    {
        if (!backward_) return system_->rates(system_.door(), mode, t, x, dxdt, all(rates));
        system_->rates(system_.door(), mode, t, x, negated(dxdt), all(rates));
        for (std::size_t i = 0; i < size(); ++i) rates[i] = -rates[i];
    }

    /// Rates of all guards at once by the central difference along the flow.
    void difference(Mode mode, double t, const X& x, const X& dxdt, double scale, Doubles& rates)
    {
        const double delta = 1e-5 * scale;
        const double ahead = backward_ ? -delta : delta;
        if (there_.size() != x.size()) there_ = x;
        detail::move(there_, x, delta, dxdt);
        system_->guards(system_.door(), mode, t + ahead, there_, all(rates));
        detail::move(there_, x, -delta, dxdt);
        system_->guards(system_.door(), mode, t - ahead, there_, all(behind_));
        for (std::size_t i = 0; i < size(); ++i) {
            rates[i] = records_[i].info.boolean ? 0 : (rates[i] - behind_[i]) / (2 * delta);
        }
    }

    SystemAt<X> system_;
    BankRules rules_;
    bool backward_;
    double armed_at_ = std::numeric_limits<double>::quiet_NaN();  ///< [s]
    bool waiting_ = false;      ///< whether any guard may be on a plateau
    bool bands_ = false;        ///< whether any guard declares one
    bool selective_ = false;    ///< whether any guard is disabled or has no rate
    bool screened_ = false;     ///< whether `suspects_` is of the step in hand
    bool as_screened_ = false;  ///< and no guard has changed since
    Doubles sign_{}, g0_{}, rate0_{}, g1_{}, rate1_{}, behind_{};
    /// Where in the step in hand the guards have been evaluated.
    enum class Looked : std::uint8_t { not_at_all, inside, further, everywhere };
    Looked looked_ = Looked::not_at_all;
    bool marked_ = false;  ///< whether `marks_` is of the step in hand
    Doubles inside_{}, further_{};
    Doubles worst_{};  ///< of further looks
    Doubles sizes_{};
    X there_{};
    GuardList<std::size_t, single> suspects_;
    GuardList<std::size_t, single> marks_;  ///< guards in doubt
    PerGuard<GuardRecord, single> records_{};
};

}  // namespace ricochet::detail
