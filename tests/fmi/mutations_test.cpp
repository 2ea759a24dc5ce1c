// Archives and descriptions that are broken at random: each is refused with an Error, or used.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "mutator.hpp"
#include "probes.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::fmi::mutations_test {

namespace {

using namespace fmi_test;

/// Replaces the value of an attribute, or changes bytes anywhere.
void break_description(std::string& text, Mutator& mutator)
{
    for (std::uint64_t i = mutator.below(3); i < 3; ++i) {
        if (mutator.one_in(4)) {
            mutator.break_bytes(text);
            continue;
        }
        const std::size_t open = text.find("=\"", mutator.below(text.size()));
        const std::size_t end = open == std::string::npos ? open : text.find('"', open + 2);
        if (end == std::string::npos) continue;
        const std::string given = text.substr(open + 2, end - open - 2);
        text.replace(open + 2, end - open - 2, mutator.change_words(given));
    }
}

/// Reads everything that a description offers.
std::size_t used(const Description& d)
{
    std::size_t sum = d.state_names().size();
    for (const Variable& variable : d.variables) {
        sum += d.find(variable.name).has_value();
        sum += variable.size > 0 ? d.name_of({0, 0}).size() : 0;
        if (sum > 100'000) break;
    }
    for (std::size_t k = 0; k < std::min<std::size_t>(d.indicator_count, 100); ++k) {
        sum += d.indicator_name(k).size();
    }
    return sum;
}

TEST(FmuMutations, FiveThousandBrokenFilesAreRefusedOrUsed)
{
    // In memory where there is such a folder: a disk takes ten times as long.
    if (std::filesystem::exists("/dev/shm")) setenv("TMPDIR", "/dev/shm", 1);
    const Folder folder;
    const ProbeModel model{"Ball", 2, 1, true};
    std::size_t refused = 0, loaded = 0;
    for (std::uint64_t seed = 0; seed < 5000; ++seed) {
        Mutator mutator(seed);
        const int version = mutator.one_in(2) ? 2 : 3;
        std::string text = description_of(model, version);
        if (!mutator.one_in(3)) break_description(text, mutator);
        std::string bytes = archive_of({{.name = "modelDescription.xml", .bytes = text},
                                        {.name = "resources/a", .bytes = "abc"}});
        if (mutator.one_in(3)) mutator.break_bytes(bytes);
        write(folder / "m.fmu", bytes);
        try {
            const Fmu fmu(folder / "m.fmu");
            ++loaded;
            EXPECT_GT(used(fmu.description()), 0U);
        } catch (const Error& error) {
            ++refused;
            EXPECT_NE(std::string(error.what()).find("m.fmu"), std::string::npos) << seed;
        }
    }
    unsetenv("TMPDIR");
    EXPECT_GT(refused, 1000U);
    EXPECT_GT(loaded, 500U);
}

TEST(FmuInstances, AThousandOfThemStartAndEnd)
{
    const Fmu fmu = probe({"Ball", 2, 1, true}, 2);
    for (int i = 0; i < 1000; ++i) {
        Simulation simulation(fmu, {});
        ASSERT_TRUE(simulation.advance());
    }
}

std::size_t temporary_folders()
{
    std::size_t count = 0;
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::temp_directory_path())) {
        count += entry.path().filename().string().starts_with("ricochet-fmu-");
    }
    return count;
}

TEST(FmuFolder, IsRemovedWithTheLastCopy)
{
    // In a folder of its own, since other tests run beside this one.
    const Folder folder;
    std::filesystem::create_directory(folder / "tmp");
    setenv("TMPDIR", (folder / "tmp").c_str(), 1);
    {
        const Fmu fmu = probe({"Ball", 2, 1, true}, 3);
        const Fmu copy = fmu;
        EXPECT_EQ(temporary_folders(), 1U);
    }
    EXPECT_EQ(temporary_folders(), 0U);
    unsetenv("TMPDIR");
}

}  // namespace

}  // namespace ricochet::fmi::mutations_test
