// Search for the events of a step, and for the first set among them.
//
// Acting guards, which have a reset or end the run, cut the step short at the first
// set of events. The set does not depend on the order in which the guards are
// declared: every candidate is located by itself, the earliest first, and
// every other guard that has left its side by the end of the window is located too. Guards
// that are only recorded are located on the step's polynomial, one at a time, up to there.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/event_hit.hpp"
#include "core/guard_table.hpp"
#include "core/step.hpp"
#include "core/step_cover.hpp"
#include "core/tolerances.hpp"
#include "resolved_parts.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/series_guard.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/options.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet::detail {

template <class X, bool single>
class EventSearch {
    using CurrentStep = Step<X>;
    using Guards = GuardTable<X, single>;
    using Probe = StepProbe<CoreGuard<X>, Step<X>>;

public:
    /// Keeps a reference to the finders.
    EventSearch(const SystemAt<X>& system, const X& like, std::size_t guards,
                const Finders<X>& finders, const Options& options)
        : finders_(&finders),
          space_(like),
          before_(like),
          rate_(like),
          lost_(like),
          kept_space_(like),
          kept_rate_(like),
          hits_(guards),
          fired_(guards),
          resolution_(options),
          signs_(finders.detector,
                 system->bounded && !defers(finders.detector, *system.operator->()), options),
          evidence_(finders.detector.evidence)
    {
        if (!single && defers(finders.detector, *system.operator->())) {
            cover_.emplace(system, finders, resolution_);
        }
    }

    /// Starts on another step; the state may have changed its dimension.
    void begin(const X& like)
    {
        fit(like);
        notes_.clear();
        states_.clear();
        parts_.clear();
        refined_ = unresolved_ = false;
        creep_.reset();
    }

    /// Work space for a state of the dimension of `like`, for use when no search is continuing.
    [[nodiscard]] X& space(const X& like)
    {
        fit(like);
        return space_.x;
    }

    [[nodiscard]] GuardList<std::size_t, single>& fired() noexcept { return fired_; }
    [[nodiscard]] std::vector<Note>& notes() noexcept { return notes_; }
    /// Crossings of guard i that are found, but not yet recorded.
    [[nodiscard]] std::uint64_t noted(std::size_t i) const noexcept
    {
        return static_cast<std::uint64_t>(std::count_if(
            notes_.begin(), notes_.end(),
            [i](const Note& note) { return note.guard == i && note.kind != EventKind::touch; }));
    }
    [[nodiscard]] Evidence evidence() const noexcept { return evidence_; }

    /// Whether the step was divided to resolve a guard, and whether that was not enough.
    [[nodiscard]] bool refined() const noexcept
    {
        return refined_ || (has_cover() && cover_->refined());
    }
    [[nodiscard]] bool unresolved() const noexcept
    {
        return unresolved_ || (has_cover() && cover_->unresolved());
    }

    /// What declared bounds tell of guards inside the current step, where checks may be deferred.
    [[nodiscard]] StepCover<X, single>& cover() noexcept
    {
        assert(has_cover());
        return *cover_;
    }

    /// What the bounds of guard i tell of the current step, at whose ends it has these values.
    [[nodiscard]] Covered cover(const CurrentStep& step, const Guards& guards, std::size_t i,
                                double start, double end, std::uint64_t& calls)
    {
        const auto guard = guards.view(i, step.mode(), calls);
        const GuardSample from{.s = 0, .value = start}, to{.s = step.h(), .value = end};
        return cover_->first_event(step, guards, guard, guards[i].side, from, from, to);
    }

    /// What enclosures of guard i tell of the current step. @param interval  [s] length of the
    /// first part that is tried; 0: the whole step
    [[nodiscard]] Covered cover_by_tubes(const CurrentStep& step, const Guards& guards,
                                         std::size_t i, double interval, Statistics& counts)
    {
        constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
        const auto guard = guards.view(i, step.mode(), counts.guard_calls);
        const GuardSample from{.s = 0, .value = unknown}, to{.s = step.h(), .value = unknown};
        cover_->try_first(interval);
        return cover_->first_event(step, guards, guard, guards[i].side, from, from, to);
    }

    /// Whether the bounds of guard i, which ends the step on its side, show an event inside.
    [[nodiscard]] bool bounds_show_event(const CurrentStep& step, const Guards& guards,
                                         std::size_t i, std::uint64_t& calls)
    {
        const GuardSample end = guards.end(i, step.h());
        if (guards[i].info.boolean)
            return has_cover() && cover_->in_use() && changes_inside(step, guards, i, calls);
        if (!is_covered(guards[i]) || !(sign_of(guards[i].side) * end.value > 0)) return false;
        const auto guard = guards.view(i, step.mode(), calls);
        Probe probe(guard, step, space_);
        return cover_between(probe, guards, guards[i].side, guards.start(i), end).leaves;
    }

    /// Whether a guard of which only the sign has a meaning has left its side inside the step.
    [[nodiscard]] bool changes_inside(const CurrentStep& step, const Guards& guards, std::size_t i,
                                      std::uint64_t& calls)
    {
        const auto guard = guards.view(i, step.mode(), calls);
        Probe probe(guard, step, space_);
        for (const double u : signs_.places_screened(step.h())) {
            if (has_left(guards[i].side, probe.dense_value(u * step.h()).value)) return true;
        }
        return false;
    }
    /// Whether guards of which only the sign has a meaning are evaluated at all places inside a
    /// step of this length.
    [[nodiscard]] bool checks_signs_closely(double h) const noexcept { return signs_.is_long(h); }

    /// Whether the set was only found at a step after the one that held it.
    [[nodiscard]] bool late() const noexcept { return late_; }

    /// Offset [s] of the set, as offset + remainder, and the state there.
    [[nodiscard]] double at() const noexcept { return at_; }
    [[nodiscard]] double at_remainder() const noexcept { return at_remainder_; }
    [[nodiscard]] X& before() noexcept { return before_; }

    /// Places the next set at the start of the step.
    void stay_at_start() noexcept
    {
        at_ = at_remainder_ = 0;
        rated_at_set_ = values_known_ = false;
    }
    /// Places the current set at the end of the step.
    void stay_at_end(const CurrentStep& step)
    {
        at_ = step.h();
        at_remainder_ = 0;
        rated_at_set_ = straight_in_space_ = has_lost_ = values_known_ = false;
        assign(before_, step.x1());
    }
    /// Adds guard i to the set at the end of the step, where it leaves `side` within rounding.
    void join_at_end(const CurrentStep& step, std::size_t i, Side side, double rate);
    [[nodiscard]] bool was_joined(const CurrentStep& step, std::size_t i) noexcept
    {
        return where(i).lo == step.h();
    }

    [[nodiscard]] const Location& where(std::size_t guard) noexcept { return hit_of(guard).where; }

    /// Offset [s] of the first event of the set that was found.
    [[nodiscard]] double first_root() noexcept;

    /// Side that a guard of the set leaves. Within the step it may have come there from the other.
    [[nodiscard]] Side side_left(std::size_t guard) noexcept { return hit_of(guard).side; }

    /// Finds the first set of acting guards in the step; a time event that is due at
    /// its end belongs to it if it lies in the window. False: none.
    [[nodiscard]] bool find_set(const CurrentStep& step, Guards& guards, bool time_event_due,
                                std::uint64_t& calls)
    {
        hits_.clear();
        fired_.clear();
        evidence_ = finders_->detector.evidence;
        late_ = rated_at_set_ = values_known_ = straight_in_space_ = has_lost_ = false;
        change_.known = false;
        std::size_t suspects = 0;
        std::size_t last = 0;
        for (const std::size_t i : guards.suspects()) {
            if (!guards[i].acting || !guards.still_suspicious(i, step.h())) continue;
            ++suspects;
            last = i;
        }
        if (suspects == 0) return false;
        if (suspects == 1 && guards.has_series(last) && find_by_series(step, guards, last, calls)) {
            settle_place(step, time_event_due);
            return true;
        }
        guards.complete_rates(step, calls);
        if (suspects == 1) {
            if (!find_only(step, guards, last, calls)) return false;
        } else if (!find_among(step, guards, calls)) {
            return false;
        }
        settle_place(step, time_event_due);
        assert(!fired_.empty() && at_ >= 0 && at_ <= step.h());
        return true;
    }

    /// Moves the set along the flow to the first place at which every guard of it has left its side
    /// in floating point, so that a reset that asks for the condition of its event finds it true:
    /// to the root predicted by the slopes of those that have not, at most as far as the bracket
    /// within which they were located. False: nowhere, and nothing is moved.
    bool meet_conditions(const CurrentStep& step, Guards& guards, std::uint64_t& calls);

    /// The same for a set whose time is given: only the state is moved.
    bool meet_conditions_on_time(const CurrentStep& step, Guards& guards, std::uint64_t& calls);

    /// Adds the crossings and touches of a recorded guard, up to the sample `end`.
    void note_crossings(const CurrentStep& step, Guards& guards, std::size_t i,
                        const GuardSample& end, std::uint64_t& calls);

    /// Adds a located crossing of an acting guard that did not change anything; `keeps_state` if
    /// its state will be recorded.
    void note(std::size_t i, Side side, bool keeps_state)
    {
        notes_.push_back({.guard = i, .kind = kind_of(where(i)), .side = side, .where = where(i)});
        if (!keeps_state) return;
        notes_.back().state = states_.size();
        states_.push_back(before_);
    }

    /// Continues the search after a crossing that changes nothing.
    void pass(const CurrentStep& step, Guards& guards, std::size_t i, std::uint64_t& calls);

    /// A guard that leaves its plateau in the step on the side away from the awaited one is
    /// armed on the awaited side from there on.
    void end_plateau(const CurrentStep& step, Guards& guards, std::size_t i, std::uint64_t& calls)
    {
        const Side awaited = guards[i].awaited;
        const auto guard = guards.view(i, step.mode(), calls);
        Probe probe(guard, step, space_);
        double on = 0;
        double off = step.h();
        while (off - on > finest_bracket(off, step.h())) {
            const double middle = on + (off - on) / 2;
            if (!(middle > on && middle < off)) break;
            (side_of(probe.value(middle).value) == opposite(awaited) ? off : on) = middle;
        }
        guards.go_on_from(i, awaited, away(awaited, on));
    }

    /// The value and rate of a guard where the set happens.
    [[nodiscard]] GuardSample sample_at_set(const CurrentStep& step, Guards& guards, std::size_t i,
                                            std::uint64_t& calls)
    {
        const auto guard = guards.view(i, step.mode(), calls);
        const double t = step.time(at_);
        GuardSample sample{.s = at_, .value = guard.value(t, before_)};
        if (!guards[i].info.boolean) {
            if (!rated_at_set_) step.flow(at_, before_, rate_);
            rated_at_set_ = true;
            sample.rate = guard.rate(t, before_, rate_, step.h());
        }
        return sample;
    }

    /// A state on the line along the flow through the set at which guard i is strictly beyond its
    /// surface, at most 4 ulp of the time past its bracket; returns its time, NaN if there is none.
    [[nodiscard]] double go_beyond(const CurrentStep& step, Guards& guards, std::size_t i, X& x,
                                   std::uint64_t& calls);

    /// What rounding has taken from component c of the state at the set, where it is known.
    [[nodiscard]] double lost_at_set(const CurrentStep& step, std::size_t c) const noexcept
    {
        const auto i = static_cast<decltype(before_.size())>(c);
        if (has_lost_) return lost_[i];
        if (!straight_in_space_) return at_remainder_ == 0 ? step.lost_at(at_, c) : 0;
        return lost_from(step, straight_from_, space_.x, space_.dxdt, c);
    }

    /// Stores `lost_at_set` of all components, since repeats of the step forget it.
    void keep_lost(const CurrentStep& step)
    {
        if (before_.size() > tolerances::remembered_components) return;
        for (std::size_t c = 0; c < static_cast<std::size_t>(before_.size()); ++c) {
            lost_[static_cast<decltype(before_.size())>(c)] = lost_at_set(step, c);
        }
        has_lost_ = true;
    }

    /// Keeps the work space, in which the set may lie on a line along the flow, for
    /// `put_space_back` after other searches in the step.
    void keep_space()
    {
        kept_space_ = space_;
        assign(kept_rate_, rate_);
        kept_rated_ = rated_at_set_;
    }
    void put_space_back()
    {
        space_ = kept_space_;
        assign(rate_, kept_rate_);
        rated_at_set_ = kept_rated_;
    }

    /// Whether any note takes its state from the step's polynomial.
    [[nodiscard]] bool shows_polynomial() const noexcept
    {
        return std::any_of(notes_.begin(), notes_.end(), [this](const Note& note) {
            return note.state >= states_.size() && note.where.root < at_;
        });
    }

    /// Value |g| at the set, where `meet_conditions` has evaluated the guard; else NaN.
    [[nodiscard]] double value_at_set(std::size_t i) noexcept
    {
        return values_known_ ? std::fabs(hit_of(i).value)
                             : std::numeric_limits<double>::quiet_NaN();
    }

    /// Keeps the flow at the set, or where the motion is straight until there.
    void keep_rate(const CurrentStep& step)
    {
        if (rated_at_set_) {
        } else if (straight_in_space_) {
            assign(rate_, space_.dxdt);
        } else {
            step.flow(at_, before_, rate_);
        }
        rated_at_set_ = true;
    }
    /// Whether guard i is a candidate that was still so far from its surface at the end of the
    /// window that its event is another one.
    [[nodiscard]] bool comes_later(const CurrentStep& step, const Guards& guards,
                                   std::size_t i) noexcept
    {
        for (const Hit& hit : hits_) {
            if (hit.guard != i) continue;
            // Its rate there is at most a few times its size over the step.
            const double moves = guards.scale(i, step.h()) / step.h() * reach_of(step, at_);
            return !hit.departed && !hit.located && std::fabs(hit.value) > 64 * moves;
        }
        return false;
    }

    /// Whether a guard crosses its surface with the set, that is, lies within rounding of it
    /// there. `sample` holds the rate of the guard.
    [[nodiscard]] bool crosses_with_set(const CurrentStep& step, const Guards& guards,
                                        std::size_t i, const GuardSample& sample) const
    {
        const double reach = reach_of(step, sample.s);
        // A guard that acts must be located in the set; one that is only recorded may be as far
        // from its surface as the rounding of its largest values.
        const double tolerance = guards[i].acting ? 0 : guards.touch(i, step.h());
        return std::fabs(sample.value) <= std::max(std::fabs(sample.rate) * reach, tolerance);
    }

    /// Adds a crossing that happens with the set.
    void note_at_set(Guards& guards, std::size_t i, Side side, double slope)
    {
        notes_.push_back({.guard = i,
                          .kind = EventKind::crossing,
                          .side = side,
                          .where = {.lo = at_, .hi = at_, .root = at_, .slope = slope}});
        guards.arm(i, opposite(side));
    }

    /// Drops the crossings beyond the offset s, and sorts the rest by time.
    void keep_notes_until(double s)
    {
        if (!notes_.empty()) sort_notes_until(s, notes_);
    }

    /// State at a crossing: that of its location, or on the step's polynomial.
    [[nodiscard]] const X& state_at(const CurrentStep& step, const Note& note)
    {
        if (note.state < states_.size()) return states_[note.state];
        step.interpolate(note.where.root, space_.x);
        return space_.x;
    }

    std::uint64_t disabled = 0;

private:
    /// Distance in time [s] over which an event at offset s is not certain: the rounding of a step
    /// of length s moves it by a few ulp(s).
    [[nodiscard]] double reach_of(const CurrentStep& step, double s) const noexcept
    {
        const double rounding = tolerances::of_location * s;
        return std::max(resolution_.blur(step.time(s)), rounding);
    }

    static constexpr int most_rounds = 1'000'000;

    [[nodiscard]] bool has_cover() const noexcept { return !single && cover_; }
    /// Whether the guard is covered by bounds inside steps.
    [[nodiscard]] bool is_covered(const GuardRecord& record) const noexcept
    {
        return has_cover() && cover_->covers(record);
    }

    /// The hit of a guard of the set.
    [[nodiscard]] Hit& hit_of(std::size_t guard) noexcept
    {
        if constexpr (!single) {
            for (Hit& hit : hits_) {
                if (hit.guard == guard) return hit;
            }
        }
        return hits_[0];
    }

    void fit(const X& like)
    {
        if (space_.x.size() != like.size()) {
            space_ = ProbeSpace<X>(like);
            before_ = rate_ = lost_ = kept_rate_ = like;
        }
    }

    /// Whether an interval with both ends on the surface is a plateau; its middle and a place that
    /// no symmetry singles out are evaluated.
    [[nodiscard]] static bool is_plateau(Probe& probe, const Watch& watch)
    {
        const double width = watch.end.s - watch.start.s;
        return watch.end.value == 0 &&
               std::fabs(watch.start.value) <= std::numeric_limits<double>::min() &&
               probe.value(watch.start.s + 0.5 * width).value == 0 &&
               probe.value(watch.start.s + 0.381966 * width).value == 0;
    }

    /// Next event of the guard in the interval. A touch is added, and a clear interval
    /// determines on which side the guard is at its end.
    [[nodiscard]] Finding next_finding(Probe& probe, Watch& watch, Guards& guards, std::size_t i)
    {
        if (is_over(probe, watch, guards[i])) return Finding::clear(evidence_);
        if (guards[i].info.boolean)
            return heed(guards, i, watch, next_change(probe, watch, guards, i));
        if (guards.has_series(i))
            return heed(guards, i, watch, next_on_series(probe, watch, guards, i));
        if (is_covered(guards[i]))
            return heed(guards, i, watch, next_under_bound(probe, watch, guards));
        if (!guards.checked())
            return heed(guards, i, watch, next_by_own_size(probe, watch, guards, i));
        return heed(guards, i, watch, next_in_parts(probe, watch, guards, i));
    }

    /// The next event in the interval, from the guard's power series. If the series is not sure,
    /// or contradicts the values at the ends, the detector is asked.
    [[nodiscard]] Finding next_on_series(Probe& probe, Watch& watch, const Guards& guards,
                                         std::size_t i);

    /// The next event of a guard of which only the sign has a meaning, from its values at the
    /// places inside the step at which it is evaluated.
    [[nodiscard, gnu::noinline]] Finding next_change(Probe& probe, Watch& watch,
                                                     const Guards& guards, std::size_t i) const
    {
        const GuardSample start = watch.start, end = watch.end;
        const double h = probe.step().h();
        std::array<GuardSample, SignChecks::most + 1> samples;
        std::size_t count = 0;
        int changes = 0;
        Side side = watch.side;
        const auto add = [&](const GuardSample& sample) {
            samples[count++] = sample;
            if (!has_left(side, sample.value)) return false;
            side = opposite(side);
            ++changes;
            return counts(opposite(side), probe.crossing());
        };
        // The bits of an event must not depend on where else the guard has been evaluated.
        const bool whole = resolution_.is_finest();
        for (const double u : signs_.places(h, guards.checked_everywhere())) {
            if (!(u * h > start.s && u * h < end.s)) continue;
            const GuardSample known = guards.known_at(u, i, h);
            if (add(known.s > 0 ? known : probe.dense_value(u * h)) && !whole) break;
        }
        add(end);
        if (changes == 1 && whole) return Ends::compare_signs(probe, watch);
        for (std::size_t k = 0;; ++k) {
            watch.end = samples[k];
            const Finding finding = Ends::compare_signs(probe, watch);
            if (finding.hit || k + 1 == count) return finding;
            watch.side = watch.side_after;
            watch.start = watch.end;
        }
    }

    /// Finding of the detector; where it finds no departure, the bounds of the guard are asked.
    [[nodiscard]] Finding next_under_bound(Probe& probe, Watch& watch, const Guards& guards)
    {
        const Finding finding = finders_->examine(probe, watch);
        if (finding.hit) return finding;
        const Covered covered = cover_between(probe, guards, watch.side, watch.start, watch.end);
        const bool touches_first = finding.touch && finding.hi.s <= covered.lo;
        if (!covered.leaves || touches_first) return finding;
        return departure(probe, watch, covered);
    }

    /// What the bounds of a guard tell of an interval.
    [[nodiscard]] Covered cover_between(const Probe& probe, const Guards& guards, Side side,
                                        const GuardSample& start, const GuardSample& end)
    {
        if (start.value == 0 && end.value == 0) return {.proved = false};  // it may rest there
        return cover_->first_event(probe.step(), guards, probe.guard(), side, start, start, end);
    }

    [[nodiscard]] static Finding departure(Probe& probe, const Watch& watch, const Covered& covered)
    {
        const bool from_start = covered.lo == watch.start.s && covered.side == watch.side;
        const GuardSample lo = from_start ? watch.start : probe.dense_value_and_rate(covered.lo);
        return Finding::leaving(covered.side, lo, probe.dense_value_and_rate(covered.hi));
    }

    /// The departure that the bounds of the guard show before the end of one that the detector has
    /// found.
    [[nodiscard]] std::optional<Finding> earlier(Probe& probe, const Watch& watch,
                                                 const Guards& guards, const Finding& finding,
                                                 const GuardSample& end)
    {
        if (finding.late || !is_covered(guards[probe.guard().which()])) return std::nullopt;
        const Covered covered = cover_->first_event(probe.step(), guards, probe.guard(), watch.side,
                                                    watch.start, finding.lo, end);
        if (!covered.leaves || !(covered.hi < end.s)) return std::nullopt;
        return departure(probe, watch, covered);
    }

    /// The finding of one candidate among several, or the earlier departure that its bounds show.
    /// (The candidate with the first root is located first.)
    [[nodiscard]] Finding first_under_bound(Probe& probe, const Watch& watch, const Guards& guards,
                                            const Finding& finding)
    {
        const auto before = earlier(probe, watch, guards, finding, finding.hi);
        return before && before->hi.s < guess(finding) ? *before : finding;
    }

    /// Where the guard turns between two samples on the same side, falling towards the surface at
    /// the first and rising at the second; nothing where its sign there is a matter of rounding.
    [[nodiscard]] static std::optional<GuardSample> turn_between(Probe& probe,
                                                                 const GuardSample& lo,
                                                                 const GuardSample& hi);

    /// Finding of the detector. Some judge by the largest value of the guard so far: one that has
    /// decayed since and changes its side is judged by its values in this step.
    [[nodiscard]] Finding next_by_own_size(Probe& probe, Watch& watch, const Guards& guards,
                                           std::size_t i) const
    {
        const Watch given = watch;
        const Finding finding = finders_->examine(probe, watch);
        const double own = guards.touch_of(i, given.scale);
        if (finding.hit || !(own < 0.5 * given.touch)) return finding;
        if (!has_left(given.side, given.end.value)) return finding;
        const double rounded = std::max(own, probe.blur(given.end.s));
        const double from = given.start.s > 0 ? rounded : std::fabs(given.start.value);
        if (!(std::min(2 * from, std::fabs(given.end.value)) > rounded)) return finding;
        watch = given;
        watch.touch = rounded;
        return finders_->examine(probe, watch);
    }

    /// Finding of the detector on the parts of an interval, up to the first that is not clear.
    [[nodiscard]] Finding next_in_parts(Probe& probe, Watch& watch, const Guards& guards,
                                        std::size_t i)
    {
        parts_.resolve(probe, i, watch, guards[i].info.touch, guards.checked_everywhere());
        refined_ = refined_ || parts_.divided();
        unresolved_ = unresolved_ || parts_.unresolved();
        const Watch whole = watch;
        const GuardSample end = watch.end;
        const bool plain = resolution_.is_finest() && parts_.nearly_cubic() &&
                           whole.start.s == parts_.whole().start.s;
        while (const GuardSample* node = parts_.next(watch.start.s, end.s)) {
            watch.end = *node;
            judge_by_its_own_size(watch, guards, i);
            Finding finding = finders_->examine(probe, watch);
            if (plain && finding.hit && finding.hi.s == node->s && stays_beyond(whole, *node)) {
                finding.lo = whole.start;
                finding.hi = whole.end;
            }
            if (finding.hit || finding.touch) return finding;
            watch.side = watch.side_after;
            watch.start = *node;
        }
        watch.end = end;
        if (parts_.divided()) judge_by_its_own_size(watch, guards, i);
        return finders_->examine(probe, watch);
    }

    /// Takes the rounding of a guard that decays within the step from its size in this part of the
    /// step.
    static void judge_by_its_own_size(Watch& watch, const Guards& guards, std::size_t i) noexcept
    {
        const double width = watch.end.s - watch.start.s;
        const CubicCheck look(watch.start.value, watch.start.rate, watch.end.value, watch.end.rate,
                              width);
        if (!std::isfinite(look.size())) return;
        watch.scale = look.size();
        watch.touch = guards.touch_of(i, look.size());
    }

    /// Finding when no further evaluation can help: a remainder after an event at the end
    /// of a step belongs to the error of that event, and a plateau waits.
    [[nodiscard]] static bool is_over(Probe& probe, const Watch& watch, GuardRecord& record)
    {
        const double h = probe.step().h();
        if (record.examined.from > 0 &&
            watch.end.s - record.examined.from <= 8 * finest_bracket(watch.end.s, h)) {
            record.examined.next = record.side;
            return true;
        }
        if (record.examined.from > 0 && ends_within_rounding(probe, watch, record.examined.slope)) {
            record.examined.next = record.side;
            return true;
        }
        if (is_plateau(probe, watch)) {
            // After a crossing a guard that moves by no more than its rounding is not on a plateau.
            const double moves = std::fabs(watch.start.rate) * (watch.end.s - watch.start.s);
            const bool rated = std::fabs(watch.start.rate) > std::numeric_limits<double>::min();
            const bool crossing =
                record.examined.from > 0 && rated && moves <= probe.blur(watch.end.s);
            if (crossing) {
                record.examined.next = record.side;
            } else {
                record.examined.next = record.awaited = Side::plateau;
            }
            return true;
        }
        return false;
    }

    /// Whether the interval after an event is so short that the rounding of time and state hides on
    /// which side the guard is at its end.
    [[nodiscard]] static bool ends_within_rounding(Probe& probe, const Watch& watch, double slope)
    {
        if (side_of(watch.end.value) == watch.side) return false;
        constexpr double ulps = tolerances::of_location;
        const double width = watch.end.s - watch.start.s;
        const bool brief = width <= ulps * std::fabs(probe.step().time(watch.end.s));
        if (!brief &&
            !(std::isfinite(slope) && width <= tolerances::by_rounding * probe.step().h()))
            return false;
        const double blur = probe.blur(watch.end.s);
        return std::fabs(watch.end.value) <= blur && (brief || width * std::fabs(slope) <= blur);
    }

    /// Whether a guard that has left its side by `node` has no other event in the rest of
    /// the interval, which then is a bracket as good as any part of it.
    [[nodiscard]] bool stays_beyond(const Watch& whole, GuardSample node) const noexcept
    {
        const DetectorTable<X>& detector = finders_->detector;
        if (!detector.checks_inside) return false;
        const double sign = sign_of(whole.side);
        if (std::fabs(whole.start.value) <= whole.touch) return false;
        if (!finders_->leaves_plainly(sign, whole.start, whole.end, whole.touch)) return false;
        for (;;) {
            const GuardSample* next = parts_.next(node.s, whole.end.s);
            const GuardSample to = next ? *next : whole.end;
            if (detector.suspects(-sign, node, to)) return false;
            if (!next) return true;
            node = *next;
        }
    }

    [[nodiscard]] Finding heed(Guards& guards, std::size_t i, const Watch& watch,
                               const Finding& finding)
    {
        if (finding.touch) {
            touched(guards, i, finding.side, finding.hi.s);
        } else if (!finding.hit) {
            evidence_ = std::max(evidence_, finding.evidence);
            guards[i].examined.next = watch.side_after;
        }
        return finding;
    }

    /// Locates a departure; nothing where the step's own map has none, as `StepProbe::agree_on`.
    [[nodiscard]] std::optional<Location> find(Probe& probe, Finding finding, const Guards& guards,
                                               std::size_t i)
    {
        if (finding.late) {
            return Location{.slope = finding.lo.rate, .error = std::fabs(finding.lo.value)};
        }
        const double tolerance = std::max(resolution_.tolerance(probe.step().time(finding.hi.s)),
                                          guards.unresolved(i, probe.step().h()));
        if (guards[i].info.boolean) return find_change(probe, finding, guards, i, tolerance);
        if (!probe.agree_on(finding.lo, finding.hi, guards.start(i), guards[i].side)) {
            return std::nullopt;
        }
        const double departure = guards.departure(i, probe.step().h());
        if (guards.is_cubic(i, departure)) probe.take_as_cubic();
        return finders_->locate(probe, finding.lo, finding.hi, tolerance);
    }

    /// The same for a guard of which only the sign has a meaning. Of the ends of the bracket only
    /// those that the bisection leaves have to agree with the step's own map.
    [[nodiscard, gnu::noinline]] std::optional<Location> find_change(Probe& probe, Finding finding,
                                                                     const Guards& guards,
                                                                     std::size_t i,
                                                                     double tolerance)
    {
        const GuardSample start = guards.start(i);
        GuardSample lo = finding.lo, hi = finding.hi;
        bisect(probe, lo, hi, tolerance);
        const bool lo_agrees =
            lo.s != finding.lo.s || lo.s == start.s || !probe.has_left(probe.value(lo.s));
        const bool hi_agrees =
            hi.s != finding.hi.s || hi.s == probe.h() || probe.has_left(probe.value(hi.s));
        if (!lo_agrees || !hi_agrees) {
            if (!probe.agree_on(finding.lo, finding.hi, start, guards[i].side)) return std::nullopt;
            lo = finding.lo;
            hi = finding.hi;
            bisect(probe, lo, hi, tolerance);
        }
        const bool seen = hi.s != finding.hi.s || hi.s == probe.h();
        change_ = {.guard = i, .known = seen, .at = hi};
        return Location{.lo = lo.s, .hi = hi.s, .root = hi.s, .error = hi.s - lo.s};
    }

    /// Continues behind a departure that the step's own map does not have, on the map's side.
    [[gnu::noinline]] static void go_behind(Probe& probe, const Finding& finding, Guards& guards,
                                            std::size_t i)
    {
        GuardSample start = probe.value_and_rate(finding.hi.s);
        const Side side =
            has_left(finding.side, start.value) ? opposite(finding.side) : finding.side;
        if (start.value == 0) start.value = away(side, start.s).value;
        guards.go_on_from(i, side, start);
    }

    [[gnu::noinline]] void touched(Guards& guards, std::size_t i, Side side, double s)
    {
        notes_.push_back({.guard = i,
                          .kind = EventKind::touch,
                          .side = side,
                          .where = {.lo = s, .hi = s, .root = s, .slope = 0}});
        guards.go_on_from(i, side, away(side, s));
    }

    /// A sample at s of a guard that is on its surface, within rounding, and heads for `side`.
    [[nodiscard]] static GuardSample away(Side side, double s) noexcept
    {
        const double least = sign_of(side) * std::numeric_limits<double>::min();
        return {.s = s, .value = least, .rate = least};
    }

    void pass(Guards& guards, std::size_t i, Side side, const Location& where, Probe& probe)
    {
        GuardSample start = away(side, where.root);
        if (finders_->detector.uses_rates && !guards[i].info.boolean) {
            start.rate =
                std::isfinite(where.slope) ? where.slope : probe.value_and_rate(where.root).rate;
            if (start.rate == 0) start.rate = start.value;
        }
        guards.go_on_from(i, side, start);
        guards[i].examined.slope = where.slope;
    }

    /// Continues the search at the offset `behind` an event, on the side of the guard there.
    void pass_behind(Guards& guards, std::size_t i, Side side, double behind, Probe& probe)
    {
        const Side there = side_of(probe.value(behind).value);
        pass(guards, i, there == Side::plateau ? side : there,
             {.lo = behind,
              .hi = behind,
              .root = behind,
              .slope = std::numeric_limits<double>::quiet_NaN()},
             probe);
    }

    /// Whether guard i leaves its side once in the step, as plainly as its samples can show.
    /// @param e  `GuardTable::departure`
    [[nodiscard, gnu::always_inline]] bool goes_plainly(const Guards& guards, std::size_t i,
                                                        double h, double e) const
    {
        const Side side = guards[i].side;
        return guards[i].examined.from == 0 && !guards[i].info.boolean &&
               counts(side, guards[i].info.crossing) && guards.is_plain(i, h, e) &&
               finders_->leaves_plainly(sign_of(side), guards.start(i), guards.end(i, h),
                                        guards.touch(i, h));
    }

    void add_hit(std::size_t i, const Finding& finding) noexcept
    {
        Hit hit;
        hit.guard = i;
        hit.side = finding.side;
        hit.finding = finding;
        hits_.push_back(hit);
    }

    /// Adds a hit of an acting guard, and its touches before it.
    void examine(const CurrentStep& step, Guards& guards, std::size_t i, std::uint64_t& calls)
    {
        const bool covered = is_covered(guards[i]);
        if (!covered && goes_plainly(guards, i, step.h(), guards.departure(i, step.h()))) {
            return add_hit(
                i, Finding::leaving(guards[i].side, guards.start(i), guards.end(i, step.h())));
        }
        const auto guard = guards.view(i, step.mode(), calls);
        Probe probe(guard, step, space_);
        for (int round = 0; round < most_rounds; ++round) {
            Watch watch = guards.watch(i, step, guards.end(i, step.h()));
            const Finding finding = next_finding(probe, watch, guards, i);
            if (finding.touch) continue;
            if (!finding.hit) return;
            if (guards[i].examined.from > 0 && !finding.late) {
                probe.watch(finding.side);
                GuardSample lo = finding.lo;
                if (!probe.agree_on(lo, finding.hi, guards.start(i), guards[i].side)) {
                    go_behind(probe, finding, guards, i);
                    continue;
                }
            }
            late_ = late_ || finding.late;
            return add_hit(i, first_under_bound(probe, watch, guards, finding));
        }
    }

    /// Root of the cubic through the ends of the interval.
    [[nodiscard]] static double guess(const Finding& finding) noexcept
    {
        if (!std::isfinite(finding.lo.rate) || !std::isfinite(finding.hi.rate)) {
            return finding.hi.s;
        }
        const double width = finding.hi.s - finding.lo.s;
        const double u = hermite_root(finding.lo.value, finding.lo.rate * width, finding.hi.value,
                                      finding.hi.rate * width, sign_of(finding.side));
        const double root = finding.lo.s + u * width;
        return std::isfinite(root) ? root : finding.hi.s;
    }

    /// Locates a departure, or the one before it that the bounds of the guard show.
    [[nodiscard]] std::optional<Location> locate_first(Probe& probe, const Watch& watch,
                                                       const Guards& guards, Finding& finding)
    {
        for (;;) {
            probe.watch(finding.side);
            const auto where = find(probe, finding, guards, probe.guard().which());
            if (!where) return where;
            const GuardSample root{.s = where->root, .value = 0, .rate = where->slope};
            const auto before = earlier(probe, watch, guards, finding, root);
            if (!before) return where;
            finding = *before;
        }
    }

    /// Locates a candidate, and keeps the state at its root if it is the first so far.
    void locate(const CurrentStep& step, Guards& guards, Hit& hit, std::uint64_t& calls)
    {
        const auto guard = guards.view(hit.guard, step.mode(), calls);
        Probe probe(guard, step, space_);
        const Watch watch = guards.watch(hit.guard, step, guards.end(hit.guard, step.h()));
        hit.where = locate_first(probe, watch, guards, hit.finding).value();
        hit.located = true;
        if (first_ && first_->where.root <= hit.where.root) {
            // Which of two equal roots is kept must not matter.
            if (first_->where.root == hit.where.root) goes_straight_ = false;
            return;
        }
        first_ = &hit;
        assign(before_, hit.finding.late ? step.x0() : probe.state_at(hit.where));
        goes_straight_ = probe.is_settled() && !hit.where.jump;
        if (!goes_straight_) return;
        assign(rate_, space_.dxdt);
        if (before_.size() > tolerances::remembered_components) return;
        at_ = hit.where.root;
        at_remainder_ = hit.where.root_remainder;
        has_lost_ = true;
        for (std::size_t c = 0; c < static_cast<std::size_t>(before_.size()); ++c) {
            lost_[static_cast<decltype(before_.size())>(c)] =
                lost_from(step, probe.placed(), space_.x, rate_, c);
        }
    }

    /// First set if guard i is the only one that needs a check. The code that nearly
    /// every event needs is inlined here: handing samples from one function to another
    /// through memory takes as long as the location itself.
    [[gnu::flatten]] bool find_only(const CurrentStep& step, Guards& guards, std::size_t i,
                                    std::uint64_t& calls)
    {
        const auto guard = guards.view(i, step.mode(), calls);
        Probe probe(guard, step, space_);
        const Side side = guards[i].side;
        const GuardSample start = guards.start(i), end = guards.end(i, step.h());
        const double departure = guards.departure(i, step.h());
        if (!is_covered(guards[i]) && goes_plainly(guards, i, step.h(), departure)) {
            probe.watch(side);
            if (guards.is_cubic(i, departure)) probe.take_as_cubic();
            const double tolerance = std::max(resolution_.tolerance(step.time(step.h())),
                                              guards.unresolved(i, step.h()));
            const Location where = finders_->locate(probe, start, end, tolerance);
            keep_only(i, side, where, probe.state_at(where));
            keep_line(probe, where);
            return true;
        }
        return find_only_carefully(step, guards, i, calls);
    }

    /// As `find_only`, for a guard with a power series that determines its first departure.
    [[nodiscard]] bool find_by_series(const CurrentStep& step, Guards& guards, std::size_t i,
                                      std::uint64_t& calls);

    [[gnu::noinline]] bool find_only_carefully(const CurrentStep& step, Guards& guards,
                                               std::size_t i, std::uint64_t& calls)
    {
        const auto guard = guards.view(i, step.mode(), calls);
        Probe probe(guard, step, space_);
        for (int round = 0; round < most_rounds; ++round) {
            Watch watch = guards.watch(i, step, guards.end(i, step.h()));
            Finding finding = next_finding(probe, watch, guards, i);
            if (finding.touch) continue;
            if (!finding.hit) return false;
            late_ = finding.late;
            std::optional<Location> where = locate_first(probe, watch, guards, finding);
            if (!where) {
                go_behind(probe, finding, guards, i);
                continue;
            }
            keep_only(i, finding.side, *where, finding.late ? step.x0() : probe.state_at(*where));
            if (!finding.late) keep_line(probe, *where);
            return true;
        }
        return false;
    }

    /// Remembers that the set lies on the line in the work space.
    void keep_line(const Probe& probe, const Location& where) noexcept
    {
        straight_in_space_ = probe.is_settled() && !where.jump;
        straight_from_ = probe.placed();
    }

    void keep_only(std::size_t i, Side side, const Location& where, const X& before)
    {
        at_ = where.root;
        at_remainder_ = where.root_remainder;
        assign(before_, before);
        Hit& hit = hits_.add();
        hit.guard = i;
        hit.side = side;
        hit.where = where;
        hit.located = true;
        fired_.push_back(i);
    }

    /// The first set among several candidates.
    [[nodiscard]] bool find_among(const CurrentStep& step, Guards& guards, std::uint64_t& calls);

    /// Locates candidates until every one that has left its side by the end of the
    /// window is located; the set is those that lie in the window.
    void close_set(const CurrentStep& step, Guards& guards, std::uint64_t& calls);

    /// Finds out which of the candidates that are not located have left their sides by offset `at`.
    void find_departed(const CurrentStep& step, Guards& guards, double at, std::uint64_t& calls);

    /// Computes the state at offset s, near the first root, for which it needs no repeat of the
    /// step if the motion is straight until there.
    void place(const CurrentStep& step, double s, X& x);

    [[nodiscard]] double window_end(const CurrentStep& step) noexcept
    {
        const double first = first_root();
        return first + resolution_.window(step.time(first));
    }

    /// The longest time [s] after which a guard of the set that has not left its side at the state
    /// x reaches its surface there, at the offset `at`; 0 if there is none, NaN if it cannot be
    /// told.
    [[nodiscard]] double lacks(const CurrentStep& step, Guards& guards, const X& x,
                               const TwoSum& at, std::uint64_t& calls);

    /// Whether every guard of the set has left its side at the state `space_.root`, which is
    /// `ahead` [s] behind the set; the set is moved there if so.
    bool holds_ahead(const CurrentStep& step, Guards& guards, double ahead, std::uint64_t& calls);

    /// Whether the only guard of the set is one whose bisection has ended at the set, so that its
    /// value there is `change_.at`.
    [[nodiscard]] bool is_at_change(const CurrentStep& step, const Hit& hit, const TwoSum& at,
                                    double t) const noexcept
    {
        return change_.known && change_.guard == hit.guard && fired_.size() == 1 &&
               at.remainder == 0 && at.value == change_.at.s && hit.where.root == at.value &&
               step.time(at.value) == t && (at.value != step.h() || same_state(before_, step.x1()));
    }

    /// The set happens at its latest root, or at the time event that it belongs to.
    void settle_place(const CurrentStep& step, bool time_event_due);

    /// What rounding has taken from component c of the state at the set, which lies on the line
    /// from a repeat of the step at the offset `from`.
    [[nodiscard]] double lost_from(const CurrentStep& step, double from, const X& x, const X& rate,
                                   std::size_t c) const noexcept
    {
        const auto i = static_cast<decltype(x.size())>(c);
        const double ahead = (at_ - from) + at_remainder_;
        return step.lost_at(from, c) + ((x[i] - before_[i]) + ahead * rate[i]);
    }

    const Finders<X>* finders_;
    ProbeSpace<X> space_;
    X before_;
    X rate_;
    X lost_;  ///< see `lost_at_set`
    ProbeSpace<X> kept_space_;
    X kept_rate_;
    bool kept_rated_ = false;
    GuardList<Hit, single> hits_;
    const Hit* first_ = nullptr;      ///< of several candidates; `before_` is the state at its root
    bool goes_straight_ = false;      ///< and `rate_` the flow there
    bool rated_at_set_ = false;       ///< `rate_` is the flow at the set
    bool straight_in_space_ = false;  ///< as is, for a while, the rate in the work space
    double straight_from_ = 0;        ///< [s] offset of the state there
    bool has_lost_ = false;
    bool values_known_ = false;  ///< hits hold the guards at the set
    GuardList<std::size_t, single> fired_;
    std::vector<Note> notes_;
    std::vector<X> states_;  ///< of notes
    EventResolution resolution_;
    SignChecks signs_;
    std::optional<StepCover<X, single>> cover_;  ///< where checks may be deferred
    ResolvedParts parts_;
    bool refined_ = false;
    bool unresolved_ = false;
    Evidence evidence_;
    bool late_ = false;
    double at_ = 0;
    double at_remainder_ = 0;
    std::optional<Creep> creep_;  ///< of the acting guards
    struct {
        std::size_t guard = 0;
        bool known = false;  ///< `at` has been evaluated on the step's own map, or at its end
        GuardSample at;
    } change_;  ///< that `find_change` has located last
};

}  // namespace ricochet::detail
