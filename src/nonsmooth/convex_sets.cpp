#include "ricochet/nonsmooth/inclusion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <random>
#include <stdexcept>
#include <vector>

namespace ricochet::detail {
namespace {

class Sampler {
public:
    Sampler(std::size_t dimension, const Projection& project, const Projection& derivative)
        : n_(dimension), project_(project), derivative_(derivative)
    {
    }

    void run()
    {
        for (int trial = 0; trial < 200; ++trial) {
            const std::vector<double> z = point();
            const std::vector<double> y = point();
            idempotent(z);
            firmly_nonexpansive(z, y);
            derivative_matches(z);
        }
    }

private:
    [[nodiscard]] std::vector<double> point()
    {
        std::normal_distribution<double> normal;
        std::uniform_int_distribution<int> decade(-2, 2);
        const double scale = std::pow(10.0, decade(random_));
        std::vector<double> z(n_);
        for (double& component : z) {
            component = scale * normal(random_);
        }
        return z;
    }

    [[nodiscard]] std::vector<double> projected(const std::vector<double>& z) const
    {
        std::vector<double> p(n_);
        project_(z, p);
        return p;
    }

    [[noreturn]] void refuse(std::string_view what, const std::vector<double>& z) const
    {
        throw std::invalid_argument(
            fmt::format("convex set: {} at ({})", what, fmt::join(z, ", ")));
    }

    void idempotent(const std::vector<double>& z) const
    {
        const std::vector<double> p = projected(z);
        const std::vector<double> again = projected(p);
        for (std::size_t i = 0; i < n_; ++i) {
            // A few roundings of the largest component.
            if (!(std::abs(again[i] - p[i]) <= 1e-12 * size(p))) {
                refuse("its projection is not idempotent", z);
            }
        }
    }

    void firmly_nonexpansive(const std::vector<double>& z, const std::vector<double>& y) const
    {
        const std::vector<double> a = projected(z);
        const std::vector<double> b = projected(y);
        double square = 0;
        double product = 0;
        for (std::size_t i = 0; i < n_; ++i) {
            square += (a[i] - b[i]) * (a[i] - b[i]);
            product += (a[i] - b[i]) * (z[i] - y[i]);
        }
        const double scale = size(z) + size(y) + size(a) + size(b);
        if (!(square <= product + 1e-12 * scale * scale)) {
            refuse("its projection is not that of a convex set", z);
        }
    }

    void derivative_matches(const std::vector<double>& z) const
    {
        std::vector<double> d(n_ * n_);
        derivative_(z, d);
        const double step = 1e-6 * size(z);
        for (std::size_t j = 0; j < n_; ++j) {
            std::vector<double> right = z;
            std::vector<double> left = z;
            right[j] += step;
            left[j] -= step;
            const std::vector<double> ahead = projected(right);
            const std::vector<double> behind = projected(left);
            const std::vector<double> here = projected(z);
            for (std::size_t i = 0; i < n_; ++i) {
                const double forward = (ahead[i] - here[i]) / step;
                const double backward = (here[i] - behind[i]) / step;
                const bool smooth = std::abs(forward - backward) < 1e-3;
                // Differences of a curved face are off by a step over its radius.
                if (smooth && std::abs(d[i * n_ + j] - (forward + backward) / 2) > 1e-3) {
                    refuse("its derivative is not that of its projection", z);
                }
            }
        }
    }

    [[nodiscard]] double size(const std::vector<double>& z) const
    {
        double largest = std::numeric_limits<double>::min();
        for (const double component : z) {
            largest = std::max(largest, std::abs(component));
        }
        return largest;
    }

    std::size_t n_;
    const Projection& project_;
    const Projection& derivative_;
    std::mt19937 random_{1};
};

}  // namespace

void check_projection(std::size_t dimension, const Projection& project,
                      const Projection& derivative)
{
    Sampler(dimension, project, derivative).run();
}

}  // namespace ricochet::detail
