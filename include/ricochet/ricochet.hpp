// The core: hybrid systems, their events, their integration, networks that replace checks.
//
// Ready systems are in `ricochet/systems/`, set-valued motion in `ricochet/nonsmooth/`,
// derivatives in `ricochet/sensitivity/`, friction in `ricochet/faults/`, training in
// `ricochet/learn/`; each is included by name.
#pragma once

#include "ricochet/bernstein.hpp"
#include "ricochet/bounds.hpp"
#include "ricochet/enclosed.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/filippov.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/options.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/run.hpp"
#include "ricochet/simulation.hpp"
#include "ricochet/system.hpp"
