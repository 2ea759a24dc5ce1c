#include "ricochet/learn/adam.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace ricochet::learn {

Adam::Adam(std::size_t parameters, const Options& options)
    : options_(options),
      state_{.steps = 0,
             .first = std::vector<double>(parameters, 0.0),
             .second = std::vector<double>(parameters, 0.0)}
{
    const auto share = [](double beta, const char* name) {
        if (beta >= 0 && beta < 1) return;
        throw std::invalid_argument(std::string("Adam: ") + name + " must lie in [0, 1), got " +
                                    std::to_string(beta));
    };
    share(options.beta1, "beta1");
    share(options.beta2, "beta2");
    if (!(options.epsilon > 0)) {
        throw std::invalid_argument("Adam: epsilon must be positive, got " +
                                    std::to_string(options.epsilon));
    }
}

void Adam::step(std::span<double> parameters, std::span<const double> gradient,
                double rate) noexcept
{
    ++state_.steps;
    const auto k = static_cast<double>(state_.steps);
    const double first_share = 1 - std::pow(options_.beta1, k);
    const double second_share = 1 - std::pow(options_.beta2, k);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        double& m = state_.first[i];
        double& v = state_.second[i];
        m = options_.beta1 * m + (1 - options_.beta1) * gradient[i];
        v = options_.beta2 * v + (1 - options_.beta2) * gradient[i] * gradient[i];
        parameters[i] -=
            rate * (m / first_share) / (std::sqrt(v / second_share) + options_.epsilon);
    }
}

void Adam::restore(State state)
{
    if (state.first.size() != state_.first.size() || state.second.size() != state_.second.size()) {
        throw std::invalid_argument("Adam: expected the state of " +
                                    std::to_string(state_.first.size()) + " parameters, found " +
                                    std::to_string(state.first.size()));
    }
    state_ = std::move(state);
}

}  // namespace ricochet::learn
