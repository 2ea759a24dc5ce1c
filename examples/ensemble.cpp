// A thousand balls with random heights and restitutions, on all cores: how many impacts does each
// have within 5 s, and where is it then?
#include <cstddef>
#include <cstdio>
#include <random>

#include <ricochet/ensemble.hpp>
#include <ricochet/ricochet.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

int main()
{
    struct End {
        double height;
        std::size_t impacts;
    };

    // The numbers of a row follow from its seed alone: the same for any number of threads.
    const auto drop = [](const ricochet::EnsembleRow& row) {
        std::mt19937_64 random(row.seed);
        const double height = std::uniform_real_distribution(1.0, 10.0)(random);  // [m]
        const double restitution = std::uniform_real_distribution(0.7, 0.9)(random);
        const ricochet::BouncingBall ball({.restitution = restitution});
        const auto run = ricochet::integrate(ball, {height, 0}, {.t_end = 5});
        return End{.height = run.x[0], .impacts = run.events.size()};
    };
    const auto balls = ricochet::ensemble(1000, drop, {.seed = 1});

    std::size_t impacts = 0;
    double highest = 0;  // [m]
    for (const auto& ball : balls.rows) {
        if (!ball) continue;  // its run threw an exception, which is in balls.failures
        impacts += ball->impacts;
        if (ball->height > highest) highest = ball->height;
    }
    std::printf("%zu impacts of %zu balls; the highest is at %.3f m after 5 s\n", impacts,
                balls.rows.size(), highest);
    return balls.complete && balls.failures.empty() ? 0 : 1;
}
