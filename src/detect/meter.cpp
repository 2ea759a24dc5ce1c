#include "ricochet/detect/meter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace ricochet::detail {

namespace {

/// Weight of what is known, at every further piece: some 50 pieces are remembered.
constexpr double memory = 0.98;
/// Pieces of both ways before one is believed to be the better one.
constexpr std::uint64_t fewest = 6;
/// Pieces between trials, at most.
constexpr std::uint64_t longest_wait = 64;
/// Answers that a run may spend before it is long enough to have a share for trials.
constexpr double first_answers = 16;

}  // namespace

void validate(const MeterOptions& options)
{
    const auto refuse = [](const char* what, double given, const char* expected) {
        throw std::invalid_argument(
            fmt::format("MeterOptions: {} must be {}, got {}", what, expected, given));
    };
    const auto cost = [](double seconds) { return seconds >= 0 && std::isfinite(seconds); };
    if (!cost(options.guard)) refuse("guard", options.guard, "zero or positive [s]");
    if (!cost(options.network)) refuse("network", options.network, "zero or positive [s]");
    const bool counted = options.decision == MeterOptions::Decision::counted;
    if (!cost(options.step) || (counted && options.step == 0)) {
        refuse("step", options.step, "positive where costs are counted [s]");
    }
    if (!(options.trials >= 0 && options.trials <= 1)) {
        refuse("trials", options.trials, "in [0, 1]");
    }
    if (options.piece == 0) refuse("piece", 0, "at least 1 step");
}

void Meter::Way::add(double more_steps, double more_cost) noexcept
{
    const double aside = pieces > 0 ? more_cost - mean() * more_steps : 0;
    steps = memory * steps + more_steps;
    cost = memory * cost + more_cost;
    squares = memory * squares + aside * aside;
    ++pieces;
}

Meter::Meter(const MeterOptions& options)
    : options_((validate(options), options)),
      decides_(options.decision == MeterOptions::Decision::measured ||
               options.decision == MeterOptions::Decision::counted),
      samples_(options.decision != MeterOptions::Decision::counted),
      asks_(options.decision == MeterOptions::Decision::always),
      next_steps_(options.piece)
{
    if (!samples_) {
        guard_.set(options.guard);
        network_.set(options.network);
        step_.set(options.step);
    }
    if (decides_ && samples_) began_ = Clock::now();
}

double Meter::cost_of(const Counts& piece) const noexcept
{
    return piece.looks * guard_.value() + piece.asked * network_.value() +
           piece.work * step_.value();
}

double Meter::allowance() const noexcept
{
    return options_.trials * total_ + first_answers * network_.value() - spent_;
}

/// Once it is known what a piece of trial costs in vain, there must be as much to spend.
bool Meter::may_try() const noexcept
{
    if (asking_.pieces == 0) return true;
    const double excess = asking_.mean() - not_asking_.mean();
    return allowance() > std::max(excess, 0.0) * static_cast<double>(options_.piece);
}

void Meter::consider(const Statistics& counts)
{
    const Counts now{.steps = static_cast<double>(counts.steps),
                     .work = static_cast<double>(counts.steps + counts.repeated_steps),
                     .looks = static_cast<double>(looks_),
                     .asked = static_cast<double>(asked_)};
    const Counts piece{.steps = now.steps - then_.steps,
                       .work = now.work - then_.work,
                       .looks = now.looks - then_.looks,
                       .asked = now.asked - then_.asked};
    if (counts.steps < next_steps_) {
        // A trial that has become too dear ends here.
        next_check_ = looks_ + asked_ + 4;
        const double excess = cost_of(piece) - not_asking_.mean() * std::max(piece.steps, 0.0);
        if (excess <= allowance() && asked_ < most_asked_) return;
    }
    if (samples_) sample_step(piece);
    close_piece(piece, cost_of(piece));
    choose_next();
    then_ = now;
    next_steps_ = counts.steps + options_.piece;
    next_check_ = looks_ + asked_ + 4;
}

/// What is left of the time of a piece, over its steps.
void Meter::sample_step(const Counts& piece)
{
    const Clock::time_point now = Clock::now();
    const double spent = std::chrono::duration<double>(now - began_).count();
    began_ = now;
    const double rest = spent - piece.looks * guard_.value() - piece.asked * network_.value();
    if (piece.work > 0) step_.add(std::max(rest, 0.0) / piece.work);
}

void Meter::close_piece(const Counts& piece, double cost)
{
    total_ += cost;
    if (on_trial_) {
        spent_ = std::max(spent_ + cost - not_asking_.mean() * std::max(piece.steps, 0.0), 0.0);
    }
    // A trial that brought the run no further still has its cost.
    (asks_ ? asking_ : not_asking_).add(std::max(piece.steps, 1.0), cost);
}

void Meter::choose_next()
{
    if (asking_.pieces >= fewest && not_asking_.pieces >= fewest) {
        const double noise = std::hypot(asking_.error(), not_asking_.error());
        const double gain = not_asking_.mean() - asking_.mean();
        const bool paid = pays_;
        pays_ = gain > (paid ? 0 : 2 * noise);
        if (pays_ != paid) {
            wait_ = 1;
        } else if (waited_ == 0) {
            wait_ = std::min(2 * wait_, longest_wait);
        }
    }
    // The way that is not the better one has its turn after `wait_` pieces.
    bool other = ++waited_ > wait_;
    if (!pays_ && !may_try()) other = false;
    if (other) waited_ = 0;
    asks_ = pays_ != other;
    on_trial_ = asks_ && !pays_;
    most_asked_ = std::numeric_limits<std::uint64_t>::max();
    if (on_trial_) {
        const double answer = network_.value();
        const double most = answer > 0 ? allowance() / answer : first_answers;
        if (most < 1e9) most_asked_ = asked_ + static_cast<std::uint64_t>(std::max(most, 1.0));
    }
}

MeterReading Meter::reading() const noexcept
{
    return {.guard = guard_.value(),
            .network = network_.value(),
            .step = step_.value(),
            .asked = asked_,
            .cleared = cleared_,
            .asking = asking_.pieces > 0 ? asking_.mean() : 0,
            .not_asking = not_asking_.pieces > 0 ? not_asking_.mean() : 0,
            .pays = pays_};
}

}  // namespace ricochet::detail
