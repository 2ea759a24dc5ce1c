// An earthquake on a strike-slip fault of 20 x 20 elements: the mean motion, and where it slipped.
#include <ricochet/faults/strike_slip_fault.hpp>

#include <cstdio>

int main()
{
    using namespace ricochet;

    const StrikeSlipFault fault({.elements = 20});  // 3 km x 3 km
    const Rupture rupture = simulate(fault, {.t_end = 30, .snapshot_times = {6.5, 8.15, 9.5}});

    std::printf("mean slip %.4f m, fastest at %.3f s with %.4f m/s, at rest after %.3f s\n",
                rupture.mean_slip, rupture.peak_time, rupture.peak_velocity, rupture.rest_time);
    std::printf("%llu elements stopped, in %llu steps\n",
                static_cast<unsigned long long>(rupture.statistics.arrests),
                static_cast<unsigned long long>(rupture.statistics.steps));

    // The rupture starts deep, where friction drops most, and runs towards the surface.
    std::puts("\nvelocity [cm/s] down the middle");
    std::puts("depth [km]   6.5 s  8.15 s   9.5 s");
    for (int row = 0; row < fault.elements(); row += 3) {
        std::printf("%10.2f", fault.depth(row) / 1000);
        for (const RuptureSnapshot& snapshot : rupture.snapshots) {
            std::printf("%8.2f", 100 * snapshot.velocity[20 * row + 10]);
        }
        std::puts("");
    }
    return rupture.outcome == Outcome::at_rest ? 0 : 1;
}
