// A learned pair of potentials made of three monotone functions of one variable.
//
//     f   = A(log(V/V*)) + beta xi
//     xi' = G(d),      d = e^C(xi) - V/V*
//
// A and G rise, C falls. The potentials are
//
//     Ddag = integral of A dV + beta V xi + beta V* c(xi),   c' = -e^C,
//     D*   = beta V* g(d / (beta V*)),                        g' = G,
//
// convex in V, in xi and in d by construction; beta sets the unit of xi and is no
// parameter of the fit.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "ricochet/faults/potentials.hpp"

namespace ricochet {

/// offset + slope z + sum of weight_i tanh(scale_i z + shift_i), of at most eight units. It
/// rises where slope >= 0 and every weight_i scale_i >= 0.
struct MonotoneNet {
    static constexpr std::size_t most_units = 8;
    using Row = std::array<double, most_units>;

    std::size_t units = 0;
    double offset = 0, slope = 0;
    Row weight{}, scale{}, shift{};  ///< zero beyond `units`

    /// Value with two derivatives.
    [[nodiscard]] ScalarJet jet(double z) const noexcept;
    /// Weights, scales, shifts, offset and slope.
    [[nodiscard]] std::size_t parameters() const noexcept { return 3 * units + 2; }
};

/// Domain in which a pair was trained.
struct PairDomain {
    double v_min = 0, v_max = 0;  ///< [m/s]
    double xi_min = 0, xi_max = 0;
};

/// A learned pair of potentials, Ddag(V, xi) and D*(d), whose friction is A(log V/V*) + beta xi
/// with monotone networks.
class AdditivePair {
public:
    static constexpr PotentialKind kind = PotentialKind::quadratic;  ///< D* of d alone
    static constexpr DirectEffect effect = DirectEffect::log;

    struct Parameters {
        double v_star = 1e-4;  ///< V* [m/s], a unit; positive
        double beta = 0.01;    ///< positive
        MonotoneNet direct;    ///< A
        MonotoneNet state;     ///< -C
        MonotoneNet rate;      ///< G, without offset: G(0) is set to zero
        PairDomain domain{};
    };

    /// @throws std::invalid_argument for a unit that makes a potential not convex, a weight
    /// that is not finite, or V* or beta not positive: net, unit and what was found.
    explicit AdditivePair(const Parameters& parameters);

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }
    /// Numbers that were fitted.
    [[nodiscard]] std::size_t fitted() const noexcept;

    /// @throws std::invalid_argument for V <= 0, here and below.
    [[nodiscard]] FrictionAndRate evaluate(double v, double xi) const;
    [[nodiscard]] FrictionAndRateGradient gradient(double v, double xi) const;

    /// Ddag(V, xi) with its derivatives; the value is found by quadrature, in microseconds.
    [[nodiscard]] RateStateJet rate_potential(double v, double xi) const;
    [[nodiscard]] ScalarJet dual(double d, double /*xi*/ = 0) const;
    /// @throws std::invalid_argument for a rate that G does not reach.
    [[nodiscard]] ScalarJet primal(double rate, double /*xi*/ = 0) const;

private:
    Parameters p_;
    double rate_at_zero_ = 0;  ///< of the units of G
};

static_assert(PotentialPair<AdditivePair>);

/// A potential file that cannot be read or is not what it claims to be: file, place, what
/// was expected and what was found.
class PotentialFileError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// The pair in a file (JSON). A file that claims to be convex where a unit contradicts it,
/// or whose stored test values are not those of its weights, is refused.
/// @throws PotentialFileError
[[nodiscard]] AdditivePair load_pair(const std::filesystem::path& path);
[[nodiscard]] AdditivePair parse_pair(const std::string& text, const std::string& name);

/// The text of a file, with test values; numbers keep their bits.
[[nodiscard]] std::string to_json(const AdditivePair& pair);

}  // namespace ricochet
