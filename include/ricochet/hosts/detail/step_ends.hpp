// Internal: the declarations of this header may change without notice.
#pragma once

#include <span>
#include <utility>
#include <vector>

namespace ricochet::hosts::detail {

/// Both ends of the step that a host took last. The host is at its end.
class StepEnds {
public:
    [[nodiscard]] double t() const noexcept { return t1_; }
    [[nodiscard]] std::span<const double> x() const noexcept { return x1_; }
    [[nodiscard]] std::span<const double> rate() const noexcept { return rate1_; }
    [[nodiscard]] double scale() const noexcept { return scale_; }

    [[nodiscard]] double t0() const noexcept { return t0_; }
    [[nodiscard]] double h() const noexcept { return t1_ - t0_; }
    [[nodiscard]] std::span<const double> x0() const noexcept { return x0_; }
    [[nodiscard]] std::span<const double> x1() const noexcept { return x1_; }
    [[nodiscard]] std::span<const double> rate0() const noexcept { return rate0_; }
    [[nodiscard]] std::span<const double> rate1() const noexcept { return rate1_; }

protected:
    StepEnds(double t, std::span<const double> x, double scale)
        : t0_(t), t1_(t), scale_(scale), x1_(x.begin(), x.end())
    {
    }

    /// The end is the start of the next step.
    void begin_step()
    {
        t0_ = t1_;
        std::swap(rate0_, rate1_);
        rate1_.resize(x1_.size());
        x0_ = x1_;
    }

    void go_to(double t, std::span<const double> x)
    {
        t1_ = t;
        if (x.data() != x1_.data()) x1_.assign(x.begin(), x.end());
        rate1_.resize(x1_.size());
    }

    double t0_, t1_;  ///< [s]
    double scale_;    ///< [s] length of the next step, roughly
    std::vector<double> x1_, x0_ = x1_, rate0_ = x1_, rate1_ = x1_;
};

}  // namespace ricochet::hosts::detail
