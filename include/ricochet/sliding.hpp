// Words and options of motion along switching surfaces.
#pragma once

#include <cstdint>

namespace ricochet {

/// Place of a motion with respect to a switching surface h = 0.
enum class Place : std::uint8_t {
    below,    ///< h < 0
    above,    ///< h > 0
    sliding,  ///< held on h = 0 by the fields of both sides
};

/// Type of the meeting of two fields at a switching surface.
enum class Meeting : std::uint8_t {
    crossing_up,    ///< both fields lead up
    crossing_down,  ///< both fields lead down
    attractive,     ///< neither field leads away: the motion slides
    repulsive,      ///< both fields lead away: the motion is not unique
};

/// Options of `Filippov`.
struct FilippovOptions {
    /// [1/s] Sliding follows h' = -restoring_rate h, which corrects the drift that the errors of
    /// the steps cause on a curved surface; a plane has no such drift. The rate must be slow
    /// compared with the motion, or it makes the motion stiff.
    double restoring_rate = 0;
};

}  // namespace ricochet
