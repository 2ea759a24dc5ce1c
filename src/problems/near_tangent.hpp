// A harmonic oscillator that barely passes a level, touches it or misses it.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet {

/// y = cos(t + phase) and the level 1 - depth.
///
/// State (y, y'); passages through the level are recorded, and change nothing.
///
///     flow    y'' = -y
///     guard   y - (1 - depth), either direction
///
/// Known solution, with n = 1, 2, ... the crests in time:
///
///     depth > 0    two passages at 2 pi n - phase +- 2 asin(sqrt(depth / 2))
///     depth = 0    one touch at 2 pi n - phase
///     depth < 0    nothing
///
/// The smaller the depth, the closer the passages and the worse their condition: the slope is the
/// sine of the half-width between them. Functions are generic in the state and its scalar.
class NearTangent {
public:
    using State = std::array<double, 2>;
    static constexpr bool resets = false;

    struct Parameters {
        double depth = 1e-4;  ///< of the level below the crest, in (-inf, 2)
        double phase = 1;     ///< [rad]
        /// The largest distance between crest and level that is a touch, zero or
        /// positive. It is for the error of the integration, which moves the crest.
        double touch = 0;
    };

    constexpr NearTangent() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit NearTangent(const Parameters& parameters);

    static constexpr std::string_view name = "near-tangent";
    [[nodiscard]] State start() const noexcept;

    [[nodiscard]] GuardInfo guard_info(std::size_t /*which*/) const noexcept
    {
        return {.name = "level", .crossing = Crossing::either, .touch = parameters_.touch};
    }

    template <class X>
    constexpr void flow(const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }

    /// y - 1 is exact near the crest, where 1 - depth would lose digits of the depth.
    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return (x[0] - 1) + parameters_.depth;
    }

    /// Time [s] from a crest to a passage; NaN for a negative depth.
    [[nodiscard]] double half_width() const noexcept;

    /// Times [s] of the passages, or touches, in (0, t_end].
    [[nodiscard]] std::vector<double> events(double t_end) const;

private:
    Parameters parameters_{};
};

}  // namespace ricochet
