// One statement of a certificate, and the decision about a box.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "bounds.hpp"
#include "ricochet/learn/certify.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn {

constexpr std::size_t most_features = NetworkBounds::max_inputs;

/// A part of the domain, and what is known about it.
struct Box {
    std::array<double, most_features> lower{};
    std::array<double, most_features> upper{};
    double low = -std::numeric_limits<double>::infinity();  ///< no logit in the box is lower
    bool guard_spent = false;  ///< every guard in the box is at most the margin
    bool logit_spent = false;  ///< every logit in the box is below the threshold

    /// The centre of the box of which this is a half; its guard and slack, if they were evaluated.
    std::array<double, most_features> parent{};
    double parent_guard = std::numeric_limits<double>::quiet_NaN();
    double parent_slack = std::numeric_limits<double>::quiet_NaN();
};

/// Result for a part of the tree.
struct Tally {
    std::uint64_t boxes = 0;
    double lowest = std::numeric_limits<double>::infinity();  ///< logit in an unproved box
    std::vector<std::vector<ValueRange>> unproved{};
    std::vector<double> counterexample{};
};

/// "logit < threshold implies guard > margin", over the domain of a model. Immutable.
class Statement {
public:
    Statement(const Classifier& classifier, const NetworkBounds& bounds,
              const GuardProblem& problem, double smallest, double margin, double threshold);

    [[nodiscard]] double margin() const noexcept { return margin_; }
    [[nodiscard]] double threshold() const noexcept { return threshold_; }
    [[nodiscard]] const NetworkBounds& bounds() const noexcept { return bounds_; }
    [[nodiscard]] Box domain() const;

    enum class Verdict {
        proved,
        cut,      ///< in two along `axis`
        stuck,    ///< too narrow to be cut
        refuted,  ///< the centre is a counterexample
    };

    /// @throws std::invalid_argument if the guard has changed by more than its slack.
    [[nodiscard]] Verdict examine(Box& box, NetworkBounds::Scratch& scratch,
                                  std::size_t& axis) const;

    /// The halves of a box that was examined.
    [[nodiscard]] std::array<Box, 2> halves(const Box& box, std::size_t axis) const;

    /// Counts a box that was stuck or refuted.
    void note(const Box& box, Verdict verdict, Tally& tally) const;

private:
    bool proved_by_guard(Box& box) const;
    bool proved_by_least(Box& box) const;
    bool proved_by_logit(Box& box, NetworkBounds::Scratch& scratch, double* influence) const;
    std::size_t choose_axis(const Box& box, const double* half, const double* influence) const;
    [[nodiscard]] bool is_counterexample(const double* x) const;
    void check_slack(const Box& box, const double* centre, double guard) const;

    const Classifier& classifier_;
    const NetworkBounds& bounds_;
    const GuardProblem& problem_;
    std::size_t n_;
    double smallest_;
    double margin_;
    double threshold_;
    std::vector<bool> guard_depends_;  ///< on this feature
};

/// The upper part of the tree, in breadth: the boxes still to be examined, and those done.
struct Frontier {
    std::vector<Box> open{};
    Tally tally{};
};

[[nodiscard]] Frontier grow(const Statement& statement, std::size_t boxes);

/// Examines all boxes below `start`, depth first, until one is refuted, more than
/// `max_unproved` boxes are stuck, or `stop`, called now and then with the number of
/// boxes examined since, returns true.
/// @returns false if stopped
bool explore(const Statement& statement, const Box& start, std::size_t max_unproved, Tally& tally,
             const std::function<bool(std::uint64_t boxes)>& stop);

/// Random descents from every box of the frontier, at most `rounds` from each.
[[nodiscard]] Estimate estimate_below(const Statement& statement, const Frontier& frontier,
                                      std::size_t rounds, std::uint64_t seed);

}  // namespace ricochet::learn
