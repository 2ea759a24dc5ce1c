// `ricochet-nonsmooth`: `simulate` and `compare` of differential inclusions and contacts.
#include <fmt/format.h>

#include "../input.hpp"
#include "../program.hpp"
#include "compare_set_valued.hpp"
#include "complete.hpp"

namespace ricochet::app {

namespace {

/// @throws BadInput for a system of another program.
const SystemEntry& own_system(std::string_view name)
{
    const SystemEntry& system = find_system(name);
    if (system.program != "nonsmooth") {
        throw BadInput(
            fmt::format("ricochet-nonsmooth runs differential inclusions and contacts, got {}; "
                        "ricochet runs it",
                        system.name));
    }
    return system;
}

int simulate_one(const SimulateRequest& request)
{
    (void)own_system(request.system);
    return simulate(request);
}

int compare_one(const CompareRequest& request)
{
    const SystemEntry& system = own_system(request.system);
    return system.published_errors.empty() ? compare(request) : compare_set_valued(system, request);
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    complete_set_valued_systems();
    return run_program(
        [](CLI::App& app, int& status) {
            add_simulate(app, status, simulate_one);
            add_compare(app, status, compare_one);
        },
        count, arguments);
}
