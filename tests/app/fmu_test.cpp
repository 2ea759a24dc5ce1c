// `ricochet simulate MODEL.fmu` and `ricochet fmu MODEL.fmu`.
#include <chrono>
#include <cmath>
#include <filesystem>
#include <string>

#include "../fmi/probes.hpp"
#include "app.hpp"

namespace ricochet::fmu_app_test {
namespace {

const std::string ball = std::string(RICOCHET_FMUS) + "/fmu_ball.fmu";

class FmuApp : public App {
protected:
    /// A probe of tests/fmi as a file in the directory of the test.
    [[nodiscard]] std::string probe(const fmi_test::ProbeModel& model) const
    {
        const std::string name = model.name + ".fmu";
        fmi_test::write(work() / name,
                        fmi_test::probe_archive(fmi_test::description_of(model, 2), 2));
        return name;
    }
};

TEST_F(FmuApp, ABallBouncesAndIsDrawn)
{
    const auto run = json({"simulate", ball, "--t-end", "3", "--rtol", "1e-4", "--json"});
    EXPECT_EQ(run.at("outcome"), "reached_end");
    EXPECT_EQ(run.at("fmi"), "3.0");
    ASSERT_EQ(run.at("events").size(), 1U);
    EXPECT_NEAR(run.at("events").at(0).at("t").get<double>(), std::sqrt(20 / 9.81), 1e-15);
    EXPECT_EQ(run.at("events").at(0).at("causes").at(0), "state");
    const Result text = this->run({"simulate", ball, "--set", "restitution=0.5", "--output",
                                   "height,events", "--csv", "ball.csv", "--samples", "11"});
    EXPECT_EQ(text.status, 0) << text.err;
    EXPECT_NE(text.out.find("reached_end at t = 12 s"), std::string::npos) << text.out;
    const std::string csv = content(work() / "ball.csv");
    EXPECT_TRUE(csv.starts_with("t [s],height [m],events,event\n0,10,0,\n")) << csv.substr(0, 100);
    EXPECT_NE(csv.find("before event\n"), std::string::npos);
}

TEST_F(FmuApp, InputsComeFromAFile)
{
    const std::string sampled = std::string(RICOCHET_FMUS) + "/fmu_sampled.fmu";
    fmi_test::write(work() / "u.csv", "t [s],u [V]\n0,0.5\n2,0.5\n2,-1\n");
    const auto jump = json({"simulate", sampled, "--input", "u.csv", "--json"});
    EXPECT_NE(jump.at("state").at("x"), json({"simulate", sampled, "--json"}).at("state").at("x"));
    fmi_test::write(work() / "bad.csv", "t,u\n0,1\n1,one\n");
    const Result bad = run({"simulate", sampled, "--input", "bad.csv"});
    EXPECT_EQ(bad.status, 2);
    EXPECT_NE(bad.err.find("bad.csv:3"), std::string::npos) << bad.err;
}

TEST_F(FmuApp, AnFmuIsDescribed)
{
    const Result text = run({"fmu", ball});
    EXPECT_EQ(text.status, 0) << text.err;
    EXPECT_NE(text.out.find("FMI 3.0, model exchange, co-simulation"), std::string::npos)
        << text.out;
    EXPECT_NE(text.out.find("height = 10 m: above the floor"), std::string::npos) << text.out;
    EXPECT_EQ(json({"fmu", ball, "--json"}).at("states").at(0), "height");
}

TEST_F(FmuApp, APassageOfAWatchedVariableIsAnEvent)
{
    const Words words{"simulate", ball, "--watch", "height=2", "--step", "0.1", "--t-end", "2"};
    const Result text = run(words);
    EXPECT_EQ(text.status, 0) << text.err;
    EXPECT_NE(text.out.find("passage (height = 2)"), std::string::npos) << text.out;
    EXPECT_NE(text.out.find("FMI 3.0; co-simulation"), std::string::npos) << text.out;
    Words as_json = words;
    as_json.push_back("--json");
    const auto events = json(as_json).at("events");
    ASSERT_GE(events.size(), 2U);
    EXPECT_EQ(events[0].at("causes").at(0), "passage");
    EXPECT_EQ(events[0].at("watch"), 0);
    EXPECT_NEAR(events[0].at("t").get<double>(), std::sqrt(16 / 9.81), 1e-15);
    EXPECT_EQ(run({"simulate", ball, "--watch", "depth=2"}).status, 2);
}

TEST_F(FmuApp, AReadySystemIsExportedAndRuns)
{
    const Result made =
        run({"fmu", "export", "thermostat", "--set", "low=19", "--fmi", "2", "-o", "room.fmu"});
    ASSERT_EQ(made.status, 0) << made.err;
    const auto room = json({"fmu", "room.fmu", "--json"});
    EXPECT_EQ(room.at("fmi"), "2.0");
    const auto there = json({"simulate", "room.fmu", "--json", "--rtol", "1e-12"}).at("events");
    const auto here = json({"simulate", "thermostat", "--set", "low=19", "--json"}).at("events");
    ASSERT_EQ(there.size(), here.size());
    for (std::size_t i = 0; i < here.size(); ++i) {
        // The tolerance of the run here, 1e-10 of 22 degrees at a degree a second.
        EXPECT_NEAR(there[i].at("t").get<double>(), here[i].at("t").get<double>(), 1e-7);
    }
    for (const Words& words : {Words{"fmu", "export", "thermostat"},
                               {"fmu", "export", "thermostats", "-o", "x.fmu"},
                               {"fmu", "export", "thermostat", "--set", "low=23", "-o", "x.fmu"},
                               {"fmu", "room.fmu", "-o", "x.fmu"},
                               {"fmu", "export", "thermostat", "--fmi", "1", "-o", "x.fmu"}}) {
        EXPECT_EQ(run(words).status, 2);
        EXPECT_FALSE(std::filesystem::exists(work() / "x.fmu"));
    }
}

#ifdef RICOCHET_SCENES
TEST_F(FmuApp, ASceneIsExportedAndRuns)
{
    const std::string scene = std::string(RICOCHET_SCENES) + "/cradle.json";
    const Result made = run({"fmu", "export", scene, "--set", "gravity.y=-1", "-o", "cradle.fmu"});
    ASSERT_EQ(made.status, 0) << made.err;
    const auto there = json({"simulate", "cradle.fmu", "--step", "0.1", "--json"});
    EXPECT_EQ(there.at("outcome"), "reached_end");
    const auto here = json({"simulate", scene, "--json"});
    // Smooth bodies on a floor: gravity changes no impact. In the FMU those of one instant are one.
    double last = -1;
    std::size_t instants = 0;
    for (const auto& event : here.at("events")) {
        instants += event.at("t").get<double>() > last;
        last = event.at("t").get<double>();
    }
    EXPECT_EQ(there.at("events").size(), instants);
    fmi_test::write(work() / "bad.json", "{\"bodies\": [{\"disc\": {}}]}");
    for (const Words& words : {Words{"fmu", "export", "bad.json", "-o", "x.fmu"},
                               {"fmu", "export", "missing.json", "-o", "x.fmu"},
                               {"fmu", "export", scene, "--set", "first.z=1", "-o", "x.fmu"},
                               {"fmu", "export", scene}}) {
        const Result result = run(words);
        EXPECT_EQ(result.status, 2) << result.err;
        EXPECT_FALSE(std::filesystem::exists(work() / "x.fmu"));
    }
    EXPECT_NE(run({"fmu", "export", "bad.json", "-o", "x.fmu"}).err.find("bad.json:1"),
              std::string::npos);
    // A scene is not overwritten by its FMU.
    EXPECT_EQ(run({"fmu", "export", "bad.json", "-o", "bad.json"}).status, 2);
}
#endif

TEST_F(FmuApp, WhatDoesNotFitIsBadInput)
{
    fmi_test::write(work() / "m.fmu", "no zip");
    for (const Words& words : {Words{"simulate", "m.fmu"},
                               {"fmu", "m.fmu"},
                               {"simulate", "missing.fmu"},
                               {"simulate", ball, "--set", "mass=1"},
                               {"simulate", ball, "--method", "euler"},
                               {"simulate", ball, "--output", "mass"},
                               {"simulate", ball, "--t-end", "-1"}}) {
        const Result result = run(words);
        EXPECT_EQ(result.status, 2) << result.err;
        EXPECT_TRUE(result.out.empty());
    }
}

TEST_F(FmuApp, ALibraryThatCrashesOrExitsIsReportedWithTheEventsUntilThen)
{
    const std::string file = probe({"Killer", 1, 1});
    for (const auto& [how, expected] : {std::pair{"p0=0", "signal 6"}, {"p0=1", "exit status 3"}}) {
        const Result result = run({"simulate", file, "--set", how, "--json"});
        EXPECT_EQ(result.status, 1);
        const auto out = nlohmann::json::parse(result.out);
        EXPECT_EQ(out.at("outcome"), "call_failed");
        EXPECT_NE(out.at("message").get<std::string>().find(expected), std::string::npos) << out;
        EXPECT_EQ(out.at("events").size(), 1U);
        EXPECT_NE(result.err.find("a library that prints"), std::string::npos) << result.err;
    }
}

TEST_F(FmuApp, EndlessBouncingIsSaid)
{
    const Result result = run({"simulate", probe({"Zeno", 2, 1})});
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.out.find("events of indicator 1"), std::string::npos) << result.out;
}

}  // namespace
}  // namespace ricochet::fmu_app_test
