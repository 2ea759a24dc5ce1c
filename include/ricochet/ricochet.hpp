// The core: hybrid systems, their events, their integration, networks that replace checks.
//
// Ready systems are in `ricochet/systems/`, set-valued motion in `ricochet/nonsmooth/`,
// derivatives in `ricochet/sensitivity/`, friction in `ricochet/faults/`, training in
// `ricochet/learn/`; each is included by name.
#pragma once

#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/gates.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/hybrid/filippov.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/simulation.hpp"
#include "ricochet/locate/locators.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/nn/model.hpp"
