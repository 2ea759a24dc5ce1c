// Stress on one rectangle of a vertical fault caused by the slip of another.
#pragma once

#include <Eigen/Core>
#include <filesystem>

namespace ricochet {

/// Shear stress at a point of the fault's plane over the shear modulus, for a unit slip along x on
/// a rectangle of the same plane, in an elastic full space:
///
///     -1/(4 pi) sum of sign [q / (p r (1 - nu)) + p / (q r)],   r = sqrt(p^2 + q^2)
///
/// over the corners p = dx +- width/2, q = dz +- height/2, with sign the product of their signs.
/// Negative on the rectangle itself: slip unloads it.
///
/// @param dx, dz         from the centre of the rectangle to the point [m]
/// @param width, height  of the rectangle, along x and along depth [m]
/// @param poisson        Poisson's ratio nu
/// @return [1/m]; infinite on the edges of the rectangle and their continuations
[[nodiscard]] double full_space_stress(double dx, double dz, double width, double height,
                                       double poisson) noexcept;

/// The same under a free surface at depth 0 (Y. Okada, Internal deformation due to shear and
/// tensile faults in a half-space, Bulletin of the Seismological Society of America 82, 1992,
/// tables 6 to 9, for a dip of 90 degrees and points on the fault's plane).
///
/// @param depth  of the point [m], zero or positive
/// @param source depth of the centre of the rectangle [m]; it may reach the surface
[[nodiscard]] double half_space_stress(double dx, double depth, double source, double width,
                                       double height, double poisson) noexcept;

/// A square matrix from a NumPy file (.npy) of float64 or float32, little-endian, in C or
/// Fortran order.
/// @throws std::invalid_argument naming the file and what was found and expected.
[[nodiscard]] Eigen::MatrixXd read_npy_square(const std::filesystem::path& file);

/// The only tensor of a safetensors file, a square matrix of F64 or F32.
/// @throws std::invalid_argument naming the file and what was found and expected.
[[nodiscard]] Eigen::MatrixXd read_safetensors_square(const std::filesystem::path& file);

/// The matrix of a file whose name ends in .safetensors, or of a NumPy file.
/// @throws std::invalid_argument naming the file and what was found and expected.
[[nodiscard]] Eigen::MatrixXd read_kernel(const std::filesystem::path& file);

}  // namespace ricochet
