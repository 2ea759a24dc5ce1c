#include "problems.hpp"

namespace ricochet::report {

Task<Arenstorf> arenstorf()
{
    // From the doubles nearest to the book's start: Fehlberg's method of order 8 in arithmetic of
    // 34 digits, in steps of 0.01 and 0.005 of the time scale of the nearer body, which agree to
    // 20 digits.
    Task<Arenstorf> task{
        .x0 = {0.994, 0, 0, -2.00158510637908252240537862224}, .t_end = 17.2, .first_step = 1e-4};
    for (const double t :
         {0.3991362164334659453380, 6.2293384973158087158388, 8.5326082800788587211297,
          10.835878062842401170621, 16.666080343725358589509, 17.065216560157812527065}) {
        task.events.push_back({t, 0});
    }
    return task;
}

}  // namespace ricochet::report
