// Faults that are planted in the models of probe.c, and those that have none.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "probes.hpp"
#include "ricochet/fmi/check.hpp"

namespace ricochet::fmi::check_test {

namespace {

using fmi_test::probe;

std::string faults(const fmi_test::ProbeModel& model, int version, const Options& options = {})
{
    std::string out;
    for (const Finding& finding : check(probe(model, version), options)) {
        if (finding.fault) out += finding.text + "\n";
    }
    return out;
}

std::string remarks(const fmi_test::ProbeModel& model, int version)
{
    std::string out;
    for (const Finding& finding : check(probe(model, version))) {
        if (!finding.fault) out += finding.text + "\n";
    }
    return out;
}

class Checks : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Fmi, Checks, testing::Values(2, 3));

TEST_P(Checks, SoundModelsHaveNoFaults)
{
    EXPECT_EQ(faults({"Ball", 2, 1, true}, GetParam()), "");
    EXPECT_EQ(faults({"Timer", 2, 2}, GetParam()), "");
    EXPECT_EQ(faults({"Clock", 0, 0}, GetParam()), "");
    EXPECT_EQ(faults({"Stiff", 1, 0, false, true}, GetParam()), "");
}

TEST_P(Checks, PlantedFaultsAreNamed)
{
    const auto expect = [&](const std::string& text, const std::string& part) {
        EXPECT_NE(text.find(part), std::string::npos) << text;
    };
    expect(faults({"Zero", 1, 1}, GetParam()), "indicator 1");
    expect(faults({"Zero", 1, 1}, GetParam()), "is 0 after event mode");
    expect(faults({"Zeno", 2, 1}, GetParam()), "have not advanced the time");
    expect(faults({"Reactions", 2, 0, false, true}, GetParam()), "the derivative of 'der(x[1])'");
    expect(faults({"Faulty", 1, 1}, GetParam()), "returned Error");
    expect(faults({"Forgetful", 1, 1}, GetParam()), "depend on the points evaluated before");
    expect(remarks({"Relay", 1, 2}, GetParam()), "indicator 2");
    expect(remarks({"Nominals", 1, 1}, GetParam()), "the nominal value of 'x[1]' is 0");
}

}  // namespace

}  // namespace ricochet::fmi::check_test
