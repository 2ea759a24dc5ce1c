// A day of the FMU of sampled_heater.cpp, or of another one of such a room, with a frosty night:
//
//     a_day sampled_heater.fmu
#include <cstddef>
#include <cstdio>
#include <exception>
#include <ricochet/fmi/run.hpp>

int main(int count, char** arguments)
try {
    if (count != 2) return std::puts("usage: a_day ROOM.fmu"), 2;
    namespace fmi = ricochet::fmi;
    const fmi::Fmu room(arguments[1]);
    const fmi::Run run = fmi::run(
        room, {.start = {{"set_point", 21}},
               .inputs = {{.name = "outside", .t = {0, 43200, 86400}, .values = {-10, 10, -10}}},
               .output = {"temperature", "heating"}});
    std::size_t switched = 0;
    double on = 0, since = 0;
    for (const fmi::Event& event : run.events) {
        if (event.before[1] == event.after[1]) continue;
        ++switched;
        if (event.before[1] == 1) on += event.t - since;
        since = event.t;
    }
    std::printf("%s; %zu ticks, switched %zu times, heated for %.2f h, at the end %.3f degC\n",
                describe(run).c_str(), run.events.size(), switched, on / 3600, run.x[0]);
    return run.end == fmi::End::reached_end && switched > 10 ? 0 : 1;
} catch (const std::exception& error) {
    std::puts(error.what());
    return 2;
}
