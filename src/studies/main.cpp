// `ricochet-studies`: the comparisons that take a minute and more, and the papers' tables and
// figures.
#include "input.hpp"
#include "nonsmooth/complete.hpp"
#include "papers.hpp"
#include "program.hpp"
#include "studies.hpp"

namespace ricochet::app {

namespace {

int compare_study(const CompareRequest& request)
{
    if (request.system == "fault") return compare_fault(request);
    if (request.system == "rate-and-state") return compare_rate_and_state(request);
    if (request.system == "step-control") return compare_step_control(request);
    throw unknown("study", request.system, {"fault", "rate-and-state", "step-control"});
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    complete_set_valued_systems();
    return run_program(
        [](CLI::App& app, int& status) {
            add_compare(app, status, compare_study);
            add_exhibits(app, status);
        },
        count, arguments);
}
