#include "problems/posts.hpp"

namespace ricochet {

Posts::Posts() : centres_{}
{
    for (std::size_t i = 0; i < count; ++i) {
        const auto k = static_cast<double>(i);
        const double reach = 0.35 + 0.6 * k / static_cast<double>(count);
        const double angle = 0.4 + 2.39996 * k;  // the golden angle
        centres_[i] = {reach * std::cos(angle), 0.8 * reach * std::sin(angle)};
    }
}

Posts::State Posts::start(std::size_t which) noexcept
{
    const auto k = static_cast<double>(which);
    return {0.1 + 0.02 * static_cast<double>(which % 7),
            -0.2 + 0.01 * static_cast<double>(which % 5), 1.1 - 0.003 * k, 0.7 + 0.002 * k};
}

Posts::Nearest Posts::nearest(double x, double y) const noexcept
{
    Nearest best{std::numeric_limits<double>::infinity(), 0, 0};
    for (const Centre& centre : centres_) {
        const double distance = std::hypot(x - centre.x, y - centre.y);
        if (distance < best.distance) {
            best = {distance, (x - centre.x) / distance, (y - centre.y) / distance};
        }
    }
    return best;
}

}  // namespace ricochet
