// Internal: the declarations of this header may change without notice.
//
// Converts a detector and a locator of any type to the tables that the loop uses.
#pragma once

#include <cstdint>
#include <type_traits>

#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/meter.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/planned.hpp"

namespace ricochet::detail {

/// Inputs of a network that predicts the events of a step.
template <class System, class X>
class StepToCome {
    using D = SystemAdapter<System, X>;

public:
    StepToCome(D& adapter, const StepState<CoreState<X>>& step)
        : step_(&step), x0_(&adapter.read(step.x0, 0)), rate0_(&adapter.read(step.rate0, 1))
    {
    }

    [[nodiscard]] double time(double s) const noexcept { return step_->time(s); }
    [[nodiscard]] double h() const noexcept { return step_->h; }
    [[nodiscard]] const X& x0() const noexcept { return *x0_; }
    [[nodiscard]] const X& rate0() const noexcept { return *rate0_; }

private:
    const StepState<CoreState<X>>* step_;
    const X* x0_;
    const X* rate0_;
};

template <class Detector, class System, class X>
class DetectorTableOf {
    using D = SystemAdapter<System, X>;
    using C = CoreState<X>;
    using Self = const void*;

    [[nodiscard]] static const Detector& self(Self detector) noexcept
    {
        return *static_cast<const Detector*>(detector);
    }
    [[nodiscard]] static D& at(void* adapter) noexcept { return *static_cast<D*>(adapter); }

    static void add_deferral(DetectorTable<C>& table, const Detector& detector)
    {
        table.defers = true;
        table.needs_bounds = Detector::needs_bounds;
        table.deferred = Detector::deferred;
        table.longest = detector.longest();
        table.checks_bounds = detector.checks_bounds();
        table.margin = detector.margin();
        table.sure = [](Self d, const GuardBound& bound, double band) {
            return self(d).sure(bound, band);
        };
        table.hoped = [](Self d, const GuardBound& bound, double slope, double band) {
            return self(d).hoped(bound, slope, band);
        };
        table.closes = [](Self d, const GuardBound& from, const GuardBound& to, double tau,
                          double band) { return self(d).closes(from, to, tau, band); };
        if constexpr (requires(const System& s, const GuardInMode& of, const MotionTube<C>& tube) {
                          Detector::template along<X>(s, of, tube);
                      }) {
            table.along = [](Self, void* adapter, const GuardInMode& of,
                             const MotionTube<C>& tube) {
                return Detector::template along<X>(at(adapter).system(), of, tube);
            };
        }
        if constexpr (requires(const System& s, const X& x) {
                          detector.horizon(s, Mode{}, 0.0, x);
                      }) {
            table.horizon = [](Self d, void* adapter, Mode mode, double t, const C& x) {
                const auto answer =
                    self(d).horizon(at(adapter).system(), mode, t, at(adapter).read(x, 0));
                return GateAnswer{answer.cleared, answer.outside};
            };
        }
        if constexpr (requires(const System& s, const X& x) {
                          detector.level(s, std::size_t{}, Mode{}, 0.0, x);
                      }) {
            table.lowest_level = detector.lowest_level();
            table.level = [](Self d, void* adapter, GuardInMode of, double t, const C& x) {
                const auto answer = self(d).level(at(adapter).system(), of.which, of.mode, t,
                                                  at(adapter).read(x, 0));
                return GateAnswer{answer.cleared, answer.outside};
            };
        }
    }

    static bool clears(Self detector, void* adapter, const StepState<C>& step, std::uint64_t& calls)
    {
        const GuardView<System, X> guard(at(adapter).system(), calls,
                                         {.mode = step.mode, .backward = step.backward});
        return self(detector).clears(guard, StepToCome<System, X>(at(adapter), step));
    }

    static void fill(DetectorTable<C>& table, const Detector& detector)
    {
        table.type = written_type<Detector>();
        table.screening = screening_of<Detector>;
        table.uses_rates = Detector::uses_rates;
        table.checks_inside = ChecksInside<Detector>;
        table.evidence = Detector::evidence;
        table.suspects = [](double sign, const GuardSample& start, const GuardSample& end) {
            return Detector::suspects(sign, start, end);
        };
        table.leaves_plainly = [](double sign, const GuardSample& start, const GuardSample& end,
                                  double touch) {
            return Detector::leaves_plainly(sign, start, end, touch);
        };
        table.examine = [](Self d, GuardPath& path, Watch& watch) {
            return self(d).examine(path, watch);
        };
        if constexpr (requires(const System& s, const X& x) { detector.check(s, x, 0.0, 0.0); }) {
            table.check = [](Self d, void* adapter, const C& x, double smallest, double largest) {
                self(d).check(at(adapter).system(), at(adapter).read(x, 0), smallest, largest);
            };
        }
        if constexpr (predicts) {
            table.clears = &clears;
            table.checks_every_step = Detector::checks_every_step;
        }
        if constexpr (defers_checks<Detector, System, X>()) add_deferral(table, detector);
        if constexpr (Metering<Detector>) table.metering = &detector.metering();
    }

public:
    static constexpr bool predicts =
        requires(const Detector& detector, const StepToCome<System, X>& step,
                 const GuardView<System, X>& guard)
    {
        detector.clears(guard, step);
    };

    [[nodiscard]] static DetectorTable<C> make(const Detector& detector)
    {
        constexpr bool is_locator = requires
        {
            &Detector::locate;
        };
        static_assert(!is_locator,
                      "ricochet: found a locator in the place of the detector; expected stepping, "
                      "detector, locator");
        static_assert(is_locator || ricochet::Detector<Detector>,
                      "ricochet: found a detector that does not have the members of one; expected "
                      "those of the concept Detector, in ricochet/finding.hpp");
        DetectorTable<C> table;
        if constexpr (ricochet::Detector<Detector>) fill(table, detector);
        return table;
    }
};

template <class Locator>
[[nodiscard]] LocatorTable locator_table() noexcept
{
    static_assert(ricochet::Locator<Locator>,
                  "ricochet: found a locator without locate(GuardPath&, GuardSample, GuardSample, "
                  "double) const; expected one that returns a Location");
    return {.type = written_type<Locator>(),
            .locate = [](const void* self, GuardPath& path, const GuardSample& lo,
                         const GuardSample& hi, double tolerance) -> Location {
                return static_cast<const Locator*>(self)->locate(path, lo, hi, tolerance);
            },
            .yields_to_series = std::is_same_v<Locator, Newton>};
}

}  // namespace ricochet::detail
