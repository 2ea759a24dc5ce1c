#include "core/cost_comparison.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "base/require.hpp"

namespace ricochet::detail {

namespace {

/// Weight that older pieces keep with every further piece: some 50 pieces are remembered.
constexpr double memory = 0.98;
/// Pieces that two alternatives must each have before one of them counts as better.
constexpr std::uint64_t fewest = 4;
/// Number of pieces at which the estimate of their noise is doubled for its own uncertainty.
constexpr double unsure = 2;
/// Least cost of a step without a plan, as a fraction of the cost of a planned step.
constexpr double least_step = 0.5;
/// Excess cost, as a fraction of a piece of the best mode, allowed to each of the first pieces in
/// which every step is checked. Events make pieces uneven: with less, most such pieces ended at
/// their first event.
constexpr double first_excess = 0.25;
/// Largest number of pieces between trials.
constexpr std::uint64_t longest_wait = 64;
/// Inferences that a run may use before it is long enough to have a budget for trials.
constexpr double first_answers = 16;

}  // namespace

double CostComparison::seconds() noexcept
{
    using Clock = std::chrono::steady_clock;
    return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

void validate(const MeterOptions& options)
{
    constexpr detail::Require require{"MeterOptions"};
    const auto cost = [](double seconds) { return seconds >= 0 && std::isfinite(seconds); };
    require(cost(options.guard), "guard must be zero or positive [s]", options.guard);
    require(cost(options.network), "network must be zero or positive [s]", options.network);
    const bool counted = options.decision == MeterOptions::Decision::counted;
    require(cost(options.step) && !(counted && options.step == 0),
            "step must be positive where costs are counted [s]", options.step);
    require(options.trials >= 0 && options.trials <= 1, "trials must be in [0, 1]", options.trials);
    require(options.piece > 0, "piece must be at least 1 step", 0);
}

void CostComparison::Account::add(double more_steps, double more_cost) noexcept
{
    const double aside = pieces > 0 ? more_cost - mean() * more_steps : 0;
    steps = memory * steps + more_steps;
    cost = memory * cost + more_cost;
    squares = memory * squares + aside * aside;
    ++pieces;
}

CostComparison::CostComparison(const MeterOptions& options, std::size_t planned_guards)
    : options_((validate(options), options)),
      planned_guards_(static_cast<double>(planned_guards)),
      decides_(options.decision == MeterOptions::Decision::measured ||
               options.decision == MeterOptions::Decision::counted),
      samples_(options.decision != MeterOptions::Decision::counted),
      best_(first_alternative()),
      current_(best_),
      next_steps_(options.piece)
{
    if (!samples_) {
        guard_.set(options.guard);
        network_.set(options.network);
        checked_step_.set(options.step);
        planned_step_.set(options.step);
    }
    if (decides_ && samples_) began_ = seconds();
}

CostComparison::Alternative CostComparison::first_alternative() const noexcept
{
    using Decision = MeterOptions::Decision;
    if (options_.decision == Decision::always) return ask;
    return planned_guards_ > 0 && options_.decision != Decision::every_step ? plan : check;
}

bool CostComparison::has(Alternative which) const noexcept
{
    return which != plan || planned_guards_ > 0;
}

SampledCost& CostComparison::step_of(Alternative which) noexcept
{
    return which == check || planned_guards_ == 0 ? checked_step_ : planned_step_;
}

/// Cost of a step. While it is not known without planning, a fraction of the cost with planning.
double CostComparison::step_cost(Alternative which) const noexcept
{
    if (which != check && planned_guards_ > 0) return planned_step_.value();
    const double known = checked_step_.value();
    return known > 0 ? known : least_step * planned_step_.value();
}

double CostComparison::cost_of(const Counts& piece) const noexcept
{
    return piece.checks * guard_.value() + piece.asked * network_.value() +
           piece.work * step_cost(current_);
}

double CostComparison::allowance(Alternative which) const noexcept
{
    const double share = options_.trials * total_ - spent_;
    if (which == ask) return share + first_answers * network_.value();
    const bool known = which != check || of(which).pieces >= fewest;
    const double piece = of(best_).mean() * static_cast<double>(options_.piece);
    return known ? share : std::max(share, 0.0) + first_excess * piece;
}

/// Whether a trial is allowed: once the cost of a useless piece is known, the budget must cover it.
bool CostComparison::may_try(Alternative which) const noexcept
{
    const Account& account = of(which);
    if (which == check && account.pieces == 0) {
        // The first pieces, before anything is in a cache, are not representative.
        const double least = planned_guards_ * guard_.value() + step_cost(which);
        return of(best_).pieces >= fewest && least < of(best_).mean();
    }
    if (account.pieces == 0) return true;
    const double excess = account.mean() - of(best_).mean();
    return allowance(which) > std::max(excess, 0.0) * static_cast<double>(options_.piece);
}

void CostComparison::consider(const Statistics& counts)
{
    const Counts now{.steps = static_cast<double>(counts.steps),
                     .work = static_cast<double>(counts.steps + counts.repeated_steps),
                     .checks = static_cast<double>(counts.guard_calls),
                     .asked = static_cast<double>(asked_)};
    const Counts piece{.steps = now.steps - then_.steps,
                       .work = now.work - then_.work,
                       .checks = now.checks - then_.checks,
                       .asked = now.asked - then_.asked};
    next_check_ = counts.guard_calls + asked_ + 4;
    if (counts.steps < next_steps_) {
        // A trial that has become too expensive ends early.
        const double excess = cost_of(piece) - of(best_).mean() * std::max(piece.steps, 0.0);
        if (excess <= allowance(current_) && asked_ < most_asked_) return;
    }
    if (samples_) sample_step(piece);
    close_piece(piece, cost_of(piece));
    choose_next();
    then_ = now;
    next_steps_ = counts.steps + options_.piece;
}

/// Adds the time of a piece per step, without its guard calls and inferences.
void CostComparison::sample_step(const Counts& piece)
{
    const double now = seconds();
    const double spent = now - began_;
    began_ = now;
    const double rest = spent - piece.checks * guard_.value() - piece.asked * network_.value();
    const double enough = 0.25 * static_cast<double>(options_.piece);
    if (piece.work >= enough) step_of(current_).add(std::max(rest, 0.0) / piece.work);
}

void CostComparison::close_piece(const Counts& piece, double cost)
{
    total_ += cost;
    if (current_ != best_) {
        spent_ = std::max(spent_ + cost - of(best_).mean() * std::max(piece.steps, 0.0), 0.0);
    }
    // A trial that did not advance the run still has its cost.
    of(current_).add(std::max(piece.steps, 1.0), cost);
}

/// Uncertainty of the difference of two means. Few pieces determine the spread of pieces badly.
double CostComparison::noise_between(Alternative a, Alternative b) const noexcept
{
    const auto pieces = static_cast<double>(std::min(of(a).pieces, of(b).pieces));
    return (1 + unsure / pieces) * std::hypot(of(a).error(), of(b).error());
}

/// The cheapest alternative with enough pieces. Asking has to be better beyond doubt.
CostComparison::Alternative CostComparison::find_best() const noexcept
{
    Alternative best = best_;
    if (of(best).pieces < fewest) return best;
    for (const Alternative which : alternatives) {
        if (which == best || of(which).pieces < fewest) continue;
        const double noise = noise_between(which, best);
        const double doubt = best == ask || which != ask ? 0 : 2 * noise;
        if (of(best).mean() - of(which).mean() > doubt) best = which;
    }
    return best;
}

/// The best alternative, or another one if its turn has come.
CostComparison::Alternative CostComparison::next_alternative() noexcept
{
    Alternative next = best_;
    for (const Alternative which : alternatives) {
        if (which == best_ || !has(which)) continue;
        Account& account = of(which);
        const bool due = ++account.waited > account.wait;
        if (due && next == best_ && may_try(which)) next = which;
    }
    if (next != best_) of(next).waited = 0;
    return next;
}

void CostComparison::choose_next()
{
    const Alternative best = find_best();
    if (best != best_) {
        for (Account& account : accounts_) account.wait = 1;
    } else if (current_ != best_ && of(current_).pieces >= fewest && of(best_).pieces >= fewest) {
        of(current_).wait = std::min(2 * of(current_).wait, longest_wait);
    }
    best_ = best;
    current_ = next_alternative();
    most_asked_ = std::numeric_limits<std::uint64_t>::max();
    if (current_ == ask && best_ != ask) {
        const double answer = network_.value();
        const double most = answer > 0 ? allowance(ask) / answer : first_answers;
        if (most < 1e9) most_asked_ = asked_ + static_cast<std::uint64_t>(std::max(most, 1.0));
    }
}

MeterReading CostComparison::reading() const noexcept
{
    const auto mean = [this](Alternative which) {
        return of(which).pieces > 0 ? of(which).mean() : 0;
    };
    const Alternative base = best_ != ask ? best_ : planned_guards_ > 0 ? plan : check;
    return {.guard = guard_.value(),
            .network = network_.value(),
            .step = step_cost(best_),
            .asked = asked_,
            .cleared = cleared_,
            .asking = mean(ask),
            .not_asking = mean(base),
            .checking = mean(check),
            .pays = best_ == ask,
            .checks = best_ == check};
}

}  // namespace ricochet::detail
