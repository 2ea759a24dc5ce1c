// Measures during a run whether evaluating a network pays.
//
// A run is divided into pieces of some hundred steps, and each is computed in one of three ways:
// every step is checked, checks are planned under bounds, or planned with the network. The costs
// of a step are compared:
//
//     cost = (guard calls x their cost + answers x their cost + steps x their cost) / steps
//
// Counts are exact; unit costs are sampled with a clock, more and more rarely, separately for
// steps with and without planning, which has a cost, too. The alternatives are tried in turn
// until the best one is clear beyond its noise. Then the others are tried again from time to time,
// but their excess cost over the best one is kept below a fraction of the run (1 %), so that
// a useless network, however large or wrong, costs no more. Checking every step is not tried
// if the evaluations that planning saves cost more than planning can.
//
// Used through `Metered`; the state lives in the run, not in the detector.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/meter.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// A cost [s], from samples of which some were disturbed.
class SampledCost {
public:
    [[nodiscard]] double value() const noexcept { return value_; }
    void set(double value) noexcept { value_ = value; }

    void add(double sample) noexcept
    {
        ++samples_;
        if (samples_ > 1) sample = least_of(sample, 3 * value_);
        const double weight = greatest_of(1.0 / static_cast<double>(samples_), 1.0 / 16);
        value_ += weight * (sample - value_);
    }

private:
    double value_ = 0;
    std::uint64_t samples_ = 0;
};

class CostComparison {
public:
    /// `planned_guards`: the number of guards, if their checks are planned; 0: without the network
    /// every step is checked.
    explicit CostComparison(const MeterOptions& options, std::size_t planned_guards = 0);

    /// Whether the network should be evaluated now.
    [[nodiscard]] bool asks() const noexcept { return current_ == ask && asked_ < most_asked_; }
    /// Whether every step should be checked now.
    [[nodiscard]] bool checks() const noexcept { return current_ == check; }
    /// Records that the inference has cleared something.
    void note_cleared() noexcept { ++cleared_; }

    template <class Call>
    auto time_guard(Call&& call)
    {
        return timed(++checks_, guard_, call);
    }
    template <class Call>
    auto time_network(Call&& call)
    {
        return timed(++asked_, network_, call);
    }

    /// Called from time to time, with the counts of the run so far.
    void review(const Statistics& counts)
    {
        if (!decides_) return;
        if (counts.steps >= next_steps_ ||
            (current_ != best_ && counts.guard_calls + asked_ >= next_check_) ||
            asked_ >= most_asked_) {
            consider(counts);
        }
    }

    [[nodiscard]] MeterReading reading() const noexcept;

private:
    static constexpr std::uint64_t every = 32;  ///< one call in so many is timed, later one in 512

    enum Alternative : std::uint8_t { check, plan, ask };
    static constexpr std::array<Alternative, 3> alternatives{check, plan, ask};

    /// Steps and their cost in one alternative, older pieces with less weight.
    struct Account {
        double steps = 0;
        double cost = 0;     ///< [s]
        double squares = 0;  ///< [s²] of the deviations of pieces from their mean
        std::uint64_t pieces = 0;
        std::uint64_t wait = 1;  ///< pieces between trials
        std::uint64_t waited = 0;

        [[nodiscard]] double mean() const noexcept { return cost / steps; }
        [[nodiscard]] double error() const noexcept { return std::sqrt(squares) / steps; }
        void add(double more_steps, double more_cost) noexcept;
    };
    struct Counts {
        double steps = 0;  ///< number of accepted steps
        double work = 0;   ///< including steps taken back
        double checks = 0;
        double asked = 0;
    };

    template <class Call>
    auto timed(std::uint64_t count, SampledCost& cost, Call& call)
    {
        const std::uint64_t gap = count > 32 * every ? 16 * every : every;
        const bool sampled = samples_ && (count <= 8 || count % gap == 0);
        const double start = sampled ? seconds() : 0;
        const auto answer = call();  // in one place, so that it is compiled as without one
        if (sampled) cost.add(seconds() - start);
        return answer;
    }

    [[nodiscard]] static double seconds() noexcept;  ///< [s] of a monotonic clock
    void consider(const Statistics& counts);
    void sample_step(const Counts& piece);
    void close_piece(const Counts& piece, double cost);
    void choose_next();
    [[nodiscard]] Alternative first_alternative() const noexcept;
    [[nodiscard]] bool has(Alternative which) const noexcept;
    [[nodiscard]] double noise_between(Alternative a, Alternative b) const noexcept;
    [[nodiscard]] Alternative find_best() const noexcept;
    [[nodiscard]] Alternative next_alternative() noexcept;
    [[nodiscard]] bool may_try(Alternative which) const noexcept;
    [[nodiscard]] double allowance(Alternative which) const noexcept;
    [[nodiscard]] SampledCost& step_of(Alternative which) noexcept;
    [[nodiscard]] double step_cost(Alternative which) const noexcept;
    [[nodiscard]] double cost_of(const Counts& piece) const noexcept;
    [[nodiscard]] Account& of(Alternative which) noexcept { return accounts_[which]; }
    [[nodiscard]] const Account& of(Alternative which) const noexcept { return accounts_[which]; }

    MeterOptions options_;
    double planned_guards_;
    bool decides_;
    bool samples_;
    Alternative best_;
    Alternative current_;  ///< alternative in use; a trial if it is not the best one
    SampledCost guard_, network_;
    SampledCost checked_step_, planned_step_;  ///< without checks and inferences
    std::array<Account, 3> accounts_;
    std::uint64_t checks_ = 0;
    std::uint64_t asked_ = 0;
    std::uint64_t cleared_ = 0;
    std::uint64_t most_asked_ = std::numeric_limits<std::uint64_t>::max();  ///< in this piece
    std::uint64_t next_steps_;
    std::uint64_t next_check_ = 0;
    Counts then_;       ///< when the piece began
    double began_ = 0;  ///< [s] when the piece began
    double spent_ = 0;  ///< [s] on useless trials
    double total_ = 0;  ///< [s] total cost of the run
};

/// The comparison of a run; without one, the network is always asked and planning is always on.
class NetworkCosts {
public:
    explicit NetworkCosts(const MeterOptions* options, std::size_t planned_guards = 0)
    {
        if (options) comparison_.emplace(*options, planned_guards);
    }

    [[nodiscard]] bool asks() const noexcept { return !comparison_ || comparison_->asks(); }
    [[nodiscard]] bool checks() const noexcept { return comparison_ && comparison_->checks(); }
    void note_cleared() noexcept
    {
        if (comparison_) comparison_->note_cleared();
    }
    void review(const Statistics& counts)
    {
        if (comparison_) comparison_->review(counts);
    }
    [[nodiscard]] MeterReading reading() const { return comparison_->reading(); }

    template <class Call>
    auto time_guard(const Call& call)
    {
        return comparison_ ? comparison_->time_guard(call) : call();
    }
    template <class Call>
    auto time_network(const Call& call)
    {
        return comparison_ ? comparison_->time_network(call) : call();
    }

private:
    std::optional<CostComparison> comparison_;
};

}  // namespace ricochet::detail
