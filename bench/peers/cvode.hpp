// SUNDIALS CVODE as a peer in the table of work against precision. Built only where
// SUNDIALS is found.
#pragma once

#include "work_precision.hpp"

namespace ricochet::bench {

/// Adds the balls, solved by CVODE's Adams method with its own root finding, at
/// rtol = atol from 1e-6 to 1e-13.
void add_cvode(CaseList& cases);

}  // namespace ricochet::bench
