// `ricochet simulate SCENE.json` and `ricochet explain SCENE.json`.
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <sstream>
#include <string>
#include <thread>

#include "app.hpp"

namespace ricochet::scene_app_test {
namespace {

const std::string scenes = RICOCHET_SCENES;

class SceneApp : public App {
protected:
    /// A gas in a box, for any length of time.
    [[nodiscard]] std::string long_scene() const
    {
        std::ofstream(work() / "long.json")
            << R"({"walls": [{"normal": [0, 1], "point": [0, 0]}, {"normal": [0, -1], "point": [0, 1]},
                {"normal": [1, 0], "point": [0, 0]}, {"normal": [-1, 0], "point": [1, 0]}],
                "bodies": [{"disc": {"radius": 0.1}, "at": [0.3, 0.4], "velocity": [1, 0.3]},
                           {"disc": {"radius": 0.1}, "at": [0.6, 0.7], "velocity": [-1, 0.2]}],
                "run": {"t_end": 1e5}})";
        return "long.json";
    }

    /// Interrupts the command as soon as it catches the signal.
    [[nodiscard]] Result interrupted(const Words& words, int signal) const
    {
        const pid_t child = start(words);
        const std::string status = "/proc/" + std::to_string(child) + "/status";
        for (int tries = 0; tries < 1000; ++tries) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            const std::string text = content(status);
            const std::size_t at = text.find("SigCgt:");
            if (at == std::string::npos) continue;
            const auto caught = std::stoull(text.substr(at + 7), nullptr, 16);
            if ((caught >> (signal - 1)) & 1U) break;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(3));
        kill(child, signal);
        return wait_for(child);
    }
};

TEST_F(SceneApp, EveryExampleRunsAndIsExplained)
{
    for (const auto& entry : fs::directory_iterator(scenes)) {
        const std::string file = entry.path().string();
        if (!file.ends_with(".json")) continue;
        SCOPED_TRACE(file);
        const auto run = json({"simulate", file, "--t-end", "0.3", "--json"});
        EXPECT_EQ(run.at("outcome"), "reached_end");
        EXPECT_EQ(run.at("t"), 0.3);
        const Result explained = App::run({"explain", file});
        EXPECT_EQ(explained.status, 0) << explained.err;
        EXPECT_NE(explained.out.find("skipped"), std::string::npos);
    }
}

TEST_F(SceneApp, ACradleHandsItsSpeedOn)
{
    const auto run = json({"simulate", scenes + "/cradle.json", "--t-end", "0.5", "--json"});
    EXPECT_NEAR(run.at("bodies").at(4).at("velocity").at(0).get<double>(), 1, 1e-12);
    EXPECT_EQ(run.at("events").at(0).at("kind"), "impact");
    const Result text = this->run({"simulate", scenes + "/cradle.json", "--t-end", "0.5"});
    EXPECT_EQ(text.status, 0);
    EXPECT_NE(text.out.find("reached_end at t = 0.5 s"), std::string::npos) << text.out;
}

TEST_F(SceneApp, FilesHaveTheSamples)
{
    const Result result = run({"simulate", scenes + "/cradle.json", "--t-end", "1", "--samples",
                               "11", "--csv", "cradle.csv", "--animate", "cradle.svg"});
    ASSERT_EQ(result.status, 0) << result.err;
    std::istringstream csv(content(work() / "cradle.csv"));
    std::string line;
    std::getline(csv, line);
    EXPECT_EQ(line, "t,body,x,y,vx,vy,asleep");
    int rows = 0;
    while (std::getline(csv, line)) ++rows;
    EXPECT_EQ(rows, 55);
    const std::string svg = content(work() / "cradle.svg");
    EXPECT_TRUE(svg.starts_with("<svg"));
    EXPECT_NE(svg.find("<animate attributeName=\"cx\""), std::string::npos);
    EXPECT_LT(svg.size(), 5000u);
}

TEST_F(SceneApp, WallsNearTheBodiesAreExplainedAndDrawn)
{
    std::ofstream(work() / "walls.json")
        << R"({"gravity": [0, -9.81], "walls": [{"point": [0, 0], "normal": [0, 1]},
            {"point": [-2, 0], "normal": [1, 0]},
            {"point": [2, 0], "normal": [-1, 0], "motion": {"amplitude": [0.1, 0], "frequency": 2}},
            {"point": [50, 0], "normal": [-1, 0]}],
            "bodies": [{"name": "small", "disc": {"radius": 0.1}, "at": [-1.7, 0.8]},
                       {"name": "big", "disc": {"radius": 0.3}, "at": [1, 0.8], "velocity": [-9, 0]}],
            "run": {"t_end": 0.5}})";
    const Result explained = run({"explain", "walls.json"});
    EXPECT_NE(explained.out.find("1 moving face; contacts with it are searched for by bounds on "
                                 "its motion"),
              std::string::npos)
        << explained.out;
    EXPECT_NE(explained.out.find("\"small\" meets \"big\" first"), std::string::npos)
        << explained.out;
    ASSERT_EQ(run({"simulate", "walls.json", "--t-end", "0.1", "--animate", "w.svg"}).status, 0);
    // All but the wall far away.
    const std::string svg = content(work() / "w.svg");
    int walls = 0;
    for (std::size_t at = 0; (at = svg.find("<polyline", at)) != std::string::npos; ++at) ++walls;
    EXPECT_EQ(walls, 3);
    const Result drawn = run({"simulate", "walls.json", "--t-end", "0.1", "--plot", "walls.svg"});
    if (drawn.err.find("gnuplot-nox") != std::string::npos) GTEST_SKIP() << drawn.err;
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    // Lines whose ends lie on the border of the picture; each moves the pen once.
    const std::string plot = content(work() / "walls.svg");
    const std::size_t path = plot.find(" d='", plot.find("'surfaces'</title>"));
    ASSERT_LT(path, plot.size());
    const std::string lines = plot.substr(path, plot.find("'/>", path) - path);
    EXPECT_EQ(std::ranges::count(lines, 'M'), 3) << lines;
}

TEST_F(SceneApp, BadInputIsOneSentenceAndStatusTwo)
{
    std::ofstream(work() / "typo.json") << "{\"gravity\": [0, -1],\n\"bodys\": []}";
    expect_refused({"simulate", "typo.json"},
                   {"typo.json:2: unknown key \"bodys\"", "nearest known is \"bodies\""});
    expect_refused({"explain", "typo.json"}, {"typo.json:2"});
    expect_refused({"simulate", "none.json"}, {"none.json"});
    std::ofstream(work() / "endless.json") << "{\"bodies\": []}";
    expect_refused({"simulate", "endless.json"}, {"t_end", "--t-end"});
    const std::string cradle = scenes + "/cradle.json";
    expect_refused({"simulate", cradle, "--animate", "x.png"}, {"--animate", ".svg"});
    expect_refused({"simulate", cradle, "--csv", "a.svg", "--animate", "a.svg"}, {"--animate"});
    expect_refused({"simulate", cradle, "--t-end", "-1"}, {"t_end"});
    expect_refused({"simulate", cradle, "--contact-step", "0"}, {"contact_step"});
}

TEST_F(SceneApp, AnInterruptKeepsWhatThereIs)
{
    for (const auto& [signal, status] : {std::pair{SIGINT, 130}, std::pair{SIGTERM, 143}}) {
        const Result result = interrupted({"simulate", long_scene(), "--json"}, signal);
        EXPECT_EQ(result.status, status) << result.err;
        const auto run = nlohmann::json::parse(result.out);
        EXPECT_EQ(run.at("outcome"), "cancelled");
        EXPECT_EQ(run.at("incomplete"), signal == SIGINT ? "interrupted" : "asked to terminate");
        EXPECT_FALSE(run.at("events").empty());
        EXPECT_NE(result.err.find("incomplete"), std::string::npos);
    }
    const Result table = interrupted({"simulate", long_scene()}, SIGINT);
    EXPECT_NE(table.out.find("\n  incomplete: interrupted\n"), std::string::npos) << table.out;
}

TEST_F(SceneApp, NamesOfBodiesAreSingleCells)
{
    std::ofstream(work() / "names.json") <<
        R"({"bodies": [{"name": "a, \"b\"\nc", "disc": {"radius": 1, "mass": 1}, "at": [0, 0]}],
            "run": {"t_end": 1}})";
    const Result result = run({"simulate", "names.json", "--samples", "2", "--csv", "n.csv"});
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_TRUE(content(work() / "n.csv")
                    .starts_with("t,body,x,y,vx,vy,asleep\n0,\"a, \"\"b\"\" c\",0,0,0,0,"))
        << content(work() / "n.csv");
}

}  // namespace
}  // namespace ricochet::scene_app_test
