// Without SUNDIALS there is no host to measure in.
#include "measure.hpp"

namespace ricochet::bench {

std::vector<Check> host_checks()
{
    return {};
}

}  // namespace ricochet::bench
