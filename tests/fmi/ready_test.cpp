// The ready systems as FMUs without a compiler.
#include "ricochet/fmi/ready.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "ricochet/fmi/run.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/systems/ready.hpp"

namespace ricochet::fmi::ready_test {

namespace {

namespace fs = std::filesystem;

/// A file that is removed.
class Temporary {
public:
    explicit Temporary(const std::string& name)
        : path(fs::temp_directory_path() /
               ("ricochet_ready_" + name + '_' + std::to_string(getpid()) + ".fmu"))
    {
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

class Ready : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Fmi, Ready, testing::Values(2, 3));

/// The times of the events that change state or mode in a run of the system itself, by the method
/// that its FMU has inside.
template <class System>
std::vector<double> own_times(double t_end)
{
    ricochet::Options options{.t_end = t_end, .rtol = 1e-12, .atol = 1e-12};
    typename System::State x;
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = System::descriptor().state[i].start;
    if constexpr (requires { System::start_mode; }) options.mode = System::start_mode;
    const auto run = ricochet::integrate(System(), x, options, ErrorControlled<Fehlberg78>{});
    std::vector<double> times;
    for (const auto& event : run.events) {
        const bool acts = event.before != event.after || event.mode_before != event.mode_after;
        if (acts) times.push_back(event.t);
    }
    return times;
}

TEST(ReadyOfVersion3, EverySystemHasItsOwnEventsAfterExportAndImport)
{
    ReadySystems::for_each([]<class System>() {
        SCOPED_TRACE(System::name);
        const double t_end = System::descriptor().t_end / 2;
        const Temporary file{std::string(System::name)};
        export_ready({.system = System::name}, file.path);
        const fmi::Run run =
            fmi::run(Fmu(file.path), {.t_end = t_end, .step = t_end, .co_simulation = true});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        const std::vector<double> expected = own_times<System>(t_end);
        ASSERT_EQ(run.events.size(), expected.size());
        for (std::size_t i = 0; i < expected.size(); ++i) {
            // The same run inside: up to the rounding of the time.
            EXPECT_NEAR(run.events[i].t, expected[i], 1e-14 * (1 + expected[i])) << i;
        }
    });
}

TEST_P(Ready, ValuesThatAreSetAreThoseOfTheDescriptionAndOfTheRun)
{
    const Temporary file("set");
    export_ready({.system = "bouncing-ball",
                  .set = {{"restitution", 0.75}, {"height", 5}, {"velocity", -1}},
                  .version = GetParam()},
                 file.path);
    const Fmu fmu(file.path);
    const BouncingBall ball({.restitution = 0.75});
    for (const bool co : {false, true}) {
        const fmi::Run run = fmi::run(fmu, {.t_end = 3,
                                            .rtol = 1e-12,
                                            .method = Method::fehlberg78,
                                            .output = {"events", "height"},
                                            .sample_times = {0, 3},
                                            .co_simulation = co});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        int impacts = 0;
        while (ball.impact_time(impacts, 5, -1) < 3) ++impacts;
        EXPECT_EQ(run.last("events"), impacts) << co;
        EXPECT_EQ(run.rows.front().values[1], 5);
        // What an importer sets still holds.
        const fmi::Run other = fmi::run(fmu, {.t_end = 1,
                                              .start = {{"gravity", 2}},
                                              .output = {"height"},
                                              .sample_times = {1},
                                              .co_simulation = co});
        EXPECT_NEAR(other.last("height"), 5 - 1 - 1, 1e-12) << co;
    }
}

TEST_P(Ready, TheModeAtTheStartFollowsFromTheStateThere)
{
    // At rest, where the static friction of 0.3 N holds the spring.
    const Temporary file("stuck");
    export_ready(
        {.system = "coulomb-oscillator", .set = {{"position", 0.2}}, .version = GetParam()},
        file.path);
    const fmi::Run run = fmi::run(
        Fmu(file.path),
        {.t_end = 5, .output = {"position", "events"}, .sample_times = {5}, .co_simulation = true});
    ASSERT_EQ(run.end, End::reached_end) << describe(run);
    EXPECT_EQ(run.last("position"), 0.2);
    EXPECT_EQ(run.last("events"), 0);
}

TEST(ReadyFmus, TakeThePlaceOfALinkAndNotOfWhatItLeadsTo)
{
    const Temporary kept("kept"), link("link");
    export_ready({.system = "pendulum"}, kept.path);
    fs::create_symlink(kept.path, link.path);
    export_ready({.system = "thermostat"}, link.path);
    EXPECT_EQ(Fmu(kept.path).description().model_name, "pendulum");
    EXPECT_EQ(Fmu(link.path).description().model_name, "thermostat");
}

TEST(ReadyFmus, AreTheSameBytesEveryTime)
{
    const Temporary one("one"), two("two");
    for (const Temporary* file : {&one, &two}) export_ready({.system = "thermostat"}, file->path);
    const auto bytes = [](const fs::path& of) {
        std::ifstream in(of, std::ios::binary);
        return std::string{std::istreambuf_iterator<char>(in), {}};
    };
    EXPECT_GT(bytes(one.path).size(), 100'000U);
    EXPECT_TRUE(bytes(one.path) == bytes(two.path));
}

void expect_refused(const ReadyFmu& wanted, const std::vector<std::string>& words,
                    const fs::path& to = fs::temp_directory_path() / "ricochet_refused.fmu")
{
    try {
        export_ready(wanted, to);
        FAIL() << "not refused";
    } catch (const Error& error) {
        for (const std::string& word : words) {
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
        }
    }
    EXPECT_FALSE(fs::exists(to));
}

TEST(ReadyFmus, RefuseWhatDoesNotFitByName)
{
    expect_refused({.system = "bouncing"}, {"bouncing", "bouncing-ball", "thermostat"});
    expect_refused({.system = "pendulum", .set = {{"mass", 1}}},
                   {"mass", "gravity, length, angle"});
    expect_refused({.system = "bouncing-ball", .set = {{"restitution", 1.5}}},
                   {"restitution", "[0, 1]", "1.5"});
    expect_refused(
        {.system = "bouncing-ball", .set = {{"height", std::numeric_limits<double>::infinity()}}},
        {"height", "finite"});
    expect_refused({.system = "pendulum", .version = 1}, {"1", "2 or 3"});
    expect_refused({.system = "pendulum"}, {"/nowhere", "written"}, "/nowhere/pendulum.fmu");
}

}  // namespace
}  // namespace ricochet::fmi::ready_test
