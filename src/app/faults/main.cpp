// `ricochet-fault`: `simulate` of the fault and the spring-slider.
#include <fmt/format.h>

#include "fault.hpp"
#include "input.hpp"
#include "program.hpp"
#include "registry.hpp"

namespace ricochet::app {

namespace {

int simulate_one(const SimulateRequest& request)
{
    const SystemEntry& system = find_system(request.system);
    if (system.name == "fault") return simulate_fault(system, request);
    if (system.name == "spring-slider") return simulate_spring_slider(system, request);
    throw BadInput(fmt::format(
        "ricochet-fault simulates fault and spring-slider, got {}; ricochet simulates it",
        system.name));
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    return run_program([](CLI::App& app, int& status) { add_simulate(app, status, simulate_one); },
                       count, arguments);
}
