// Measures of the quality of a trained classifier of steps.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "ricochet/learn/data_set.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

/// Counts of a classifier's answers, by truth and answer.
struct Confusion {
    std::size_t detected = 0;      ///< events called events
    std::size_t missed = 0;        ///< events called clear
    std::size_t false_alarms = 0;  ///< clear states called events
    std::size_t cleared = 0;       ///< clear states called clear
};

/// A classifier on one data set.
struct Assessment {
    Confusion confusion;
    double miss_bound = 1;        ///< 95 % upper bound of the fraction of events missed
    double false_alarm_rate = 0;  ///< fraction of all clear states called events
    double margin = 0.1;          ///< margin from which a state counts as well clear
    std::size_t well_clear = 0;   ///< clear states of at least that margin
    double cleared_share = 0;     ///< fraction of these that are called clear; 0 if there are none
    double lowest_event = 0;      ///< smallest logit of an event; compare with the threshold
};

/// Upper bound, at 95 % confidence, of a rate of which `misses` were seen in
/// `events` independent trials: 3 / events if there were none, else the one-sided
/// bound of Clopper and Pearson. 1 if there were no trials.
[[nodiscard]] double miss_bound(std::size_t misses, std::size_t events);

/// Logits of the states of `data`, as `Classifier` gives them.
/// @throws std::invalid_argument if `data` has another number of features, or if
///         `Classifier` throws it.
[[nodiscard]] std::vector<double> logits(const Model& model, const DataSet& data);

/// Compares the answers of `model` with the labels of `data`. A logit that is
/// not a number announces an event, as in `Classifier`.
/// @throws what `logits` throws
[[nodiscard]] Assessment assess(const Model& model, const DataSet& data, double margin = 0.1);

}  // namespace ricochet::learn
