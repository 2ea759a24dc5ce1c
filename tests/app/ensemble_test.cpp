// `ricochet ensemble`: tables, shares, results, and processes that are killed.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "app.hpp"

namespace ricochet::ensemble_test {
namespace {

const Words random_balls{"--vary", "height=1:10", "--vary", "restitution=0.7:0.9", "--t-end", "3"};

Words balls(const std::string& count, const Words& more)
{
    Words words{"ensemble", "bouncing-ball", "--count", count};
    words.insert(words.end(), random_balls.begin(), random_balls.end());
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

Words of_table(const Words& more)
{
    Words words{"ensemble", "bouncing-ball", "--table", "t.csv", "--out", "out"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

class EnsembleApp : public App {
protected:
    void expect_fine(const Words& words, const Words& environment = {}) const
    {
        const Result result = run(words, environment);
        EXPECT_EQ(result.status, 0) << result.err;
    }

    [[nodiscard]] std::string results(const std::string& directory) const
    {
        const fs::path path = work() / directory;
        return content(path / "results.npy") + content(path / "results.csv");
    }

    /// Cells of the results, line by line, with the names first.
    [[nodiscard]] std::vector<Words> table(const std::string& directory) const
    {
        std::istringstream in(content(work() / directory / "results.csv"));
        std::vector<Words> out;
        for (std::string line; std::getline(in, line);) {
            out.emplace_back();
            std::istringstream cells(line);
            for (std::string cell; std::getline(cells, cell, ',');) out.back().push_back(cell);
        }
        return out;
    }

    /// Starts an ensemble and sends a signal after it has kept some blocks.
    [[nodiscard]] Result signalled(const Words& words, const fs::path& share, int signal) const
    {
        std::error_code error;
        const auto size = [&] {
            const auto bytes = fs::file_size(share, error);
            return error ? 0 : bytes;
        };
        // A header is about 1 kB, and a block of 64 rows 7 kB.
        const auto enough = size() + 20'000;
        const pid_t child = start(words);
        while (size() < enough) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        kill(child, signal);
        return wait_for(child);
    }
};

TEST_F(EnsembleApp, RowsAreRunsOfSimulate)
{
    write("t.csv", "\xef\xbb\xbf# balls\nheight [m],restitution\r\n1, 0.7\r\n\n\"10\",0.9\n");
    expect_fine(of_table({"--set", "gravity=1.62"}));
    const std::vector<Words> rows = table("out");
    ASSERT_EQ(rows.size(), 3U);
    EXPECT_EQ(rows[0], (Words{"row", "height [m]", "restitution", "outcome", "t_final [s]",
                              "u_final [m]", "v_final [m/s]", "events", "steps", "rejected",
                              "flow_calls", "guard_calls", "message"}));
    const nlohmann::json one = json({"simulate", "bouncing-ball", "--json", "--set", "gravity=1.62",
                                     "height=10", "restitution=0.9"});
    EXPECT_EQ(rows[2][0], "1");
    EXPECT_EQ(rows[2][3], one["outcome"]);
    EXPECT_EQ(std::stod(rows[2][5]), one["state"][0].get<double>());
    EXPECT_EQ(std::stod(rows[2][6]), one["state"][1].get<double>());
    EXPECT_EQ(std::stoul(rows[2][7]), one["events"].size());
    EXPECT_EQ(std::stoul(rows[2][8]), one["statistics"]["steps"].get<std::size_t>());
}

TEST_F(EnsembleApp, ComponentsOfTheStateAreColumns)
{
    // A component that a parameter sets is that parameter.
    write("t.csv", "u\n2\n");
    expect_fine(of_table({}));
    const nlohmann::json two = json(simulate({"--json", "--set", "height=2"}));
    EXPECT_EQ(std::stod(table("out")[1][4]), two["state"][0].get<double>());

    write("v.csv", "v,u\n0,0\n1,0.5\n");
    const auto words = [](const std::string& system, const std::string& file) {
        return Words{"ensemble", system, "--table", file, "--out", system};
    };
    expect_fine(words("impact-oscillator", "v.csv"));
    const nlohmann::json rest = json({"simulate", "impact-oscillator", "--json"});
    const std::vector<Words> rows = table("impact-oscillator");
    EXPECT_EQ(std::stod(rows[1][5]), rest["state"][0].get<double>());
    EXPECT_NE(rows[2][5], rows[1][5]);

    // Ensembles of set-valued systems too, and of contacts.
    write("s.csv", "u\n1\n1.5\n");
    expect_fine(words("stick-slip", "s.csv"));
    const nlohmann::json slip = json({"simulate", "stick-slip", "--json", "--set", "position=1.5"});
    const std::vector<Words> slips = table("stick-slip");
    EXPECT_EQ(std::stod(slips[2][4]), slip["state"][0].get<double>());
    EXPECT_EQ(slips[0][6], "mode_final");
    EXPECT_EQ(slips[2][6], slip["mode"]);
    write("w.csv", "sleeve',friction\n0,0.3\n0.1,0.3\n");
    expect_fine(words("woodpecker", "w.csv"));
    EXPECT_NE(table("woodpecker")[1], table("woodpecker")[2]);
}

TEST_F(EnsembleApp, NumPyReadsTheResults)
{
    expect_fine(balls("100", {"--out", "out"}));
    const std::string npy = content(work() / "out" / "results.npy");
    ASSERT_GT(npy.size(), 10U);
    EXPECT_EQ(npy.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
    const std::size_t header = 10 + static_cast<unsigned char>(npy[8]) +
                               256 * static_cast<std::size_t>(static_cast<unsigned char>(npy[9]));
    EXPECT_EQ(header % 64, 0U);
    EXPECT_NE(npy.find("('outcome', '<U24')"), std::string::npos);
    EXPECT_NE(npy.find("'shape': (100,)"), std::string::npos);
    // Eleven numbers of 8 bytes and 24 characters of 4 in each row.
    EXPECT_EQ(npy.size(), header + 100 * (11 * 8 + 24 * 4));
    double height = 0;
    std::memcpy(&height, npy.data() + header + 8, sizeof height);
    EXPECT_EQ(height, std::stod(table("out")[1][1]));
}

TEST_F(EnsembleApp, ResultsAreTheSameForAnyThreadsAndShares)
{
    expect_fine(balls("1000", {"--out", "one", "--threads", "1"}));
    const std::string one = results("one");
    for (const char* threads : {"2", "4"}) {
        expect_fine(balls("1000", {"--out", threads, "--threads", threads}));
        EXPECT_EQ(results(threads), one) << threads << " threads";
    }
    for (const std::string n : {"1", "2", "3", "20"}) {
        const std::string out = "shares" + n;
        for (int k = 1; k <= std::stoi(n); ++k) {
            expect_fine(balls("1000", {"--out", out, "--share", std::to_string(k) + '/' + n}));
        }
        fs::remove(work() / out / "results.npy");
        expect_fine({"ensemble", "--merge", out});
        EXPECT_EQ(results(out), one) << n << " shares";
    }
    // Rows do not depend on their number, and another seed gives others.
    expect_fine(balls("70", {"--out", "few"}));
    EXPECT_EQ(table("few")[70], table("one")[70]);
    expect_fine(balls("70", {"--out", "other", "--seed", "2"}));
    EXPECT_NE(table("other")[70], table("one")[70]);
}

TEST_F(EnsembleApp, SharesOfFewRowsAllHaveSome)
{
    // A hundred rows are fewer than two blocks of 64.
    for (int k = 1; k <= 4; ++k) {
        const std::string share = std::to_string(k) + "/4";
        const Result result = run(balls("100", {"--out", "four", "--share", share, "--json"}));
        ASSERT_EQ(result.status, 0) << result.err;
        EXPECT_EQ(nlohmann::json::parse(result.out).at("rows"), 25) << share;
    }
    expect_fine({"ensemble", "--merge", "four"});
    expect_fine(balls("100", {"--out", "whole"}));
    EXPECT_EQ(results("four"), results("whole"));
}

TEST_F(EnsembleApp, ACompleteShareIsSkipped)
{
    const Words words = balls("200", {"--out", "out", "--json"});
    EXPECT_EQ(json(words)["rows_run"], 200);
    const nlohmann::json again = json(words);
    EXPECT_EQ(again["rows_run"], 0);
    EXPECT_EQ(again["rows_kept"], 200);
    EXPECT_EQ(again["outcomes"]["reached_end"], 200);
    EXPECT_EQ(json({"ensemble", "--merge", "out", "--json"})["events"], again["events"]);
}

TEST_F(EnsembleApp, AKilledProcessLosesTheBlocksInHandAndNoMore)
{
    expect_fine(balls("10000", {"--out", "whole"}));
    const Words words = balls("10000", {"--out", "out", "--json"});
    const fs::path share = work() / "out" / "share-1-of-1.rows";
    EXPECT_EQ(signalled(words, share, SIGKILL).status, -1);
    EXPECT_FALSE(fs::exists(work() / "out" / "results.npy"));
    expect_refused({"ensemble", "--merge", "out"}, {"share 1/1", "not complete"});
    const nlohmann::json rest = json(words);
    EXPECT_LT(rest["rows_run"], 10000);
    EXPECT_GT(rest["rows_run"], 0);
    EXPECT_EQ(results("out"), results("whole"));
}

TEST_F(EnsembleApp, AnInterruptKeepsWhatThereIs)
{
    expect_fine(balls("10000", {"--out", "whole"}));
    const Words words = balls("10000", {"--out", "out", "--json"});
    const fs::path share = work() / "out" / "share-1-of-1.rows";
    for (const int signal : {SIGINT, SIGTERM}) {
        const Result result = signalled(words, share, signal);
        EXPECT_EQ(result.status, 128 + signal);
        EXPECT_NE(result.err.find("the same call goes on"), std::string::npos) << result.err;
        EXPECT_LT(nlohmann::json::parse(result.out)["rows_kept"], 10000);
    }
    expect_fine(words);
    EXPECT_EQ(results("out"), results("whole"));
}

TEST_F(EnsembleApp, HalfABlockAndAByteThatChangedAreRunAgain)
{
    const Words words = balls("300", {"--out", "out", "--json"});
    expect_fine(words);
    const std::string expected = results("out");
    const fs::path share = work() / "out" / "share-1-of-1.rows";
    const std::string whole = content(share);
    // The file is cut in the header, in the first block, and in the last.
    for (const std::size_t size : {std::size_t{10}, whole.size() / 3, whole.size() - 1}) {
        write("out/share-1-of-1.rows", whole.substr(0, size));
        EXPECT_GT(json(words)["rows_run"], 0) << size;
        EXPECT_EQ(results("out"), expected) << size;
    }
    std::string changed = whole;
    changed[whole.size() / 2] ^= 1;
    write("out/share-1-of-1.rows", changed);
    EXPECT_GT(json(words)["rows_run"], 0);
    EXPECT_EQ(results("out"), expected);
}

TEST_F(EnsembleApp, AShareWhoseFirstLineHasChangedIsRefused)
{
    const Words words = balls("100", {"--out", "out"});
    expect_fine(words);
    const std::string whole = content(work() / "out" / "share-1-of-1.rows");
    const auto changed = [&](std::string_view from, std::string_view to) {
        std::string bytes = whole;
        bytes.replace(bytes.find(from), from.size(), to);
        write("out/share-1-of-1.rows", bytes);
    };
    for (const auto& [from, to] :
         {std::pair("\"v_final\"", "\"w_final\""), std::pair("\"rows\":100", "\"rows\":101"),
          std::pair("\"rows\":100", "\"rows\":\"1\""), std::pair("\"rows\":100", "\"rows\":0"),
          std::pair("\"check\"", "\"chick\"")}) {
        changed(from, to);
        expect_refused({"ensemble", "--merge", "out"}, {"first line", "was changed"});
        expect_refused(words, {"first line", "was changed"});
    }
    write("out/share-1-of-1.rows", whole);
    expect_fine({"ensemble", "--merge", "out"});
}

TEST_F(EnsembleApp, ARowThatCannotBeRunIsAnOutcome)
{
    // The low threshold must be below the high one, which no range of one parameter can express.
    write("t.csv", "low,high\n18,22\n25,22\n");
    const nlohmann::json run =
        json({"ensemble", "thermostat", "--table", "t.csv", "--out", "out", "--json"});
    EXPECT_EQ(run["outcomes"]["failed"], 1);
    EXPECT_EQ(run["outcomes"]["reached_end"], 1);
    EXPECT_NE(run["first_failure"].get<std::string>().find("row 1: "), std::string::npos);
    EXPECT_EQ(table("out")[2][3], "failed");
    EXPECT_EQ(table("out")[2][4], "nan");
}

TEST_F(EnsembleApp, CellsOutOfRangeFailTheirRows)
{
    write("t.csv", "height,restitution\n1,0.5\n1,2\n1,0.6\n");
    const nlohmann::json run = json({"ensemble", "bouncing-ball", "--table", "t.csv", "--t-end",
                                     "1", "--out", "out", "--json"});
    EXPECT_EQ(run["outcomes"]["failed"], 1);
    EXPECT_EQ(run["outcomes"]["reached_end"], 2);
    const std::string failure = run["first_failure"];
    EXPECT_NE(failure.find("row 1: "), std::string::npos);
    EXPECT_NE(failure.find("got 2"), std::string::npos);
}

TEST_F(EnsembleApp, OptionsAndAnIdentifierMayBeColumnsAndTimesOfEventsResults)
{
    // A ball dropped from h strikes the floor after sqrt(2 h / g).
    write("t.csv", "id,height,t-end,max-steps\n7,1,0.25,100\n8,2,2,100\n9,1,1,0.5\n");
    expect_fine({"ensemble", "bouncing-ball", "--table", "t.csv", "--events", "2", "--out", "out"});
    const std::vector<Words> rows = table("out");
    const auto column = [&](const std::string& name) {
        const auto found = std::ranges::find_if(
            rows[0], [&](const std::string& cell) { return cell.starts_with(name); });
        return static_cast<std::size_t>(found - rows[0].begin());
    };
    ASSERT_LT(column("event_2"), rows[0].size());
    EXPECT_EQ(rows[1][column("id")], "7");
    EXPECT_EQ(std::stod(rows[1][column("t_final")]), 0.25);
    EXPECT_EQ(rows[1][column("event_1")], "nan");
    EXPECT_NEAR(std::stod(rows[2][column("event_1")]), std::sqrt(4 / 9.81), 1e-9);
    EXPECT_EQ(rows[3][column("outcome")], "failed");
    expect_refused({"ensemble", "bouncing-ball", "--table", "t.csv", "--t-end", "3", "--out", "o"},
                   {"--t-end is given", "column"});
}

TEST_F(EnsembleApp, GridsHaveAllCombinationsAndRandomColumnsTheirDistributions)
{
    expect_fine({"ensemble", "bouncing-ball", "--grid", "height=1:8:4:log", "--grid",
                 "restitution=0.5:0.7:3", "--t-end", "0.1", "--out", "grid"});
    const std::vector<Words> rows = table("grid");
    ASSERT_EQ(rows.size(), 13U);
    for (std::size_t k = 0; k < 12; ++k) {
        EXPECT_NEAR(std::stod(rows[k + 1][1]), std::exp2(static_cast<double>(k % 4)), 1e-14);
        EXPECT_NEAR(std::stod(rows[k + 1][2]), 0.5 + 0.1 * static_cast<double>(k / 4), 1e-15);
    }
    // The logarithm of the one is uniform with the mean log 10 and the deviation log(100) /
    // sqrt(12); the other has the mean 9 and the deviation 2: each mean within 4 standard errors.
    expect_fine({"ensemble", "bouncing-ball", "--count", "1000", "--vary", "height=1:100:log",
                 "--vary", "gravity=9:2:normal", "--t-end", "0.01", "--out", "random"});
    const std::vector<Words> random = table("random");
    ASSERT_EQ(random.size(), 1001U);
    double logs = 0;
    double mean = 0;
    for (std::size_t k = 1; k < random.size(); ++k) {
        const double height = std::stod(random[k][1]);
        EXPECT_TRUE(height >= 1 && height <= 100);
        logs += std::log(height) / 1000;
        mean += std::stod(random[k][2]) / 1000;
    }
    EXPECT_NEAR(logs, std::log(10), 4 * std::log(100) / std::sqrt(12.0 * 1000));
    EXPECT_NEAR(mean, 9, 4 * 2 / std::sqrt(1000));
    const auto refused = [&](const Words& more, const Words& pieces) {
        Words words{"ensemble", "bouncing-ball", "--out", "o"};
        words.insert(words.end(), more.begin(), more.end());
        expect_refused(words, pieces);
    };
    refused({"--grid", "height=1:2"}, {"--grid must be", "name=first:last:count"});
    refused({"--grid", "height=0:2:3:log"}, {"must be positive, got 0"});
    refused({"--count", "2", "--vary", "height=1:2:even"}, {"--vary must be"});
    refused({"--count", "2", "--vary", "height=1:-2:normal"}, {"deviation"});
}

#ifdef RICOCHET_ENSEMBLE_SCENES
TEST_F(EnsembleApp, ScenesAreRunForEachRow)
{
    // A disc thrown down from 2 m above a floor at v: it strikes where 2 - v t - g t^2 / 2 = 0.
    write("s.json", R"({"gravity": [0, -10], "walls": [{"point": [0, 0], "normal": [0, 1]}],
        "bodies": [{"name": "a", "disc": {"radius": 0.5}, "at": [0, 2.5]}], "run": {"t_end": 0.9}})");
    expect_fine({"ensemble", "s.json", "--grid", "bodies.a.velocity.y=-3:0:4", "--events", "1",
                 "--out", "out"});
    const std::vector<Words> rows = table("out");
    ASSERT_EQ(rows.size(), 5U);
    const auto column = [&](const std::string& name) {
        const auto found = std::ranges::find_if(
            rows[0], [&](const std::string& cell) { return cell.starts_with(name); });
        return static_cast<std::size_t>(found - rows[0].begin());
    };
    for (std::size_t k = 1; k < rows.size(); ++k) {
        const double v = -std::stod(rows[k][1]);
        const double t = (-v + std::sqrt(v * v + 40)) / 10;
        EXPECT_NEAR(std::stod(rows[k][column("event_1")]), t, 1e-14);
        EXPECT_EQ(rows[k][column("outcome")], "reached_end");
        EXPECT_NEAR(std::stod(rows[k][column("energy_final")]),
                    std::stod(rows[k][column("energy_start")]), 1e-13);
    }
    write("t.csv", "bodies.a.disc.radius,t-end\n0.25,1\n-1,1\n0.25,2\n");
    const nlohmann::json run =
        json({"ensemble", "s.json", "--table", "t.csv", "--out", "failing", "--json"});
    EXPECT_EQ(run["outcomes"]["failed"], 1);
    EXPECT_EQ(run["outcomes"]["reached_end"], 2);
    EXPECT_NE(run["first_failure"].get<std::string>().find("radius"), std::string::npos);
    expect_refused({"ensemble", "s.json", "--grid", "bodies.b.mass=1:2:2", "--out", "o"},
                   {"there is no 'b' among a"});
    expect_refused({"ensemble", "s.json", "--grid", "bodies.a.name=1:2:2", "--out", "o"},
                   {"expected the name of a number"});
    expect_refused(
        {"ensemble", "s.json", "--grid", "gravity.y=1:2:2", "--step", "0.1", "--out", "o"},
        {"ensemble of scenes"});
}
#endif

TEST_F(EnsembleApp, ResultsAreDrawnOverTheFirstColumn)
{
    const Words grid{"ensemble", "bouncing-ball", "--grid", "height=1:10:40", "--t-end", "3"};
    const auto drawn = [&](const Words& more) {
        Words words = grid;
        words.insert(words.end(), more.begin(), more.end());
        return run(words);
    };
    const Result first = drawn({"--events", "3", "--out", "o", "--plot", "o.svg"});
    if (first.err.find("gnuplot-nox") != std::string::npos) GTEST_SKIP() << first.err;
    ASSERT_EQ(first.status, 0) << first.err;
    EXPECT_NE(first.out.find("o/results.csv, o.svg"), std::string::npos) << first.out;
    // A point for each event that has happened, as gnuplot writes them, within its key of styles.
    const auto points = [&](const std::string& file) {
        const std::string picture = content(work() / file);
        std::size_t count = 0;
        for (std::size_t at = 0;
             (at = picture.find("<use xlink:href='#gpPt6'", at)) != std::string::npos; ++at) {
            ++count;
        }
        return count;
    };
    std::size_t events = 0;
    const std::vector<Words> rows = table("o");
    for (std::size_t k = 1; k < rows.size(); ++k) {
        for (std::size_t c = 0; c < rows[0].size(); ++c) {
            if (rows[0][c].starts_with("event_")) events += rows[k][c] != "nan";
        }
    }
    EXPECT_GT(events, 60U);
    EXPECT_EQ(points("o.svg"), events);
    EXPECT_NE(content(work() / "o.svg").find("height [m]"), std::string::npos);
    EXPECT_NE(content(work() / "o.svg").find("events [s]"), std::string::npos);
    // Two results by name, from shares; the second column gives the colour.
    for (const char* share : {"1/2", "2/2"}) {
        const Result part =
            drawn({"--grid", "restitution=0.5:0.9:3", "--out", "p", "--share", share});
        ASSERT_EQ(part.status, 0) << part.err;
    }
    const Result merged =
        run({"ensemble", "--merge", "p", "--plot", "p.svg", "--show", "u_final", "events"});
    ASSERT_EQ(merged.status, 0) << merged.err;
    EXPECT_EQ(points("p.svg"), 240U);
    EXPECT_NE(content(work() / "p.svg").find("restitution"), std::string::npos);
}

TEST_F(EnsembleApp, SharesAreReadFromLaunchers)
{
    const auto share = [&](const Words& environment) {
        const Result result =
            run(balls("64", {"--out", environment.front(), "--json"}), environment);
        EXPECT_EQ(result.status, 0) << result.err;
        return nlohmann::json::parse(result.out).value("share", nlohmann::json{});
    };
    using Pair = std::vector<int>;
    EXPECT_EQ(share({"NOTHING=1"}), (Pair{1, 1}));
    EXPECT_EQ(share({"OMPI_COMM_WORLD_RANK=2", "OMPI_COMM_WORLD_SIZE=4"}), (Pair{3, 4}));
    EXPECT_EQ(share({"PMI_RANK=0", "PMI_SIZE=2"}), (Pair{1, 2}));
    EXPECT_EQ(share({"SLURM_PROCID=7", "SLURM_NTASKS=8"}), (Pair{8, 8}));
    EXPECT_EQ(share({"SLURM_ARRAY_TASK_ID=5", "SLURM_ARRAY_TASK_COUNT=4", "SLURM_ARRAY_TASK_MIN=3",
                     "SLURM_ARRAY_TASK_MAX=6"}),
              (Pair{3, 4}));
    EXPECT_EQ(share({"SLURM_ARRAY_TASK_MIN=0", "SLURM_ARRAY_TASK_ID=10", "SLURM_ARRAY_TASK_COUNT=4",
                     "SLURM_ARRAY_TASK_STEP=10", "SLURM_ARRAY_TASK_MAX=30"}),
              (Pair{2, 4}));
    // Tasks within a task of an array; and a batch script, which has a rank without a size.
    EXPECT_EQ(share({"SLURM_NTASKS=2", "SLURM_PROCID=1", "SLURM_ARRAY_TASK_ID=1",
                     "SLURM_ARRAY_TASK_COUNT=3", "SLURM_ARRAY_TASK_MIN=0"}),
              (Pair{4, 6}));
    EXPECT_EQ(share({"SLURM_JOB_ID=17", "SLURM_PROCID=0"}), (Pair{1, 1}));
    // mpirun within a batch job of Slurm: the ranks are those of MPI.
    EXPECT_EQ(share({"OMPI_COMM_WORLD_SIZE=4", "OMPI_COMM_WORLD_RANK=3", "SLURM_JOB_ID=17",
                     "SLURM_PROCID=0", "SLURM_NTASKS=4"}),
              (Pair{4, 4}));
}

TEST_F(EnsembleApp, RanksWithoutSizesAndContradictionsAreRefused)
{
    const auto refused = [&](const Words& environment, const std::string& piece) {
        const Result result = run(balls("64", {"--out", "out"}), environment);
        EXPECT_EQ(result.status, 2);
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        EXPECT_NE(result.err.find(piece), std::string::npos) << result.err;
        EXPECT_TRUE(files().empty());
    };
    refused({"OMPI_COMM_WORLD_RANK=2"}, "OMPI_COMM_WORLD_SIZE is not set");
    refused({"PMI_SIZE=2"}, "PMI_RANK is not set");
    refused({"SLURM_PROCID=1"}, "SLURM_NTASKS is not set");
    refused({"SLURM_ARRAY_TASK_ID=1"}, "SLURM_ARRAY_TASK_COUNT is not set");
    refused({"PMI_RANK=4", "PMI_SIZE=4"}, "a rank below the size");
    refused({"PMI_RANK=x", "PMI_SIZE=4"}, "PMI_RANK must be a whole number");
    refused({"PMI_RANK=1", "PMI_SIZE=4", "OMPI_COMM_WORLD_RANK=2", "OMPI_COMM_WORLD_SIZE=4"},
            "Open MPI gives rank 2 of 4, and PMI rank 1 of 4");
    refused(
        {"SLURM_PROCID=1", "SLURM_NTASKS=4", "OMPI_COMM_WORLD_RANK=2", "OMPI_COMM_WORLD_SIZE=4"},
        "and Slurm rank 1 of 4");
    refused({"SLURM_ARRAY_TASK_ID=7", "SLURM_ARRAY_TASK_COUNT=3", "SLURM_ARRAY_TASK_MIN=1",
             "SLURM_ARRAY_TASK_MAX=7"},
            "without gaps");
}

TEST_F(EnsembleApp, TablesAreRefusedByLineAndColumn)
{
    const auto refused = [&](std::string_view content, const Words& pieces) {
        write("t.csv", content);
        expect_refused(of_table({}), pieces);
    };
    refused("", {"'t.csv'", "empty"});
    refused("height\n", {"no rows"});
    refused("height,heigth\n1,2\n", {"line 1, column 2", "'heigth'", "nearest is height", "known"});
    refused("# a\nheight,height\n1,2\n", {"line 2, column 2", "already"});
    refused("height,u\n1,2\n", {"column 2", "u, which is height"});
    refused("height [km]\n1\n", {"'km'", "'m'"});
    refused("height,restitution\n1,0.5\n1\n", {"line 3", "found 1 number, expected 2"});
    refused("height,restitution\n1,0.5,2\n", {"line 2", "found 3 numbers"});
    refused("height\n1\n1,\n", {"line 3", "found 2 numbers, expected 1"});
    refused("height\nhigh\n", {"line 2, column 1", "height must be a number", "'high'"});
    refused("height,velocity\n1,nan\n", {"line 2, column 2", "velocity must be a finite number"});
    write("u.csv", "u\n0.5\n");
    expect_refused({"ensemble", "bouncing-ball", "--table", "none.csv", "--out", "out"},
                   {"'none.csv'", "cannot be read"});
    expect_refused({"ensemble", "bouncing-ball", "--table", ".", "--out", "out"},
                   {"expected a file"});
}

TEST_F(EnsembleApp, RequestsThatContradictThemselvesAreRefused)
{
    write("t.csv", "restitution\n0.5\n");
    const auto refused = [&](const Words& more, const Words& pieces) {
        Words words{"ensemble"};
        words.insert(words.end(), more.begin(), more.end());
        expect_refused(words, pieces);
    };
    refused({}, {"SYSTEM", "--merge"});
    refused({"trebuchet", "--table", "t.csv", "--out", "o"}, {"trebuchet"});
    refused({"fault", "--table", "t.csv", "--out", "o"}, {"fault", "simulate alone"});
    refused({"bouncing-ball", "--out", "o"}, {"--table", "--count"});
    refused({"bouncing-ball", "--table", "t.csv"}, {"--out"});
    refused({"bouncing-ball", "--table", "t.csv", "--count", "3", "--out", "o"},
            {"one or the other"});
    refused({"bouncing-ball", "--table", "t.csv", "--vary", "height=1:2", "--out", "o"},
            {"--vary"});
    refused({"bouncing-ball", "--table", "t.csv", "--seed", "2", "--out", "o"}, {"--seed"});
    refused({"bouncing-ball", "--count", "3", "--out", "o"}, {"--vary"});
    refused({"bouncing-ball", "--count", "3", "--vary", "height=1", "--out", "o"},
            {"lowest:highest"});
    refused({"bouncing-ball", "--count", "3", "--vary", "height=2:1", "--out", "o"}, {"above"});
    refused({"bouncing-ball", "--count", "3", "--vary", "hight=1:2", "--out", "o"},
            {"nearest is height"});
    refused({"bouncing-ball", "--count", "3", "--vary", "restitution=0.5:2", "--out", "o"},
            {"restitution", "got 2"});
    refused({"bouncing-ball", "--count", "3", "--vary", "height=1:2", "height=3:4", "--out", "o"},
            {"already"});
    refused({"bouncing-ball", "--table", "t.csv", "--set", "restitution=0.8", "--out", "o"},
            {"restitution", "set twice"});
    refused({"bouncing-ball", "--table", "t.csv", "--out", "none/o"}, {"none/o"});
    refused({"bouncing-ball", "--table", "t.csv", "--out", "t.csv"}, {"directory"});
    for (const char* share : {"3", "0/3", "4/3", "1/0", "a/b", "1/2/3"}) {
        refused({"bouncing-ball", "--table", "t.csv", "--out", "o", "--share", share}, {"share"});
    }
    refused({"bouncing-ball", "--table", "t.csv", "--out", "o", "--threads", "0"}, {"--threads"});
    refused({"--merge", "t.csv"}, {"no share"});
    refused({"--merge", "none"}, {"no share"});
    refused({"--merge", ".", "--share", "1/2"}, {"alone"});
    refused({"--merge", ".", "--rtol", "1e-3"}, {"alone"});
    refused({"bouncing-ball", "--table", "t.csv", "--out", "o", "--plot", "o.pdf"},
            {".svg or .png"});
    refused({"bouncing-ball", "--table", "t.csv", "--out", "o", "--show", "u_final"}, {"--plot"});
    refused(
        {"bouncing-ball", "--table", "t.csv", "--out", "o", "--plot", "o.svg", "--show", "u_end"},
        {"'u_end' is not a result", "t_final, u_final, v_final"});
    refused(
        {"bouncing-ball", "--table", "t.csv", "--out", "o", "--plot", "o.svg", "--share", "1/2"},
        {"a share is not drawn"});
    // This network was trained for one gravity.
    write("g.csv", "gravity\n9.81\n");
    refused({"bouncing-ball", "--table", "g.csv", "--out", "o", "--model",
             "bouncing-ball-step-0.01", "--step", "0.01"},
            {"gravity = 9.81", "no column"});
}

TEST_F(EnsembleApp, SharesOfDifferentSetUpsAreRefused)
{
    expect_fine(balls("200", {"--out", "out", "--share", "1/2"}));
    expect_refused(balls("200", {"--out", "out", "--share", "1/2", "--rtol", "1e-10"}),
                   {"another set-up", "rtol is 1e-08 there, and 1e-10 here"});
    expect_refused(balls("201", {"--out", "out", "--share", "1/2"}), {"rows is 200 there"});
    expect_refused(balls("200", {"--out", "out", "--share", "1/2", "--seed", "3"}), {"table is"});
    expect_refused(balls("200", {"--out", "out", "--share", "1/3"}), {"share 1/2", "share 1/3"});
    expect_refused(balls("200", {"--out", "out"}), {"share 1/2", "share 1/1"});
    expect_refused({"ensemble", "--merge", "out"}, {"share 2/2", "not complete"});
    // Rows with other fields are not read.
    write("t.csv", "height,restitution,gravity\n1,0.7,9.81\n2,0.8,9.81\n");
    expect_refused(
        {"ensemble", "bouncing-ball", "--table", "t.csv", "--out", "out", "--share", "1/2"},
        {"another set-up"});

    expect_fine(balls("200", {"--out", "other", "--share", "2/2", "--rtol", "1e-10"}));
    fs::copy(work() / "other" / "share-2-of-2.rows", work() / "out" / "share-2-of-2.rows");
    expect_refused({"ensemble", "--merge", "out"}, {"share 2/2", "another set-up", "rtol"});
    write("out/share-2-of-2.rows", "nothing\n");
    expect_refused({"ensemble", "--merge", "out"}, {"no share of an ensemble"});
    fs::remove(work() / "out" / "share-2-of-2.rows");
    write("out/share-1-of-3.rows", "nothing\n");
    expect_refused({"ensemble", "--merge", "out"}, {"share 1/2", "share 1/3"});
}

TEST_F(EnsembleApp, ProcessesOfMpiexecTakeSharesOfTheirOwn)
{
    if (std::system("command -v mpiexec > /dev/null") != 0) GTEST_SKIP() << "no mpiexec";
    std::string command = "cd '" + work().string() +
                          "' && OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "
                          "OMPI_MCA_rmaps_base_oversubscribe=1 mpiexec -n 3 " RICOCHET_APP;
    for (const std::string& word : balls("1000", {"--out", "out", "--threads", "1"})) {
        command += ' ' + word;
    }
    ASSERT_EQ(std::system((command + " > log 2>&1").c_str()), 0) << content(work() / "log");
    EXPECT_TRUE(fs::exists(work() / "out" / "share-3-of-3.rows"));
    expect_fine({"ensemble", "--merge", "out"});
    expect_fine(balls("1000", {"--out", "whole"}));
    EXPECT_EQ(results("out"), results("whole"));
}

}  // namespace
}  // namespace ricochet::ensemble_test
