// Internal: what it declares may change without notice.
//
// All guards of a system at the ends of a step.
//
// What every step needs of every guard lies in plain arrays, so that a hundred guards
// are screened in one loop; what only events need lies beside them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/cubic_look.hpp"
#include "ricochet/detail/finding.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/hybrid/event.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/detail/shrinking_intervals.hpp"

namespace ricochet::detail {

/// A T for every guard; on the stack where the system fixes their number.
template <class T, std::size_t fixed>
using PerGuard = std::conditional_t<fixed == counted_at_run_time, std::vector<T>,
                                    std::array<T, fixed == counted_at_run_time ? 1 : fixed>>;

/// As many elements as there are guards, at most.
template <class T, std::size_t fixed>
class GuardList {
public:
    explicit GuardList(std::size_t guards)
    {
        if constexpr (fixed == counted_at_run_time) items_.resize(guards);
    }
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
    PerGuard<T, fixed> items_{};
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

template <class System, class X, class Detector>
class GuardBank {
    static constexpr std::size_t fixed = fixed_guard_count<System, X>();
    static constexpr bool puts_off = puts_off_checks<Detector, System, X>();

public:
    /// Whether the scale of a guard is that of its largest value so far: for detectors that do
    /// not ask for the rounding of the state, so that neighbouring steps agree on what a touch
    /// is.
    static constexpr bool remembers =
        Detector::uses_rates && !LooksInside<Detector> && !Bounded<System, X>;

    /// Whether brackets are not narrowed below the rounding of the sizes that smooth phases
    /// started with: those of guards with declared bounds, which may be expensive.
    static constexpr bool coarse = Detector::uses_rates && Bounded<System, X>;

    /// Whether sizes are kept from step to step.
    static constexpr bool keeps_sizes = remembers || coarse;

    /// Whether guards can be looked at inside a step.
    static constexpr bool looks = LooksInside<Detector> && !Bounded<System, X>;

    GuardBank(const System& system, bool backward)
        : system_(&system),
          backward_(backward),
          count_(guard_count_of<X>(system)),
          suspects_(count_),
          marks_(count_)
    {
        if constexpr (fixed == counted_at_run_time) {
            if constexpr (looks) inside_.resize(count_);
            if constexpr (looks) further_.resize(count_);
            if constexpr (looks) worst_.resize(count_);
            if constexpr (keeps_sizes) sizes_.resize(count_);
            for (auto* numbers : {&sign_, &g0_, &rate0_, &g1_, &rate1_, &behind_})
                numbers->resize(count_);
            records_.resize(count_);
        }
        for (std::size_t i = 0; i < count_; ++i) {
            records_[i].info = guard_info_of<X>(system, i);
            bands_ = bands_ || records_[i].info.touch > 0;
        }
        heed_enabled();
    }

    [[nodiscard]] std::size_t size() const noexcept
    {
        return fixed == counted_at_run_time ? count_ : fixed;
    }
    [[nodiscard]] GuardRecord& operator[](std::size_t i) noexcept { return records_[i]; }
    [[nodiscard]] const GuardRecord& operator[](std::size_t i) const noexcept
    {
        return records_[i];
    }
    [[nodiscard]] bool backward() const noexcept { return backward_; }

    [[nodiscard]] GuardView<System, X> view(std::size_t i, Mode mode,
                                            std::uint64_t& calls) const noexcept
    {
        return {*system_, calls, i, mode, records_[i].info.crossing, backward_};
    }

    /// Samples all guards at the start of a step.
    template <class Step>
    void sample_start(const Step& step, std::uint64_t& calls, double scale)
    {
        if constexpr (puts_off) {
            call_guards(*system_, step.mode(), step.time(0), step.x0(), all(g0_));
            calls += size();
            for (std::size_t i = 0; i < size(); ++i) {
                rate0_[i] = std::numeric_limits<double>::quiet_NaN();  // until somebody asks
                records_[i].asleep = false;
            }
        } else {
            sample(step.mode(), step.time(0), step.x0(), step.rate0(), scale, calls, g0_, rate0_);
        }
        if constexpr (keeps_sizes) {
            for (std::size_t i = 0; i < size(); ++i) {
                // Beside a pole that it has just passed, a guard has no size of its own.
                if (records_[i].fired && records_[i].jumped) continue;
                sizes_[i] = std::fmax(std::fabs(g0_[i]), sizes_[i]);
            }
        }
    }

    /// All guards take part in the steps from here on. `sampled`: their values are known.
    template <class Step>
    void wake_all(const Step& step, double scale, std::uint64_t& calls, bool sampled)
    {
        if (!sampled) sample_values(step.mode(), step.time(0), step.x0(), calls, g0_);
        sample_rates(step.mode(), step.time(0), step.x0(), step.rate0(), scale, calls, rate0_);
        for (std::size_t i = 0; i < size(); ++i) {
            records_[i].asleep = false;
            arm(i, records_[i].side);
        }
    }

    /// Samples all guards at the end of a step.
    template <class Step>
    void sample_end(const Step& step, std::uint64_t& calls)
    {
        sample(step.mode(), step.time(step.h()), step.x1(), step.rate1(), step.h(), calls, g1_,
               rate1_);
        forget_screening();
    }

    /// Evaluates all guards inside a step, at its state `x` there.
    template <class Step>
    void sample_inside(const Step& step, const X& x, std::uint64_t& calls)
    {
        if constexpr (looks) {
            sample_values(step.mode(), step.time(CubicLook::inside * step.h()), x, calls, inside_);
            looked_ = Looked::inside;
            marked_ = false;
        }
    }

    /// And once more, at the part `CubicLook::further` of the step where the state is `x`.
    template <class Step>
    void sample_further(const Step& step, const X& x, std::uint64_t& calls)
    {
        if constexpr (looks) {
            const double s = CubicLook::further * step.h();
            sample_values(step.mode(), step.time(s), x, calls, further_);
            looked_ = Looked::further;
        }
    }

    /// And once more, at the part `u` of the step, one of `CubicLook::places`.
    template <class Step>
    void sample_place(const Step& step, double u, const X& x, std::uint64_t& calls)
    {
        if constexpr (looks) {
            sample_values(step.mode(), step.time(u * step.h()), x, calls, further_);
            const double h = step.h();
            const bool first = looked_ != Looked::everywhere;
            for (std::size_t i = 0; i < size(); ++i) {
                const double e = cubic(i, h).deviation(u, further_[i]);
                worst_[i] = !first && !(worst_[i] <= e) ? worst_[i] : e;  // NaN stays
            }
            looked_ = Looked::everywhere;
        }
    }

    [[nodiscard]] bool looked_everywhere() const noexcept { return looked_ == Looked::everywhere; }

    /// Whether any guard deserves a second evaluation inside the step, or a search.
    [[nodiscard]] bool doubtful(double h) noexcept
    {
        if constexpr (looks) {
            if (looked() && !waiting_ && !bands_) {
                if (are_few()) return any_of(in_doubt(h));
                mark(h);
                return !marks_.empty();
            }
        }
        return suspicious(h);
    }

    /// Whether a second evaluation inside the step can change what is thought of a guard: not
    /// where the first met the cubic to nine digits, which is no coincidence.
    [[nodiscard]] bool needs_second_look(double h) const noexcept
    {
        if constexpr (looks) {
            for (std::size_t i = 0; i < size(); ++i) {
                const CubicLook look = cubic(i, h);
                const double e = look.deviation(CubicLook::inside, inside_[i]);
                if (sign_[i] != 0 && !(0x1p30 * e <= look.size())) return true;
            }
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
        if constexpr (looks) {
            const CubicLook look = cubic(i, h);
            return !(look.lowest(sign_[i]) > CubicLook::most * deviation(look, i));
        } else {
            return false;
        }
    }

    /// Whether guard i is in the step what the cubic through its ends says, as far as it has
    /// been evaluated.
    [[nodiscard]] bool is_plain(std::size_t i, double h) const noexcept
    {
        if constexpr (looks) {
            if (!looked()) return true;
            const CubicLook look = cubic(i, h);
            return 0x1p16 * deviation(look, i) <= look.size();
        } else {
            return true;
        }
    }

    /// Whether the guards have been evaluated inside the step.
    [[nodiscard]] bool looked() const noexcept { return looks && looked_ != Looked::not_at_all; }

    [[nodiscard]] bool suspicious(std::size_t i, double h) const noexcept
    {
        if (sign_[i] == 0) return false;
        const double band = sign_[i] * records_[i].info.touch;  // worth a look if it is reached
        return Detector::suspects(sign_[i], g0_[i] - band, rate0_[i], g1_[i] - band, rate1_[i],
                                  h) ||
               !is_finite(g1_[i]) || (looked() && hides(i, h));
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
    template <class Step>
    [[nodiscard]] Watch watch(std::size_t i, const Step& step, const GuardSample& end) const
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
    [[nodiscard]] double touch(std::size_t i, [[maybe_unused]] double h) const noexcept
    {
        if constexpr (remembers) {
            return touch_of(i, sizes_[i]);
        } else {
            return touch_of(i, scale(i, h));
        }
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
        if (!Detector::uses_rates) return ends;
        return std::fmax(ends, std::fmax(std::fabs(g0_[i] + rate0_[i] * (h / 3)),
                                         std::fabs(g1_[i] - rate1_[i] * (h / 3))));
    }

    void arm(std::size_t i, Side side) noexcept
    {
        records_[i].side = side;
        sign_[i] = records_[i].enabled && !records_[i].asleep ? sign_of(side) : 0;
    }

    /// The width [s] below which a bracket in a step of length h is a matter of the guard's
    /// rounding, where it is not narrowed further; else 0.
    [[nodiscard]] double unresolved(std::size_t i, double h) const noexcept
    {
        if constexpr (coarse) {
            const double size =
                std::fmax(sizes_[i], std::fmax(std::fabs(g0_[i]), std::fabs(g1_[i])));
            const double rate = std::fmin(std::fabs(rate0_[i]), std::fabs(rate1_[i]));
            const double width = 4 * std::numeric_limits<double>::epsilon() * size / rate;
            return width <= 1e-10 * h ? width : 1e-10 * h;
        } else {
            return 0;
        }
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
        if (records_[i].info.boolean || !Detector::uses_rates) return 0;
        if constexpr (RatesTogether<System, X>) {
            rates_together(mode, t, x, dxdt, behind_);
            return behind_[i];
        } else {
            return view(i, mode, calls).rate(t, x, dxdt, scale);
        }
    }

    /// Nothing inside the step has been looked at. What a search changes belongs to `suspects`;
    /// all other guards are at its end what they were at its start.
    void begin_search(double h) noexcept
    {
        // A guard that wakes or leaves its plateau is another than the one that was screened.
        if (puts_off || waiting_) forget_screening();
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
        if constexpr (remembers) {
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
        if constexpr (Detector::uses_rates) hand_over(rate1_, rate0_);
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
    template <class Step>
    [[nodiscard]] double complete_rate0(std::size_t i, const Step& step, double scale,
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
            if constexpr (keeps_sizes) visit(sizes_[i]);
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
            if constexpr (puts_off) visit(record.asleep);
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

    using Doubles = PerGuard<double, fixed>;

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
    [[nodiscard, gnu::always_inline]] auto shows(double h) const noexcept
    {
        return [ this, h ](std::size_t i) __attribute__((always_inline))
        {
            const bool suspected =
                Detector::suspects(sign_[i], g0_[i], rate0_[i], g1_[i], rate1_[i], h);
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
    [[nodiscard, gnu::always_inline]] auto in_doubt(double h) const noexcept
    {
        return [
            shows = shows(h), strays = strays(h, CubicLook::inside, CubicLook::doubt, inside_)
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
    void mark(double h) noexcept
    {
        marks_.clear();
        marked_ = true;
        for_each_that(in_doubt(h), [this](std::size_t i) { marks_.push_back(i); });
    }

    /// Finds the guards that deserve a search.
    [[gnu::noinline]] void screen(double h) noexcept
    {
        suspects_.clear();
        screened_ = true;
        if (are_few() || bands_) {
            for (std::size_t i = 0; i < size(); ++i) add_if_suspicious(i, h);
            return;
        }
        if constexpr (looks) {
            if (looked()) {
                // One that deserves a search is in doubt, or deviates elsewhere.
                if (!marked_) mark(h);
                if (looked_ == Looked::inside)
                    return screen_marked(h, [](std::size_t) { return false; });
                if (looked_ == Looked::further) {
                    return screen_marked(h,
                                         strays(h, CubicLook::further, CubicLook::most, further_));
                }
                return screen_marked(
                    h, [ this, h ](std::size_t i) __attribute__((always_inline)) {
                        const bool clear =
                            cubic(i, h).lowest(sign_[i]) > CubicLook::most * worst_[i];
                        const bool armed = sign_[i] != 0;
                        return !clear & armed;
                    });
            }
        }
        marks_.clear();
        const auto condition =
            [ this, shows = shows(h) ](std::size_t i) __attribute__((always_inline))
        {
            const bool shown = shows(i);
            const bool armed = sign_[i] != 0;
            const bool lost = !is_finite(g1_[i]);
            return shown | (lost & armed);
        };
        if (any_of(condition)) screen_marked(h, condition);
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
    static void hand_over(Doubles& from, Doubles& to) noexcept
    {
        if constexpr (fixed == counted_at_run_time && !puts_off) {
            std::swap(from, to);
        } else {
            to = from;
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

    [[nodiscard]] static double known(double rate) noexcept
    {
        return Detector::uses_rates ? rate : std::numeric_limits<double>::quiet_NaN();
    }

    [[nodiscard]] std::span<double> all(Doubles& numbers) const noexcept
    {
        return {numbers.data(), size()};
    }

    void sample(Mode mode, double t, const X& x, const X& dxdt, double scale, std::uint64_t& calls,
                Doubles& g, Doubles& rates)
    {
        sample_values(mode, t, x, calls, g);
        sample_rates(mode, t, x, dxdt, scale, calls, rates);
    }

    void sample_values(Mode mode, double t, const X& x, std::uint64_t& calls, Doubles& g)
    {
        call_guards(*system_, mode, t, x, all(g));
        calls += size();
    }

    void sample_rates([[maybe_unused]] Mode mode, [[maybe_unused]] double t,
                      [[maybe_unused]] const X& x, [[maybe_unused]] const X& dxdt,
                      [[maybe_unused]] double scale, [[maybe_unused]] std::uint64_t& calls,
                      [[maybe_unused]] Doubles& rates)
    {
        if constexpr (Detector::uses_rates) {
            if constexpr (RatesTogether<System, X>) {
                rates_together(mode, t, x, dxdt, rates);
            } else if constexpr (RateAlone<System, X> || GuardAlone<System, X>) {
                if constexpr (RateAlone<System, X>) {
                    if (!selective_ && !backward_) {
                        double* to = rates.data();
                        for (std::size_t i = 0; i < size(); ++i) {
                            to[i] = call_rate(*system_, i, mode, t, x, dxdt);
                        }
                        return;
                    }
                }
                for (std::size_t i = 0; i < size(); ++i) {
                    rates[i] = records_[i].info.boolean || !records_[i].enabled
                                   ? 0
                                   : view(i, mode, calls).rate(t, x, dxdt, scale);
                }
            } else {
                difference(mode, t, x, dxdt, scale, rates);
                calls += 2 * size();
            }
        }
    }

    /// Rates of all guards at once from the system.
    void rates_together(Mode mode, double t, const X& x, const X& dxdt, Doubles& rates)
    {
        if (!backward_) return call_rates(*system_, mode, t, x, dxdt, all(rates));
        call_rates(*system_, mode, t, x, negated(dxdt), all(rates));
        for (std::size_t i = 0; i < size(); ++i) rates[i] = -rates[i];
    }

    /// Rates of all guards at once by the central difference along the flow.
    void difference(Mode mode, double t, const X& x, const X& dxdt, double scale, Doubles& rates)
    {
        const double delta = 1e-5 * scale;
        const double ahead = backward_ ? -delta : delta;
        if (there_.size() != x.size()) there_ = x;
        detail::move(there_, x, delta, dxdt);
        call_guards(*system_, mode, t + ahead, there_, all(rates));
        detail::move(there_, x, -delta, dxdt);
        call_guards(*system_, mode, t - ahead, there_, all(behind_));
        for (std::size_t i = 0; i < size(); ++i) {
            rates[i] = records_[i].info.boolean ? 0 : (rates[i] - behind_[i]) / (2 * delta);
        }
    }

    const System* system_;
    bool backward_;
    std::size_t count_;
    double armed_at_ = std::numeric_limits<double>::quiet_NaN();  ///< [s]
    bool waiting_ = false;    ///< whether any guard may be on a plateau
    bool bands_ = false;      ///< whether any guard declares one
    bool selective_ = false;  ///< whether any guard is disabled or has no rate
    bool screened_ = false;   ///< whether `suspects_` is of the step in hand
    Doubles sign_{}, g0_{}, rate0_{}, g1_{}, rate1_{}, behind_{};
    /// Where in the step in hand the guards have been evaluated.
    enum class Looked : std::uint8_t { not_at_all, inside, further, everywhere };
    Looked looked_ = Looked::not_at_all;
    bool marked_ = false;  ///< whether `marks_` is of the step in hand
    struct None {};
    [[no_unique_address]] std::conditional_t<looks, Doubles, None> inside_{}, further_{};
    [[no_unique_address]] std::conditional_t<looks, Doubles, None> worst_{};  ///< of further looks
    [[no_unique_address]] std::conditional_t<keeps_sizes, Doubles, None> sizes_{};
    X there_{};
    GuardList<std::size_t, fixed> suspects_;
    GuardList<std::size_t, fixed> marks_;  ///< guards in doubt
    PerGuard<GuardRecord, fixed> records_{};
};

}  // namespace ricochet::detail
