#include "bindings/c/run_of.hpp"

#include <memory>

template class ricochet::c::CallbackSetup<std::vector<double>>;

std::unique_ptr<ricochet::c::AnyRun> ricochet::c::make_run_of_any(
    std::shared_ptr<const CallbackSystem> system, const double* x0, const RunOptions& options)
{
    return make_run_with<std::vector<double>>(std::move(system), x0, options);
}
