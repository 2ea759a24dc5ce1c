// Internal: the declarations of this header may change without notice.
//
// One implicit stage with a reaction.
//
//     c A w = kappa f(t, w) + sigma G reaction + q,     law(E w - s(t), reaction)
//
// is solved in the stages of every implicit method. Its residual is relative to
// the forces involved: the largest defect of the equation, and of the law
//
//     sigma G (reaction - P(reaction - rho y)),   rho_i = 1 / W_ii,  W = sigma E S^-1 G,
//
// over the largest term of the equation, with S = c A - kappa df/dw. It is nondimensional
// and does not depend on any quantity that a solver carries along.
#pragma once

#include <algorithm>
#include <limits>

#include "ricochet/nonsmooth/detail/any_inclusion.hpp"
#include "ricochet/nonsmooth/stage_options.hpp"
#include "ricochet/phase.hpp"

namespace ricochet::detail {

template <int N, int M>
struct RICOCHET_ALIGNED Stage {
    double t = 0;
    double c = 1;
    double kappa = 1;
    double sigma = 1;
    Eigen::Matrix<double, N, 1> q;
};

/// Writes the inverse of the first n rows and columns of a, n <= 4, and zeros elsewhere. The
/// formula is that of n.
template <int N>
void invert_first(const Eigen::Matrix<double, N, N>& a, Eigen::Index n,
                  Eigen::Matrix<double, N, N>& inverse)
{
    if (n < N) inverse.setZero();
    const auto invert = [&]<int k>(std::integral_constant<int, k>) {
        if constexpr (k <= N) {
            const Eigen::Matrix<double, k, k> own = a.template topLeftCorner<k, k>();
            inverse.template topLeftCorner<k, k>() = own.inverse();
        }
    };
    switch (n) {
        case 1: return invert(std::integral_constant<int, 1>{});
        case 2: return invert(std::integral_constant<int, 2>{});
        case 3: return invert(std::integral_constant<int, 3>{});
        default: return invert(std::integral_constant<int, 4>{});
    }
}

/// S^-1 and the matrices that follow from it.
template <int N, int M>
struct RICOCHET_ALIGNED StageFactor {
    /// Whether a system of n components has its inverse written out.
    [[nodiscard]] static constexpr bool is_direct(Eigen::Index n) noexcept
    {
        return N != Eigen::Dynamic && n <= 4;
    }
    using Matrices = AnyMatrices<N, M>;
    using State = typename Matrices::State;
    using Square = typename Matrices::Square;

    double c = 0, kappa = 0, sigma = 0;
    bool valid = false;
    bool direct = false;
    Square jacobian;
    Square inverse;                        // of S, if direct
    Eigen::PartialPivLU<Square> lu;        // of S, if not
    typename Matrices::Action influence;   // sigma S^-1 G
    typename Matrices::Delassus delassus;  // E influence

    void compute(const Matrices& m, const Stage<N, M>& stage)
    {
        c = stage.c, kappa = stage.kappa, sigma = stage.sigma;
        direct = is_direct(m.own_size());
        if constexpr (N != Eigen::Dynamic) {
            if (direct) {
                invert_first<N>(c * m.mass() - kappa * jacobian, m.own_size(), inverse);
                influence.noalias() = times(inverse, m.act());
            }
        }
        if constexpr (!is_direct(N)) {
            if (!direct) {
                lu.compute(c * m.mass() - kappa * jacobian);
                influence = solve_by(lu, m.act());
            }
        }
        influence *= sigma;
        delassus.noalias() = times(m.observe(), influence);
        valid = true;
    }

    void solve(const State& right, State& w) const
    {
        if constexpr (is_direct(N)) {
            w.noalias() = times(inverse, right);
        } else if (direct) {
            w.noalias() = times(inverse, right);
        } else {
            w = solve_by(lu, right);
        }
    }
};

/// Results and memory that the stage solvers share.
template <int N, int M>
struct RICOCHET_ALIGNED StageScratch {
    using Matrices = AnyMatrices<N, M>;
    using State = typename Matrices::State;
    using Reaction = typename Matrices::Reaction;

    explicit StageScratch(const Matrices& matrices)
        : m(matrices), inclusion(matrices.inclusion()), traits(matrices.traits())
    {
        const Eigen::Index n = matrices.size();
        const Eigen::Index k = matrices.reactions();
        for (State* v : {&f, &f_trial, &w0, &trial, &defect, &base}) v->setZero(n);
        for (Reaction* v : {&s, &y, &reaction, &argument, &image, &rho, &lower, &upper})
            v->setZero(k);
        for (auto& factor : factors) factor.jacobian.setZero(n, n);
        inequality.w.setZero(k, k);
        for (Reaction* v : {&inequality.y0, &inequality.lower, &inequality.upper}) v->setZero(k);
        inequality.confines = traits.confines;
        if constexpr (M != Eigen::Dynamic) inequality.unknowns = matrices.own_reactions();
    }

    const Matrices& m;
    const AnyInclusion<N, M>& inclusion;
    const InclusionTraits& traits;
    State f, f_trial, w0, trial, defect, base;
    Reaction s, y, reaction, argument, image, rho, lower, upper;
    LinearInequality<M> inequality;
    // Steps of constant length need the factors of two stages, and halved steps two more.
    std::array<StageFactor<N, M>, 4> factors;
    std::size_t next_factor = 0;

    /// The factor of S at (t, w), which is reused if f is affine and the weights are
    /// the same.
    StageFactor<N, M>& factor(const Stage<N, M>& stage, const State& w)
    {
        if (traits.affine) {
            for (auto& known : factors) {
                if (known.valid && known.c == stage.c && known.kappa == stage.kappa &&
                    known.sigma == stage.sigma) {
                    return known;
                }
            }
        }
        auto& fresh = factors[next_factor];
        if (traits.affine) next_factor = (next_factor + 1) % factors.size();
        m.jacobian(stage.t, w, fresh.jacobian);
        fresh.compute(m, stage);
        return fresh;
    }

    /// Sets rho from the diagonal of W. Sets that are not boxes need one value for all components.
    void set_rho(const StageFactor<N, M>& by)
    {
        double sum = 0;
        for (Eigen::Index i = 0; i < rho.size(); ++i) {
            const double w = std::abs(by.delassus(i, i));
            rho[i] = w > 0 ? 1 / w : 1;
            sum += w;
        }
        if (!traits.box) {
            rho.setConstant(sum > 0 ? static_cast<double>(m.own_reactions()) / sum : 1);
        }
    }

    /// Argument of the projection in the law of (w, r): reaction - rho y, or for a set of states
    /// y - reaction / rho.
    void law_argument(const State& w, const Reaction& r)
    {
        y.noalias() = times(m.observe(), w);
        y -= s;
        if (traits.of_reactions()) {
            argument = r - rho.cwiseProduct(y);
        } else {
            argument = y - r.cwiseQuotient(rho);
        }
    }

    /// image = reaction - P(reaction - rho y), or for a set of states
    /// rho (P(y - reaction / rho) - y) with the sign of a reaction.
    void law_defect(double t, const State& w, const Reaction& r)
    {
        law_argument(w, r);
        inclusion.project(t, w, argument, image);
        if (traits.of_reactions()) {
            image = r - image;
        } else {
            image = rho.cwiseProduct(image - y);
        }
    }

    /// The residual of (w, r), with f = f(t, w) given; finds the component whose law is worst.
    StageReport residual(const Stage<N, M>& stage, const State& w, const State& f_at,
                         const Reaction& r)
    {
        base.noalias() = stage.c * times(m.mass(), w);
        defect = base - stage.kappa * f_at - stage.q;
        double scale = std::max({base.template lpNorm<Eigen::Infinity>(),
                                 stage.kappa * f_at.template lpNorm<Eigen::Infinity>(),
                                 stage.q.template lpNorm<Eigen::Infinity>()});
        base.noalias() = stage.sigma * times(m.act(), r);
        defect -= base;
        scale = std::max(scale, base.template lpNorm<Eigen::Infinity>());
        StageReport report{.residual = defect.template lpNorm<Eigen::Infinity>()};

        law_defect(stage.t, w, r);
        for (Eigen::Index i = 0; i < image.size(); ++i) {
            const double force = stage.sigma * std::abs(image[i]) *
                                 m.act().col(i).template lpNorm<Eigen::Infinity>();
            if (force > report.residual) {
                report.residual = force;
                report.set = static_cast<int>(i);
            }
        }
        if (!std::isfinite(report.residual) || !std::isfinite(scale)) {
            report.residual = std::numeric_limits<double>::infinity();
        } else if (scale > 0) {
            report.residual /= scale;
        }
        return report;
    }
};

}  // namespace ricochet::detail
