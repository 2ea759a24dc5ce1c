// Internal: the declarations of this header may change without notice.
//
// The Wright omega function.
#pragma once

namespace ricochet {

/// omega(z), the solution of omega + log(omega) = z, for any real z: positive, increasing,
/// e^z for z -> -infinity and z - log(z) for z -> infinity. Within 2 units in the last
/// place where the result is a normal number.
///
/// A fitted start is improved once by the fourth-order scheme of F. N. Fritsch,
/// R. E. Shafer and W. P. Crowley (Algorithm 443, Communications of the ACM 16, 1973).
/// (R. M. Corless and D. J. Jeffrey, The Wright omega function, 2002.)
[[nodiscard]] double wright_omega(double z) noexcept;

}  // namespace ricochet
