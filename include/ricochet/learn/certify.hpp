// Certification: a proof that, wherever a network clears the state, the guard is above a margin.
//
// *Statement.* For every state x in the domain of the model
//
//     logit(x) < threshold  implies  guard(x) > margin,
//
// for the logit as it is computed at run time, and the guard as the system computes it.
//
// *Proof*, by branch and bound. A box with centre c and half-widths h is proved if its logit is
// nowhere below the threshold (`NetworkBounds`), or if
//
//     guard(c) - guard_slack(h) > margin,
//
// and is cut in two if neither holds. A bound that has shown that it can never prove a part of a
// box is not computed again for that part. A box that is too narrow to be cut is unproved: it is
// listed in the record, and the exact guard is evaluated there at run time.
//
// A system may declare `guard_least`, a lower bound of its guard over a box, which then replaces
// the second condition. For a concave guard this bound is attained at a corner.
//
// A gate of levels is proved level by level: its certificate says "logit < threshold_k implies
// guard > rho_k", and its thresholds become those that were proved.
//
// The proof assumes that `guard_slack` and `guard_least` are correct. Every cut tests the slack
// with the values at the centres of a box and its halves; one proof in 64 by `guard_least` compares
// it with the guard at the centre. A violation is reported with the states.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/detail/features.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// A system whose first guard does not depend on time, with a bound of its change between
/// two states:
///
///     |guard(t, x) - guard(t, y)| <= guard_slack(h)   if |x_i - y_i| <= h_i for all i,
///
/// as computed, with the guard's own rounding included. h is a state of nonnegative
/// half-widths; a larger h gives no smaller slack. Examples: hypot(h_0, h_1) for a
/// distance in the plane of x_0 and x_1; sum of L_i h_i for a guard with a constant L_i for each
/// component, as the reach of an arm beyond joint i; infinity is valid.
template <class System, class X>
concept SlackedGuard = Guarded<System, X> && requires(const System& system, const X& half_widths)
{
    {
        system.guard_slack(half_widths)
        } -> std::convertible_to<double>;
};

/// A system that also bounds its guard from below over a box of states, rounding included:
/// guard(t, x) >= guard_least(lower, upper) if lower_i <= x_i <= upper_i for all i. -infinity is a
/// valid bound. The slack then serves only to choose the edge along which a box is cut.
template <class System, class X>
concept LeastGuard = SlackedGuard<System, X> && requires(const System& system, const X& corner)
{
    {
        system.guard_least(corner, corner)
        } -> std::convertible_to<double>;
};

}  // namespace ricochet

namespace ricochet::learn {

/// The guard that a model is to be proved against, as functions of its raw features. They are
/// called from several threads at a time.
struct GuardProblem {
    std::function<double(const double* x)> guard;
    std::function<double(const double* half_widths)> slack;  ///< see `SlackedGuard`
    /// See `LeastGuard`; empty if there is none.
    std::function<double(const double* lower, const double* upper)> least{};
};

/// Options of a proof.
struct CertifyOptions {
    double margin = 0;       ///< of the first level, in units of the guard
    std::size_t levels = 1;  ///< number of levels, 1 to 32
    double ratio = 2;        ///< between margins; above 1, needs a positive margin
    /// Margins of all levels, rising, in place of the three options above. If this is empty and
    /// the model is a level gate, the margins are those of the gate.
    std::vector<double> margins{};
    /// Search for the highest threshold that can be proved, and store it in the model. Otherwise
    /// the stored threshold is proved as it is; further levels are always searched for.
    bool search = true;
    /// A search stops at this distance from the lowest logit that was found within the margin,
    /// in units of the spread of the logits over the domain.
    double closest = 1.0 / 64;
    double smallest = 1.0 / 1024;    ///< edge that is not cut further, over the domain's
    std::size_t max_unproved = 256;  ///< boxes that a level may list
    double limit = 300;              ///< [s] a level whose estimate exceeds this is not started
    double time_limit = std::numeric_limits<double>::infinity();  ///< [s] when the proof stops
    unsigned threads = 2;                ///< 1 to 64; the result does not depend on it
    std::uint64_t seed = 1;              ///< of estimates and searches
    std::filesystem::path checkpoint{};  ///< written every few seconds and on stopping; empty: none
    bool resume = false;                 ///< continue from `checkpoint`
};

/// Estimated cost of a proof, by random descent: a path is followed to a leaf, and 2^depth
/// is an unbiased estimate of the number of leaves (Knuth, "Estimating the efficiency of
/// backtrack programs", Math. Comp. 29, 1975). The top of the tree is counted, not estimated.
struct Estimate {
    double boxes = 0;
    double seconds = 0;   ///< on all threads
    double unproved = 0;  ///< boxes that will be too narrow to be cut
    double error = 0;     ///< relative standard error of `boxes`
};

/// Progress of a proof, as its callback sees it.
struct CertifyProgress {
    std::size_t level = 0;  ///< from 0
    std::size_t levels = 0;
    double margin = 0;
    double threshold = 0;
    Estimate estimate;        ///< of this level
    std::uint64_t boxes = 0;  ///< examined so far, at this level
    double rate = 0;          ///< [1/s]
    double seconds = 0;       ///< [s] time on this level, earlier parts included
    double seconds_left = 0;
    double share = 0;  ///< fraction of the level that is done, in [0, 1]
};

/// Receives the progress; returns false to stop the proof. The first call for each level has
/// `boxes` = 0 and reports the estimate before the work starts.
using CertifyCallback = std::function<bool(const CertifyProgress&)>;

/// How a proof ended.
enum class CertifyOutcome {
    proved,         ///< all levels are proved, without exceptions
    partly_proved,  ///< all levels, but for unproved boxes that are listed
    refuted,        ///< in some state the network clears and the guard is within the margin
    not_provable,   ///< too many boxes are too narrow to be cut
    too_long,       ///< the estimate is above the limit; the proof was not started
    out_of_time,    ///< `time_limit` was reached; the results so far are in the checkpoint
    out_of_memory,  ///< memory was exhausted; likewise
    interrupted,    ///< the callback stopped the proof; likewise
};

/// Thrown by a guard or its slack to stop the proof, as a callback that returns false does: the
/// outcome is `interrupted`.
struct CertifyInterrupted {};

/// Describes the outcome in one sentence, with a remedy.
[[nodiscard]] std::string_view describe(CertifyOutcome outcome) noexcept;

struct CertifyReport;
/// The same, with the fraction of the domain where the first level clears the state.
[[nodiscard]] std::string describe(const CertifyReport& report);

/// Result and cost of a proof.
struct CertifyReport {
    CertifyOutcome outcome = CertifyOutcome::proved;
    std::vector<CertificateLevel> levels{};  ///< finished levels
    /// For each of them the fraction of the domain where it clears the state, by 4096 random
    /// states; the statement says nothing of the others.
    std::vector<double> clears{};
    std::vector<Estimate> estimates{};     ///< of these and of the unfinished level
    std::vector<double> counterexample{};  ///< state that refutes the statement, if `refuted`
    double seconds = 0;                    ///< [s] total time, searches and estimates included
    /// Reason why the last checkpoint could not be written; empty if it was, or there is none.
    std::string checkpoint_trouble{};
};

/// A model and its certificate, which contains the finished levels and is empty if there are none.
/// The threshold of the model is the proved one. A gate keeps the levels that were proved, with the
/// proved thresholds, and loses its calibration, which was measured with other thresholds.
struct CertifiedModel {
    Model model;
    CertifyReport report;

    /// Whether all levels or some of them are proved.
    [[nodiscard]] bool proved() const noexcept
    {
        return report.outcome == CertifyOutcome::proved ||
               report.outcome == CertifyOutcome::partly_proved;
    }
};

/// Proves the levels that the options specify. The same model, problem and options give the same
/// record, except for its times, for any number of threads and of interruptions. A search is cut
/// short by `limit`, and so depends on the speed of the machine.
///
/// @throws std::invalid_argument if an option is outside its range, if the recipe of the model is
///         not `state`, if the model is a horizon gate (which predicts times, not guard values),
///         as `NetworkBounds`, or if slack or least guard are violated, naming the states.
/// @throws std::runtime_error if the checkpoint cannot be written or read, or belongs to another
///         model or other options.
[[nodiscard]] CertifiedModel certify(const Model& model, const GuardProblem& problem,
                                     const CertifyOptions& options,
                                     const CertifyCallback& progress = {});

/// Estimates the cost of the proof of one statement over the domain of the model.
/// @throws as `certify`
[[nodiscard]] Estimate estimate(const Model& model, const GuardProblem& problem, double margin,
                                double threshold, const CertifyOptions& options);

/// A state with a low logit where the guard is within the margin.
struct LowestLogit {
    double logit = std::numeric_limits<double>::infinity();  ///< inf: no such state was found
    std::vector<double> x{};
};

/// Searches for the lowest logit among states with guard <= margin: half of `states` are drawn at
/// random in the domain, the others by random steps of decreasing size from the best found so far.
[[nodiscard]] LowestLogit lowest_logit(const Model& model, const GuardProblem& problem,
                                       double margin, std::size_t states, std::uint64_t seed);

/// Makes the problem of proving `model` against the first guard of `system`.
/// @param like  any state of the right size
/// @throws std::invalid_argument naming what the model is for and what the system is: name,
///         parameters, number of components; or if the recipe of the model is not `state`.
template <class System, class X>
[[nodiscard]] GuardProblem guard_problem(System system, const Model& model, const X& like);

namespace detail {

/// @throws std::invalid_argument
void check_certifiable(const Model& model, std::string_view system, std::size_t components);
void check_parameter(const std::string& name, double trained, std::optional<double> value);

}  // namespace detail

template <class System, class X>
GuardProblem guard_problem(System system, const Model& model, const X& like)
{
    static_assert(
        SlackedGuard<System, X>,
        "ricochet: to certify a network the system must declare guard_slack(half_widths)");
    const auto n = static_cast<std::size_t>(like.size());
    if constexpr (requires { std::string_view(system.name); }) {
        detail::check_certifiable(model, system.name, n);
    } else {
        detail::check_certifiable(model, {}, n);
    }
    for (const auto& [name, trained] : model.parameters) {
        std::optional<double> value;
        if constexpr (requires { system.parameter(std::string_view()); }) {
            value = system.parameter(std::string_view(name));
        }
        detail::check_parameter(name, trained, value);
    }
    const auto state = [like, n](const double* from) {
        X x = like;
        for (std::size_t i = 0; i < n; ++i) x[i] = from[i];
        return x;
    };
    GuardProblem problem{
        .guard =
            [system, state](const double* x) {
                return ricochet::detail::call_guard(system, 0, 0, 0.0, state(x));
            },
        .slack = [system, state](const double* h) { return double(system.guard_slack(state(h))); }};
    if constexpr (LeastGuard<System, X>) {
        problem.least = [system, state](const double* lower, const double* upper) {
            return double(system.guard_least(state(lower), state(upper)));
        };
    }
    return problem;
}

}  // namespace ricochet::learn
