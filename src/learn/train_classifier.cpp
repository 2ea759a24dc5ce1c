#include "ricochet/learn/train.hpp"

#include <fmt/format.h>

namespace ricochet::learn {

std::string ClassifierTrial::describe() const
{
    const double ratio = network_seconds / std::max(exact_seconds, 1e-12);
    // The rivals, among them Ends, were timed on the same runs: there is one verdict, theirs.
    std::string verdict = learn::describe(rivals);
    if (verdict.empty()) {
        verdict = pays() ? fmt::format(
                               "with the network a run takes {:.2f} of the time of checking the "
                               "end of every step with Ends",
                               ratio)
                         : fmt::format(
                               "a check of the end of every step is faster: with the network a run "
                               "takes {:.2f} times as long as with Ends",
                               ratio);
    }
    return fmt::format("{}; it asks the guard {} times instead of {}, and misses {} of {} events",
                       verdict, network_calls, exact_calls, missed, events);
}

namespace detail {

void check(const ClassifierTraining& training)
{
    const auto require = [](bool fulfilled, const char* option, double found,
                            const char* expected) {
        if (fulfilled) return;
        throw std::invalid_argument(
            fmt::format("train_classifier: found {} = {}; expected {}", option, found, expected));
    };
    require(training.step > 0 && std::isfinite(training.step), "step", training.step,
            "a positive number of seconds");
    require(training.run_length >= training.step && std::isfinite(training.run_length),
            "run_length", training.run_length, "at least a step");
    require(training.margin >= 0 && training.margin < 1, "margin", training.margin,
            "a number in [0, 1)");
    require(training.widened >= 0 && std::isfinite(training.widened), "widened", training.widened,
            "a share of at least 0");
    require(training.surface_points > 0, "surface_points", 0, "at least one");
    require(training.states >= 100, "states", static_cast<double>(training.states), "at least 100");
    require(training.fresh_states >= 2, "fresh_states", static_cast<double>(training.fresh_states),
            "at least 2");
}

void throw_no_surface(std::uint64_t steps)
{
    throw std::invalid_argument(fmt::format(
        "train_classifier: found no event in runs of {} steps in all; expected starts from which "
        "the guard is crossed within the length of a run",
        steps));
}

void throw_too_many_components(std::size_t found, std::size_t most)
{
    throw std::invalid_argument(fmt::format(
        "train_classifier: found a state of {} components; expected at most {}", found, most));
}

}  // namespace detail

}  // namespace ricochet::learn
