// ricochet_measure: every check.
#include "measure.hpp"

int main(int argc, char** argv)
{
    namespace bench = ricochet::bench;
    std::vector<bench::Check> checks;
    for (const auto& some :
         {bench::ball_checks(), bench::core_checks(), bench::network_checks(),
          bench::event_checks(), bench::resolution_checks(), bench::guard_checks(),
          bench::nonsmooth_checks(), bench::inclusion_checks(), bench::step_checks(),
          bench::fault_checks(), bench::friction_checks(), bench::file_checks(),
          bench::host_checks(), bench::taylor_checks(), bench::scene_checks(),
#ifdef RICOCHET_C
          bench::c_checks()
#endif
         }) {
        checks.insert(checks.end(), some.begin(), some.end());
    }
    return bench::run_checks(checks, argc, argv);
}
