// All guards of a system at the ends of a step.
//
// What every step needs of every guard lies in plain arrays, so that a hundred guards
// are screened in one loop; what only events need lies beside them.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "ricochet/detect/finding.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/hybrid/event.hpp"
#include "ricochet/hybrid/guard_view.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/integrate/shrinking_intervals.hpp"

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
    bool rested = false;           ///< its events have accumulated
    Side awaited = Side::plateau;  ///< on a plateau: leaving it away from here is an event
    bool acting = false;           ///< resets, or may end the run; else a notification
    bool asleep = false;           ///< its check is put off: nothing in the bank is of this step
    Side side = Side::plateau;
    Side next = Side::plateau;  ///< at the end of the step, if it stands
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
    GuardBank(const System& system, bool backward)
        : system_(&system), backward_(backward), count_(guard_count_of<X>(system))
    {
        if constexpr (fixed == counted_at_run_time) {
            for (auto* numbers : {&sign_, &g0_, &rate0_, &g1_, &rate1_, &behind_, &sizes_})
                numbers->resize(count_);
            records_.resize(count_);
        }
        for (std::size_t i = 0; i < count_; ++i) {
            records_[i].info = guard_info_of<X>(system, i);
            bands_ = bands_ || records_[i].info.touch > 0;
        }
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
        if (Detector::uses_rates) {
            for (std::size_t i = 0; i < size(); ++i) note_size(i, g0_[i]);
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
    }

    /// Whether any guard deserves a look.
    [[nodiscard]] bool suspicious(double h) const noexcept
    {
        if (waiting_ && leaves_plateau()) return true;
        if (bands_) [[unlikely]]
            return suspicious_with_bands(h);
        double any = 0;  // a double, so that the loop is vectorised
        for (std::size_t i = 0; i < size(); ++i) {
            const bool suspected =
                Detector::suspects(sign_[i], g0_[i], rate0_[i], g1_[i], rate1_[i], h);
            any = (suspected & (sign_[i] != 0)) ? 1.0 : any;
        }
        return any != 0;
    }

    [[nodiscard]] bool suspicious(std::size_t i, double h) const noexcept
    {
        const double band = sign_[i] * records_[i].info.touch;  // worth a look if it is reached
        return sign_[i] != 0 &&
               Detector::suspects(sign_[i], g0_[i] - band, rate0_[i], g1_[i] - band, rate1_[i], h);
    }

    /// The first guard that is not a number at the end of the step, or `no_guard`.
    [[nodiscard]] std::size_t first_nan(double h) const noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
            const bool idle = !records_[i].enabled || records_[i].asleep;
            if (!idle && std::isnan(g1_[i]) && (sign_[i] == 0 || suspicious(i, h))) return i;
        }
        return no_guard;
    }

    [[nodiscard]] GuardSample start(std::size_t i) const noexcept
    {
        return {.s = records_[i].from, .value = g0_[i], .rate = known(rate0_[i])};
    }
    [[nodiscard]] GuardSample end(std::size_t i, double h) const noexcept
    {
        return {.s = h, .value = g1_[i], .rate = known(rate1_[i])};
    }

    /// Half the width of the band around the surface that counts as being on it where
    /// the rate is zero. The values of a guard with declared bounds may never be taken where
    /// it is far away; its size is that of the values at which it was armed and of this step.
    [[nodiscard]] double touch(std::size_t i) const noexcept
    {
        if constexpr (Bounded<System, X>) {
            return touch_of(i, std::fmax(std::fabs(g0_[i]), std::fabs(g1_[i])));
        } else {
            return touch_of(i, 0);
        }
    }

    /// As `touch`, in a stretch in which |g| reaches `largest`.
    [[nodiscard]] double touch_of(std::size_t i, double largest) const noexcept
    {
        constexpr double ulps = 64 * std::numeric_limits<double>::epsilon();
        return std::fmax(records_[i].info.touch, ulps * std::fmax(sizes_[i], largest));
    }

    void arm(std::size_t i, Side side) noexcept
    {
        records_[i].side = side;
        sign_[i] = records_[i].enabled && !records_[i].asleep ? sign_of(side) : 0;
    }

    /// The width [s] below which a bracket in a step of length h is a matter of the guard's
    /// rounding: that of a guard with declared bounds, which may be dear, is not narrowed
    /// further. 0 for any other.
    [[nodiscard]] double unresolved(std::size_t i, double h) const noexcept
    {
        if constexpr (Bounded<System, X> && Detector::uses_rates) {
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

    /// Nothing inside the step has been looked at.
    void begin_search() noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) records_[i].next = records_[i].side;
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
        double plateaus = 0;
        for (std::size_t i = 0; i < size(); ++i) {
            g0_[i] = g1_[i];
            plateaus = sign_[i] == 0 ? 1.0 : plateaus;
        }
        if (Detector::uses_rates) {
            for (std::size_t i = 0; i < size(); ++i) {
                rate0_[i] = rate1_[i];
                if constexpr (!Bounded<System, X>) note_size(i, g1_[i]);
            }
        }
        if (plateaus == 0) return;
        for (std::size_t i = 0; i < size(); ++i) leave_plateau(i);
    }

    /// A guard on a plateau takes the side that it is on at the end of the step.
    void leave_plateau(std::size_t i) noexcept
    {
        if (sign_[i] == 0 && records_[i].enabled && !records_[i].asleep) arm(i, side_of(g1_[i]));
    }

    /// As `pass_on`, after events inside the step.
    void pass_on_after_events() noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
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
            visit(g0_[i]);
            visit(rate0_[i]);
            visit(record.enabled);
            visit(record.side);
            visit(sizes_[i]);
            visit(record.events);
            visit(record.last);
            visit(record.last_side);
            visit(record.band);
            visit(record.rested);
            visit(record.awaited);
            if constexpr (puts_off) visit(record.asleep);
            record.intervals.visit(visit);
        }
        visit(waiting_);
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
        if (std::isnan(g1_[i])) return true;
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

    [[gnu::noinline]] bool suspicious_with_bands(double h) const noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
            if (suspicious(i, h)) return true;
        }
        return false;
    }

    void note_size(std::size_t i, double g) noexcept
    {
        const double size = std::fabs(g);
        sizes_[i] = size > sizes_[i] ? size : sizes_[i];
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
    bool waiting_ = false;  ///< whether any guard may be on a plateau
    bool bands_ = false;    ///< whether any guard declares one
    Doubles sign_{}, g0_{}, rate0_{}, g1_{}, rate1_{}, behind_{}, sizes_{};
    X there_{};
    PerGuard<GuardRecord, fixed> records_{};
};

}  // namespace ricochet::detail
