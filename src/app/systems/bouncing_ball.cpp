#include "ricochet/systems/bouncing_ball.hpp"

#include "entries.hpp"
#include "ready_runs.hpp"

namespace ricochet::app {

namespace {

constexpr std::string_view source =
    "Saunders, Steyer and Kuether, Machine learning for event detection in non-smooth initial "
    "value problems, SAND2023-06682C, table 1";

std::vector<Published> published()
{
    return {{.name = "paper: network",
             .source = source,
             .times = {1.427843122926641, 3.997960744196168, 6.311066603338677, 8.392861876565325,
                       10.266477622465255, 11.952731793775415, 13.470360547954783,
                       14.836226426716886, 16.065505717603227, 17.171857079401377,
                       18.167573305020159, 19.063717908075276, 19.870248050826223}},
            {.name = "paper: simple approach (ode45)",
             .source = source,
             .times = {1.427843122927093, 3.997960744195887, 6.311066603337761, 8.392861876565391,
                       10.266477622470353, 11.952731793784908, 13.470360547967886,
                       14.836226426732534, 16.065505717620926, 17.171857079420576,
                       18.167573305040214, 19.063717908097843, 19.870248050849643}}};
}

}  // namespace

SystemEntry bouncing_ball_entry()
{
    SystemEntry entry = described<BouncingBall>();
    ReadyRuns<BouncingBall>::give_to(entry);
    entry.models = {
        {.file = "bouncing-ball-step-0.01.safetensors", .kind = "fixed-step", .any_step = false},
        {.file = "bouncing-ball.safetensors", .kind = "any-step", .any_step = true}};
    entry.line = "u/(g h²) + v/(g h) <= 1/2";
    entry.published = published();
    return entry;
}

}  // namespace ricochet::app
