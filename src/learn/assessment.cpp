#include "ricochet/learn/assessment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <boost/math/special_functions/beta.hpp>

#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn {

double miss_bound(std::size_t misses, std::size_t events)
{
    if (misses >= events) return 1;
    const auto n = static_cast<double>(events);
    if (misses == 0) return std::min(1.0, 3 / n);
    const auto k = static_cast<double>(misses);
    return boost::math::ibeta_inv(k + 1, n - k, 0.95);
}

std::vector<double> logits(const Model& model, const DataSet& data)
{
    const Classifier classifier(model);
    if (data.width() != classifier.inputs()) {
        throw std::invalid_argument("logits: the model takes " +
                                    std::to_string(classifier.inputs()) +
                                    " features, the data set has " + std::to_string(data.width()));
    }
    std::vector<double> answers(data.size());
    for (std::size_t i = 0; i < data.size(); ++i) answers[i] = classifier.logit(data.row(i).data());
    return answers;
}

Assessment assess(const Model& model, const DataSet& data, double margin)
{
    Assessment result;
    result.margin = margin;
    result.lowest_event = std::numeric_limits<double>::infinity();
    const std::vector<double> answers = logits(model, data);
    std::size_t well_cleared = 0;
    for (std::size_t i = 0; i < data.size(); ++i) {
        const bool well_clear = data.labels[i] == 0 && data.margins[i] >= margin;
        result.well_clear += well_clear ? 1 : 0;
        if (data.labels[i] != 0) {
            const bool detected = !(answers[i] < model.threshold);
            ++(detected ? result.confusion.detected : result.confusion.missed);
            result.lowest_event = std::min(result.lowest_event, answers[i]);
        } else {
            const bool cleared = answers[i] < model.threshold;
            ++(cleared ? result.confusion.cleared : result.confusion.false_alarms);
            well_cleared += well_clear && cleared ? 1 : 0;
        }
    }
    const auto share = [](std::size_t part, std::size_t whole) {
        return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
    };
    const Confusion& c = result.confusion;
    result.miss_bound = miss_bound(c.missed, c.missed + c.detected);
    result.false_alarm_rate = share(c.false_alarms, c.false_alarms + c.cleared);
    result.cleared_share = share(well_cleared, result.well_clear);
    return result;
}

}  // namespace ricochet::learn
