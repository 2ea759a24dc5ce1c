// Random inclusions in thirteen families, and their motion by another method.
//
// All families share one type: six components of state, of which the unused ones rest, and M
// reactions, of which the unused ones act with the bounds [0, 0] on a component that is always 1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string_view>
#include <vector>

#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet::test {

enum class InclusionFamily {
    relay_from_rest,     ///< one relay, two sines as a load
    relay_at_its_limit,  ///< w' = a sin(omega t) + r with a slightly above 1
    coupled_relays,      ///< two to four, sliding on their intersections
    redundant_chain,     ///< two masses: ground, ground, and between them
    chain,               ///< two masses: ground, and between them
    dependent,           ///< two relays on one observation, in either direction
    diodes,
    opposed_diodes,  ///< one holds w >= 0, the other w <= 0 or w <= v
    twisting,        ///< one relay acts two integrations away
    super_twisting,
    weakening,      ///< friction that falls with the velocity, one or two masses
    one_sided,      ///< a unilateral contact beside two of friction
    four_contacts,  ///< three masses
    five_contacts,  ///< three masses; needs M = 5
};
inline constexpr std::array<std::string_view, 14> family_names{
    "relay from rest", "relay at its limit", "coupled relays", "redundant chain",
    "chain",           "dependent",          "diodes",         "opposed diodes",
    "twisting",        "super-twisting",     "weakening",      "one-sided",
    "four contacts",   "five contacts"};

/// w' = B w + sines + G r, y = E w, r in a box that may shrink with |y|.
template <int M>
struct RandomInclusion {
    static constexpr int state_size = 6;
    static constexpr int reaction_size = M;
    using Vector = Eigen::Matrix<double, state_size, 1>;
    using Reaction = Eigen::Matrix<double, M, 1>;
    using Square = Eigen::Matrix<double, state_size, state_size>;

    Square linear = Square::Zero();
    Eigen::Matrix<double, state_size, M> lever = Eigen::Matrix<double, state_size, M>::Zero();
    Eigen::Matrix<double, M, state_size> seen = Eigen::Matrix<double, M, state_size>::Zero();
    Vector slow = Vector::Zero(), fast = Vector::Zero();  // amplitudes of the load
    std::array<double, 2> frequency{1, 1}, phase{0, 0};
    Reaction lower = Reaction::Zero(), upper = Reaction::Zero(), weakening = Reaction::Zero();
    double root = 0;  // of the super-twisting term in component 0
    Vector start = Vector::Zero();
    double t_end = 1;
    int reactions = 0;  // that are used

    [[nodiscard]] Vector load(double t) const
    {
        return slow * std::sin(frequency[0] * t + phase[0]) +
               fast * std::sin(frequency[1] * t + phase[1]);
    }
    void smooth(double t, const Vector& w, Vector& f) const
    {
        f.noalias() = linear * w;
        f += load(t);
        if (root != 0) f[0] -= root * std::copysign(std::sqrt(std::abs(w[0])), w[0]);
    }
    void smooth_jacobian(double, const Vector& w, Square& j) const
    {
        j = linear;
        if (root != 0) j(0, 0) -= root / (2 * std::sqrt(std::max(std::abs(w[0]), 1e-24)));
    }
    void observe(Eigen::Matrix<double, M, state_size>& e) const { e = seen; }
    void act(Eigen::Matrix<double, state_size, M>& g) const { g = lever; }
    [[nodiscard]] sets::Box<M> reaction_set(double, const Vector& w) const
    {
        std::array<double, M> low, up;
        for (Eigen::Index i = 0; i < M; ++i) {
            const double weaker =
                weakening[i] > 0 ? 1 + weakening[i] * std::abs(seen.row(i).dot(w)) : 1;
            low[static_cast<std::size_t>(i)] = lower[i] / weaker;
            up[static_cast<std::size_t>(i)] = upper[i] / weaker;
        }
        return sets::Box<M>(low, up);
    }
    [[nodiscard]] double branch_bound(double, const Vector& w, int i, Branch branch) const
    {
        const double y = seen.row(i).dot(w);
        const bool up = branch == Branch::upper;
        return (up ? upper[i] : lower[i]) / std::max(0.5, 1 + weakening[i] * (up ? -y : y));
    }
};

/// The same numbers from the same seed with any standard library.
class Draw {
    std::mt19937_64 engine_;

public:
    explicit Draw(std::uint64_t seed) : engine_(seed) {}

    double uniform(double a, double b)
    {
        return a + (b - a) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
    }
    bool coin() { return uniform(0, 1) < 0.5; }
};

/// t_end k / samples, k = 1 ... samples.
[[nodiscard]] inline std::vector<double> equal_times(double t_end, int samples)
{
    std::vector<double> times;
    for (int i = 1; i <= samples; ++i) {
        times.push_back(i == samples ? t_end : t_end * i / samples);
    }
    return times;
}

template <int M>
class InclusionMaker : Draw {
    using System = RandomInclusion<M>;
    System s_;
    int next_ = 0;

public:
    InclusionMaker(InclusionFamily family, std::uint64_t seed)
        : Draw(seed * 1000003 + static_cast<std::uint64_t>(family) * 7919 + 17)
    {
    }

    [[nodiscard]] System make(InclusionFamily family)
    {
        using enum InclusionFamily;
        switch (family) {
            case relay_from_rest:
            case relay_at_its_limit: relay(family == relay_from_rest); break;
            case coupled_relays: relays(); break;
            case redundant_chain: masses(true); break;
            case chain: masses(false); break;
            case dependent: dependent_relays(); break;
            case diodes:
            case opposed_diodes: circuit(family == opposed_diodes); break;
            case twisting: twist(); break;
            case super_twisting: super_twist(); break;
            case weakening: weaken(); break;
            case one_sided: unilateral(); break;
            case four_contacts: three_masses(false); break;
            case five_contacts: three_masses(true); break;
        }
        s_.reactions = next_;
        s_.start[5] = 1;
        for (int i = next_; i < M; ++i) s_.seen(i, 5) = s_.lever(5, i) = 1;
        return s_;
    }

private:
    void loads(int first, int end, double amplitude, double fastest = 12)
    {
        for (int i = first; i < end; ++i) {
            s_.slow[i] = uniform(-amplitude, amplitude);
            s_.fast[i] = uniform(-amplitude, amplitude);
        }
        s_.frequency = {uniform(0.7, fastest / 2), uniform(1, fastest)};
        s_.phase = {uniform(0, 6), uniform(0, 6)};
    }
    /// Friction or a relay on the velocity of `a` relative to `b`, or to the ground.
    void friction(int a, int b, double bound, double mass_a = 1, double mass_b = 1)
    {
        s_.seen(next_, a) = 1;
        s_.lever(a, next_) = 1 / mass_a;
        if (b >= 0) {
            s_.seen(next_, b) = -1;
            s_.lever(b, next_) = -1 / mass_b;
        }
        s_.upper[next_] = bound;
        s_.lower[next_++] = -bound;
    }

    void relay(bool two_sines)
    {
        friction(0, -1, 1);
        s_.slow[0] = two_sines ? uniform(0.5, 1) : uniform(1.01, 1.2);
        if (two_sines) s_.fast[0] = uniform(0.3, 0.8);
        s_.frequency = {two_sines ? uniform(1, 6) : uniform(5, 20), uniform(2, 12)};
        s_.t_end = uniform(5, 20);
    }
    void relays()
    {
        const int m = 2 + static_cast<int>(uniform(0, 3));
        for (int i = 0; i < m; ++i) {
            friction(i, -1, uniform(0.5, 1.5));
            s_.start[i] = coin() ? uniform(-1, 1) : 0;
        }
        for (int i = 0; i < m; ++i) {
            for (int j = 0; j < m; ++j) {
                // Dominant diagonals, so that the motion is unique.
                if (i != j) s_.lever(i, j) = uniform(-0.9, 0.9) / (m - 1);
                s_.linear(i, j) = uniform(-0.5, 0.5);
            }
        }
        loads(0, m, 1);
        s_.t_end = uniform(3, 10);
    }
    void masses(bool redundant)
    {
        const double m1 = uniform(0.5, 2), m2 = uniform(0.5, 2);
        const double k1 = uniform(0, 3), k2 = uniform(0, 3), k = uniform(0, 3);
        s_.linear(0, 2) = s_.linear(1, 3) = 1;
        s_.linear(2, 0) = -(k1 + k) / m1, s_.linear(2, 1) = k / m1;
        s_.linear(3, 1) = -(k2 + k) / m2, s_.linear(3, 0) = k / m2;
        friction(2, -1, uniform(0.2, 1), m1);
        if (redundant) friction(3, -1, uniform(0.2, 1), m2);
        friction(2, 3, uniform(0.2, 1), m1, m2);
        loads(2, 4, 1.5, 4);
        for (int j = 0; j < 4; ++j) s_.start[j] = coin() ? uniform(-1, 1) : 0;
        s_.t_end = uniform(4, 10);
    }
    void dependent_relays()
    {
        const int m = coin() ? 2 : 3;
        for (int i = 0; i < 2; ++i) {
            for (int j = 0; j < 2; ++j) s_.linear(i, j) = uniform(-0.5, 0.5);
            s_.start[i] = coin() ? uniform(-1, 1) : 0;
        }
        for (; next_ < m; ++next_) {
            s_.upper[next_] = uniform(0.3, 1);
            s_.lower[next_] = -uniform(0.3, 1);
            s_.seen.row(next_).head(2) << uniform(-1, 1), uniform(-1, 1);
            if (next_ == m - 1) s_.seen.row(next_) = (coin() ? 2 : -2) * s_.seen.row(0);
            s_.lever.col(next_) = s_.seen.row(next_).transpose();
        }
        loads(0, 2, 2);
        s_.t_end = uniform(3, 10);
    }
    void circuit(bool opposed)
    {
        const double g = uniform(0.2, 2);
        s_.linear.template topLeftCorner<3, 3>() << -g, g, 0, g, -g, 1, uniform(-0.5, 0.5), -1, 0;
        s_.seen(0, 0) = s_.lever(0, 0) = 1;
        s_.start.template head<3>() << (coin() ? uniform(0, 1) : 0), uniform(1, 2), uniform(-1, 1);
        const bool between = coin();
        if (opposed) {
            s_.seen(1, 0) = s_.lever(0, 1) = -1;
            if (between) s_.seen(1, 1) = s_.lever(1, 1) = 1;
            if (!between) s_.start[0] = 0;
        } else {
            s_.seen(1, 1) = s_.lever(1, 1) = 1;
        }
        s_.upper[0] = s_.upper[1] = std::numeric_limits<double>::infinity();
        next_ = 2;
        loads(0, 3, 1.5);
        s_.t_end = uniform(3, 12);
    }
    void twist()
    {
        const double a = uniform(1, 3), b = uniform(0.3, 0.8) * a;
        s_.linear(0, 1) = 1;
        friction(0, -1, a);
        s_.lever(0, 0) = 0;
        s_.lever(1, 0) = 1;
        friction(1, -1, b);
        s_.slow[1] = uniform(0, 0.8) * std::min(b, a - b);
        s_.frequency[0] = uniform(0.5, 3);
        s_.start.template head<2>() << uniform(-1, 1), uniform(-1, 1);
        s_.t_end = uniform(3, 15);
    }
    void super_twist()
    {
        s_.root = uniform(2, 5);
        s_.linear(0, 1) = 1;
        friction(0, -1, uniform(1.5, 3));
        s_.lever(0, 0) = 0;
        s_.lever(1, 0) = 1;
        s_.slow[1] = uniform(0, 0.7) * s_.upper[0];
        s_.frequency[0] = uniform(0.5, 3);
        s_.start.template head<2>() << uniform(-1, 1), uniform(-1, 1);
        s_.t_end = uniform(3, 12);
    }
    void weaken()
    {
        const int n = coin() ? 1 : 2;
        for (int i = 0; i < n; ++i) {
            s_.linear(i, 2 + i) = 1;
            s_.linear(2 + i, i) = -uniform(0.5, 3);
            s_.weakening[i] = uniform(0.2, 2);
            friction(2 + i, -1, uniform(0.3, 1));
            s_.seen(i, 5) = uniform(-0.3, 0.3);  // the velocity of the belt
            s_.start[i] = uniform(-1, 1);
            s_.start[2 + i] = coin() ? uniform(-0.5, 0.5) : -s_.seen(i, 5);
        }
        loads(2, 2 + n, 0.4);
        s_.t_end = uniform(4, 12);
    }
    void unilateral()
    {
        const double m1 = uniform(0.5, 2), m2 = uniform(0.5, 2);
        s_.linear.template topLeftCorner<2, 2>() << -uniform(0, 0.5), uniform(-0.5, 0.5),
            uniform(-0.5, 0.5), -uniform(0, 0.5);
        friction(0, -1, std::numeric_limits<double>::infinity(), m1);
        s_.lower[0] = 0;
        friction(1, -1, uniform(0.3, 1), m2);
        if (coin()) friction(0, 1, uniform(0.3, 1), m1, m2);
        loads(0, 2, 1.5);
        s_.start.template head<2>() << (coin() ? uniform(0, 1) : 0), (coin() ? uniform(-1, 1) : 0);
        s_.t_end = uniform(4, 12);
    }
    void three_masses(bool five)
    {
        std::array<double, 3> m{};
        for (int i = 0; i < 3; ++i) {
            m[static_cast<std::size_t>(i)] = uniform(0.5, 2);
            s_.linear(i, i) = -uniform(0, 0.5);
            s_.start[i] = coin() ? uniform(-1, 1) : 0;
        }
        friction(0, -1, uniform(0.2, 0.8), m[0]);
        friction(1, -1, uniform(0.2, 0.8), m[1]);
        if (five) friction(2, -1, uniform(0.2, 0.8), m[2]);
        friction(0, 1, uniform(0.2, 0.8), m[0], m[1]);
        friction(1, 2, uniform(0.2, 0.8), m[1], m[2]);
        loads(0, 3, 1.5);
        s_.t_end = uniform(4, 12);
    }
};

template <int M>
[[nodiscard]] RandomInclusion<M> random_inclusion(InclusionFamily family, std::uint64_t seed)
{
    return InclusionMaker<M>(family, seed).make(family);
}

/// Backward Euler with every choice of branches tried, on plain arrays and independently of
/// the library.
class BackwardEuler {
    static constexpr std::size_t n = 6, most = 5;
    using State = std::array<double, n>;
    using Reactions = std::array<double, most>;

public:
    std::vector<State> at;  ///< t_end k / samples, k = 1 ... samples
    double size = 0;        ///< the largest component of w
    double speed = 0;       ///< the largest of w'
    int unsolved = 0;       ///< steps without a solution

    template <int M>
    BackwardEuler(const RandomInclusion<M>& s, int steps, int samples)
        : m_(static_cast<std::size_t>(s.reactions)), h_(s.t_end / steps), root_(s.root)
    {
        const auto e = [](std::size_t i) { return static_cast<Eigen::Index>(i); };
        State w{};
        for (std::size_t i = 0; i < n; ++i) {
            w[i] = s.start[e(i)];
            for (std::size_t j = 0; j < n; ++j) linear_[i][j] = s.linear(e(i), e(j));
            for (std::size_t k = 0; k < m_; ++k) {
                lever_[i][k] = s.lever(e(i), e(k));
                seen_[k][i] = s.seen(e(k), e(i));
            }
        }
        factor(w);
        for (int k = 1; k <= steps; ++k) {
            if (root_ != 0) factor(w);
            const double t = s.t_end * k / steps;
            State load{};
            for (std::size_t i = 0; i < n; ++i) {
                load[i] = s.slow[e(i)] * std::sin(s.frequency[0] * t + s.phase[0]) +
                          s.fast[e(i)] * std::sin(s.frequency[1] * t + s.phase[1]);
            }
            // The bounds are those of the step's start.
            for (std::size_t i = 0; i < m_; ++i) {
                double y = 0;
                for (std::size_t j = 0; j < n; ++j) y += seen_[i][j] * w[j];
                lower_[i] = s.lower[e(i)] / (1 + s.weakening[e(i)] * std::abs(y));
                upper_[i] = s.upper[e(i)] / (1 + s.weakening[e(i)] * std::abs(y));
            }
            const State next = step(w, load);
            for (std::size_t i = 0; i + 1 < n; ++i) {
                speed = std::max(speed, std::abs(next[i] - w[i]) / h_);
                size = std::max(size, std::abs(next[i]));
            }
            w = next;
            if (k % (steps / samples) == 0) at.push_back(w);
        }
    }

private:
    void factor(const State& w)
    {
        double a[n][2 * n] = {};
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t j = 0; j < n; ++j) a[i][j] = (i == j) - h_ * linear_[i][j];
            a[i][n + i] = 1;
        }
        // The root is taken as linear, with the factor of the step's start.
        a[0][0] += h_ * root_ / std::sqrt(std::max(std::abs(w[0]), 1e-10));
        for (std::size_t i = 0; i < n; ++i) {  // I - h B is near the unit matrix
            for (std::size_t k = 0; k < n; ++k) {
                const double f = k == i ? 0 : a[k][i] / a[i][i];
                for (std::size_t j = 0; f != 0 && j < 2 * n; ++j) a[k][j] -= f * a[i][j];
            }
        }
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t j = 0; j < n; ++j) inverse_[i][j] = a[i][n + j] / a[i][i];
        }
        for (std::size_t k = 0; k < m_; ++k) {
            for (std::size_t i = 0; i < n; ++i) {
                influence_[i][k] = 0;
                for (std::size_t j = 0; j < n; ++j) {
                    influence_[i][k] += h_ * inverse_[i][j] * lever_[j][k];
                }
            }
        }
        for (std::size_t k = 0; k < m_; ++k) {
            for (std::size_t l = 0; l < m_; ++l) {
                w_[k][l] = 0;
                for (std::size_t i = 0; i < n; ++i) w_[k][l] += seen_[k][i] * influence_[i][l];
            }
        }
    }

    State step(const State& w, const State& load)
    {
        State next{};
        double largest = 1;
        for (std::size_t i = 0; i < n; ++i) {
            largest = std::max(largest, std::abs(w[i]));
            for (std::size_t j = 0; j < n; ++j) next[i] += inverse_[i][j] * (w[j] + h_ * load[j]);
        }
        Reactions q{}, r{};
        for (std::size_t k = 0; k < m_; ++k) {
            for (std::size_t i = 0; i < n; ++i) q[k] += seen_[k][i] * next[i];
        }
        bool found = fits(q, 1e-14 * largest, r);
        int codes = 1;
        for (std::size_t i = 0; i < m_; ++i) codes *= 3;
        for (double tolerance = 1e-14; !found && tolerance < 1e-9; tolerance *= 100) {
            for (int code = 0; code < codes && !found; ++code) {
                int rest = code;
                for (std::size_t i = 0; i < m_; ++i) branch_[i] = rest % 3 - 1, rest /= 3;
                found = fits(q, tolerance * largest, r);
            }
        }
        unsolved += !found;
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t k = 0; k < m_; ++k) next[i] += influence_[i][k] * r[k];
        }
        return next;
    }

    /// The reaction on the present branches, if it lies on them. A reaction whose y is zero may be
    /// at its bound, so that reactions that depend on one another need not be held together.
    bool fits(const Reactions& q, double room, Reactions& r) const
    {
        std::array<std::size_t, most> held{};
        std::size_t count = 0;
        for (std::size_t i = 0; i < m_; ++i) {
            r[i] = branch_[i] == 0 ? 0 : branch_[i] < 0 ? lower_[i] : upper_[i];
            if (std::isinf(r[i])) return false;
            if (branch_[i] == 0) held[count++] = i;
        }
        double a[most][most + 1];
        double largest = 0;
        for (std::size_t i = 0; i < count; ++i) {
            a[i][count] = -q[held[i]];
            for (std::size_t l = 0; l < m_; ++l) a[i][count] -= w_[held[i]][l] * r[l];
            for (std::size_t j = 0; j < count; ++j) {
                a[i][j] = w_[held[i]][held[j]];
                largest = std::max(largest, std::abs(a[i][j]));
            }
        }
        for (std::size_t i = 0; i < count; ++i) {
            std::size_t pivot = i;
            for (std::size_t k = i; k < count; ++k) {
                if (std::abs(a[k][i]) > std::abs(a[pivot][i])) pivot = k;
            }
            if (std::abs(a[pivot][i]) < 1e-10 * largest) return false;
            std::swap(a[i], a[pivot]);
            for (std::size_t k = i + 1; k < count; ++k) {
                const double f = a[k][i] / a[i][i];
                for (std::size_t j = i; j <= count; ++j) a[k][j] -= f * a[i][j];
            }
        }
        for (std::size_t i = count; i-- > 0;) {
            double sum = a[i][count];
            for (std::size_t j = i + 1; j < count; ++j) sum -= a[i][j] * r[held[j]];
            r[held[i]] = sum / a[i][i];
        }
        for (std::size_t i = 0; i < m_; ++i) {
            double y = q[i];
            for (std::size_t l = 0; l < m_; ++l) y += w_[i][l] * r[l];
            const bool inside = r[i] >= lower_[i] - room / h_ && r[i] <= upper_[i] + room / h_;
            if (branch_[i] == 0 ? !inside : branch_[i] * y > room) return false;
        }
        return true;
    }

    std::size_t m_;
    double h_, root_;
    std::array<int, most> branch_{};
    double linear_[n][n] = {}, inverse_[n][n] = {}, lever_[n][most] = {}, influence_[n][most] = {};
    double seen_[most][n] = {}, w_[most][most] = {};
    Reactions lower_{}, upper_{};
};

/// Extrapolated from two step lengths, with their difference.
class ReferenceMotion {
public:
    double size = 0, speed = 0, uncertainty = 0;
    bool solved = false;

    template <int M>
    ReferenceMotion(const RandomInclusion<M>& system, int steps, int samples)
    {
        // Where switchings accumulate the two may agree at some times by accident.
        constexpr int between = 10;
        const BackwardEuler coarse(system, steps, between * samples);
        const BackwardEuler fine(system, 2 * steps, between * samples);
        for (std::size_t i = 0; i < fine.at.size(); ++i) {
            std::array<double, 6> w = fine.at[i];
            for (std::size_t j = 0; j < w.size(); ++j) {
                const double off = fine.at[i][j] - coarse.at[i][j];
                w[j] += off;
                uncertainty = std::max(uncertainty, std::abs(off));
            }
            if ((i + 1) % between == 0) at_.push_back(w);
        }
        size = std::max(fine.size, 1e-3 * system.t_end);
        speed = fine.speed;
        solved = coarse.unsolved + fine.unsolved == 0;
    }

    /// Distance of w from the motion at sample i.
    template <class Vector>
    [[nodiscard]] double error(std::size_t i, const Vector& w) const
    {
        double worst = 0;
        for (std::size_t j = 0; j < at_[i].size(); ++j) {
            worst = std::max(worst, std::abs(w[static_cast<Eigen::Index>(j)] - at_[i][j]));
        }
        return worst;
    }

    /// Allowed error of a run of set-valued steps h: a thousandth of the motion, or the change of
    /// the motion in two steps, since a change within a step costs a step at one rate.
    [[nodiscard]] double allowed(double h) const
    {
        return 3 * uncertainty + std::max(1e-3 * size, 2 * h * speed);
    }

private:
    std::vector<std::array<double, 6>> at_;
};

}  // namespace ricochet::test
