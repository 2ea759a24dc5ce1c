#include "ricochet/nonsmooth/composite_step.hpp"

#include "base/require.hpp"

namespace ricochet {

void validate(const SchemeOptions& options)
{
    using detail::require;
    require(options.theta > 0 && options.theta <= 1, "SchemeOptions", "theta", "lie in (0, 1]",
            options.theta);
    const StageOptions& stage = options.stage;
    require(stage.tolerance > 0, "StageOptions", "tolerance", "be positive", stage.tolerance);
    require(stage.max_iterations >= 1, "StageOptions", "max_iterations", "be at least 1",
            stage.max_iterations);
}

}  // namespace ricochet
