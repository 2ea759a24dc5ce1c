// `ricochet-ensemble`: the program of `ricochet ensemble`.
#include "../program.hpp"
#include "ensemble_command.hpp"

#ifdef RICOCHET_HAS_NONSMOOTH
#include "../nonsmooth/complete.hpp"
#endif

int main(int count, char** arguments)
{
    using namespace ricochet::app;
#ifdef RICOCHET_HAS_NONSMOOTH
    complete_set_valued_systems();
#endif
    return run_command(
        "ensemble", [](CLI::App& app, int& status) { add_ensemble(app, status, run_ensemble); },
        count, arguments);
}
