// Internal: the declarations of this header may change without notice.
//
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

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/meter_options.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// A detector whose network is metered.
template <class Detector>
concept Metering = requires(const Detector& detector)
{
    detector.metering();
};

/// @throws std::invalid_argument naming the option.
void validate(const MeterOptions& options);

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

class Meter {
public:
    /// `planned_guards`: the number of guards, if their checks are planned; 0: without the network
    /// every step is checked.
    explicit Meter(const MeterOptions& options, std::size_t planned_guards = 0);

    /// Whether the network should be evaluated now.
    [[nodiscard]] bool asks() const noexcept { return way_ == ask && asked_ < most_asked_; }
    /// Whether every step should be checked now.
    [[nodiscard]] bool checks() const noexcept { return way_ == check; }
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
            (way_ != best_ && counts.guard_calls + asked_ >= next_check_) ||
            asked_ >= most_asked_) {
            consider(counts);
        }
    }

    [[nodiscard]] MeterReading reading() const noexcept;

private:
    static constexpr std::uint64_t every = 32;  ///< one call in so many is timed, later one in 512

    enum Way : std::uint8_t { check, plan, ask };
    static constexpr std::array<Way, 3> all_ways{check, plan, ask};

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
        const auto answer = call();  // in one place, so that it is compiled as without a meter
        if (sampled) cost.add(seconds() - start);
        return answer;
    }

    [[nodiscard]] static double seconds() noexcept;  ///< [s] of a monotonic clock
    void consider(const Statistics& counts);
    void sample_step(const Counts& piece);
    void close_piece(const Counts& piece, double cost);
    void choose_next();
    [[nodiscard]] Way first_way() const noexcept;
    [[nodiscard]] bool has_way(Way way) const noexcept;
    [[nodiscard]] double noise_between(Way a, Way b) const noexcept;
    [[nodiscard]] Way find_best() const noexcept;
    [[nodiscard]] Way next_way() noexcept;
    [[nodiscard]] bool may_try(Way way) const noexcept;
    [[nodiscard]] double allowance(Way way) const noexcept;
    [[nodiscard]] SampledCost& step_of(Way way) noexcept;
    [[nodiscard]] double step_cost(Way way) const noexcept;
    [[nodiscard]] double cost_of(const Counts& piece) const noexcept;
    [[nodiscard]] Account& of(Way way) noexcept { return accounts_[way]; }
    [[nodiscard]] const Account& of(Way way) const noexcept { return accounts_[way]; }

    MeterOptions options_;
    double planned_guards_;
    bool decides_;
    bool samples_;
    Way best_;
    Way way_;  ///< alternative in use; a trial if it is not the best one
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

}  // namespace ricochet::detail
