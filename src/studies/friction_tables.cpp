#include "friction_tables.hpp"

#include <fmt/format.h>

#include <cmath>

#include "interrupt.hpp"

namespace ricochet::app {

namespace {

using learn::SliderVelocities;
using learn::study_steps;
constexpr std::size_t columns = std::size(study_steps);

/// S. Liu, K. Bhattacharya and N. Lapusta, tables 3 and 4.
StabilityTables published_tables()
{
    StabilityTables out;
    out.unstable = {
        {"NN, implicit and explicit", {}, true},
        {"RS, implicit", {.506, .571, .623, .623, .675, .727}, true},
        {"RS, explicit", {.455, .455, .455, .455, .455, .455}, true},
    };
    out.mean_error = {
        {"NN, implicit", {5.993e-06, 3.636e-06, 4.807e-06, 4.716e-06, 6.282e-06, 8.508e-06}, true},
        {"NN, explicit", {6.130e-06, 3.808e-06, 4.786e-06, 4.397e-06, 5.968e-06, 7.795e-06}, true},
        {"RS, explicit", {7.321e-06, 4.447e-06, 5.267e-06, 4.426e-06, 6.464e-06, 8.069e-06}, true},
    };
    out.deviation = {
        {"NN, implicit", {5.799e-06, 5.390e-06, 5.575e-06, 7.069e-06, 6.384e-06, 1.033e-05}, true},
        {"NN, explicit", {6.241e-06, 5.766e-06, 5.844e-06, 6.887e-06, 6.572e-06, 9.639e-06}, true},
        {"RS, explicit", {9.601e-06, 6.886e-06, 5.541e-06, 5.597e-06, 6.845e-06, 1.017e-05}, true},
    };
    return out;
}

/// The sliders, and their reference velocities by order 4 with a step of 2^-15 s.
class StabilityStudy {
public:
    explicit StabilityStudy(std::size_t every)
    {
        const std::vector<SliderCase> all = slider_cases(1);
        for (std::size_t i = 0; i < all.size(); i += every) cases_.push_back(all[i]);
        for (const SliderCase& c : cases_) {
            if (Interrupts::any()) return;
            reference_.push_back(learn::slider_velocities(c, 4, 512).velocity);
        }
    }

    /// Adds the rows of a method, unless the study was interrupted.
    template <class Velocities>
    void add(const std::string& name, const Velocities& velocities)
    {
        StudyRow unstable{.name = name};
        std::vector<std::array<double, columns>> errors;
        for (std::size_t i = 0; i < cases_.size(); ++i) {
            std::array<double, columns> error{};
            bool always = true;
            for (std::size_t k = 0; k < columns; ++k) {
                if (Interrupts::any()) return;
                const SliderVelocities run = velocities(cases_[i], study_steps[k]);
                if (run.stable) {
                    error[k] = relative_error(run.velocity, reference_[i]);
                } else {
                    unstable.value[k] += 1.0 / static_cast<double>(cases_.size());
                    always = false;
                }
            }
            if (always) errors.push_back(error);
        }
        tables_.unstable.push_back(unstable);
        add_errors(name, errors);
    }

    [[nodiscard]] StabilityTables take() { return std::move(tables_); }

private:
    void add_errors(const std::string& name, const std::vector<std::array<double, columns>>& errors)
    {
        StudyRow mean{.name = name};
        StudyRow deviation{.name = name};
        const auto count = static_cast<double>(errors.size());
        for (std::size_t k = 0; k < columns; ++k) {
            double sum = 0;
            double squares = 0;
            for (const auto& error : errors) sum += error[k];
            mean.value[k] = sum / count;  // NaN if there is none
            for (const auto& error : errors) {
                squares += (error[k] - mean.value[k]) * (error[k] - mean.value[k]);
            }
            deviation.value[k] = std::sqrt(squares / count);
        }
        tables_.mean_error.push_back(mean);
        tables_.deviation.push_back(deviation);
    }

    std::vector<SliderCase> cases_;
    std::vector<std::vector<double>> reference_;
    StabilityTables tables_ = published_tables();
};

}  // namespace

std::vector<double> study_step_lengths()
{
    std::vector<double> out;
    for (const int steps : study_steps) out.push_back(1.0 / (64 * steps));
    return out;
}

StabilityTables stability_tables(const StudyMethods& methods, std::size_t every)
{
    StabilityStudy study(every);
    const auto variational = [&](int order) {
        study.add(fmt::format("variational, order {}", order),
                  [order](const SliderCase& c, int steps) {
                      return learn::slider_velocities(c, order, steps);
                  });
    };
    const auto baseline = [&](const std::string& name, const BaselineOptions& options) {
        study.add(name, [&](const SliderCase& c, int steps) {
            return learn::slider_velocities(c, options, steps);
        });
    };
    if (methods.variational) {
        for (const int order : {1, 2, 4}) variational(order);
    }
    if (methods.explicit_steps) {
        baseline("RK4, theta form", {.method = Baseline::rk4});
        baseline("RK4, exact potential form",
                 {.method = Baseline::rk4, .form = StateForm::potential});
    }
    if (methods.functional) {
        baseline("Adams <= 12, functional iteration", {.method = Baseline::adams});
    }
    if (methods.functional_pair) {
        baseline("Adams <= 12, exact potential form",
                 {.method = Baseline::adams, .form = StateForm::potential});
    }
    if (methods.plain_newton) {
        baseline("backward Euler, plain Newton", {.method = Baseline::backward_euler});
    }
    return study.take();
}

}  // namespace ricochet::app
