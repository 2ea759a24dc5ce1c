// ricochet_measure_v3: the checks of Taylor's method, all compiled for x86-64-v3 (AVX2 and FMA).
#include "measure.hpp"

int main(int argc, char** argv)
{
    namespace bench = ricochet::bench;
    std::vector<bench::Check> checks;
    for (bench::Check& check : bench::taylor_checks()) {
        // Where products and sums are fused every run is computed alone (ricochet/lanes.hpp).
        if (check.id == "taylor-lanes") continue;
        check.sentence += ", x86-64-v3";
        checks.push_back(check);
    }
    return bench::run_checks(checks, argc, argv);
}
