// A user of the component `fmi`: runs the FMU that ricochet_add_fmu has made of fmi_ball.cpp.
#include <cmath>
#include <cstdio>

#include "ricochet/fmi/run.hpp"

int main()
{
    using namespace ricochet::fmi;
    const Run run = ricochet::fmi::run(Fmu(BALL_FMU), {.t_end = 2});
    const bool fine = run.end == End::reached_end && run.events.size() == 1 &&
                      std::fabs(run.events[0].t - std::sqrt(20 / 9.81)) < 1e-15;
    std::puts(fine ? "fine" : describe(run).c_str());
    return fine ? 0 : 1;
}
