// Scenes as FMUs for co-simulation: the motion and the events of the scene itself.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "fmi/unpacked.hpp"
#include "ricochet/fmi/ready.hpp"
#include "ricochet/fmi/run.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::fmi::scene_fmu_test {

namespace {

namespace fs = std::filesystem;
using Result = fmi::Run;

/// A file that is removed, with a name of its own.
class Temporary {
public:
    explicit Temporary(const std::string& name)
        : path(fs::temp_directory_path() / ("ricochet_scene_" + std::to_string(getpid()) + name))
    {
    }
    Temporary(const std::string& name, const std::string& text) : Temporary(name)
    {
        std::ofstream(path) << text;
    }
    ~Temporary()
    {
        std::error_code ignored;
        fs::remove(path, ignored);
    }
    Temporary(const Temporary&) = delete;
    Temporary& operator=(const Temporary&) = delete;

    const fs::path path;
};

fs::path example(const std::string& name)
{
    return fs::path(RICOCHET_SCENES) / (name + ".json");
}

const std::string lone_ball = R"({"gravity": [0, -9.81],
"materials": {"steel": {"restitution": 0.5}},
"walls": [{"point": [0, 0], "normal": [0, 1], "material": "steel"}],
"bodies": [{"name": "ball", "disc": {"radius": 1}, "at": [0, 11], "material": "steel"}],
"run": {"t_end": 6}})";

class SceneFmus : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Fmi, SceneFmus, testing::Values(2, 3));

/// The scene advanced from outside until t_end, and the times of its events.
std::pair<SceneRun, std::vector<double>> own_run(const fs::path& scene, double t_end)
{
    const SceneFile file = load_scene(scene.string());
    SceneOptions options = file.options;
    options.t_end = 1000;  // no step ends there, as none does in the FMU
    options.contacts = scene_contacts();
    SceneSimulation own(file.scene, options);
    std::vector<double> times;
    while (own.advance(t_end)) {
        if (times.empty() || own.t() > times.back()) times.push_back(own.t());
    }
    return {own.run(), times};
}

TEST_P(SceneFmus, MoveAsTheSceneDoesWithAnyCommunicationStep)
{
    for (const auto& [name, t_end] : {std::pair{"bin", 0.4}, {"chain", 0.2}}) {
        SCOPED_TRACE(name);
        const Temporary file(std::string(name) + ".fmu");
        export_scene({.scene = example(name), .version = GetParam()}, file.path);
        const Fmu fmu(file.path);
        EXPECT_EQ(fmu.description().model_name, name);
        EXPECT_FALSE(fmu.description().model_exchange);
        const auto [expected, times] = own_run(example(name), t_end);
        for (const double step : {t_end / 37, t_end}) {
            const Result run =
                fmi::run(fmu, {.t_end = t_end, .sample_times = {t_end}, .step = step});
            ASSERT_EQ(run.end, End::reached_end) << describe(run);
            ASSERT_EQ(run.output.size(), 4 * expected.bodies.size() + 2);
            const std::vector<double>& found = run.rows.back().values;
            for (std::size_t i = 0; i < expected.bodies.size(); ++i) {
                const BodyState& body = expected.bodies[i];
                EXPECT_EQ((std::vector(found.begin() + 4 * i, found.begin() + 4 * i + 4)),
                          (std::vector{body.at[0], body.at[1], body.velocity[0], body.velocity[1]}))
                    << run.output[4 * i];
            }
            EXPECT_EQ(found[found.size() - 2],
                      energy(load_scene(example(name).string()).scene, expected.bodies));
            EXPECT_EQ(run.last("events"), static_cast<double>(expected.statistics.events));
            if (GetParam() == 2) continue;
            // In 3.0 a step ends at each event.
            std::vector<double> seen;
            for (const Event& event : run.events) seen.push_back(event.t);
            EXPECT_EQ(seen, times);
        }
    }
}

TEST(SceneFmusOfVersion3, ShowTheVelocitiesBeforeAnEventUntilItIsHandled)
{
    const Temporary scene("ball.json", lone_ball), file("ball.fmu");
    export_scene({.scene = scene.path}, file.path);
    const Result run =
        fmi::run(Fmu(file.path), {.t_end = 3, .output = {"ball.vy", "ball.y"}, .step = 0.7});
    ASSERT_GE(run.events.size(), 2U);
    EXPECT_NEAR(run.events[0].t, std::sqrt(20 / 9.81), 1e-15);
    int sides = 0;
    for (std::size_t i = 0; i + 1 < run.rows.size(); ++i) {
        if (run.rows[i].place != Row::Place::before_event) continue;
        const double before = run.rows[i].values[0], after = run.rows[i + 1].values[0];
        EXPECT_LT(before, 0);
        EXPECT_DOUBLE_EQ(after, -0.5 * before);
        EXPECT_NEAR(run.rows[i].values[1], 1, 1e-14);
        ++sides;
    }
    EXPECT_EQ(sides, static_cast<int>(run.events.size()));
}

TEST_P(SceneFmus, KeepTheirStateForPassagesOfAVariable)
{
    const Temporary scene("kept.json", lone_ball), file("kept.fmu");
    export_scene({.scene = scene.path, .version = GetParam()}, file.path);
    const Fmu fmu(file.path);
    const auto run_with = [&](std::vector<Watch> watch) {
        return fmi::run(fmu, {.t_end = 6,
                              .output = {"ball.y", "ball.vy"},
                              .sample_times = {6},
                              .step = 0.13,
                              .co_simulation = true,
                              .watch = std::move(watch)});
    };
    const Result run = run_with({{"ball.y", 2}});
    ASSERT_EQ(run.end, End::reached_end) << describe(run);
    std::vector<double> found;
    for (const Event& event : run.events) {
        if (event.causes.passage) found.push_back(event.t);
    }
    // The centre falls from 11 m through 2 m, and is there on its way up and down in the flight
    // after the first impact, with half the speed; the next flight is too low.
    const double g = 9.81, fall = std::sqrt(20 / g), v = 0.5 * g * fall;
    const double root = std::sqrt(v * v - 2 * g);
    const std::vector<double> expected{std::sqrt(18 / g), fall + (v - root) / g,
                                       fall + (v + root) / g};
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-14) << i;
    EXPECT_EQ(run.rows.back().values, run_with({}).rows.back().values);
}

TEST_P(SceneFmus, StartWithTheValuesThatAreSet)
{
    const Temporary scene("set.json", lone_ball), file("set.fmu");
    export_scene(
        {.scene = scene.path, .set = {{"gravity.y", -2}, {"ball.y", 2}}, .version = GetParam()},
        file.path);
    const Fmu fmu(file.path);
    const auto last = [&](std::vector<std::pair<std::string, double>> start) {
        return fmi::run(fmu, {.t_end = 1.5,
                              .start = std::move(start),
                              .output = {"ball.y", "ball.x"},
                              .sample_times = {1.5},
                              .step = 0.5});
    };
    // One metre at 2 m/s^2 takes 1 s; it leaves with half of 2 m/s, or a quarter.
    EXPECT_NEAR(last({}).last("ball.y"), 1 + 0.5 - 0.25, 1e-15);
    EXPECT_NEAR(last({{"steel.restitution", 0.25}}).last("ball.y"), 1, 1e-15);
    EXPECT_NEAR(last({{"ball.vx", 3}}).last("ball.x"), 4.5, 1e-15);
    try {
        (void)last({{"ball.y", 0.5}});
        FAIL() << "not refused";
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("ball at (0, 0.5) lies behind a wall"),
                  std::string::npos)
            << error.what();
    }
}

/// Message with which an export is refused.
std::string refusal(const SceneFmu& wanted)
{
    const Temporary file("refused.fmu");
    try {
        export_scene(wanted, file.path);
    } catch (const Error& error) {
        EXPECT_FALSE(fs::exists(file.path));
        return error.what();
    }
    return {};
}

TEST(SceneFmuRefusals, NameTheFileAndWhatDoesNotFit)
{
    const Temporary scene("good.json", lone_ball);
    const auto expect_words = [](const std::string& message, const std::vector<std::string>& all) {
        for (const std::string& words : all) {
            EXPECT_NE(message.find(words), std::string::npos) << message;
        }
    };
    expect_words(refusal({.scene = "/nowhere/scene.json"}), {"/nowhere/scene.json"});
    const Temporary broken("broken.json", "{\"gravity\": [0, -9.81],\n\"boddies\": []}");
    expect_words(refusal({.scene = broken.path}), {broken.path.string() + ":2", "boddies"});
    const Temporary overlap("overlap.json", R"({"bodies": [
        {"name": "a", "disc": {}, "at": [0, 0]}, {"name": "b", "disc": {}, "at": [1, 0]}]})");
    expect_words(refusal({.scene = overlap.path}), {overlap.path.string(), "a and b overlap"});
    expect_words(refusal({.scene = scene.path, .set = {{"ball.z", 1}}}),
                 {scene.path.string(), "ball.z=1"});
    expect_words(refusal({.scene = scene.path,
                          .set = {{"ball.x", std::numeric_limits<double>::infinity()}}}),
                 {"ball.x=inf", "finite"});
    expect_words(refusal({.scene = scene.path, .set = {{"steel.restitution", 1.5}}}),
                 {"restitution", "1.5"});
    expect_words(refusal({.scene = scene.path, .version = 1}), {"1", "2 or 3"});
}

TEST(SceneFmuRefusals, AnotherSceneInTheArchiveIsNotRun)
{
    const Temporary scene("one.json", lone_ball), file("one.fmu");
    export_scene({.scene = scene.path}, file.path);
    const Fmu fmu(file.path);
    // Walls are not in the description.
    std::string other = lone_ball;
    other.replace(other.find("[0, 0]"), 6, "[0, 1]");
    std::ofstream(fmu.unpacked()->folder.path() / "resources" / "model.json") << other;
    try {
        (void)fmi::run(fmu, {.t_end = 1});
        FAIL() << "not refused";
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("another model"), std::string::npos)
            << error.what();
    }
}

TEST(SceneFmuNames, AreThoseOfStructuredNaming)
{
    const Temporary scene("names.json", R"({"materials": {"soft rubber": {"restitution": 0.5}},
        "bodies": [{"name": "a", "disc": {"inertia": 1}, "at": [0, 0]},
                   {"name": "it's", "disc": {}, "at": [3, 0]},
                   {"name": "gravity", "disc": {}, "at": [6, 0]},
                   {"disc": {}, "at": [9, 0]},
                   {"name": "row", "grid": [1, 2], "spacing": [3, 3], "disc": {}, "at": [12, 0]}]})");
    const Temporary file("names.fmu");
    export_scene({.scene = scene.path}, file.path);
    const Description d = Fmu(file.path).description();
    for (const char* const name :
         {"a.x", "a.angle", "'it\\'s'.vx", "'gravity'.y", "body[3].x", "row[0,1].vy", "gravity.x",
          "'soft rubber'.restitution", "energy", "events"}) {
        EXPECT_TRUE(d.find(name)) << name;
    }
    EXPECT_EQ(d.variables[d.find("a.spin")->variable].unit, "rad/s");
}

}  // namespace

}  // namespace ricochet::fmi::scene_fmu_test
