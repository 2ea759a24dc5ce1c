#include "ricochet/nonsmooth/set_valued_motion.hpp"

#include <fmt/format.h>

#include "base/require.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {

void validate(const SetValuedOptions& options)
{
    constexpr detail::Require require{"SetValuedOptions"};
    require(std::isfinite(options.t_start), "t_start must be finite", options.t_start);
    require(std::isfinite(options.t_end) && options.t_end >= options.t_start,
            "t_end must be finite and no earlier than t_start", options.t_end);
    require(options.step > 0 && std::isfinite(options.step), "step must be positive and finite",
            options.step);
    require(options.rtol >= 0 && options.rtol < 1, "rtol must lie in [0, 1)", options.rtol);
    require(options.atol >= 0 && std::isfinite(options.atol), "atol must be zero or positive",
            options.atol);
    require(options.atol + options.rtol > 0, "one of atol and rtol must be positive",
            options.atol + options.rtol);
    require(options.error_order >= 1, "error_order must be at least 1", options.error_order);
    require(options.h_min >= 0, "h_min must be zero or positive", options.h_min);
    require(options.h_min <= options.step, "h_min must not be above step", options.h_min);
    require(options.h_max > options.h_min, "h_max must be above h_min", options.h_max);
    const bool constant = std::holds_alternative<ConstantStep>(options.controller);
    if (!constant && options.estimate == ErrorEstimate::none) {
        throw std::invalid_argument(
            "SetValuedOptions: a controller other than ConstantStep needs an error estimate");
    }
}

void detail::validate_fields(const std::vector<ErrorField>& fields, Eigen::Index size)
{
    for (std::size_t i = 0; i < fields.size(); ++i) {
        const ErrorField& f = fields[i];
        if (f.first < 0 || f.count < 1 || f.first + f.count > size) {
            throw std::invalid_argument(
                fmt::format("SetValuedOptions: field {} must lie within the {} components, got {} "
                            "from component {}",
                            i, size, f.count, f.first));
        }
        if (!(f.rtol > 0) || !(f.floor >= 0) || !std::isfinite(f.rtol + f.floor)) {
            throw std::invalid_argument(
                fmt::format("SetValuedOptions: field {} needs a positive rtol and a floor of zero "
                            "or more, got {} and {}",
                            i, f.rtol, f.floor));
        }
    }
}

void detail::validate_policy(const SetValuedOptions& options, const StepLayout* layout)
{
    const auto* learned = std::get_if<LearnedStep>(&options.controller);
    if (learned == nullptr) return;
    if (layout == nullptr) {
        throw std::invalid_argument(
            fmt::format("SetValuedOptions: the policy is for the system {}, and this system "
                        "declares no inputs for policies",
                        learned->policy->model().system));
    }
    learned->policy->require(*layout);
    if (options.estimate != ErrorEstimate::embedded) {
        throw std::invalid_argument(
            "SetValuedOptions: a learned controller needs the embedded estimate of the error");
    }
}

}  // namespace ricochet
