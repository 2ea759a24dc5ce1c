#include "ricochet/learn_steps/train_friction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>

#include "base/require.hpp"
#include "friction_models.hpp"
#include "ricochet/faults/variational_step.hpp"
#include "ricochet/learn/adam.hpp"

namespace ricochet::learn {

namespace {

using detail::FrictionModel;
using detail::sum_of_squares;

constexpr ricochet::detail::Refuse refuse_friction{"train_friction"};

double processor_time()
{
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// One internal variable along a history, with its derivatives by its block of parameters.
class StatePath {
public:
    StatePath(const FrictionModel& model, std::size_t j, bool with_gradient)
        : model_(model),
          j_(j),
          table_(ricochet::detail::sdirk_table(4)),
          with_gradient_(with_gradient)
    {
        if (!with_gradient) return;
        const auto n = static_cast<Eigen::Index>(model.block(j).size);
        sensitivity_.setZero(n);
        rate_gradient_.setZero(n);
        for (Eigen::VectorXd& k : slopes_) k.setZero(n);
    }

    [[nodiscard]] double value() const { return xi_; }
    [[nodiscard]] const Eigen::VectorXd& sensitivity() const { return sensitivity_; }

    /// Advances over an interval of length h in which V/V* goes linearly from u0 to u1.
    void advance(double u0, double u1, double h, int steps)
    {
        const double part = h / steps;
        for (int i = 0; i < steps; ++i) {
            const double from = u0 + (u1 - u0) * i / steps;
            step(from, (u1 - u0) / steps, part);
        }
    }

    /// Number of steps for an interval, by the slip in it, since the state forgets by slip.
    [[nodiscard]] static int steps_for(double u0, double u1, int refine)
    {
        const double u = std::max(u0, u1);
        const int steps = u > 2 ? 16 : u > 0.5 ? 8 : u > 0.1 ? 5 : 3;
        return steps << refine;
    }

private:
    void step(double u0, double change, double h)
    {
        const double own = table_.gamma * h;
        std::array<double, 5> k;
        double xi = xi_;
        for (std::size_t i = 0; i < table_.stages; ++i) {
            double before = xi_;
            for (std::size_t l = 0; l < i; ++l) before += h * table_.a[i][l] * k[l];
            const double u = u0 + change * table_.c[i];
            const double y = std::log(u);
            xi = solve(y, u, before, own, xi);
            k[i] = (xi - before) / own;
            if (with_gradient_) carry(i, y, u, xi, own, h);
        }
        xi_ = xi;
        if (with_gradient_) sensitivity_ = stage_;
    }

    /// Solves xi - before - own rate(xi) = 0, between before and before + own rate(before).
    [[nodiscard]] double solve(double y, double u, double before, double own, double guess) const
    {
        const double far = before + own * model_.rate(j_, y, u, before, nullptr).value;
        double lower = std::min(before, far);
        double upper = std::max(before, far);
        double xi = std::clamp(guess, lower, upper);
        for (int i = 0; i < 100; ++i) {
            const FrictionModel::Rate r = model_.rate(j_, y, u, xi, nullptr);
            const double gap = xi - before - own * r.value;
            const double step = -gap / (1 - own * r.slope);
            (gap > 0 ? upper : lower) = xi;
            // After a step this small the error is its square.
            if (std::abs(step) <= 1e-8) return xi + step;
            const double next = xi + step;
            xi = next > lower && next < upper ? next : (lower + upper) / 2;
        }
        return xi;
    }

    /// d xi_i = (d before + own dF/dp) / (1 - own dF/dxi).
    void carry(std::size_t i, double y, double u, double xi, double own, double h)
    {
        const FrictionModel::Rate r = model_.rate(j_, y, u, xi, rate_gradient_.data());
        before_ = sensitivity_;
        for (std::size_t l = 0; l < i; ++l) before_ += (h * table_.a[i][l]) * slopes_[l];
        stage_ = (before_ + own * rate_gradient_) / (1 - own * r.slope);
        slopes_[i] = (stage_ - before_) / own;
    }

    const FrictionModel& model_;
    std::size_t j_;
    const ricochet::detail::SdirkTable& table_;
    bool with_gradient_;
    double xi_ = 0;
    Eigen::VectorXd sensitivity_, rate_gradient_, before_, stage_;
    std::array<Eigen::VectorXd, 5> slopes_;
};

/// Friction along a history; rows of `jacobian` are its derivatives.
void roll_out(const FrictionModel& model, const FrictionHistory& history, int refine,
              std::vector<double>& friction, Eigen::MatrixXd* jacobian,
              std::vector<std::vector<double>>* internal)
{
    const std::size_t n = history.t.size();
    const std::size_t m = model.internals();
    std::vector<StatePath> paths;
    for (std::size_t j = 0; j < m; ++j) paths.emplace_back(model, j, jacobian != nullptr);
    std::vector<double> xi(m), by_xi(m);
    Eigen::VectorXd g(static_cast<Eigen::Index>(model.size()));
    friction.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < m; ++j) {
            if (i > 0) {
                const double u0 = history.v[i - 1] / model.v_star;
                const bool linear = history.between == FrictionHistory::Between::linear;
                const double u1 = linear ? history.v[i] / model.v_star : u0;
                paths[j].advance(u0, u1, history.t[i] - history.t[i - 1],
                                 StatePath::steps_for(u0, u1, refine));
            }
            xi[j] = paths[j].value();
            if (internal != nullptr) (*internal)[j].push_back(xi[j]);
        }
        const double y = std::log(history.v[i] / model.v_star);
        friction[i] =
            model.friction(y, xi.data(), by_xi.data(), jacobian != nullptr ? g.data() : nullptr);
        if (jacobian == nullptr) continue;
        for (std::size_t j = 0; j < m; ++j) {
            const FrictionModel::Block b = model.block(j);
            g.segment(static_cast<Eigen::Index>(b.first), static_cast<Eigen::Index>(b.size)) +=
                by_xi[j] * paths[j].sensitivity();
        }
        jacobian->row(static_cast<Eigen::Index>(i)) = g;
    }
}

double norm(const std::vector<double>& x)
{
    double square = 0;
    for (const double value : x) square += value * value;
    return std::sqrt(square);
}

}  // namespace

double detail::sum_of_squares(FrictionModel& model,
                              const std::vector<const FrictionHistory*>& histories,
                              const Eigen::VectorXd& p, Eigen::MatrixXd* normal,
                              Eigen::VectorXd* gradient)
{
    model.set(p);
    if (normal != nullptr) normal->setZero(p.size(), p.size());
    if (gradient != nullptr) gradient->setZero(p.size());
    double sum = 0;
    std::vector<double> friction;
    for (const FrictionHistory* h : histories) {
        Eigen::MatrixXd jacobian;
        if (gradient != nullptr) {
            jacobian.resize(static_cast<Eigen::Index>(h->t.size()), p.size());
        }
        roll_out(model, *h, 0, friction, gradient != nullptr ? &jacobian : nullptr, nullptr);
        const double weight = 1 / norm(h->friction);
        Eigen::VectorXd r(static_cast<Eigen::Index>(friction.size()));
        for (std::size_t i = 0; i < friction.size(); ++i) {
            r[static_cast<Eigen::Index>(i)] = weight * (friction[i] - h->friction[i]);
        }
        sum += r.squaredNorm();
        if (gradient == nullptr) continue;
        *gradient += weight * (jacobian.transpose() * r);
        if (normal != nullptr) {
            normal->selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose(),
                                                               weight * weight);
        }
    }
    if (normal != nullptr) {
        normal->triangularView<Eigen::StrictlyUpper>() =
            normal->triangularView<Eigen::StrictlyLower>().transpose();
    }
    return sum;
}

namespace {

void check(const std::vector<FrictionHistory>& histories, const FrictionTrainingOptions& o)
{
    if (histories.empty()) refuse_friction("expected histories, got none");
    for (const FrictionHistory& h : histories) {
        validate(h);
        if (h.friction.empty()) refuse_friction("a history without friction");
    }
    if (o.internal < 0 || o.internal > 2) {
        refuse_friction(fmt::format("internal must be 0, 1 or 2, got {}", o.internal));
    }
    if (o.network == FrictionNetwork::general && o.internal != 1) {
        refuse_friction(
            fmt::format("the general network has one internal variable, got {}", o.internal));
    }
    constexpr std::size_t most = MonotoneNet::most_units;
    if (std::max({o.direct_units, o.state_units, o.rate_units}) > most) {
        refuse_friction(fmt::format("a monotone net has at most {} units", most));
    }
    if (!(o.v_star > 0 && std::isfinite(o.v_star))) {
        refuse_friction(fmt::format("v_star must be positive and finite, got {}", o.v_star));
    }
}

/// Stochastic moves before Levenberg and Marquardt's, each on eight histories.
void move_by_adam(FrictionModel& model, const std::vector<const FrictionHistory*>& histories,
                  Eigen::VectorXd& p, const FrictionTrainingOptions& options)
{
    Random random(options.seed + 1000);
    Adam adam(static_cast<std::size_t>(p.size()), {});
    Eigen::VectorXd gradient(p.size());
    for (int i = 0; i < options.adam_iterations; ++i) {
        if (options.cancelled && options.cancelled->load(std::memory_order_relaxed)) return;
        std::vector<const FrictionHistory*> batch;
        for (int k = 0; k < 8; ++k) batch.push_back(histories[random.below(histories.size())]);
        (void)sum_of_squares(model, batch, p, nullptr, &gradient);
        const double decay = 1 - static_cast<double>(i) / options.adam_iterations;
        adam.step({p.data(), static_cast<std::size_t>(p.size())},
                  {gradient.data(), static_cast<std::size_t>(p.size())}, options.adam_rate * decay);
    }
}

LearnedFriction fit(std::unique_ptr<FrictionModel> model, Eigen::VectorXd p,
                    const std::vector<FrictionHistory>& histories,
                    const FrictionTrainingOptions& options)
{
    const double start = processor_time();
    std::vector<const FrictionHistory*> all;
    for (const FrictionHistory& h : histories) all.push_back(&h);
    move_by_adam(*model, all, p, options);
    const auto count = static_cast<double>(histories.size());
    const SumOfSquares problem = [&](const Eigen::VectorXd& at, Eigen::MatrixXd* normal,
                                     Eigen::VectorXd* gradient) {
        return sum_of_squares(*model, all, at, normal, gradient);
    };
    const LevenbergMarquardtReport report =
        levenberg_marquardt(problem, p,
                            {.iterations = options.iterations,
                             .seconds = options.seconds - (processor_time() - start),
                             .target = count * options.target * options.target,
                             .cancelled = options.cancelled});
    model->set(p);
    PairDomain& domain = model->domain;
    domain = {std::numeric_limits<double>::infinity(), 0, 0, 0};
    for (const FrictionHistory& h : histories) {
        domain.v_min = std::min(domain.v_min, *std::min_element(h.v.begin(), h.v.end()));
        domain.v_max = std::max(domain.v_max, *std::max_element(h.v.begin(), h.v.end()));
        if (model->internals() != 1) continue;
        std::vector<double> friction;
        std::vector<std::vector<double>> internal(1);
        roll_out(*model, h, 0, friction, nullptr, &internal);
        const auto [low, high] = std::minmax_element(internal[0].begin(), internal[0].end());
        domain.xi_min = std::min(domain.xi_min, *low);
        domain.xi_max = std::max(domain.xi_max, *high);
    }
    LearnedFriction out{std::shared_ptr<const FrictionModel>(std::move(model))};
    out.seconds = processor_time() - start;
    out.iterations = report.iterations;
    out.training_error = std::sqrt(report.sum / count);
    return out;
}

}  // namespace

LearnedFriction::LearnedFriction(std::shared_ptr<const FrictionModel> model)
    : model_(std::move(model))
{
}

std::vector<double> LearnedFriction::friction(const FrictionHistory& history, int refine) const
{
    validate(history);
    std::vector<double> out;
    roll_out(*model_, history, refine, out, nullptr, nullptr);
    return out;
}

std::vector<std::vector<double>> LearnedFriction::internal(const FrictionHistory& history) const
{
    validate(history);
    std::vector<double> friction;
    std::vector<std::vector<double>> out(model_->internals());
    roll_out(*model_, history, 0, friction, nullptr, &out);
    return out;
}

std::size_t LearnedFriction::parameters() const noexcept
{
    return static_cast<std::size_t>(model_->parameters.size());
}

std::optional<AdditivePair> LearnedFriction::pair() const
{
    return model_->pair();
}

LearnedFriction train_friction(const std::vector<FrictionHistory>& histories,
                               const FrictionTrainingOptions& options)
{
    check(histories, options);
    std::unique_ptr<FrictionModel> model;
    if (options.network == FrictionNetwork::general) {
        model = std::make_unique<detail::GeneralModel>(options.hidden_units, options.state_units,
                                                       options.rate_units);
    } else {
        model = std::make_unique<detail::AdditiveModel>(options.direct_units, options.state_units,
                                                        options.rate_units,
                                                        static_cast<std::size_t>(options.internal));
    }
    model->v_star = options.v_star;
    double mean = 0;
    double square = 0;
    double samples = 0;
    for (const FrictionHistory& h : histories) {
        for (const double f : h.friction) {
            mean += f;
            square += f * f;
            ++samples;
        }
    }
    mean /= samples;
    const double deviation = std::sqrt(std::max(square / samples - mean * mean, 1e-12));
    Eigen::VectorXd p(static_cast<Eigen::Index>(model->size()));
    Random random(options.seed);
    model->start(p, mean, deviation, random);
    return fit(std::move(model), std::move(p), histories, options);
}

LearnedFriction train_further(const LearnedFriction& from,
                              const std::vector<FrictionHistory>& histories,
                              const FrictionTrainingOptions& options)
{
    check(histories, options);
    return fit(from.model()->clone(), from.model()->parameters, histories, options);
}

FrictionErrors assess(const LearnedFriction& fit, const std::vector<FrictionHistory>& histories,
                      double f_star)
{
    FrictionErrors out;
    double square = 0;
    const auto count = static_cast<double>(histories.size());
    for (const FrictionHistory& h : histories) {
        const std::vector<double> friction = fit.friction(h);
        const double error = relative_error(friction, h.friction);
        out.mean += error / count;
        square += error * error / count;
        out.most = std::max(out.most, error);
        out.mean_beyond += relative_error_beyond(friction, h.friction, f_star) / count;
    }
    out.deviation = std::sqrt(std::max(square - out.mean * out.mean, 0.0));
    return out;
}

}  // namespace ricochet::learn
