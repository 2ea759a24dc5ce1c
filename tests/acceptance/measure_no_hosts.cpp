// Without SUNDIALS there is no host program for measurements.
#include "measure.hpp"

namespace ricochet::bench {

std::vector<Check> host_checks()
{
    return {};
}

}  // namespace ricochet::bench
