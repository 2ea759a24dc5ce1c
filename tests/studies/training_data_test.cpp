// ricochet-training-data, and the sets that it writes.
#include "training_data.hpp"

#include <algorithm>
#include <filesystem>
#include <set>

#include "app.hpp"
#include "faults/fault_kernel.hpp"
#include "ricochet/faults/friction.hpp"

namespace ricochet::studies::training_data_test {
namespace {

// --- files ---

TEST(Crc32, OfTheNineDigitsIsTheOneOfTheStandard)
{
    EXPECT_EQ(crc32("123456789"), 0xcbf43926U);
}

TrainingSet square()
{
    return {.columns = {{"u", "m"}, {"v", "m/s"}, {"part", "1"}},
            .values = {0.1, -2, 0, 1.0 / 3, 1e300, 1, -0.0, 5e-324, 2}};
}

TEST_F(App, ReadsBackTheNpyFileOfASet)
{
    const fs::path file = work() / "square.npy";
    const std::string bytes = to_npy(square());
    write_whole(file, bytes);
    EXPECT_EQ((bytes.size() - 9 * sizeof(double)) % 64, 0U);
    const Eigen::MatrixXd read = read_npy_square(file);
    for (int i = 0; i < 9; ++i) {
        EXPECT_EQ(read(i / 3, i % 3), square().values[static_cast<std::size_t>(i)]);
    }
    EXPECT_EQ(files(), Words{"square.npy"});
}

TEST(Csv, HasUnitsInItsHeaderAndShortestDigits)
{
    EXPECT_EQ(to_csv(square(), 2), "u [m],v [m/s],part\n0.1,-2,0\n0.3333333333333333,1e+300,1\n");
    EXPECT_EQ(to_csv(square(), 9),
              "u [m],v [m/s],part\n0.1,-2,0\n0.3333333333333333,1e+300,1\n-0,5e-324,2\n");
}

// --- sets ---

TEST(ModelData, NamesEveryModelThatIsShipped)
{
    std::set<std::string> shipped;
    for (const auto& entry : fs::directory_iterator(RICOCHET_MODELS)) {
        if (entry.path().extension() != ".md") shipped.insert(entry.path().stem().string());
    }
    std::set<std::string> named;
    for (const ModelData& data : model_data()) named.emplace(data.model);
    EXPECT_EQ(named, shipped);
}

TEST(ModelData, HasAChecksumForEverySet)
{
    for (const ModelData& data : model_data()) {
        EXPECT_EQ(stored_line(data.model).empty(), data.make == nullptr) << data.model;
        EXPECT_EQ(stored(std::string(data.model) + ".csv").empty(), data.make == nullptr);
    }
}

class Set : public testing::TestWithParam<const char*> {};

TEST_P(Set, IsTheStoredOne)
{
    expect_stored(GetParam(), data_of(GetParam()).make({}));
}

class Gate : public Set {};

TEST_P(Gate, IsTheStoredSetAndTheOneThatTheNetworkIsScaledBy)
{
    const TrainingSet set = data_of(GetParam()).make({});
    expect_stored(GetParam(), set);
    // Sums of 3e5 terms are rounded to 1e-11.
    expect_trained_on(GetParam(), set, 1e-9);
}

std::string test_name(const testing::TestParamInfo<const char*>& info)
{
    std::string name = info.param;
    std::replace_if(
        name.begin(), name.end(), [](char c) { return c == '-' || c == '.'; }, '_');
    return name;
}

INSTANTIATE_TEST_SUITE_P(Of, Set,
                         testing::Values("ageing-friction", "bouncing-ball",
                                         "bouncing-ball-step-0.01"),
                         test_name);
INSTANTIATE_TEST_SUITE_P(Of, Gate,
                         testing::Values("coulomb-oscillator-gate",
                                         "coulomb-oscillator-gate-adaptive",
                                         "impact-oscillator-gate-adaptive", "pendulum-gate",
                                         "pendulum-gate-adaptive", "stick-slip-gate",
                                         "stick-slip-gate-adaptive", "thermostat-gate"),
                         test_name);

TEST(FrictionSet, SpansTheSlipRatesThatTheModelIsFor)
{
    const TrainingSet set = data_of("ageing-friction").make({});
    const PairDomain domain =
        load_pair(RICOCHET_MODELS "/ageing-friction.json").parameters().domain;
    double least = domain.v_max;
    double most = domain.v_min;
    for (std::size_t i = 0; i < set.rows() && set.row(i).back() == part::training; ++i) {
        least = std::min(least, set.row(i)[3]);
        most = std::max(most, set.row(i)[3]);
    }
    EXPECT_NEAR(least, domain.v_min, 1e-12 * domain.v_min);
    EXPECT_NEAR(most, domain.v_max, 1e-12 * domain.v_max);
}

// --- the program ---

class Program : public App {
protected:
    /// Status 2, one sentence with this piece, nothing printed and no additional file.
    void expect_one_sentence(const Words& words, std::string_view piece) const
    {
        const Words before = files();
        const Result result = run(words);
        EXPECT_EQ(result.status, 2) << piece;
        EXPECT_EQ(result.out, "");
        EXPECT_EQ(files(), before);
        EXPECT_TRUE(result.err.starts_with("ricochet-training-data: ")) << result.err;
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        EXPECT_NE(result.err.find(piece), std::string::npos) << result.err;
    }
};

TEST_F(Program, WritesTheFilesOfAModelAndItsChecksum)
{
    const Result result = run({"ageing-friction", "--out", ".", "--rows", "3"});
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(files(), (Words{"ageing-friction.csv", "ageing-friction.npy"}));
    const TrainingSet set = data_of("ageing-friction").make({});
    const std::string npy = to_npy(set);
    EXPECT_EQ(content(work() / "ageing-friction.npy"), npy);
    EXPECT_EQ(content(work() / "ageing-friction.csv"), to_csv(set, 3));
    EXPECT_EQ(result.out, std::string(checksum_header) + "\n" +
                              checksum_line("ageing-friction", set, npy) + "\n");
}

TEST_F(Program, RefusesToReplaceAFileUnlessForced)
{
    write("ageing-friction.csv", "mine");
    expect_one_sentence({"ageing-friction", "--out", "."}, "--force");
    EXPECT_EQ(content(work() / "ageing-friction.csv"), "mine");
    EXPECT_EQ(run({"ageing-friction", "--out", ".", "--force"}).status, 0);
    EXPECT_EQ(content(work() / "ageing-friction.csv"), stored("ageing-friction.csv"));

    fs::remove(work() / "ageing-friction.npy");
    fs::create_directory(work() / "ageing-friction.npy");
    expect_one_sentence({"ageing-friction", "--out", ".", "--force"}, "something else");
}

TEST_F(Program, RefusesWhatItDoesNotKnowWithOneSentence)
{
    expect_one_sentence({"bouncing", "--out", "."}, "known are ageing-friction, bouncing-ball,");
    expect_one_sentence({"fault-tqc", "--out", "."}, "fault-tqc has no training set");
    expect_one_sentence({"--out", "."}, "the name of a model, --all or --list");
    expect_one_sentence({"ageing-friction"}, "--out");
    expect_one_sentence({"ageing-friction", "--out", "nowhere"}, "'nowhere'");
    expect_one_sentence({"ageing-friction", "--out", ".", "--rows", "-1"}, "--rows");
    expect_one_sentence({"ageing-friction", "--column", "1"}, "--column");
}

TEST_F(Program, ListsTheModelsWithAndWithoutASet)
{
    const Result result = run({"--list"});
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'),
              static_cast<std::ptrdiff_t>(model_data().size()));
    EXPECT_TRUE(files().empty());
}

}  // namespace
}  // namespace ricochet::studies::training_data_test
