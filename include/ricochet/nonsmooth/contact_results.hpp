// What a motion with contacts returns besides its states: counts and forces.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "ricochet/run.hpp"

namespace ricochet {

/// Counts over one motion by time stepping.
struct TimeSteppingStatistics {
    std::uint64_t steps = 0;
    std::uint64_t problems = 0;    ///< steps with a closed contact, or with dry friction
    std::uint64_t iterations = 0;  ///< iterations of Newton's method in them
    std::uint64_t sweeps = 0;
    std::uint64_t unsolved = 0;  ///< steps that were repeated at half the length
};

/// Counts over one run with contacts.
struct ContactStatistics {
    Statistics event_driven;
    TimeSteppingStatistics time_stepping;
    std::uint64_t to_contact = 0;  ///< hand-overs, including a start in contact
    std::uint64_t to_flight = 0;
    double contact_time = 0;  ///< [s] duration of the motion in contact
};

/// Forces in contact, the means over a step: impulses by its length.
struct ContactForces {
    Eigen::VectorXd contacts;     ///< [N] of each contact, its normal one first; zero where open
    Eigen::VectorXd coordinates;  ///< of dry friction of each coordinate, zero without it
};

}  // namespace ricochet
