#include "bindings/c/run_of.hpp"

#include <memory>

std::unique_ptr<ricochet::c::AnyRun> ricochet::c::make_run_of_small(
    std::shared_ptr<const CallbackSystem> system, const double* x0, const RunOptions& options)
{
    return make_run_with<ricochet::detail::SmallState>(std::move(system), x0, options);
}
