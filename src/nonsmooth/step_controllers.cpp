#include "ricochet/nonsmooth/step_controllers.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "base/require.hpp"

namespace ricochet {
namespace {

// An error of zero would make the factors infinite or not a number.
double positive(double error)
{
    return std::max(error, 1e-30);
}

}  // namespace

StepVerdict ErrorStep::judge(double error, double /*h*/) const noexcept
{
    return {error <= reject_above, rule.factor(error, order)};
}

StepVerdict HeuristicStep::judge(double error, double /*h*/) const noexcept
{
    const double factor = std::pow(positive(error), -1.0 / (order + 1));
    // Just above 1 the power rounds to 1, and the same step would be rejected forever.
    constexpr double below_one = 1 - std::numeric_limits<double>::epsilon() / 2;
    return error <= 1 ? StepVerdict{true, std::min(up, factor)}
                      : StepVerdict{false, std::min(factor, below_one)};
}

StepVerdict ClassicStep::judge(double error, double /*h*/) noexcept
{
    if (error > 1) return {false, down};
    const double q = 1.0 / (order + 1);
    const double now = positive(error);
    const double factor = error_before > 0
                              ? safety * std::pow(now, -0.7 * q) * std::pow(error_before, -0.4 * q)
                              : safety * std::pow(now, -q);
    error_before = now;
    return {true, std::min(up, std::max(down, factor))};
}

StepVerdict PrintedPiStep::judge(double error, double h) noexcept
{
    const double q = 1.0 / (order + 1);
    const double now = positive(error);
    const double before = error_before > 0 ? error_before : 1;
    const double ratio = h_before > 0 ? h / h_before : 1;
    const double factor =
        std::pow(now, -q / gamma1) * std::pow(before, q / gamma2) * std::pow(ratio, -kappa);
    if (!(factor >= c1)) {
        // The power of a huge error is zero, and so would be the step.
        return {false, std::min(std::max(factor, std::numeric_limits<double>::min()), 0.6)};
    }
    error_before = now;
    h_before = h;
    return {true, std::min(factor, c2)};
}

FilteredStep FilteredStep::h211b(double b) noexcept
{
    return {.beta1 = 1 / b, .beta2 = 1 / b, .alpha = 1 / b};
}
FilteredStep FilteredStep::h211pi() noexcept
{
    return {.beta1 = 1.0 / 6, .beta2 = 1.0 / 6, .alpha = 0};
}
FilteredStep FilteredStep::pi3040() noexcept
{
    return {.beta1 = 0.7, .beta2 = -0.4, .alpha = 0};
}
FilteredStep FilteredStep::pi3333() noexcept
{
    return {.beta1 = 2.0 / 3, .beta2 = -1.0 / 3, .alpha = 0};
}
FilteredStep FilteredStep::pi4020() noexcept
{
    return {.beta1 = 0.6, .beta2 = -0.2, .alpha = 0};
}
FilteredStep FilteredStep::elementary() noexcept
{
    return {.beta1 = 1, .beta2 = 0, .alpha = 0};
}

StepVerdict FilteredStep::judge(double error, double /*h*/) noexcept
{
    const double k = order + 1;
    const double now = positive(error);
    const double factor = std::pow(now, -beta1 / k) * std::pow(error_before, -beta2 / k) *
                          std::pow(factor_before, -alpha);
    if (!(factor >= least)) return {false, failed()};
    rejections = 0;
    error_before = now;
    factor_before = std::min(factor, most);
    return {true, factor_before};
}

StepVerdict PrescribedSteps::judge(double /*error*/, double h) noexcept
{
    const double wanted = (*lengths)[std::min(next, lengths->size() - 1)];
    ++next;
    return {true, wanted / h};
}

double FilteredStep::failed() noexcept
{
    if (++rejections >= 3) reset();
    return down;
}

void validate(const StepController& controller)
{
    constexpr detail::Require require{"step controller"};
    std::visit(
        [&](const auto& c) {
            using C = std::decay_t<decltype(c)>;
            if constexpr (requires { c.order; })
                require(c.order >= 1, "order must be at least 1", c.order);
            if constexpr (requires { c.down; }) {
                require(c.down > 0 && c.down < 1, "down must lie in (0, 1)", c.down);
            }
            if constexpr (requires { c.up; }) require(c.up >= 1, "up must be at least 1", c.up);
            if constexpr (std::is_same_v<C, ErrorStep>) {
                require(c.reject_above >= 1, "reject_above must be at least 1", c.reject_above);
                require(c.rule.smallest > 0 && c.rule.smallest < 1, "smallest must lie in (0, 1)",
                        c.rule.smallest);
                require(c.rule.largest > 1, "largest must be above 1", c.rule.largest);
                require(c.rule.safety > 0 && std::isfinite(c.rule.safety),
                        "safety must be positive and finite", c.rule.safety);
            }
            if constexpr (std::is_same_v<C, ClassicStep>) {
                require(c.safety > 0 && std::isfinite(c.safety),
                        "safety must be positive and finite", c.safety);
            }
            if constexpr (std::is_same_v<C, PrescribedSteps>) {
                require(c.lengths && !c.lengths->empty(), "steps must be prescribed", 0);
                for (const double length : *c.lengths) {
                    require(length > 0, "prescribed steps must be positive", length);
                }
            }
            if constexpr (std::is_same_v<C, LearnedStep>) {
                if (!c.policy) detail::Refuse{require.who}("no policy was given");
                validate(StepController(c.plain));
            }
            if constexpr (std::is_same_v<C, FilteredStep>) {
                require(c.least > 0 && c.least <= 1, "least must lie in (0, 1]", c.least);
                require(c.most > 1, "most must be above 1", c.most);
                require(std::isfinite(c.beta1 + c.beta2 + c.alpha), "the exponents must be finite",
                        c.beta1 + c.beta2 + c.alpha);
            }
            if constexpr (std::is_same_v<C, PrintedPiStep>) {
                require(c.gamma1 != 0 && c.gamma2 != 0, "gamma must not be zero",
                        std::min(std::abs(c.gamma1), std::abs(c.gamma2)));
                const double exponents = 1 / c.gamma1 + 1 / c.gamma2 + c.kappa;
                require(std::isfinite(exponents), "the exponents must be finite", exponents);
                require(c.c1 > 0 && std::isfinite(c.c1), "c1 must be positive and finite", c.c1);
                require(c.c2 > 1, "c2 must be above 1", c.c2);
            }
        },
        controller);
}

}  // namespace ricochet
