// Parametrised potentials of friction, with the derivatives that training needs.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "base/fast_tanh.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/faults/friction.hpp"

namespace ricochet::learn::detail {

/// A rising function e^s z + sum of e^p_i tanh(e^q_i z + r_i) of raw numbers s, p, q, r.
class Rising {
public:
    static constexpr std::size_t most = MonotoneNet::most_units;

    explicit Rising(std::size_t units) : units_(units) {}

    [[nodiscard]] std::size_t size() const { return 1 + 3 * units_; }

    void set(const double* raw)
    {
        slope_ = std::exp(raw[0]);
        weight_ = scale_ = shift_ = {};
        for (std::size_t i = 0; i < units_; ++i) {
            weight_[i] = std::exp(raw[1 + i]);
            scale_[i] = std::exp(raw[1 + units_ + i]);
            shift_[i] = raw[1 + 2 * units_ + i];
        }
    }

    /// Random units with slopes of the order of `slope` over |z| <= 1 / `scale`.
    void start(double* raw, double slope, double scale, Random& random) const
    {
        raw[0] = std::log(slope) + random.uniform(-0.5, 0.5);
        for (std::size_t i = 0; i < units_; ++i) {
            const double q = scale * random.log_uniform(0.5, 2);
            raw[1 + i] = std::log(0.3 * slope / q) + random.uniform(-0.5, 0.5);
            raw[1 + units_ + i] = std::log(q);
            raw[1 + 2 * units_ + i] = random.uniform(-2, 2);
        }
    }

    struct Value {
        double value, slope;
    };

    [[nodiscard]] Value at(double z) const
    {
        std::array<double, most> t = arguments(z);
        Value out{slope_ * z, slope_};
        for (std::size_t i = 0; i < units_; ++i) {
            out.value += weight_[i] * t[i];
            out.slope += weight_[i] * scale_[i] * (1 - t[i] * t[i]);
        }
        return out;
    }

    /// The derivatives of the value by the raw numbers, times `factor`, into g.
    void gradient(double z, double factor, double* g) const
    {
        const std::array<double, most> t = arguments(z);
        g[0] = factor * slope_ * z;
        for (std::size_t i = 0; i < units_; ++i) {
            const double rise = factor * weight_[i] * (1 - t[i] * t[i]);
            g[1 + i] = factor * weight_[i] * t[i];
            g[1 + units_ + i] = rise * scale_[i] * z;
            g[1 + 2 * units_ + i] = rise;
        }
    }

    [[nodiscard]] MonotoneNet net(double offset) const
    {
        return {.units = units_,
                .offset = offset,
                .slope = slope_,
                .weight = weight_,
                .scale = scale_,
                .shift = shift_};
    }

private:
    [[nodiscard]] std::array<double, most> arguments(double z) const
    {
        std::array<double, most> t;
        for (std::size_t i = 0; i < most; ++i) t[i] = scale_[i] * z + shift_[i];
        ricochet::detail::tanh_all(t);
        return t;
    }

    std::size_t units_;
    double slope_ = 1;
    std::array<double, most> weight_{}, scale_{}, shift_{};
};

/// The drive of the internal variable: d = e^C(xi) - w with w the wear, xi' = G(d), in one
/// block of parameters: offset of C, C, G.
class StateDrive {
public:
    StateDrive(std::size_t state_units, std::size_t rate_units)
        : state_(state_units), rate_(rate_units)
    {
    }

    [[nodiscard]] std::size_t size() const { return 1 + state_.size() + rate_.size(); }

    void set(const double* raw)
    {
        offset_ = raw[0];
        state_.set(raw + 1);
        rate_.set(raw + 1 + state_.size());
        rest_ = rate_.at(0).value;
    }

    void start(double* raw, Random& random) const
    {
        raw[0] = 0;
        state_.start(raw + 1, 0.5, 0.3, random);
        rate_.start(raw + 1 + state_.size(), 30, 0.3, random);
    }

    struct Drive {
        double heal, heal_slope;  ///< e^C and its derivative by xi
        double rate, rate_slope;  ///< G(d) and G'(d)
        double d;
    };

    [[nodiscard]] Drive at(double wear, double xi) const
    {
        const Rising::Value c = state_.at(xi);
        const double heal = std::exp(std::min(offset_ - c.value, 60.0));
        const double d = heal - wear;
        const Rising::Value g = rate_.at(d);
        return {heal, -heal * c.slope, g.value - rest_, g.slope, d};
    }

    /// dG/d(raw) of the drive at xi into g; the caller adds the part through the wear.
    void gradient(const Drive& drive, double xi, double* g) const
    {
        const double by_c = drive.rate_slope * drive.heal;
        g[0] = by_c;
        state_.gradient(xi, -by_c, g + 1);
        double* own = g + 1 + state_.size();
        rate_.gradient(drive.d, 1, own);
        std::array<double, 3 * Rising::most + 1> zero;
        rate_.gradient(0, 1, zero.data());
        for (std::size_t i = 0; i < rate_.size(); ++i) own[i] -= zero[i];
    }

    [[nodiscard]] const Rising& state() const { return state_; }
    [[nodiscard]] const Rising& rate() const { return rate_; }
    [[nodiscard]] double offset() const { return offset_; }

private:
    Rising state_, rate_;
    double offset_ = 0, rest_ = 0;
};

/// Friction and rates as functions of y = log(V/V*), u = V/V*, the internal variables and
/// the parameters.
class FrictionModel {
public:
    virtual ~FrictionModel() = default;
    FrictionModel() = default;
    FrictionModel(const FrictionModel&) = default;
    FrictionModel& operator=(const FrictionModel&) = delete;

    [[nodiscard]] virtual std::unique_ptr<FrictionModel> clone() const = 0;
    [[nodiscard]] virtual std::size_t size() const = 0;
    [[nodiscard]] virtual std::size_t internals() const = 0;
    /// The parameters on which the rate of an internal variable depends.
    struct Block {
        std::size_t first, size;
    };
    [[nodiscard]] virtual Block block(std::size_t j) const = 0;
    virtual void set(const Eigen::VectorXd& p) = 0;
    virtual void start(Eigen::VectorXd& p, double mean, double deviation, Random& random) = 0;

    struct Rate {
        double value, slope;  ///< and its derivative by xi_j
    };
    /// xi_j' and, where `g` is not null, its derivatives by the block.
    virtual Rate rate(std::size_t j, double y, double u, double xi, double* g) const = 0;
    /// Friction, its derivatives by the internal variables, and by all parameters.
    virtual double friction(double y, const double* xi, double* by_xi, double* g) const = 0;
    [[nodiscard]] virtual std::optional<AdditivePair> pair() const { return std::nullopt; }

    double v_star = 1e-4;
    PairDomain domain{};
    Eigen::VectorXd parameters;
};

class AdditiveModel : public FrictionModel {
public:
    AdditiveModel(std::size_t direct, std::size_t state, std::size_t rate, std::size_t internals)
        : direct_(direct), drives_(internals, StateDrive(state, rate))
    {
    }

    [[nodiscard]] std::unique_ptr<FrictionModel> clone() const override
    {
        return std::make_unique<AdditiveModel>(*this);
    }
    [[nodiscard]] std::size_t internals() const override { return drives_.size(); }
    [[nodiscard]] std::size_t size() const override
    {
        return first() + (drives_.empty() ? 0 : drives_.size() * drives_[0].size());
    }
    [[nodiscard]] Block block(std::size_t j) const override
    {
        return {first() + j * drives_[j].size(), drives_[j].size()};
    }

    void set(const Eigen::VectorXd& p) override
    {
        parameters = p;
        offset_ = p[0];
        direct_.set(p.data() + 1);
        for (std::size_t j = 0; j < drives_.size(); ++j) drives_[j].set(p.data() + block(j).first);
    }

    void start(Eigen::VectorXd& p, double mean, double deviation, Random& random) override
    {
        beta = deviation;
        p[0] = mean;
        direct_.start(p.data() + 1, deviation / 3, 0.3, random);
        for (std::size_t j = 0; j < drives_.size(); ++j) {
            drives_[j].start(p.data() + block(j).first, random);
        }
    }

    Rate rate(std::size_t j, double /*y*/, double u, double xi, double* g) const override
    {
        const StateDrive::Drive d = drives_[j].at(u, xi);
        if (g != nullptr) drives_[j].gradient(d, xi, g);
        return {d.rate, d.rate_slope * d.heal_slope};
    }

    double friction(double y, const double* xi, double* by_xi, double* g) const override
    {
        double f = offset_ + direct_.at(y).value;
        for (std::size_t j = 0; j < drives_.size(); ++j) {
            f += beta * xi[j];
            by_xi[j] = beta;
        }
        if (g != nullptr) {
            std::fill(g, g + size(), 0.0);
            g[0] = 1;
            direct_.gradient(y, 1, g + 1);
        }
        return f;
    }

    [[nodiscard]] std::optional<AdditivePair> pair() const override
    {
        if (drives_.size() != 1) return std::nullopt;
        const StateDrive& drive = drives_[0];
        return AdditivePair({.v_star = v_star,
                             .beta = beta,
                             .direct = direct_.net(offset_),
                             .state = drive.state().net(-drive.offset()),
                             .rate = drive.rate().net(0),
                             .domain = domain});
    }

    double beta = 0.01;

private:
    [[nodiscard]] std::size_t first() const { return 1 + direct_.size(); }

    Rising direct_;
    std::vector<StateDrive> drives_;
    double offset_ = 0;
};

/// N(y, xi) = n0 + alpha y + beta (xi + sum of w_i log(1 + e^(p_i y + q_i xi + r_i))), w > 0.
class GeneralModel : public FrictionModel {
public:
    GeneralModel(std::size_t hidden, std::size_t state, std::size_t rate)
        : hidden_(hidden), drive_(state, rate), w_(hidden), p_(hidden), q_(hidden), r_(hidden)
    {
    }

    [[nodiscard]] std::unique_ptr<FrictionModel> clone() const override
    {
        return std::make_unique<GeneralModel>(*this);
    }
    [[nodiscard]] std::size_t internals() const override { return 1; }
    [[nodiscard]] std::size_t size() const override { return 2 + 4 * hidden_ + drive_.size(); }
    [[nodiscard]] Block block(std::size_t) const override { return {0, size()}; }

    void set(const Eigen::VectorXd& p) override
    {
        parameters = p;
        offset_ = p[0];
        alpha_ = p[1];
        for (std::size_t i = 0; i < hidden_; ++i) {
            const auto at = static_cast<Eigen::Index>(2 + 4 * i);
            w_[i] = std::exp(p[at]);
            p_[i] = p[at + 1];
            q_[i] = p[at + 2];
            r_[i] = p[at + 3];
        }
        drive_.set(p.data() + 2 + 4 * hidden_);
    }

    void start(Eigen::VectorXd& p, double mean, double deviation, Random& random) override
    {
        beta = deviation;
        p[0] = mean;
        p[1] = deviation / 3;
        for (std::size_t i = 0; i < hidden_; ++i) {
            const auto at = static_cast<Eigen::Index>(2 + 4 * i);
            p[at] = std::log(0.1);
            p[at + 1] = random.uniform(-0.5, 0.5);
            p[at + 2] = random.uniform(-0.5, 0.5);
            p[at + 3] = random.uniform(-2, 2);
        }
        drive_.start(p.data() + 2 + 4 * hidden_, random);
    }

    Rate rate(std::size_t, double y, double u, double xi, double* g) const override
    {
        double slope = 1;
        double bend = 0;
        for (std::size_t i = 0; i < hidden_; ++i) {
            const double s = sigmoid(i, y, xi);
            slope += w_[i] * q_[i] * s;
            bend += w_[i] * q_[i] * q_[i] * s * (1 - s);
        }
        const StateDrive::Drive d = drive_.at(u * slope, xi);
        if (g != nullptr) {
            const double by_wear = -d.rate_slope * u;
            g[0] = g[1] = 0;
            for (std::size_t i = 0; i < hidden_; ++i) {
                const double s = sigmoid(i, y, xi);
                const double t = s * (1 - s);
                double* own = g + 2 + 4 * i;
                const double w = by_wear * w_[i];
                own[0] = w * q_[i] * s;
                own[1] = w * q_[i] * t * y;
                own[2] = w * (s + q_[i] * t * xi);
                own[3] = w * q_[i] * t;
            }
            drive_.gradient(d, xi, g + 2 + 4 * hidden_);
        }
        return {d.rate, d.rate_slope * (d.heal_slope - u * bend)};
    }

    double friction(double y, const double* state, double* by_xi, double* g) const override
    {
        const double xi = state[0];
        double f = offset_ + alpha_ * (1 + y) + beta * xi;
        double slope = beta;
        if (g != nullptr) {
            std::fill(g, g + size(), 0.0);
            g[0] = 1;
            g[1] = 1 + y;
        }
        for (std::size_t i = 0; i < hidden_; ++i) {
            const double a = p_[i] * y + q_[i] * xi + r_[i];
            const double soft = a > 30 ? a : std::log1p(std::exp(a));
            const double s = 1 / (1 + std::exp(-a));
            const double t = s * (1 - s);
            const double w = beta * w_[i];
            f += w * (soft + p_[i] * s);
            slope += w * q_[i] * (s + p_[i] * t);
            if (g == nullptr) continue;
            double* own = g + 2 + 4 * i;
            own[0] = w * (soft + p_[i] * s);
            own[1] = w * (s * y + s + p_[i] * t * y);
            own[2] = w * xi * (s + p_[i] * t);
            own[3] = w * (s + p_[i] * t);
        }
        by_xi[0] = slope;
        return f;
    }

    double beta = 0.01;

private:
    [[nodiscard]] double sigmoid(std::size_t i, double y, double xi) const
    {
        return 1 / (1 + std::exp(-(p_[i] * y + q_[i] * xi + r_[i])));
    }

    std::size_t hidden_;
    StateDrive drive_;
    std::vector<double> w_, p_, q_, r_;
    double offset_ = 0, alpha_ = 0;
};

/// The sum over histories of the square of the relative error at the parameters p, and,
/// where they are not null, J^T J and half of its gradient, J^T r.
double sum_of_squares(FrictionModel& model, const std::vector<const FrictionHistory*>& histories,
                      const Eigen::VectorXd& p, Eigen::MatrixXd* normal, Eigen::VectorXd* gradient);

}  // namespace ricochet::learn::detail
