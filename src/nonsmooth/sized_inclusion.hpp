// Inclusions whose sizes are known at run time, such as those of callbacks, in the solvers of the
// sizes that the library has compiled: at most 8 components and 4 reactions, whose sets are boxes.
#pragma once

#include <cstddef>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/nonsmooth/detail/branch_phases.hpp"

namespace ricochet::detail {

/// A, E and G by rows. Empty: the unit matrix, the first m components, and the transpose of E.
struct SizedMatrices {
    std::vector<double> mass, observe, act;
};

/// A w' = f(t, w) + G r, y = E w - s(t), lower <= r <= upper; see inclusion.hpp. With n components
/// and m reactions, arrays have n or m numbers.
class SizedInclusion {
public:
    SizedInclusion() = default;
    SizedInclusion(const SizedInclusion&) = delete;
    SizedInclusion& operator=(const SizedInclusion&) = delete;
    virtual ~SizedInclusion() = default;

    [[nodiscard]] virtual std::size_t size() const noexcept = 0;
    [[nodiscard]] virtual std::size_t reactions() const noexcept = 0;
    virtual void smooth(double t, const double* w, double* f) const = 0;
    virtual void bounds(double t, const double* w, double* lower, double* upper) const = 0;
    [[nodiscard]] virtual bool has_offset() const noexcept = 0;
    /// s, which is zero where it is not written, and its rate.
    virtual void offset(double t, double* s) const = 0;
    virtual void offset_rate(double t, double* rate) const = 0;
    [[nodiscard]] virtual const SizedMatrices& matrices() const noexcept = 0;
    /// See static-friction.md.
    [[nodiscard]] virtual bool has_static_bounds() const noexcept = 0;
    virtual void static_bounds(double t, const double* w, double* bounds) const = 0;
};

inline constexpr std::size_t most_components = 8, most_reactions = 4;

/// @throws InclusionRefused for sizes beyond these, and matrices that are not as they have to be.
[[nodiscard]] Owner<BranchPhases> make_branch_phases(Shared<const SizedInclusion> inclusion,
                                                     const BranchPhasesOptions& options);

}  // namespace ricochet::detail
